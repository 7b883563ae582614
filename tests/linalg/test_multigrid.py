"""V-cycles as good on every level, smoothers, iterative systems and what ends them."""

import logging

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.linalg import iterative
from ngcontact.linalg.iterative import IterativeSystems
from ngcontact.linalg.multigrid import LONG_ROWS, GaussSeidel, StalledError, truncated_multigrid
from ngcontact.linalg.sparse import cholesky, congruent, handed_over
from ngcontact.qp import BorderedSystems, Iterate, minimise
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


class Scene:
    """One program, its factorisation, its multigrid, and how often that was made."""

    def __init__(self, name: str, order: int, rounds: int, maxh: float = 0.5) -> None:
        self.problem = discrete(REFINED[name], order, rounds, maxh)
        self.program = self.problem.program
        space = self.problem.space
        _, self.matrix = congruent(space.form.mat, space.basis @ self.problem.basis.T)
        self.factor = cholesky(self.matrix)
        self.made = 0

    def prepare(self, free):
        self.made += 1
        return truncated_multigrid(self.matrix, steps_of(self.problem, 300), free)

    def systems(self):
        return IterativeSystems(self.program, self.factor, self.prepare)

    def direct(self) -> Iterate:
        return minimise(BorderedSystems(self.program, self.factor))


def same(one: Iterate, other: Iterate) -> None:
    """Both solve the same program, to the digits that its condition leaves."""
    np.testing.assert_array_equal(one.active, other.active)
    # Measured 1e-13 to 5e-12 at 1e5 unknowns.
    np.testing.assert_allclose(one.u, other.u, rtol=0, atol=1e-10 * np.abs(other.u).max())
    np.testing.assert_allclose(one.force, other.force, rtol=0, atol=1e-10 * other.force.max())


@pytest.mark.parametrize(
    ("limit", "value"), [("MOST_CYCLES", 1), ("MOST_STEPS", 1), ("RESTARTS", 0)]
)
def test_systems_that_stall_are_factorised(caplog, monkeypatch, limit: str, value: int):
    """In a Newton step, after many of them, and in the last refinement."""
    monkeypatch.setattr(iterative, limit, value)
    scene = Scene("disc", 1, 3)
    with caplog.at_level(logging.INFO, logger="ngcontact"):
        result = minimise(scene.systems())
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
