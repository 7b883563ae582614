"""First active sets, coarser spaces, and bodies of very different stiffness."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from drivers.reference import cases
from ngcontact import Contact, ConvergenceError, Elastic, Problem, solve
from ngcontact.adaptivity.refinement import refined
from ngcontact.contact import ContactState
from ngcontact.discrete import carried_active_set, discretise, first_active_set
from ngcontact.discrete.discrete_problem import DiscreteProblem
from ngcontact.geometries import punch
from ngcontact.lagrange import gauss_lobatto
from ngcontact.linalg import refined_share
from ngcontact.mesh import curve, first_mesh
from ngcontact.mesh.generation import vertex_parents
from tests.scenes import REFINED, coordinates, discrete, near_origin, steps_of


def prepared(problem, maxh, order):
    mesh, _ = curve(first_mesh(problem, maxh), order, "isoparametric")
    return discretise(problem, mesh, order, "isoparametric")


def state(line, active):
    """A pair without gaps or forces."""
    nothing = np.zeros(len(line.node))
    return ContactState(line, nothing, nothing, active)


def test_points_that_touch_start_active():
    problem = cases.pressed_disc()
    discrete = prepared(problem, 0.4, 2)
    [line] = discrete.lines
    touching = np.linalg.norm(line.position, axis=1) < 1e-9  # the disc touches the origin
    np.testing.assert_array_equal(first_active_set(discrete), touching)


def test_a_new_point_between_two_is_active_if_one_of_them_is():
    [coarse] = prepared(cases.one_transition().problem, 0.5, 1).lines
    at = np.argsort(coarse.position[:, 0])
    active = np.zeros(len(at), dtype=bool)
    active[at[0]] = True
    middle = coarse.position[at[:2]].mean(axis=0)
    new = replace(
        coarse, node=coarse.node[:1], position=middle[None], direction=coarse.direction[:1]
    )
    assert carried_active_set([new], [state(coarse, active)]).tolist() == [True]


def test_points_around_a_transition_are_told_by_their_side_of_it():
    """It is located inside elements: finer than the nodes of the mesh it comes from."""
    problem = cases.one_transition().problem
    coarse = solve(problem, maxh=0.4, order=3)
    [end] = coarse.transitions()
    [line] = prepared(problem, 0.1, 3).lines
    carried = carried_active_set([line], coarse.pairs)
    np.testing.assert_array_equal(carried, line.position[:, 0] < end[0])


def linear_field(problem: DiscreteProblem) -> np.ndarray:
    """Node values of a linear displacement, edge functions 0, (2n,)."""
    trace = problem.space.trace
    xy = coordinates(trace.mesh)
    points = np.zeros((trace.space.ndof, 2))
    points[: len(xy)] = xy
    present = np.zeros(len(points))
    present[: len(xy)] = 1.0
    for s, nodes in zip(
        gauss_lobatto(trace.order)[1:-1], trace.nodes[problem.space.nodal].T[1:-1], strict=True
    ):
        start, stop = trace.nodes[problem.space.nodal][:, [0, -1]].T
        points[nodes] = (1 - s) * xy[start] + s * xy[stop]
        present[nodes] = 1.0
    u = points @ np.array([[0.3, -0.7], [1.1, 0.2]]) + present[:, None] * np.array([0.5, -0.4])
    return u.T.ravel()


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_linear_displacements_are_in_all_spaces(order: int):
    problem = discrete(cases.partly_opening_block(), order, 3)
    y = sp.linalg.spsolve(problem.basis.T.tocsc(), linear_field(problem))
    steps = steps_of(problem)
    assert len(steps) > 2
    for step in steps:
        # Theory: exact, on straight bodies; 100 times round-off.
        np.testing.assert_allclose(step.P @ y[step.kept], y, rtol=0, atol=1e-14)
        y = y[step.kept]


@pytest.mark.parametrize("local", [False, True])
def test_spaces_shrink_geometrically(local: bool):
    mesh = first = first_mesh(REFINED["block"], 0.5)
    for _ in range(6 if local else 3):
        mesh = refined(REFINED["block"], mesh, near_origin(mesh, 0.3) if local else None)
    problem = discretise(REFINED["block"], mesh, 1, "isoparametric")
    sizes = [step.P.shape for step in steps_of(problem, 4 * first.nv)]
    assert all(k <= n / 2 for n, k in sizes)
    assert sizes[0][0] == 2 * mesh.nv
    assert sizes[-1][1] <= 4 * first.nv
    assert refined_share(vertex_parents(mesh)) == pytest.approx(1 - first.nv / mesh.nv)


PAIR = ("punch_contact", "foundation_contact")


def pressed(contrast: float, pair: tuple[str, str] = PAIR, **loads: object) -> Problem:
    """Flat punch, `contrast` times stiffer than its foundation."""
    problem = replace(cases.flat_punch(), geometry=punch(width=20.0, depth=20.0), **loads)
    materials = {**problem.materials, "punch": Elastic(E=contrast, nu=0.3)}
    return replace(problem, materials=materials, contact=[Contact(*pair)])


@pytest.mark.parametrize("pair", [PAIR, PAIR[::-1]])
@pytest.mark.parametrize("contrast", [1e8, 1e10, 1e12, 1e14])
def test_the_force_on_a_stiff_punch_is_that_on_a_rigid_one(
    contrast: float, pair: tuple[str, str]
) -> None:
    rigid = solve(pressed(1e7), maxh=2.0, order=2)
    stiff = solve(pressed(contrast, pair), maxh=2.0, order=2)
    force, expected = abs(stiff.contact_force()[1]), abs(rigid.contact_force()[1])
    # The punch of the comparison gives way by 1e-7 of the foundation.
    assert force == pytest.approx(expected, rel=1e-6)
    pressure, same = (s.pressure[np.argsort(s.points[:, 0])] for s in (stiff, rigid))
    # Likewise; measured 1.6e-7.
    np.testing.assert_allclose(pressure, same, rtol=1e-6)


def test_a_stiff_punch_held_by_contact_alone_is_right_or_refused() -> None:
    loads = {"displacement": {"foundation_bottom": (0, 0)}, "traction": {"punch_top": 0.01}}
    solution = solve(pressed(1e6, **loads), maxh=2.0, order=2)
    # The load is 0.01 times the length 1. Round-off of the stiffer body, 1e6 eps, some tens of
    # times: measured 4e-9.
    assert solution.contact_force()[1] == pytest.approx(0.01, rel=1e-7)
    with pytest.raises(ConvergenceError, match="moduli"):
        solve(pressed(1e12, **loads), maxh=2.0, order=2)
