"""Whole zones in unknowns of their rows: no penetration, no dependence on roles, shared nodes."""

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import blocks
from ngcontact.geometries.region import body, compound, polygon

LINE = ((-1.0, 0.0), (-0.4, 0.25), (0.3, -0.2), (1.0, 0.1))  # a convex and a re-entrant corner
SOFT, HARD = Elastic(E=1.0, nu=0.3), Elastic(E=3.0, nu=0.2)


def penetration(solution, samples=20):
    """Values n.(u' - u'') (k, samples) on the matched segments of a polygonal zone."""
    trace, line = solution.discrete.space.trace, solution.discrete.lines[0]
    assert line.searches == 0
    ends = {frozenset(map(tuple, np.round(trace.curve[k], 9))): k for k in line.facing}
    found = []
    for k in line.segments:
        opposite = ends[frozenset(map(tuple, np.round(trace.curve[k], 9)))]
        here, there = np.full(samples, k), np.full(samples, opposite)
        s = np.linspace(0, 1, samples)
        turned = np.linalg.norm(trace.curve[k, 0] - trace.curve[opposite, 0]) > 1e-6
        t = 1 - s if turned else s
        np.testing.assert_allclose(trace.point(here, s), trace.point(there, t), atol=1e-14)
        first = trace.evaluate(solution.displacement, here, s)
        second = trace.evaluate(solution.displacement, there, t)
        found.append(((first - second) * trace.normal(here, s)).sum(axis=1))
    return np.array(found)


@pytest.mark.parametrize("tilt", [-0.06, 0.0, 0.08])
@pytest.mark.parametrize("maxh", [0.6, 0.2])
def test_polygonal_zones_are_free_of_penetration_everywhere(tilt, maxh):
    """Lemma 2.1 of HH81: the nodal conditions hold between the nodes, K_h lies in K."""
    problem = Problem(
        geometry=blocks(line=LINE),
        materials={"upper": SOFT, "lower": HARD},
        displacement={"top": ng.CF((0.02, -0.01 + tilt * ng.x)), "bottom": (0, 0)},
        contact=[Contact("upper_contact", "lower_contact")],
    )
    solution = solve(problem, maxh=maxh)
    closed = penetration(solution)
    assert closed.max() <= 1e-15  # round-off of displacements of size 0.1
    # The zone is open in part, and the nodes at the corners meet both conditions.
    assert 0 < np.count_nonzero(solution.active) < len(solution.active)
    assert closed.min() < -1e-3
    doubled = np.bincount(solution.discrete.lines[0].node) == 2
    assert np.count_nonzero(doubled) == 2
    assert (solution.gap >= -1e-15).all()


def rectangle(name, x0, x1, y0, y1):
    """A body whose sides are called <name>_bottom, <name>_right, <name>_top, <name>_left."""
    sides = [f"{name}_{side}" for side in ("bottom", "right", "top", "left")]
    return body(name, polygon([(x0, y0), (x1, y0), (x1, y1), (x0, y1)], sides))


@pytest.mark.parametrize("order", [1, 3])
def test_stack_of_layers_does_not_depend_on_the_roles(order):
    """Matched meshes: the set K_h is the same whichever side carries the points."""
    layers = [rectangle("a", -1, 1, 1, 2), rectangle("b", -1, 1, 0.8, 1)]
    layers += [rectangle("c", -1, 1, 0.6, 0.8), rectangle("d", -1, 1, 0, 0.6)]
    pairs = [("a_bottom", "b_top"), ("b_bottom", "c_top"), ("c_bottom", "d_top")]
    energies, forces = [], []
    for roles in (pairs, [pair[::-1] for pair in pairs], [pairs[0], pairs[1][::-1], pairs[2]]):
        problem = Problem(
            geometry=compound(*layers),
            materials={"a": SOFT, "b": HARD, "c": SOFT, "d": HARD},
            displacement={
                "a_top": (0, ng.CF(-0.01) - 0.06 * ng.x),
                "b_left|c_left": (0, None),
                "d_bottom": (0, 0),
            },
            contact=[Contact(*role) for role in roles],
        )
        solution = solve(problem, maxh=0.5, order=order)
        assert 0 < np.count_nonzero(~solution.active)
        energies.append(solution.energy)
        forces.append([abs(solution.contact_force(k)[1]) for k in range(3)])
    # One minimum, reached through systems whose condition is about 1e4.
    np.testing.assert_allclose(energies, energies[0], rtol=1e-11)
    np.testing.assert_allclose(forces, np.full((3, 3), forces[0][0]), rtol=1e-10)
