"""Estimates that rise, and how often functions among the data are evaluated."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import solve
from ngcontact.adaptivity import refined
from ngcontact.mesh import first_mesh
from ngcontact.plausibility import estimates_rise
from tests.quadrature.test_loads import loaded


@pytest.mark.parametrize(
    ("estimates", "rise"),
    [
        ([0.3, 0.2, 0.1, 0.12, 0.13, 0.18], True),
        ([0.3, 0.1, 0.14, 0.13, 0.16], True),
        ([0.1, 0.12, 0.13], True),  # two levels, of twice the unknowns each
        ([0.1, 0.13], False),  # one level
        ([0.8, 11.0, 8.0, 2.2], False),  # falls again
        ([1e-3, 1.01e-3, 1.02e-3, 1.03e-3], False),  # noise
        ([0.4, 0.2, 0.1, 0.05], False),
        ([0.5], False),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_rises_of_several_levels_are_found(estimates, rise, unit):
    assert estimates_rise([unit * estimate for estimate in estimates]) == rise


PLACES = 2048  # on a boundary, for each component


def moved():
    """The square, one side of which is moved by a function."""
    top = (0, 0.1 * ng.sin(ng.x))
    return replace(loaded(), traction={}, force={}, displacement={"bottom": (0, 0), "top": top})


def meshes(problem, refinements):
    """The first mesh, refined uniformly."""
    mesh = first_mesh(problem, 0.25)
    yield mesh
    for _ in range(refinements):
        mesh = refined(problem, mesh)
        yield mesh


def test_refinement_costs_no_looks():
    """A search on each segment and mesh took 257 points a segment, and 90 for each of its parts."""
    counts = [solve(moved(), mesh, order=2).work["evaluations"] for mesh in meshes(moved(), 4)]
    assert PLACES < min(counts)  # one look, and more closely where the slope is extreme
    assert max(counts) <= 1.1 * PLACES


def test_parameters_that_change_are_seen_by_the_next_run():
    """The same problem again, of which a parameter has made a function jump."""
    jump = ng.Parameter(0.0)
    top = (0, 0.1 * ng.sin(ng.x) + jump * ng.IfPos(ng.x - 0.3, 1.0, 0.0))
    problem = replace(moved(), displacement={"bottom": (0, 0), "top": top})
    first = solve(problem, maxh=0.25, order=2)
    assert first.error_bound < np.inf
    jump.Set(0.01)
    again = solve(problem, first.mesh, order=2, start=first)
    with pytest.raises(ValueError, match=r'"top" jumps near \(0.3, 1\)'):
        _ = again.error_bound
