"""Looks behind warnings evaluate functions among the data a stated number of times."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import solve
from ngcontact.adaptivity import refined
from ngcontact.mesh import first_mesh
from tests.quadrature.test_loads import loaded

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
