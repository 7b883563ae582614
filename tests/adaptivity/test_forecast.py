"""Forecasts: exact where behaviour is known, close on real fields; turned round; plans."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Elastic, Problem, adapt
from ngcontact.adaptivity import (
    Aim,
    Forecast,
    RefinementTree,
    Refining,
    planned,
    unresolvable,
)
from ngcontact.adaptivity.continuation import rebuilt, transferred
from ngcontact.fem import unknowns
from ngcontact.geometries import blocks
from ngcontact.mesh import first_mesh
from ngcontact.problem import MeshArrays

NONE = unresolvable([])
PROBLEM = Problem(geometry=blocks(), materials={"upper|lower": Elastic(E=1.0, nu=0.3)})
TRIANGLE = np.array([[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]])
QUARTERS = np.array([[0, 0, 0.5], [0.5, 0, 0.5], [0, 0.5, 0.5], [0.5, 0.5, -0.5]])
PARTS = QUARTERS[:, None, :2] + QUARTERS[:, 2, None, None] * TRIANGLE[0]


def forecast(mesh, order=2, singular=NONE):
    """Of equal indicators."""
    return Forecast(MeshArrays(mesh).corners, np.full(mesh.ne, 1 / mesh.ne), order, singular)


def aim(**changes):
    """Without an end but for the `changes`."""
    default = {"unknowns": np.inf, "most": np.inf, "error": 0.0, "theta": 0.5, "ending": 0.1}
    return Aim(**(default | changes))


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_smooth_errors_fall_with_the_power_of_the_size(order):
    """Half the size everywhere: the error is 2^-p of what it was."""
    mesh = first_mesh(PROBLEM, 0.5)
    refining, everything = Refining(PROBLEM, mesh), np.ones(mesh.ne, bool)
    finer, error = planned(
        refining, everything, forecast(mesh, order), aim(unknowns=0), "isoparametric"
    )
    assert error == pytest.approx(2.0**-order, rel=1e-12)
    assert (np.bincount(finer.origin) == 4).all()


def test_the_error_at_a_singular_point_falls_with_its_own_power():
    """One element of the four at a corner keeps 4^-3/2 of the square, the others 4^-3 each."""
    singular = replace(unresolvable([np.zeros(2)]), powers=np.array([1.5]))
    new = Forecast(TRIANGLE, np.ones(1), 2, singular).after(PARTS, np.zeros(4, dtype=int))
    assert new.squares == pytest.approx([1 / 8, 1 / 64, 1 / 64, 1 / 64], rel=1e-14)
    assert new.error == pytest.approx(np.sqrt(11 / 64), rel=1e-14)


def test_plans_end_at_the_aim_and_never_exceed_the_most():
    mesh = first_mesh(PROBLEM, 0.25)
    marked = np.arange(mesh.ne) < 5
    shares = 0.8 ** np.arange(mesh.ne)
    steep = replace(forecast(mesh), squares=shares / shares.sum())

    def plan(**changes):
        refining = Refining(PROBLEM, mesh)
        finer, error = planned(refining, marked, steep, aim(**changes), "isoparametric")
        return unknowns(finer.finished(), 2, "isoparametric"), error

    sizes, errors = np.array([plan(unknowns=n) for n in (0, 2000, 4000)]).T
    assert (sizes >= [0, 2000, 4000]).all()
    assert (np.diff(sizes) > 0).all()
    assert (np.diff(errors) < 0).all()
    assert plan(error=errors[1]) == (sizes[1], errors[1])
    # One unknown too many: all markings but the last; the first one is refined whatever comes.
    assert plan(unknowns=4000, most=sizes[2] - 1)[0] < sizes[2]
    assert plan(unknowns=4000, most=sizes[2]) == (sizes[2], errors[2])
    assert plan(unknowns=4000, most=1) == (sizes[0], errors[0])


@pytest.mark.parametrize(
    ("make", "order"),
    [
        (cases.partly_opening_block, 2),
        (cases.partly_opening_block, 4),
        (lambda: cases.hertz_contact().problem, 3),
        (cases.flat_punch, 3),
        (cases.partly_opening_block, None),
        (lambda: cases.hertz_contact().problem, None),
    ],
)
@pytest.mark.study(witness=["partly_opening_block-2", "partly_opening_block-None"])
def test_estimates_are_as_forecast(monkeypatch, make, order):
    """From the second level on: the first mesh may be too coarse to see its error."""
    forecasts, estimates = [], []

    def watched(*args):
        forecasts.append(planned(*args))
        return forecasts[-1]

    monkeypatch.setattr("ngcontact.adaptivity.planning.planned", watched)
    for solution in adapt(make(), order=order, max_dofs=12_000):
        estimates.append(solution.error_estimate)
    errors = [error for _, error in forecasts[: len(estimates) - 1]]
    ratios = np.divide(estimates[1:], estimates[:-1]) / errors
    assert len(ratios) >= 2
    # Measured: 0.95 to 1.08, at the punch, whose corners are worse than supposed, 1.17 to 1.24;
    # where the order rises 0.56 to 1.46.
    assert ratios[1:] == pytest.approx(1, abs=0.5 if order is None else 0.3)


def test_unknowns_of_meshes_being_refined():
    for element, order in (("isoparametric", 3), ("superparametric", 2), ("physical", 1)):
        problem = cases.ring_in_ring().problem
        mesh = ng.Mesh(first_mesh(problem, 0.6).ngmesh.Copy())
        mesh.Curve(2)
        refining = Refining(problem, mesh)
        for _ in range(3):
            refining.bisect(np.arange(refining.mesh.ne) % 5 == 0)
        finished = refining.finished()
        predicted = refining.unknowns(order, element)
        finished.Curve(2)
        assert predicted == unknowns(finished, order, element)


def divided(rounds, marked=None):
    """The first mesh, one that was refined so often, and the first's elements of its parts."""
    mesh = first_mesh(PROBLEM, 0.5)
    refining = Refining(PROBLEM, mesh)
    for _ in range(rounds):
        everything = np.ones(refining.mesh.ne, dtype=bool)
        refining.bisect(everything if marked is None else marked(refining.mesh))
    return mesh, refining.finished(), refining.origin


