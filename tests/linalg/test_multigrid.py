"""V-cycles: symmetric, positive definite, as good on every level; conjugate gradients with them."""

import numpy as np
import pytest

from ngcontact.linalg.multigrid import Multigrid, StalledError, truncated_multigrid
from ngcontact.linalg.smoothing import chebyshev, gauss_seidel
from ngcontact.linalg.sparse import congruent
from tests.scenes import REFINED, discrete, steps_of

SMOOTHERS = (gauss_seidel, chebyshev)


def prepared(name: str, order: int, rounds: int, maxh: float = 0.5, smoother=gauss_seidel):
    """Matrix, multigrid and free unknowns, every second contact row active."""
    problem = discrete(REFINED[name], order, rounds, maxh)
    p = problem.program
    K, matrix = congruent(
        problem.space.matrix, problem.space.A, problem.space.basis @ problem.basis.T
    )
    free = ~p.fixed
    free[p.unknown[: len(p.unknown) // 2]] = False
    return K, truncated_multigrid(matrix, steps_of(problem, 0), free, smoother), free


def cycles(multigrid: Multigrid, size: int) -> np.ndarray:
    """The preconditioner as a matrix."""
    right, solution = (multigrid.levels[0].matrix.CreateColVector() for _ in range(2))
    columns = np.zeros((size, size))
    for i in range(size):
        right[:] = 0.0
        right[i] = 1.0
        multigrid.cycle(right, solution)
        columns[i] = solution.FV().NumPy()
    return columns


@pytest.mark.parametrize("smoother", SMOOTHERS)
@pytest.mark.parametrize("released", [False, True])
@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(
    witness=["disc-1-True-gauss_seidel", "disc-2-False-gauss_seidel", "disc-1-False-gauss_seidel"]
)
def test_a_cycle_is_symmetric_and_positive_definite(
    name: str, order: int, released: bool, smoother
):
    K, multigrid, free = prepared(name, order, 1 if order > 1 else 2, 1.0, smoother)
    if released:  # coarser matrices are those of another set
        free = free.copy()
        held = np.flatnonzero(~free)[::3]
        free[held] = True
        free[np.flatnonzero(free)[:2]] = False
        multigrid.hold(free)
    whole = cycles(multigrid, K.shape[0])
    inside = whole[np.ix_(free, free)]
    # Round-off of sums; entries are alike.
    np.testing.assert_allclose(inside, inside.T, rtol=0, atol=1e-12 * np.abs(inside).max())
    assert not whole[:, ~free].any()
    root = np.linalg.cholesky(K[free][:, free].toarray())
    values = np.linalg.eigvalsh(root.T @ inside @ root)
    # Theory: 1 - (contraction)^2, in (0, 1] with coarse matrices of the set itself.
    assert values[0] > 0
    if not released:
        assert values[-1] <= 1 + 1e-12


@pytest.mark.parametrize(
    ("smoother", "order", "most"),
    # Measured 30, 40, 52 and 61 at most for ten digits with sweeps, 13, 21, 28 and 38
    # with polynomials.
    [
        *((gauss_seidel, *counts) for counts in ((1, 38), (2, 50), (3, 64), (4, 75))),
        *((chebyshev, *counts) for counts in ((1, 16), (2, 26), (3, 35), (4, 47))),
    ],
)
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(
    witness=["disc-gauss_seidel-1-38", "disc-gauss_seidel-2-50", "disc-chebyshev-1-16"]
)
def test_cycles_do_not_grow_with_the_mesh(name: str, smoother, order: int, most: int):
    rng = np.random.default_rng(order)
    counts = []
    for rounds in (1, 2, 3):
        K, multigrid, free = prepared(name, order, rounds, smoother=smoother)
        b = np.where(free, rng.normal(size=K.shape[0]), 0.0)
        x, count = multigrid.solve(b, 1e-10 * np.abs(b).max(), 100)
        # The iteration's own residual drifts from this one by round-off.
        assert np.abs(b - K @ x)[free].max() < 2e-10 * np.abs(b).max()
        assert not x[~free].any()
        counts.append(count)
    assert max(counts) <= most
    assert counts[-1] <= 1.25 * counts[-2] + 1  # measured 1.2; and a whole one


def test_what_does_not_converge_is_said():
    K, multigrid, free = prepared("disc", 1, 2)
    b = np.where(free, 1.0, 0.0)
    with pytest.raises(StalledError, match="3 V-cycles left"):
        multigrid.solve(b, 1e-10, 3)
    with pytest.raises(StalledError, match="V-cycles left nan"):
        multigrid.solve(np.full(K.shape[0], np.nan), 1e-10, 3)
