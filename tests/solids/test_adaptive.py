"""Estimate and adaptive levels of solids, on Hertz contact with exact data and on a press fit."""

import math

import numpy as np
import pytest

from drivers.reference.solids import hertz_of_solids, relative_energy_error
from ngcontact import Elastic, Problem, adapt, solve
from ngcontact.discrete.discrete_problem import MULTIGRID
from ngcontact.fem import unknowns
from ngcontact.geometries.solids import shells
from tests.solids.meshes import boxes
from tests.solids.test_curved import errors, press_fit
from tests.solids.test_patch import blocks, pressed
from tests.solids.test_surfaces import indented


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("counts", [(2, 2), (3, 2)])
def test_estimate_of_exact_solutions(order, counts):
    solution = solve(pressed(blocks(*counts)), order=order)
    # Round-off: measured 4e-14.
    assert solution.relative_error_estimate < 1e-12


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


@pytest.fixture(scope="module")
def hertz():
    problem, exact = hertz_of_solids()
    return exact, list(adapt(problem, maxh=0.5, max_dofs=16_000))


def test_hertz_by_levels(hertz):
    """Measured on 9138 unknowns: force 3e-3, radius 1.6e-2; first order is 2."""
    exact, levels = hertz
    last = levels[-1]
    assert last.order == 2
    assert 8_000 < last.displacement.space.ndof <= 16_000
    [x, y, z] = 4 * last.contact_force()
    assert abs(x) == abs(y) == 0.0
    assert -z == pytest.approx(exact.P, rel=1e-2)
    [pair] = last.pairs
    area = 4 * pair.line.weight[pair.active].sum()
    assert math.sqrt(area / math.pi) == pytest.approx(exact.a, rel=4e-2)
    assert all(level.work["gap_searches"] == 0 for level in levels)  # nodes face nodes
    estimates = [level.relative_error_estimate for level in levels]
    assert all(np.diff(estimates) < 0)
    # Bisection leaves edges of no element in NGSolve's count of edges.
    for level in levels:
        assert unknowns(level.mesh, 2, "isoparametric") == level.displacement.space.ndof


def test_effectivity(hertz):
    """Measured 4.5 to 4.8 on all levels but the first."""
    exact, levels = hertz
    for level in levels[1:]:
        error = relative_energy_error(level, exact)
        assert 3 < level.relative_error_estimate / error < 8
    assert error < 8e-2  # measured 6e-2 at 9138 unknowns


def test_parts_of_the_estimate(hertz):
    """All of them, and nothing else: what is left inside elements and between them dominates."""
    _, levels = hertz
    parts = levels[-1].estimate_parts
    assert set(parts) == {
        "element",
        "jump",
        "pressure",
        "tangential",
        "penetration",
        "complementarity",
        "displacement",
        "boundary",
    }
    total = sum(part.sum() for part in parts.values())
    assert total == pytest.approx(levels[-1].error_estimate ** 2, rel=1e-12)


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
    with pytest.raises(ValueError, match="order=4 is not available; solids have"):
        adapt(problem, order=4)
