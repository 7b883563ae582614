"""Large problems by multigrid: the solutions that factorisations give, and when they step in."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.benchmark.studies.linear import uniform_mesh
from drivers.reference import cases
from ngcontact import ConvergenceError, Elastic, Solution, adapt, solve
from ngcontact.discrete.discrete_problem import MULTIGRID, minimise_energy
from ngcontact.linalg import multigrid
from tests.scenes import REFINED

ORDERS = (1, 2, 3, 4)


@pytest.fixture
def large(monkeypatch):
    """Every size is a large one, down to coarsest spaces of a few hundred unknowns."""
    monkeypatch.setattr(MULTIGRID, "large", dict.fromkeys(ORDERS, 0))
    monkeypatch.setattr(MULTIGRID, "coarsest", 300)


def direct(*args, **options) -> Solution:
    """The same by factorisation."""
    known, MULTIGRID.large = MULTIGRID.large, {}
    try:
        return solve(*args, **options)
    finally:
        MULTIGRID.large = known


def same(one: Solution, other: Solution, accuracy: float = 1e-10) -> None:
    """Both solve the same discrete problem, to the digits that its condition leaves.

    Measured 1e-13 to 5e-12 at 1e5 unknowns.
    """
    np.testing.assert_array_equal(one.active, other.active)
    u, v = (s.displacement.vec.FV().NumPy() for s in (one, other))
    np.testing.assert_allclose(u, v, rtol=0, atol=accuracy * np.abs(v).max())
    np.testing.assert_allclose(one.force, other.force, rtol=0, atol=accuracy * other.force.max())
    # Round-off: as small as the direct ones.
    assert all(one.residuals[name] < 1e-12 for name in one.residuals)


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(witness=["disc-3"])
def test_solutions_are_those_of_a_factor(large, name: str, order: int):
    problem = REFINED[name]
    mesh = uniform_mesh(problem, order, 6000)
    solution = solve(problem, mesh, order=order)
    assert len(solution.steps) > 2
    assert solution.work["factorizations"] == 0
    assert solution.work["back_solves"] > 10
    same(solution, direct(problem, mesh, order=order))


@pytest.mark.usefixtures("large", "two_threads")
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(witness=["disc-2"])
def test_two_threads_find_what_one_finds(name: str, order: int):
    problem = REFINED[name]
    mesh = uniform_mesh(problem, order, 6000)
    one = solve(problem, mesh, order=order)
    with ng.TaskManager():
        two = solve(problem, mesh, order=order)
    assert two.work["factorizations"] == 0
    # Sums in another order may end a system one V-cycle sooner or later.
    assert abs(two.work["back_solves"] - one.work["back_solves"]) <= len(one.steps)
    same(two, one)
    np.testing.assert_allclose(two.indicators, one.indicators, rtol=1e-8)


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(witness=["disc-2", "block-2"])
def test_adaptive_meshes(large, name: str, order: int):
    *_, solution = adapt(REFINED[name], order=order, max_dofs=6000)
    assert solution.work["factorizations"] == 0
    same(solution, direct(REFINED[name], solution.mesh, order=order))


@pytest.mark.parametrize(
    ("limit", "value"), [("MOST_CYCLES", 1), ("MOST_STEPS", 1), ("RESTARTS", 0)]
)
def test_systems_that_stall_are_factorised(large, caplog, monkeypatch, limit: str, value: int):
    """In a Newton step, after many of them, and in the last refinement."""
    monkeypatch.setattr(multigrid, limit, value)
    problem = REFINED["disc"]
    mesh = uniform_mesh(problem, 1, 3000)
    with caplog.at_level("INFO", logger="ngcontact"):
        solution = solve(problem, mesh, order=1)
    assert caplog.text.count("the matrix is factorised: ") == 1
    assert solution.work["factorizations"] > 0
    same(solution, direct(problem, mesh, order=1))


def test_motions_that_no_contact_resists_ask_for_a_factor(large):
    """The block's upper body is held by contact alone; with no point active it falls."""
    problem = REFINED["block"]
    solution = solve(problem, uniform_mesh(problem, 2, 3000), order=2)
    assert solution.discrete.program.null_space.pins.size > 0
    assert solution.work["factorizations"] == 0
    result = minimise_energy(solution.discrete, np.zeros_like(solution.active))
    assert result.factorizations > 0
    np.testing.assert_array_equal(result.active, solution.active)
    u = solution.minimiser.u
    np.testing.assert_allclose(result.u, u, rtol=0, atol=1e-10 * np.abs(u).max())


def test_nearly_incompressible_bodies(large):
    """Gauss-Seidel sweeps are slow there: that is seen soon."""
    stiff = Elastic(E=1.0, nu=0.4999)
    problem = replace(REFINED["disc on block"], materials={"disc": stiff, "block": stiff})
    mesh = uniform_mesh(problem, 2, 3000)
    solution = solve(problem, mesh, order=2)
    assert solution.work["factorizations"] > 0
    known = direct(problem, mesh, order=2)
    np.testing.assert_array_equal(solution.active, known.active)
    assert solution.work["back_solves"] <= known.work["back_solves"] + 30


def test_a_free_motion_is_refused():
    problem = cases.partly_opening_block()
    problem = replace(problem, sliding="lower_axis", traction={"pressed|top": 1.0})
    solution = solve(problem, maxh=0.5, order=1)
    none = np.zeros_like(solution.active)
    with pytest.raises(ConvergenceError, match="rigid motion"):
        solution.discrete.influence(none, np.zeros(none.size))
