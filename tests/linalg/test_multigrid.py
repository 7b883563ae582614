"""V-cycles as good on every level, smoothers, iterative systems and what ends them."""

import logging

import ngsolve as ng
import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.linalg.iterative import IterativeSystems, Limits
from ngcontact.linalg.multigrid import (
    DEGREE,
    LONG_ROWS,
    SAFETY,
    Chebyshev,
    GaussSeidel,
    StalledError,
    fastest,
    truncated_multigrid,
)
from ngcontact.linalg.sparse import cholesky, congruent, handed_over
from ngcontact.qp import BorderedSystems, Iterate, minimise
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


def matrix_of(name: str, order: int) -> tuple[np.ndarray, ng.BaseMatrix, np.ndarray]:
    K, _, free = prepared(name, order, 1, 1.0)
    return K.toarray(), handed_over(K), free


def smoothed(smoother, right: np.ndarray, start: np.ndarray | None) -> np.ndarray:
    """What a smoother makes of `start`, or of zero."""
    b, x = (ng.BaseVector(right.size) for _ in range(2))
    b.FV().NumPy()[:] = right
    x.FV().NumPy()[:] = np.nan if start is None else start
    (smoother.before if start is None else smoother.after)(b, x)
    return x.FV().NumPy().copy()


@pytest.mark.usefixtures("two_threads")
def test_several_threads_take_polynomials():
    _, matrix, free = matrix_of("disc", 1)
    assert isinstance(fastest(matrix, free), GaussSeidel)  # no manager has been entered
    with ng.TaskManager():
        assert isinstance(fastest(matrix, free), Chebyshev)
    ng.SetNumThreads(1)
    with ng.TaskManager():
        assert isinstance(fastest(matrix, free), GaussSeidel)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("name", REFINED)
def test_the_largest_eigenvalue_is_found(name: str, order: int):
    K, matrix, free = matrix_of(name, order)
    diagonal = K.diagonal()  # 0 at unknowns inside of elements
    root = np.divide(1.0, np.sqrt(diagonal), np.zeros(len(diagonal)), where=diagonal > 0)
    exact = np.linalg.eigvalsh(K * np.outer(root, root))[-1]
    found = Chebyshev(matrix, free).largest / SAFETY
    assert 0.9 * exact <= found <= exact * (1 + 1e-12)  # by Lanczos from below


@pytest.mark.parametrize("name", REFINED)
def test_the_polynomial_is_that_of_the_fourth_kind(name: str):
    """Of an eigenvector W(1 - 2 t) / (2 k + 1) is left; W(cos a) = sin((k + 1/2) a) / sin(a/2)."""
    K, matrix, free = matrix_of(name, 2)
    smoother = Chebyshev(matrix, free)
    inside = K[np.ix_(free, free)]
    root = 1 / np.sqrt(inside.diagonal())
    values, vectors = np.linalg.eigh(inside * np.outer(root, root))
    for i in (0, values.size // 3, values.size - 1):
        vector = np.zeros(free.size)
        vector[free] = root * vectors[:, i]
        a = np.arccos(1 - 2 * values[i] / smoother.largest)
        factor = np.sin((DEGREE + 0.5) * a) / np.sin(a / 2) / (2 * DEGREE + 1)
        right = np.where(free, K @ vector, 1.0)  # the last is not read
        for start in (None, np.zeros(free.size)):
            error = vector - smoothed(smoother, right, start)
            round_off = 1e-12 * np.abs(vector).max()
            np.testing.assert_allclose(error, factor * vector, rtol=0, atol=round_off)


class Scene:
    """One program, its factorisation, its multigrid, and how often that was made."""

    def __init__(self, name: str, order: int, rounds: int, maxh: float = 0.5) -> None:
        self.problem = discrete(REFINED[name], order, rounds, maxh)
        self.program = self.problem.program
        space = self.problem.space
        _, self.matrix = congruent(space.matrix, space.A, space.basis @ self.problem.basis.T)
        self.factor = cholesky(self.matrix)
        self.made = 0

    def prepare(self, free):
        self.made += 1
        return truncated_multigrid(self.matrix, steps_of(self.problem, 300), free)

    def systems(self, limits=None):
        return IterativeSystems(self.program, self.factor, self.prepare, limits)

    def direct(self) -> Iterate:
        return minimise(BorderedSystems(self.program, self.factor))


def same(one: Iterate, other: Iterate) -> None:
    """Both solve the same program, to the digits that its condition leaves."""
    np.testing.assert_array_equal(one.active, other.active)
    # Measured 1e-13 to 5e-12 at 1e5 unknowns.
    np.testing.assert_allclose(one.u, other.u, rtol=0, atol=1e-10 * np.abs(other.u).max())
    np.testing.assert_allclose(one.force, other.force, rtol=0, atol=1e-10 * other.force.max())


@pytest.mark.parametrize("limits", [Limits(cycles=1), Limits(restarts=0)])
def test_systems_that_stall_are_factorised(caplog, limits: Limits):
    """In a Newton step, and in the last refinement."""
    scene = Scene("disc", 1, 3)
    with caplog.at_level(logging.INFO, logger="ngcontact"):
        result = minimise(scene.systems(limits))
    assert caplog.text.count("the matrix is factorised: ") == 1
    assert result.factorizations > 0
    same(result, scene.direct())


def test_systems_may_be_refined_in_any_order():
    """Without `solve` before, or after that of another set: the same solution."""
    scene = Scene("disc on block", 1, 2)
    m = len(scene.program.g)
    one, other = np.arange(m) < m // 2, np.arange(m) > m // 3
    known, systems = BorderedSystems(scene.program, scene.factor), scene.systems()
    for active in (one, other, one):
        u, force = systems.refine(active)
        right, forces = known.refine(active)
        np.testing.assert_allclose(u, right, rtol=0, atol=1e-10 * np.abs(right).max())
        np.testing.assert_allclose(force, forces, rtol=0, atol=1e-10 * np.abs(forces).max())
        systems.solve(one)
    assert scene.made == 1
    systems.forget()
    systems.restart(scene.program)
    assert systems.back_solves == 0
    u, _ = systems.refine(one)
    right, _ = known.refine(one)
    np.testing.assert_allclose(u, right, rtol=0, atol=1e-10 * np.abs(right).max())
    assert scene.made == 2
