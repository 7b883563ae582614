"""Quadratic programs of users: brute force, another solver, known cycles, ties, bad input."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ngcontact.qp.active_set import solve_qp
from tests.qp.programs import (
    CYCLES,
    ROUND_OFF,
    brute_force,
    condition,
    dual,
    kkt_residual,
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
def test_random_problems_against_brute_force(m):
    rng = np.random.default_rng(m)
    for _ in range(125):  # 1000 problems in all
        program = random_program(rng, m)
        result = solve_qp(*program)
        allowed = ROUND_OFF * condition(program)
        assert kkt_residual(program, result) <= allowed
        right = brute_force(program)
        np.testing.assert_allclose(result.u, right, rtol=0, atol=allowed * np.abs(right).max())


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
        ({"B": [[1.0]]}, "B has 1 columns"),
        ({"g": [1.0, 2.0]}, "g has shape"),
        ({"active": np.array([1])}, "active is"),
    ],
)
def test_bad_input(change, message):
    data = {"A": np.eye(2), "f": [1.0, 1.0], "B": [[1.0, 0.0]], "g": [1.0]} | change
    with pytest.raises(ValueError, match=message):
        solve_qp(**data)
