"""Whole zones in unknowns of their rows: no penetration, no dependence on roles, shared nodes."""

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import blocks

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