@pytest.mark.parametrize("power", [0.75, 1.5, 3.0])
@pytest.mark.parametrize("scale", [1e-9, 1.0, 1e9])
def test_what_is_forecast_of_parts_is_transferred_from_them(power, scale):
    """The two are inverse to each other, at a singular point (order 2: powers below 3) and away."""
    singular = replace(unresolvable([np.zeros(2)]), powers=np.array([power]))
    whole = Forecast(scale * TRIANGLE, np.array([0.7]), 2, singular)
    parts = whole.after(scale * PARTS, np.zeros(4, dtype=int))
    squares = transferred(parts, np.zeros(4, dtype=int), scale * TRIANGLE)
    assert squares == pytest.approx([0.7], rel=1e-13)


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("times", [1, 1 / 2, 2])
def test_the_mesh_is_as_fine_as_the_error_asks_for(order, times):
    """From equal indicators: `times` the size is times^p the error."""
    mesh, fine, origin = divided(2)
    known = Forecast(MeshArrays(fine).corners, np.full(fine.ne, 1 / fine.ne), order, NONE)
    tree, asked = RefinementTree(mesh, origin), aim(error=1.001 * times**order)
    new = rebuilt(PROBLEM, tree, known, asked, "isoparametric")
    # What Doerfler leaves in one round takes the next: up to 11 % more elements (order 1).
    assert 1 <= new.mesh.ne * times**2 / fine.ne < 1.12
    assert len(new.origin) == new.mesh.ne
    assert np.bincount(new.origin).min() >= 0.7 * 16 / times**2  # measured 0.75
