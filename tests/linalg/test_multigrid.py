"""V-cycles as good on every level, smoothers, and what does not converge."""

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.linalg.multigrid import (
    LONG_ROWS,
    GaussSeidel,
    IterativeSystems,
    StalledError,
    truncated_multigrid,
)
from ngcontact.linalg.sparse import cholesky, congruent, handed_over
from ngcontact.qp import BorderedSystems
from tests.scenes import REFINED, discrete, steps_of


def prepared(name: str, order: int, rounds: int, maxh: float = 0.5):
    """Matrix, multigrid and free unknowns, every second contact row active."""
    problem = discrete(REFINED[name], order, rounds, maxh)
    p = problem.program
    K, matrix = congruent(problem.space.form.mat, problem.space.basis @ problem.basis.T)
    free = ~p.fixed
    free[p.unknown[: len(p.unknown) // 2]] = False
    return K, truncated_multigrid(matrix, steps_of(problem, 0), free), free


# Measured 30, 40, 52 and 61 at most for ten digits.
@pytest.mark.parametrize(("order", "most"), [(1, 38), (2, 50), (3, 64), (4, 75)])
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(witness=["disc-1-38", "disc-2-50"])
def test_cycles_do_not_grow_with_the_mesh(name: str, order: int, most: int):
    rng = np.random.default_rng(order)
    counts = []
    for rounds in (1, 2, 3):
        K, multigrid, free = prepared(name, order, rounds)
        b = np.where(free, rng.normal(size=K.shape[0]), 0.0)
        x, count = multigrid.solve(b, 1e-10 * np.abs(b).max(), 100)
        # The iteration's own residual drifts from this one by round-off.
        assert np.abs(b - K @ x)[free].max() < 2e-10 * np.abs(b).max()
        assert not x[~free].any()
        counts.append(count)
    assert max(counts) <= most
    assert counts[-1] <= 1.25 * counts[-2] + 1  # measured 1.2; and a whole one


@pytest.mark.parametrize("size", [LONG_ROWS // 2, 2 * LONG_ROWS])
def test_the_sweep_after_is_the_reverse_one(size):
    """Of few entries a row NGSolve's own, of many that of a copy in reverse order."""
    rng = np.random.default_rng(size)
    B = rng.normal(size=(size, size))
    K, free = B @ B.T + size * np.eye(size), rng.random(size) < 0.8
    matrix = handed_over(sp.csr_array(K))
    smoother = GaussSeidel(matrix, free)
    right, solution = matrix.CreateColVector(), matrix.CreateColVector()
    b, x = right.FV().NumPy(), solution.FV().NumPy()
    b[:], x[:] = rng.normal(size=(2, size))
    exact = x.copy()
    exact[free] += np.linalg.solve(np.triu(K[np.ix_(free, free)]), (b - K @ x)[free])
    smoother.after(right, solution)
    # Round-off of sums of `size` terms; the condition of the triangle is about 4.
    np.testing.assert_allclose(x, exact, rtol=0, atol=1e-13 * size)


def test_what_does_not_converge_is_said():
    K, multigrid, free = prepared("disc", 1, 2)
    b = np.where(free, 1.0, 0.0)
    with pytest.raises(StalledError, match="3 V-cycles left"):
        multigrid.solve(b, 1e-10, 3)
    with pytest.raises(StalledError, match="V-cycles left nan"):
        multigrid.solve(np.full(K.shape[0], np.nan), 1e-10, 3)


def test_systems_may_be_refined_in_any_order():
    """Without `solve` before, or after that of another set: the same solution."""
    problem, made = discrete(REFINED["disc on block"], 1, 2), []
    program, space = problem.program, problem.space
    _, matrix = congruent(space.form.mat, space.basis @ problem.basis.T)

    def prepare(free):
        made.append(free)
        return truncated_multigrid(matrix, steps_of(problem, 300), free)

    factor, m = cholesky(matrix), len(program.g)
    known = BorderedSystems(program, factor)
    systems = IterativeSystems(program, factor, prepare)

    def check(active):
        for found, right in zip(
            systems.solve(active, refined=True), known.solve(active, refined=True), strict=True
        ):
            np.testing.assert_allclose(found, right, rtol=0, atol=1e-10 * np.abs(right).max())

    one, other = np.arange(m) < m // 2, np.arange(m) > m // 3
    for active in (one, other, one):
        check(active)
        systems.solve(one)
    assert len(made) == 1
    systems.forget()
    systems.restart(program)
    assert systems.back_solves == 0
    check(one)
    assert len(made) == 2
