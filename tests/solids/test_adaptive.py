"""Estimate and adaptive levels of solids, on Hertz contact with exact data and on a press fit."""

import math

import numpy as np
import pytest

from drivers.reference.solids import hertz_of_solids
from ngcontact import Elastic, Problem, adapt, solve
from ngcontact.discrete.discrete_problem import MULTIGRID
from ngcontact.geometries.solids import shells
from tests.solids.meshes import boxes
from tests.solids.test_curved import errors, press_fit
from tests.solids.test_patch import blocks, pressed
from tests.solids.test_surfaces import indented


def test_exact_solutions_are_not_refined():
    problem = pressed(blocks(2, 2))
    assert len(list(adapt(problem, order=2, tolerance=1e-3))) == 1


def test_levels_on_a_rigid_obstacle():
    """A paraboloid: errors by the energy that order 3 finds. Measured 4.4 to 7.9."""
    exact = solve(indented(), order=3).energy
    levels = list(adapt(indented(), order=1, max_dofs=6000))
    missed = [math.sqrt(2 * (level.energy - exact)) for level in levels]
    assert len(levels) == 3
    assert missed[-1] < 0.8 * missed[0]
    for level, error in zip(levels, missed, strict=True):
        assert 3 < level.error_estimate / error < 10


def test_facing_facets_stay_matched():
    """On a sphere, refined on one side of the interface alone, by what the stiffer body needs."""
    levels = list(adapt(press_fit(shells()), maxh=0.4, max_dofs=12_000))
    assert len(levels) > 2
    assert all(level.work["gap_searches"] == 0 for level in levels)
    assert errors(levels[-1])[0] < 1.5e-3  # measured 6.6e-4
    assert errors(levels[-1])[1] < 6e-3  # measured 2.8e-3


@pytest.mark.parametrize("order", [1, 2, 3])
def test_multigrid_tells_the_same(monkeypatch, order):
    problem, _ = hertz_of_solids()
    *_, factorised = adapt(problem, order=order, maxh=0.5, max_dofs=7_000)
    monkeypatch.setattr(MULTIGRID, "large_solids", {order: 0})
    monkeypatch.setattr(MULTIGRID, "coarsest", 500)
    *_, iterated = adapt(problem, order=order, maxh=0.5, max_dofs=7_000)
    assert factorised.work["factorizations"] > 0
    assert iterated.work["factorizations"] == 0
    assert (factorised.active == iterated.active).all()
    difference = np.abs(factorised.force - iterated.force).max()
    assert difference < 1e-8 * factorised.force.max()


def test_force_on_a_body():
    """A cube that hangs: its weight is in the residual of the elements."""
    mesh = boxes(("a", (0, 0, 0), (1, 1, 1), (2, 2, 2)))
    problem = Problem(
        mesh, {"a": Elastic(1.0, 0.0)}, displacement={"a_top": (0, 0, 0)}, force={"a": (0, 0, -1)}
    )
    # nu = 0: u is quadratic in z.
    solution = solve(problem, order=2)
    assert solution.relative_error_estimate < 1e-12


def test_what_adapt_refuses():
    problem = pressed(blocks(2, 2))
    for options in (
        {"guaranteed": True, "tolerance": 0.1},
        {"start": solve(problem)},
        {"order": "auto"},
    ):
        with pytest.raises(ValueError, match="not available for solids"):
            adapt(problem, **options)
