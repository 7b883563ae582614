"""The quadratic program solver against brute force, another solver, known cycles and ties."""

from __future__ import annotations

import weakref
from collections.abc import Callable

import daqp
import numpy as np
import pytest
import scipy.sparse as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from drivers.stress.trials.algebra import (
    CYCLES,
    NOT_SYMMETRIC,
    ROUND_OFF,
    brute_force,
    condition,
    dual,
    kkt_residual,
    random_program,
    tied_program,
)
from ngcontact.errors import ConvergenceError
from ngcontact.qp import active_set as newton
from ngcontact.qp import schur_complement as bordered
from ngcontact.qp.active_set import minimise
from ngcontact.qp.quadratic_program import QuadraticProgram
from ngcontact.qp.schur_complement import BorderedSystems
from ngcontact.qp.solving import solve_qp

SIZES_AND_SEEDS = st.integers(1, 40), st.integers(0, 2**32 - 1)


@pytest.mark.parametrize("name", CYCLES)
def test_known_cycles_end(name):
    S, d, force = CYCLES[name]
    result = solve_qp(*dual(np.array(S, float), np.array(d, float)))
    # The condition of S is below 100: 1e-12 is 50 times the round-off of S^-1.
    np.testing.assert_allclose(result.force, force, atol=1e-12)
    assert result.steps[-1] == 0


def test_plain_method_cycles(monkeypatch):
    """The safeguard is what ends it: with endless patience the plain method cycles."""
    monkeypatch.setattr(newton, "PATIENCE", 10**9)
    S, d, _ = CYCLES["T-cyc-1 moved"]
    with pytest.raises(ConvergenceError, match="did not settle") as failure:
        solve_qp(*dual(np.array(S, float), np.array(d, float)))
    assert failure.value.iterate.u.shape == (3,)


def test_matrix_of_a_cycle_that_is_not_symmetric_is_refused():
    """T-cyc-0: a P-matrix on which block pivoting may cycle has no energy to minimise."""
    with pytest.raises(ValueError, match="not symmetric"):
        solve_qp(*dual(NOT_SYMMETRIC, -np.ones(3)))


@pytest.mark.parametrize("m", range(1, 9))
def test_random_problems_against_brute_force(m):
    rng = np.random.default_rng(m)
    for _ in range(125):  # 1000 problems in all
        program = random_program(rng, m)
        result = solve_qp(*program)
        allowed = ROUND_OFF * condition(program)
        assert kkt_residual(program, result) <= allowed
        right = brute_force(program)
        np.testing.assert_allclose(result.u, right, rtol=0, atol=allowed * np.abs(right).max())


def another_solver(A, f, B, g):
    """Minimiser by DAQP, a dual active-set method (Arnstroem, Bemporad, Axehill 2022)."""
    none, kinds = np.full(g.size, -1e30), np.zeros(g.size, dtype=np.int32)
    u, _, flag, _ = daqp.solve(A, -f, B, g.copy(), none, kinds, primal_tol=1e-12, dual_tol=1e-12)
    assert flag == 1
    return u


@settings(max_examples=1000, deadline=None)
@given(*SIZES_AND_SEEDS)
def test_random_problems_against_another_solver(m, seed):
    rng = np.random.default_rng(seed)
    program = random_program(rng, m)
    result = solve_qp(*program, active=rng.random(m) < 0.5)
    assert kkt_residual(program, result) <= ROUND_OFF * condition(program)
    right = another_solver(*program)
    # The other solver's tolerance, 1e-12 of constraints whose rows are independent to 1/20, times
    # the condition of A; measured below 4e-12 on 600 problems.
    allowed = 1e-10 * np.abs(right).max()
    np.testing.assert_allclose(result.u, right, rtol=0, atol=allowed)


@settings(max_examples=1000, deadline=None)
@given(*SIZES_AND_SEEDS)
def test_ties_of_small_integers(m, seed):
    """Rows with neither force nor slack, a load matrix of half the rank: the solution is known."""
    rng = np.random.default_rng(seed)
    program, u, force = tied_program(rng, m)
    result = solve_qp(*program, active=rng.random(m) < 0.5)
    allowed = ROUND_OFF * condition(program)
    np.testing.assert_allclose(result.u, u, rtol=0, atol=allowed * max(np.abs(u).max(), 1))
    np.testing.assert_allclose(result.force, force, rtol=0, atol=allowed * max(force.max(), 1))
    assert result.steps[-1] == 0


