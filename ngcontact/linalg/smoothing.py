"""Smoothers of multigrid: Gauss-Seidel sweeps on one thread, Chebyshev polynomials on several."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from .sparse import shared

DEGREE = 4  # of the polynomial: of 2 to 4 the fastest in whole solves of a million unknowns
LANCZOS = 6  # steps for the largest eigenvalue; they find 0.9 of it and more
ABOVE = 1.1  # what it is taken for, over what is found; 0.82 of it would do for convergence


class Smoother(Protocol):
    """Iterations for the free ones of n unknowns, before and after a coarser space corrects.

    The one after is the adjoint of the one before, so that a V-cycle is symmetric.
    """

    def holding(self, free: Mask) -> Smoother:
        """The same where other unknowns are `free` (n,)."""

    def before(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Set `solution` (n,), starting from zero."""

    def after(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Improve `solution` (n,)."""


def fastest(matrix: ng.BaseMatrix, free: Mask) -> Smoother:
    """The faster one for the `free` (n,) unknowns of a matrix, on the caller's threads.

    A sweep runs on one thread; a polynomial takes more products with the matrix, which use all.
    """
    return (gauss_seidel if ng.GetNumThreads() == 1 else chebyshev)(matrix, free)


def gauss_seidel(matrix: ng.BaseMatrix, free: Mask) -> GaussSeidel:
    """Sweeps over the `free` (n,) unknowns of a symmetric positive semidefinite matrix (n, n)."""
    return GaussSeidel(matrix, matrix.CreateSmoother(ng.BitArray(free)))


def chebyshev(matrix: ng.BaseMatrix, free: Mask) -> Chebyshev:
    """The polynomial for the `free` (n,) unknowns of a symmetric positive semidefinite matrix."""
    diagonal = shared(matrix).diagonal()
    residual, scaled, step = (matrix.CreateColVector() for _ in range(3))
    return Chebyshev(
        matrix=matrix,
        diagonal=diagonal,
        inverse=_inverse(diagonal, free),
        largest=ABOVE * largest_eigenvalue(matrix, _inverse(diagonal, diagonal > 0)),
        residual=residual,
        scaled=scaled,
        step=step,
    )


@dataclass(frozen=True, eq=False)
class GaussSeidel:
    """A sweep over all free unknowns, and the reverse one."""

    matrix: ng.BaseMatrix
    sweeps: ng.BaseSmoother

    def holding(self, free: Mask) -> GaussSeidel:
        """The same where other unknowns are `free` (n,)."""
        return gauss_seidel(self.matrix, free)

    def before(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """See `Smoother`."""
        solution[:] = 0.0
        self.sweeps.Smooth(solution, right)

    def after(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """See `Smoother`."""
        self.sweeps.SmoothBack(solution, right)


@dataclass(frozen=True, eq=False)
class Chebyshev:
    """A polynomial of the matrix over its diagonal, Chebyshev's of the fourth kind.

    The best one for V-cycles that does not ask where the low eigenvalues end (Lottes 2023, Numer.
    Linear Algebra Appl. 30:e2518).

    Attributes
    ----------
    matrix : ng.BaseMatrix (n, n)
    diagonal : ndarray (n,)
    inverse : ng.BaseMatrix
        Of the diagonal at free unknowns, zero at others.
    largest : float
        What the largest eigenvalue for all unknowns is taken for; that for free ones is below.
    residual, scaled, step : ng.BaseVector (n,)
        To work with.
    """

    matrix: ng.BaseMatrix
    diagonal: Array
    inverse: ng.BaseMatrix
    largest: float
    residual: ng.BaseVector
    scaled: ng.BaseVector
    step: ng.BaseVector

    def holding(self, free: Mask) -> Chebyshev:
        """The same where other unknowns are `free` (n,)."""
        return replace(self, inverse=_inverse(self.diagonal, free))

    def before(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """See `Smoother`."""
        solution[:] = 0.0
        self.residual.data = right
        self._improve(solution)

    def after(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """See `Smoother`."""
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


def _inverse(diagonal: Array, free: Mask) -> ng.BaseMatrix:
    """Inverse of a `diagonal` (n,) at `free` unknowns, zero at others."""
    values = ng.BaseVector(diagonal.size)
    values.FV().NumPy()[:] = np.divide(1.0, diagonal, out=np.zeros(diagonal.size), where=free)
    return ng.DiagonalMatrix(values)


def largest_eigenvalue(matrix: ng.BaseMatrix, inverse: ng.BaseMatrix) -> float:
    """Largest eigenvalue of `inverse` times `matrix` (n, n), from below, by Lanczos' method.

    As conjugate gradients find it (Golub and Van Loan, Matrix Computations, 10.2).
    """
    r, z, d, q = (matrix.CreateColVector() for _ in range(4))
    r.FV().NumPy()[:] = np.random.default_rng(0).uniform(-1, 1, matrix.height)
    z.data = inverse * r
    r.data = matrix * z  # without a part where the matrix is singular
    d[:] = 0.0
    product, before = np.inf, 0.0
    T = np.zeros((LANCZOS, LANCZOS))
    for k in range(LANCZOS):
        z.data = inverse * r
        last, product = product, ng.InnerProduct(r, z)
        share = product / last
        d *= share
        d.data += z
        q.data = matrix * d
        step = product / ng.InnerProduct(d, q)
        r.data -= step * q
        T[k, k] = 1 / step + share * before
        T[k, k - 1 : k] = T[k - 1 : k, k] = np.sqrt(share) * before
        before = 1 / step
    return float(np.linalg.eigvalsh(T)[-1])
