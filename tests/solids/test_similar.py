"""Turned, in other units, by another solver, in parts: the same solids have the same figures."""

import math
import warnings
from dataclasses import replace

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact import Contact, Elastic, Problem, adapt, solve, solve_qp
from ngcontact.problem.mesh_arrays import MeshArrays, move_vertices
from tests.solids.meshes import boxes
from tests.solids.test_patch import TURN, blocks, pressed


def figures(order, turn=None, length=1.0, modulus=1.0):
    """Of a block pressed on another one by a gap, in their own axes and units."""
    turn = np.eye(3) if turn is None else turn
    mesh = boxes(("a", (0, 0, 0), (1, 1, 1), (3, 3, 3)), ("b", (0, 0, -1), (1, 1, 0), (2, 2, 2)))
    move_vertices(mesh, length * MeshArrays(mesh).vertices @ turn.T)
    own = [ng.InnerProduct(ng.CF(tuple(d)), ng.CF((ng.x, ng.y, ng.z))) for d in turn.T]
    contact = Contact(
        "a_bottom",
        "b_top",
        direction=tuple(-turn[:, 2]),
        gap=0.1 * (own[0] ** 2 + own[1] ** 2) / length,
    )
    problem = Problem(
        geometry=mesh,
        materials={"a": Elastic(modulus, 0.3), "b": Elastic(3 * modulus, 0.2)},
        displacement={"b_bottom": (0, 0, 0)},
        sliding="a_left|b_left|a_front|b_front",
        traction={"a_top": 0.02 * modulus},
        contact=[contact],
    )
    solution = solve(problem, order=order)
    assert solution.active.any()
    assert not solution.active.all()
    peak = solution.quantities()["peak pressure"].value
    return np.array(
        [
            *solution.contact_force() @ turn / (modulus * length**2),
            *(solution.reactions["a_left"] @ turn / (modulus * length**2)),
            solution.energy / (modulus * length**3),
            solution.contact_area() / length**2,
            solution.pressure.max() / modulus,
            peak / modulus,
        ]
    ), solution.relative_error_estimate


@pytest.mark.parametrize("order", [1, 2, 3])
def test_turns_and_units(order):
    expected, estimate = figures(order)
    for length, modulus in ((1.0, 1.0), (1e-9, 1e9), (1e9, 1e-9)):
        found, other = figures(order, TURN, length, modulus)
        # Required 1e-8; measured 1e-13.
        assert np.abs(found - expected).max() < 1e-11 * np.abs(expected).max()
        assert other == pytest.approx(estimate, rel=1e-11)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_the_algebra_alone(order):
    """`solve_qp` with node values as unknowns finds the same active set and forces."""
    problem = pressed(blocks(4, 3, width=1.3))
    gap = 0.1 * (ng.x - 0.3) ** 2 + 0.1 * ng.y**2 - 0.01
    problem = replace(
        problem,
        sliding=None,
        traction={},
        displacement={"lower_bottom": (0, 0, 0), "upper_top": (0, 0, -0.02 * ng.x)},
        contact=[replace(problem.contact[0], gap=gap)],
    )
    solution = solve(problem, order=order)
    discrete, space = solution.discrete, solution.discrete.space
    N, c = space.basis, discrete.conditions
    A, f, B = (
        sp.csr_array(N.T @ space.A @ N),
        N.T @ space.right_side,
        sp.csr_array(discrete.rows.matrix),
    )
    axis, n = c.direction.argmax(axis=1), len(f) // 3
    held, value = np.zeros(len(f), dtype=bool), np.zeros(len(f))
    held[axis * n + c.node], value[axis * n + c.node] = True, c.value
    free = np.flatnonzero(~held)
    found = solve_qp(
        A[free][:, free], f[free] - A[free] @ value, B[:, free], discrete.rows.g - B @ value
    )
    assert 3 < np.count_nonzero(found.active) < len(found.active)
    assert np.array_equal(found.active, solution.active)
    assert np.abs(found.force - solution.force).max() < 1e-8 * solution.force.max()


def hollow(whole):
    """A ball of radius 1.5 with a ball of .5 cut out, or an octant of it."""
    outer, inner = occ.Sphere((0, 0, 0), 1.5), occ.Sphere((0, 0, 0), 0.5)
    outer.faces.name, inner.faces.name = "rim", "hole"
    body = outer - inner
    if not whole:
        box = occ.Box((0, 0, 0), (2, 2, 2))
        for name, direction in (("cut_x", occ.X), ("cut_y", occ.Y), ("cut_z", occ.Z)):
            box.faces.Min(direction).name = name
        body = body * box
    (solid,) = body.solids
    solid.name = "body"
    return occ.OCCGeometry(body)


def lame():
    """Stress under the pressure 1 in the hole, radii .5 and 1.5."""
    a, b, r2 = 0.5, 1.5, ng.x**2 + ng.y**2 + ng.z**2
    radial = ng.OuterProduct(*2 * [ng.CF((ng.x, ng.y, ng.z))]) / r2
    A, ratio = a**3 / (b**3 - a**3), (b * b / r2) ** 1.5
    return A * (1 - ratio) * radial + A * (1 + ratio / 2) * (ng.Id(3) - radial)


@pytest.mark.parametrize("whole", [True, False])
def test_pressure_in_a_hole(whole):
    """Each guide bears what the pressure exerts across it, and the stress is that of Lame."""
    problem = Problem(
        geometry=hollow(whole),
        materials={"body": Elastic(1.0, 0.3)},
        sliding=None if whole else "cut_x|cut_y|cut_z",
        traction={"hole": 1.0},
    )
    errors, counts = [], []
    for solution in adapt(problem, maxh=0.5, max_dofs=8000 if not whole else 4500):
        mesh, exact = solution.mesh, lame()
        on_hole = ng.Integrate(-ng.specialcf.normal(3), mesh.Boundaries("hole"), order=6)
        total = np.array(on_hole) + sum(solution.reactions.values(), np.zeros(3))
        assert np.abs(total).max() < 1e-12
        for name, force in solution.reactions.items():
            side = "xyz".index(name[-1])
            expected = np.where(np.arange(3) == side, -np.array(on_hole), 0.0)
            assert np.abs(force - expected).max() < 1e-12
        miss = solution.stress - exact
        errors.append(math.sqrt(ng.Integrate(ng.InnerProduct(miss, miss), mesh, order=8)))
        counts.append(solution.displacement.space.ndof)
    if not whole:
        rate = math.log(errors[-1] / errors[0]) / math.log(counts[0] / counts[-1])
        assert rate > 0.5


def test_an_obstacle_that_the_first_mesh_does_not_meet():
    """Middles of edges lie beside a zone of radius .22: refinement finds it."""
    mesh = boxes(("a", (0, 0, -1), (1, 1, 0), (2, 2, 2)))
    problem = Problem(
        geometry=mesh,
        materials={"a": Elastic(1.0, 0.3)},
        displacement={"a_bottom": (0, 0, 0)},
        sliding="a_left|a_front",
        contact=[Contact("a_top", direction=(0, 0, 1), gap=ng.x**2 + ng.y**2 - 0.05)],
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        levels = list(adapt(problem, order=2, max_dofs=4000))
    assert not levels[0].active.any()
    assert levels[-1].active.any()
    assert levels[-1].contact_force()[2] < 0
