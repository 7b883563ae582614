"""V-cycles: symmetric, positive definite, as good on every level; conjugate gradients with them."""

import numpy as np
import pytest

from ngcontact.linalg.multigrid import Multigrid, StalledError, truncated_multigrid
from ngcontact.linalg.smoothing import Chebyshev, GaussSeidel
from ngcontact.linalg.sparse import congruent
from tests.scenes import REFINED, discrete, steps_of


def prepared(name: str, order: int, rounds: int, maxh: float = 0.5, smoother=GaussSeidel):
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


@pytest.mark.parametrize(
    ("smoother", "order", "most"),
    # Measured 30, 40, 52 and 61 at most for ten digits with sweeps, 13, 21, 28 and 38
    # with polynomials.
    [
        *((GaussSeidel, *counts) for counts in ((1, 38), (2, 50), (3, 64), (4, 75))),
        *((Chebyshev, *counts) for counts in ((1, 16), (2, 26), (3, 35), (4, 47))),
    ],
)
@pytest.mark.parametrize("name", REFINED)
@pytest.mark.study(
    witness=["disc-GaussSeidel-1-38", "disc-GaussSeidel-2-50", "disc-Chebyshev-1-16"]
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