def test_bounds_drive_what_no_load_does():
    """Without a load the forces of the rows are what residuals are small against."""
    rng = np.random.default_rng(0)
    for _ in range(100):
        A, f, B, g = random_program(rng, 3)
        program = A, 0 * f, B, -abs(g)
        result = solve_qp(*program)
        assert kkt_residual(program, result) <= ROUND_OFF * condition(program)
        right = brute_force(program)
        allowed = ROUND_OFF * condition(program) * np.abs(right).max()
        np.testing.assert_allclose(result.u, right, rtol=0, atol=allowed)


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


def membrane(n=60, load=-1.0, height=-0.02):
    """An obstacle problem with one unknown per row: K, b, bounds of -u <= height."""
    h = 1 / (n + 1)
    K = sp.diags_array([-1.0, 2.0, -1.0], offsets=[-1, 0, 1], shape=(n, n), format="csr") / h
    return K, np.full(n, load * h), np.full(n, -height)


def first_unknowns_bounded(K, b, g):
    """The program of bounds g on the first unknowns, none of them fixed."""
    m, n = g.size, b.size
    return QuadraticProgram(
        K=K,
        b=b,
        R=sp.eye_array(n, format="csr")[:m],
        g=g,
        equality=np.zeros(m, dtype=bool),
        fixed=np.zeros(n, dtype=bool),
        values=np.zeros(n),
        unknown=np.arange(m),
    )


def counting_factor(K, calls):
    """Dense factor of principal submatrices that records each request."""

    def factor(free):
        calls.append(free.copy())
        inverse = np.zeros(K.shape)
        inverse[np.ix_(free, free)] = np.linalg.inv(K.toarray()[np.ix_(free, free)])
        return lambda right: inverse @ right

    return factor


def test_one_factorisation_at_a_time(monkeypatch):
    monkeypatch.setattr(bordered, "BORDER", 0)
    rng = np.random.default_rng(7)
    X = rng.normal(size=(12, 14))
    program = first_unknowns_bounded(sp.csr_array(X @ X.T), rng.normal(size=12), rng.normal(size=6))
    dense = counting_factor(program.K, [])
    alive: weakref.WeakSet[Callable] = weakref.WeakSet()
    before = []

    def factor(free):
        before.append(len(alive))
        solve = dense(free)
        alive.add(solve)
        return solve

    minimise(BorderedSystems(program, factor), np.ones(6, dtype=bool))
    assert len(before) > 1
    assert not any(before)


@pytest.mark.parametrize("border", [0, 5, 1000])
def test_bordering_equals_refactorising(monkeypatch, border):
    """Unit rows: bordered systems give the solution that a new factor for each set gives."""
    monkeypatch.setattr(bordered, "BORDER", border)
    K, b, g = membrane()
    n = g.size
    flip = sp.eye_array(n, format="csr")
    program = first_unknowns_bounded(K, -b, g)
    calls = []
    start = np.zeros(n, dtype=bool)
    start[::2] = True
    result = minimise(BorderedSystems(program, counting_factor(K, calls)), start)
    reference = solve_qp(K, -b, flip, g)
    np.testing.assert_array_equal(result.active, reference.active)
    np.testing.assert_allclose(result.u, reference.u, rtol=1e-11)
    np.testing.assert_allclose(result.force, reference.force, atol=1e-11 * reference.force.max())
    assert len(calls) == result.factorizations
    if border == 1000:
        assert result.factorizations == 1
    # Free boundary of -u'' = -1 over the obstacle -0.02: contact where x is in [0.2, 0.8].
    contact = np.flatnonzero(result.active) + 1
    assert abs(contact[0] / (n + 1) - 0.2) <= 1 / (n + 1)
    assert abs(contact[-1] / (n + 1) - 0.8) <= 1 / (n + 1)


def test_given_values_and_equalities_with_unit_rows():
    K, b, g = membrane(n=9)
    n = g.size
    rows = np.array([3, 6])
    R = sp.eye_array(n, format="csr")[rows]
    fixed, values = np.zeros(n, dtype=bool), np.zeros(n)
    fixed[0], values[0] = True, 0.01
    program = QuadraticProgram(
        K=K,
        b=b,
        R=R,
        g=np.array([0.05, 1.0]),
        equality=np.array([True, False]),
        fixed=fixed,
        values=values,
        unknown=rows,
    )
    result = minimise(BorderedSystems(program, counting_factor(K, [])))
    assert result.u[0] == 0.01
    assert result.u[3] == 0.05
    assert result.active.tolist() == [True, False]
    assert result.force[0] < 0  # pulled up to the bound: an equality may pull
    free = np.ones(n, dtype=bool)
    free[[0, 3]] = False
    assert np.abs((b - K @ result.u)[free]).max() < 1e-13 * abs(K).max()


