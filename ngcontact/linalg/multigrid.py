"""Conjugate gradients with a multigrid V-cycle, for principal submatrices of a stiffness."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Mask
from .coarse_spaces import Coarsening
from .sparse import handed_over

TRIAL = 25  # V-cycles after which is judged whether the target will be reached


class StalledError(ArithmeticError):
    """Conjugate gradients did not reach their target."""


class _Level:
    """One space that has a coarser one: its smoother, and vectors of both."""

    def __init__(self, matrix: ng.BaseMatrix, free: Mask, step: Coarsening) -> None:
        self.matrix = matrix
        self.P, self.transposed = step.P, step.P.T
        self.residual = matrix.CreateColVector()
        self.right, self.solution = ng.BaseVector(step.kept.size), ng.BaseVector(step.kept.size)
        self.hold(free)

    def hold(self, free: Mask) -> None:
        self.free = free
        self.smoother = self.matrix.CreateSmoother(ng.BitArray(free))


def _galerkin(matrix: ng.BaseMatrix, P: sp.csr_array, free: Mask, coarse: Mask) -> ng.BaseMatrix:
    """Matrix of the coarser space, whose functions vanish at unknowns that are not free."""
    columns = P.tocoo()
    columns.data = columns.data * (free[columns.row] & coarse[columns.col])
    there = handed_over(columns)
    return there.CreateTranspose() @ (matrix @ there)


class Multigrid:
    """Solver of the systems of the free unknowns of a symmetric positive definite matrix.

    One Gauss-Seidel sweep over all unknowns before a coarser space corrects, the reverse one
    after it, and a Cholesky factor of the coarsest space: a symmetric positive definite
    preconditioner. Functions of coarser spaces vanish at the unknowns that are not free, as in
    truncated monotone multigrid (Kornhuber 1994, Numer. Math. 69:167).

    Parameters
    ----------
    matrix : ng.BaseMatrix (n, n)
        Both halves of it.
    steps : list of Coarsening
        At least one, finest first.
    free : ndarray of bool (n,)
        Unknowns of the systems.
    """

    def __init__(self, matrix: ng.BaseMatrix, steps: list[Coarsening], free: Mask) -> None:
        self.levels: list[_Level] = []
        for step in steps:
            self.levels.append(_Level(matrix, free, step))
            coarse = free[step.kept]
            matrix = _galerkin(matrix, step.P, free, coarse)
            free = coarse
        self.inverse = matrix.Inverse(ng.BitArray(free), inverse="sparsecholesky")

    def hold(self, free: Mask) -> None:
        """Free other unknowns; coarser spaces stay as they are but for what they correct."""
        self.levels[0].hold(free)

    def cycle(self, right: ng.BaseVector, solution: ng.BaseVector, level: int = 0) -> None:
        """Set `solution` to the preconditioner times `right`; both vanish where not free."""
        if level == len(self.levels):
            solution.data = self.inverse * right
            return
        here = self.levels[level]
        solution[:] = 0.0
        here.smoother.Smooth(solution, right)
        here.residual.data = right - here.matrix * solution
        residual = here.residual.FV().NumPy()
        residual *= here.free
        here.right.FV().NumPy()[:] = here.transposed @ residual
        self.cycle(here.right, here.solution, level + 1)
        np.multiply(here.P @ here.solution.FV().NumPy(), here.free, out=residual)
        solution.data += here.residual
        here.smoother.SmoothBack(solution, right)

    def solve(self, right: Array, target: float, most: int) -> tuple[Array, int]:
        """Solution (n,), its largest residual at most `target`, and the number of V-cycles.

        Raises
        ------
        StalledError
            The target was not reached in `most` V-cycles, or will not be at the rate so far.
        """
        finest = self.levels[0]
        x, r, z, d, q = (finest.matrix.CreateColVector() for _ in range(5))
        residual, image = r.FV().NumPy(), q.FV().NumPy()
        np.multiply(right, finest.free, out=residual)
        x[:] = 0.0
        d[:] = 0.0
        product = np.inf
        first = size = float(np.abs(residual).max())
        for count in range(most + 1):
            size = float(max(residual.max(), -residual.min()))
            if size <= target:
                return x.FV().NumPy().copy(), count
            if count == TRIAL and count * np.log(target / first) < most * np.log(size / first):
                break
            self.cycle(r, z)
            last, product = product, ng.InnerProduct(r, z)
            d *= product / last
            d.data += z
            q.data = finest.matrix * d
            image *= finest.free
            step = product / ng.InnerProduct(d, q)
            x.data += step * d
            r.data -= step * q
        raise StalledError(f"{count} V-cycles left {size / first:.1e} of a residual")
