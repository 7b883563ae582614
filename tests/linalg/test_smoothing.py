"""Smoothers: which one when, and the polynomial against its closed form."""

import ngsolve as ng
import numpy as np
import pytest

from ngcontact.linalg.smoothing import DEGREE, SAFETY, Chebyshev, GaussSeidel, fastest
from ngcontact.linalg.sparse import handed_over
from tests.linalg.test_multigrid import prepared
from tests.scenes import REFINED


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
    root = 1 / np.sqrt(K.diagonal())
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
