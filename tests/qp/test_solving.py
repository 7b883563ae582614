"""Active sets: optimality, known cycles, ties, rigid motions, bad input."""

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from ngcontact.errors import ConvergenceError
from ngcontact.qp import schur_complement
from ngcontact.qp.active_set import minimise, solve_qp
from ngcontact.qp.quadratic_program import kkt_residuals, pinned_null_space
from ngcontact.qp.schur_complement import BorderedSystems
from tests.qp.programs import (
    CYCLES,
    ROUND_OFF,
    condition,
    counting_factor,
    dual,
    first_unknowns_bounded,
    inequalities,
    kkt_residual,
    membrane,
    random_program,
    tied_program,
)

SIZES_AND_SEEDS = st.integers(1, 40), st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("name", CYCLES)
def test_known_cycles_end_in_every_unit(name):
    """From all first active sets."""
    S, d, force = CYCLES[name]
    for unit, *first in product([1e-150, 1.0, 1e150], *[[False, True]] * 3):
        program = dual(S, unit * np.array(d))
        result = solve_qp(*program, active=np.array(first))
        allowed = ROUND_OFF * condition(program)
        assert kkt_residual(program, result) <= allowed
        np.testing.assert_allclose(result.force / unit, force, atol=allowed * max(*force, 1))
        assert result.steps[-1] == 0


@pytest.mark.parametrize("m", range(1, 9))
@pytest.mark.study(witness=["1"])
def test_random_problems_are_solved(m):
    """Their minimisers are unique: the optimality conditions tell whether they are found."""
    rng = np.random.default_rng(m)
    for _ in range(125):  # 1000 problems in all
        program = random_program(rng, m)
        assert kkt_residual(program, solve_qp(*program)) <= ROUND_OFF * condition(program)


@settings(max_examples=1000, deadline=None)
@given(*SIZES_AND_SEEDS)
@pytest.mark.study
def test_ties_of_small_integers(m, seed):
    """Rows with neither force nor slack, a load matrix of half the rank: the solution is known."""
    rng = np.random.default_rng(seed)
    program, u, force = tied_program(rng, m)
    result = solve_qp(*program, active=rng.random(m) < 0.5)
    allowed = ROUND_OFF * condition(program)
    np.testing.assert_allclose(result.u, u, rtol=0, atol=allowed * max(np.abs(u).max(), 1))
    np.testing.assert_allclose(result.force, force, rtol=0, atol=allowed * max(force.max(), 1))
    assert result.steps[-1] == 0


def test_equations_are_met():
    rng = np.random.default_rng(0)
    A, f, B, g = random_program(rng, 4)
    E, e = rng.normal(size=(1, A.shape[0])), np.array([0.3])
    result = solve_qp(A, f, B, g, E, e)
    residual = A @ result.u + B.T @ result.force + E.T @ result.multiplier - f
    assert np.abs(residual).max() < 1e-10  # entries of order 1, condition below 1e4
    assert abs(E @ result.u - e) < 1e-12
    assert (result.force >= 0).all()
    assert (B @ result.u <= g + 1e-12).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": [[1.0, 0.5], [0.0, 1.0]]}, "not symmetric"),
        ({"A": [[1.0, 0.0], [0.0, -1.0]]}, "not positive definite"),
        ({"A": [[1.0, 2.0], [2.0, 1.0]]}, "not positive definite"),
        ({"A": [[1.0, 0.0]]}, "must be square"),
        ({"f": [1.0]}, "f has shape"),
        ({"f": [1.0, np.nan]}, "f has entries"),
        ({"A": [[np.inf, 0.0], [0.0, 1.0]]}, "A has entries that are NaN or infinite"),
        ({"B": [[1.0]]}, "B has 1 columns"),
        ({"g": [1.0, 2.0]}, "g has shape"),
        ({"active": np.array([1])}, "active is"),
        # Nothing is admissible; three rows in two unknowns, of which the last is missed by 0.1.
        ({"B": [[1.0, 0.0], [-1.0, 0.0]], "g": [-1.0, 0.0]}, "of B, E is missed by 0.5"),
        ({"B": [[1, 0], [0, 1], [1, 1]], "g": [0.5, 0.5, 0.8]}, "row 2 of B, E is missed by 0.1"),
    ],
)
def test_bad_input(change, message):
    data = {"A": np.eye(2), "f": [1.0, 1.0], "B": [[1.0, 0.0]], "g": [1.0]} | change
    with pytest.raises(ValueError, match=message):
        solve_qp(**data)


