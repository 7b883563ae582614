"""Meshes from the indicators for another load: forecasts turned round, sizes, coarsening."""

from dataclasses import replace

import numpy as np
import pytest

from ngcontact import Elastic, Problem
from ngcontact.adaptivity import Aim, Descent, Forecast, Refining, unresolvable
from ngcontact.adaptivity.continuation import rebuilt, recalled
from ngcontact.geometries import blocks
from ngcontact.mesh import first_mesh
from ngcontact.problem import Triangulation

PROBLEM = Problem(geometry=blocks(), materials={"upper|lower": Elastic(E=1.0, nu=0.3)})
TRIANGLE = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
QUARTERS = np.array([[0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5], [0.5, 0.5, -0.5]])
PARTS = QUARTERS[:, None, :2] + QUARTERS[:, 2, None, None] * TRIANGLE[0]
NONE = unresolvable([])


def divided(rounds, marked=None):
    """The first mesh, one that was refined so often, and the first's elements of its parts."""
    mesh = first_mesh(PROBLEM, 0.5)
    refining = Refining(PROBLEM, mesh)
    for _ in range(rounds):
        everything = np.ones(refining.mesh.ne, dtype=bool)
        refining.bisect(everything if marked is None else marked(refining.mesh))
    return mesh, refining.finished(), refining.origin


def aim(error):
    """Of an error over the known one."""
    return Aim(np.inf, np.inf, error, 0.5, 0.1, np.inf)


@pytest.mark.parametrize("power", [0.75, 1.5, 3.0])
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_what_is_forecast_of_parts_is_recalled_from_them(power, scale):
    """The two are inverse to each other, at a singular point (order 2: powers below 3) and away."""
    singular = replace(unresolvable([np.zeros(2)]), powers=np.array([power]))
    whole = Forecast(scale * TRIANGLE, np.array([0.7]), 2, singular)
    parts = whole.after(scale * PARTS, np.zeros(4, dtype=int))
    squares = recalled(parts, np.zeros(4, dtype=int), scale * TRIANGLE)
    assert squares == pytest.approx([0.7], rel=1e-13)


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("times", [1, 1 / 2, 2])
def test_the_mesh_is_as_fine_as_the_error_asks_for(order, times):
    """From equal indicators: `times` the size is times^p the error."""
    mesh, fine, origin = divided(2)
    known = Forecast(Triangulation(fine).corners, np.full(fine.ne, 1 / fine.ne), order, NONE)
    new, descent = rebuilt(
        PROBLEM, Descent(mesh, origin), known, aim(1.001 * times**order), "isoparametric"
    )
    # What Doerfler leaves in one round takes the next: up to 11 % more elements (order 1).
    assert 1 <= new.ne * times**2 / fine.ne < 1.12
    assert len(descent.element) == new.ne
    assert np.bincount(descent.element).min() >= 0.7 * 16 / times**2  # measured 0.75
