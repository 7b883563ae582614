"""Smoothers of multigrid: Gauss-Seidel sweeps on one thread, Chebyshev polynomials on several.

Iterations for the free ones of n unknowns, before and after a coarser space corrects. The one after
is the adjoint of the one before, so that a V-cycle is symmetric.
"""

from __future__ import annotations

from typing import TypeAlias

import ngsolve as ng
import numpy as np
from scipy.sparse.linalg import LinearOperator, eigsh

from ..arrays import Array, Mask
from .sparse import shared

DEGREE = 4  # of the polynomial: of 2 to 4 the fastest in whole solves of a million unknowns
EIGENVALUE_ERROR = 0.1  # relative, of the largest eigenvalue
LANCZOS_STEPS = 6  # before it is told whether that is met: it is
SAFETY = 1.1  # what it is taken for, over what is found; 0.82 of it would do for convergence


def fastest(matrix: ng.BaseMatrix, free: Mask) -> Smoother:
    """The faster one for the `free` (n,) unknowns of a matrix, on the caller's threads.

    A sweep runs on one thread; a polynomial takes more products with the matrix, which use all.
    """
    return (GaussSeidel if ng.GetNumThreads() == 1 else Chebyshev)(matrix, free)


class GaussSeidel:
    """A sweep over all `free` (n,) unknowns of a semidefinite `matrix`, and the reverse one."""

    sweeps: ng.BaseSmoother

    def __init__(self, matrix: ng.BaseMatrix, free: Mask) -> None:
        self.matrix = matrix
        self.hold(free)

    def hold(self, free: Mask) -> None:
        """Let `free` (n,) be the unknowns."""
        self.sweeps = self.matrix.CreateSmoother(ng.BitArray(free))

    def before(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Set `solution` (n,), starting from zero."""
        solution[:] = 0.0
        self.sweeps.Smooth(solution, right)

    def after(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Improve `solution` (n,)."""
        self.sweeps.SmoothBack(solution, right)


class Chebyshev:
    """A polynomial of the matrix over its diagonal, Chebyshev's of the fourth kind.

    For the `free` (n,) unknowns of a semidefinite `matrix`. The best one for V-cycles that does not
    ask where the low eigenvalues end (Lottes 2023, Numer. Linear Algebra Appl. 30:e2518).

    Attributes
    ----------
    largest : float
        What the largest eigenvalue for all unknowns is taken for; that for free ones is below.
    """

    inverse: ng.BaseMatrix

    def __init__(self, matrix: ng.BaseMatrix, free: Mask) -> None:
        self.matrix, self.diagonal = matrix, shared(matrix).diagonal()
        self.residual, self.scaled, self.step = (matrix.CreateColVector() for _ in range(3))
        self.largest = SAFETY * largest_eigenvalue(matrix, self.diagonal)
        self.hold(free)

    def hold(self, free: Mask) -> None:
        """Let `free` (n,) be the unknowns."""
        values = ng.BaseVector(free.size)
        values.FV().NumPy()[:] = np.divide(1.0, self.diagonal, np.zeros(free.size), where=free)
        self.inverse = ng.DiagonalMatrix(values)

    def before(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Set `solution` (n,), starting from zero."""
        solution[:] = 0.0
        self.residual.data = right
        self._improve(solution)

    def after(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Improve `solution` (n,)."""
        self.residual.data = right - self.matrix * solution
        self._improve(solution)

    def _improve(self, solution: ng.BaseVector) -> None:
        """Add the polynomial of the residual, by the recurrence of the fourth kind."""
        residual, scaled, step = self.residual, self.scaled, self.step
        step.data = self.inverse * residual
        step *= 4 / (3 * self.largest)
        solution += step
        for k in range(1, DEGREE):
            residual.data -= self.matrix * step
            scaled.data = self.inverse * residual
            step *= (2 * k - 1) / (2 * k + 3)
            step.data += (8 * k + 4) / ((2 * k + 3) * self.largest) * scaled
            solution += step


Smoother: TypeAlias = GaussSeidel | Chebyshev


def largest_eigenvalue(matrix: ng.BaseMatrix, diagonal: Array) -> float:
    """Largest eigenvalue of a `matrix` (n, n) over its `diagonal` (n,), from below, by Lanczos."""
    x, y = matrix.CreateRowVector(), matrix.CreateColVector()
    root = np.sqrt(np.divide(1.0, diagonal, np.zeros(diagonal.size), where=diagonal > 0))

    def product(v: Array) -> Array:
        x.FV().NumPy()[:] = root * v.ravel()
        y.data = matrix * x
        return np.asarray(root * y.FV().NumPy())

    start = product(np.random.default_rng(0).uniform(-1, 1, diagonal.size))
    [value] = eigsh(
        LinearOperator((diagonal.size,) * 2, matvec=product, dtype=float),
        k=1,
        which="LA",
        ncv=min(LANCZOS_STEPS, diagonal.size),
        tol=EIGENVALUE_ERROR,
        v0=start,
        return_eigenvectors=False,
    )
    return float(value)