def test_plain_method_cycles(monkeypatch):
    """The dense program is what ends it: full switches, which are left without it, cycle."""
    S, d, force = CYCLES["T-cyc-1 moved"]
    program = inequalities(*dual(S, d))
    factor = counting_factor(program.K, [])
    result = minimise(BorderedSystems(program, factor))
    np.testing.assert_allclose(result.force, force, atol=1e-12)  # condition below 100

    def endless(*args):
        raise RuntimeError("Maximum number of iterations reached.")

    monkeypatch.setattr(schur_complement, "nnls", endless)
    with pytest.raises(ConvergenceError, match="did not settle") as failure:
        minimise(BorderedSystems(program, factor))
    assert failure.value.iterate.u.shape == (3,)


def test_a_singular_system_is_said():
    """Two springs of which nothing holds the second: never a number."""
    K = sp.csr_array(np.diag([1.0, 0.0]))
    program = first_unknowns_bounded(K, np.ones(2), np.ones(1))
    systems = BorderedSystems(program, lambda free: lambda right: right)
    with pytest.raises(ConvergenceError, match=r"Newton step 1: .*singular") as failure:
        minimise(systems)
    assert failure.value.iterate.steps == []


def test_residuals_name_what_is_violated():
    K, b, g = membrane()
    program = first_unknowns_bounded(K, -b, g)
    result = minimise(BorderedSystems(program, counting_factor(K, [])))
    assert max(kkt_residuals(program, result).values()) < 1e-13  # round-off
    contact, apart = np.flatnonzero(result.active)[0], np.flatnonzero(~result.active)[0]
    length, largest = np.abs(result.u).max(), result.force.max()
    u, force = result.u.copy(), result.force.copy()
    u[contact] += 0.1 * length
    force[apart] -= 0.2 * largest
    wrong = kkt_residuals(program, replace(result, u=u, force=force))
    assert wrong["penetration"] == pytest.approx(0.1 / 1.1, rel=1e-9)
    assert wrong["tension"] == pytest.approx(0.2, rel=1e-12)
    assert min(wrong["equilibrium"], wrong["complementarity"]) > 1e-3


SPRINGS = 6


def chain(load, g):
    """Springs in a row that nothing holds but bounds at their first two joints."""
    n = SPRINGS + 1
    D = np.diff(np.eye(n), axis=0)
    fixed = np.zeros(n, dtype=bool)
    rows = np.arange(len(g))
    null_space = pinned_null_space(np.ones((n, 1)), np.zeros((1, 0)), np.zeros((0, n)), rows, fixed)
    return first_unknowns_bounded(sp.csr_array(D.T @ D), load, np.array(g), null_space)


@pytest.mark.parametrize("start", [False, True])
def test_contact_alone_holds_a_chain(start):
    """Pushed at its far end it moves until the first joint meets its bound: no spring is left."""
    load = np.zeros(SPRINGS + 1)
    load[-1] = 1.0
    program = chain(load, [0.3, 5.0])
    assert program.null_space.pins.size == 1
    systems = BorderedSystems(program, counting_factor(program.K, []))
    result = minimise(systems, np.full(2, start))
    np.testing.assert_allclose(result.u, 0.3 + np.arange(SPRINGS + 1), rtol=1e-12)
    np.testing.assert_allclose(result.force, [1, 0], atol=1e-12)  # condition of the chain: 50
    assert result.active.tolist() == [True, False]
    assert systems.factorizations == 1


def test_motions_that_nothing_resists_obey_their_conditions():
    """No bounds at all, a load in equilibrium: the mean of the displacement is zero."""
    n = SPRINGS + 1
    D = np.diff(np.eye(n), axis=0)
    ones, none = np.ones((n, 1)), np.zeros(0, dtype=np.intp)
    null_space = pinned_null_space(ones, np.eye(1), ones.T / n, none, np.zeros(n, dtype=bool))
    assert (null_space.held.size, null_space.pins.size) == (1, 0)
    load = np.zeros(n)
    load[[0, -1]] = -1.0, 1.0
    program = first_unknowns_bounded(sp.csr_array(D.T @ D), load, np.zeros(0), null_space)
    result = minimise(BorderedSystems(program, counting_factor(program.K, [])))
    np.testing.assert_allclose(result.u, np.arange(n) - SPRINGS / 2, atol=1e-13)