def test_zero_load_takes_one_step():
    result = solve_qp(np.eye(3), np.zeros(3), np.eye(3), np.zeros(3), active=np.ones(3, dtype=bool))
    assert result.steps == [0]
    assert not result.u.any()
    assert not result.force.any()


@pytest.mark.parametrize("scale", [1e-300, 1e-9, 1e9, 1e150])
def test_active_set_does_not_depend_on_units(scale):
    K, b, g = membrane()
    plain = solve_qp(K, -b, sp.eye_array(g.size), g)
    scaled = solve_qp(K, -b * scale, sp.eye_array(g.size), g * scale)
    np.testing.assert_array_equal(plain.active, scaled.active)
    assert plain.steps == scaled.steps


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"A": [[1.0, 0.5], [0.0, 1.0]]}, "not symmetric"),
        ({"A": [[1.0, 0.0], [0.0, -1.0]]}, "not positive definite"),
        ({"A": [[1.0, 2.0], [2.0, 1.0]]}, "not positive definite"),
        ({"A": [[1.0, 0.0]]}, "must be square"),
        ({"f": [1.0]}, "f has shape"),
        ({"f": [1.0, np.nan]}, "f has entries"),
        ({"B": [[1.0]]}, "B has 1 columns"),
        ({"g": [1.0, 2.0]}, "g has shape"),
        ({"active": np.array([1])}, "active is"),
    ],
)
def test_bad_input(change, message):
    data = {"A": np.eye(2), "f": [1.0, 1.0], "B": [[1.0, 0.0]], "g": [1.0]} | change
    with pytest.raises(ValueError, match=message):
        solve_qp(**data)


@pytest.mark.parametrize(
    "kind",
    [np.ndarray.tolist, np.asarray, sp.csr_matrix, sp.coo_matrix, sp.csr_array, sp.dok_array],
)
def test_matrices_of_any_kind(kind):
    A, B, E = np.diag([2.0, 4.0, 1.0]), np.eye(3)[:2], np.array([[0.0, 0.0, 1.0]])
    program = [2.0, 2.0, 0.0], kind(B), [0.25, 1.0], kind(E), [0.5]
    result = solve_qp(kind(A), *program)
    # Exact: all numbers are sums of powers of two.
    assert result.u.tolist() == [0.25, 0.5, 0.5]
    assert result.force.tolist() == [1.5, 0.0]
    assert result.multiplier.tolist() == [-0.5]


def test_a_vector_is_one_row():
    result = solve_qp(np.eye(2), [2.0, 2.0], [1.0, 0.0], [0.25])
    assert result.u.tolist() == [0.25, 2.0]


@pytest.mark.parametrize("stiffness", [1e-9, 1.0, 2.1e11])
def test_bordered_systems_do_not_depend_on_the_stiffness(stiffness):
    """Added rows border with compliances, released rows with stiffnesses: both must count."""
    rng = np.random.default_rng(5)
    n, m = 12, 6
    for _ in range(50):
        X = rng.normal(size=(n, n + 2))
        K, b, g = sp.csr_array(X @ X.T), rng.normal(size=n), 0.3 * rng.normal(size=m)
        rows = sp.eye_array(n, format="csr")[:m]
        program = first_unknowns_bounded(stiffness * K, stiffness * b, g)
        result = minimise(
            BorderedSystems(program, counting_factor(program.K, [])), rng.random(m) < 0.5
        )
        reference = solve_qp(K, b, rows, g)
        np.testing.assert_array_equal(result.active, reference.active)
        # Condition of these matrices up to 1e5: round-off 1e-10.
        np.testing.assert_allclose(result.u, reference.u, atol=1e-9)


def test_rows_of_any_length():
    result = solve_qp(np.eye(2), [2.0, 2.0], [[1.0, 0.0], [0.0, 1e-7]], [0.25, 0.25e-7])
    np.testing.assert_allclose(result.u, 0.25, rtol=1e-12)
