"""Conjugate gradients with a multigrid V-cycle, for principal submatrices of a stiffness.

By these the linear systems of large programs are solved for changing active sets. Gauss-Seidel
sweeps improve the free ones of n unknowns before and after a coarser space corrects. The one after
is the adjoint of the one before, so that a V-cycle is symmetric.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Factor, Mask
from ..qp import COARSE_RESIDUAL, FINE_RESIDUAL, Anchor, BorderedSystems, QuadraticProgram, terms
from .coarse_spaces import Coarsening
from .sparse import handed_over, inverse_of, reversed_order, shared

TRIAL_CYCLES = 25  # V-cycles after which is judged whether the target will be reached
# Entries of a row from which the reverse sweep runs on a copy of the matrix: against the stream of
# memory it takes 2.5 times the forward one with the 87 of solids of order 2, 1.2 times with 14.
LONG_ROWS = 40
LOOSE_RESIDUAL = 1e-2  # relative to the first one, at which the next active set is chosen
TERM_ROUND_OFF = 4 * np.finfo(float).eps  # round-off of the residual, relative to its terms
# V-cycles with coarse matrices of another active set, from which new ones are cheaper.
RENEWAL_CYCLES = 20
# V-cycles for a system, two to three times those of nu = 0.3; then the matrix is factorised.
MOST_CYCLES = 100
MOST_STEPS = 50  # systems of one program; likewise
RESTARTS = 3  # from the residual itself, which the iteration's own drifts from; likewise

log = logging.getLogger("ngcontact")


class GaussSeidel:
    """A sweep over all `free` (n,) unknowns of a semidefinite `matrix`, and the reverse one."""

    sweeps: ng.BaseSmoother
    turned: ng.BaseMatrix | None = None  # the matrix in reverse order, where its rows are long
    reverse: ng.BaseSmoother  # the forward sweep of that one

    def __init__(self, matrix: ng.BaseMatrix, free: Mask) -> None:
        self.matrix = matrix
        if shared(matrix).nnz > LONG_ROWS * matrix.height:
            self.turned = reversed_order(matrix)
            self.right, self.solution = matrix.CreateColVector(), matrix.CreateColVector()
        self.hold(free)

    def hold(self, free: Mask) -> None:
        """Let `free` (n,) be the unknowns."""
        self.sweeps = self.matrix.CreateSmoother(ng.BitArray(free))
        if self.turned:
            self.reverse = self.turned.CreateSmoother(ng.BitArray(free[::-1].copy()))

    def before(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Set `solution` (n,), starting from zero."""
        solution[:] = 0.0
        self.sweeps.Smooth(solution, right)

    def after(self, right: ng.BaseVector, solution: ng.BaseVector) -> None:
        """Improve `solution` (n,)."""
        if not self.turned:
            self.sweeps.SmoothBack(solution, right)
            return
        self.right.FV().NumPy()[:] = right.FV().NumPy()[::-1]
        self.solution.FV().NumPy()[:] = solution.FV().NumPy()[::-1]
        self.reverse.Smooth(self.solution, self.right)
        solution.FV().NumPy()[:] = self.solution.FV().NumPy()[::-1]


class StalledError(ArithmeticError):
    """Conjugate gradients did not reach their target."""


class _Level:
    """One space of n unknowns that has a coarser one of k, and vectors of both to work with."""

    free: Mask  # (n,), unknowns that are corrected
    projector: ng.BaseMatrix  # onto them

    def __init__(self, matrix: ng.BaseMatrix, free: Mask, P: sp.csr_array) -> None:
        self.matrix, self.P = matrix, handed_over(P)
        self.transposed = self.P.CreateTranspose()
        self.smoother = GaussSeidel(matrix, free)
        self.free, self.projector = free, ng.Projector(ng.BitArray(free), True)
        self.residual = matrix.CreateColVector()
        self.right, self.solution = ng.BaseVector(P.shape[1]), ng.BaseVector(P.shape[1])

    def hold(self, free: Mask) -> None:
        """Let `free` (n,) be the unknowns."""
        self.free, self.projector = free, ng.Projector(ng.BitArray(free), True)
        self.smoother.hold(free)


def _galerkin(matrix: ng.BaseMatrix, P: sp.csr_array, free: Mask, coarse: Mask) -> ng.BaseMatrix:
    """Matrix of the coarser space, whose functions vanish at unknowns that are not free."""
    columns = P.tocoo()
    columns.data = columns.data * (free[columns.row] & coarse[columns.col])
    there = handed_over(columns)
    return there.CreateTranspose() @ (matrix @ there)


@dataclass(frozen=True, eq=False)
class Multigrid:
    """Solver of the systems of the free unknowns of a symmetric positive definite matrix.

    A smoother before a coarser space corrects, its adjoint after it, and a Cholesky factor of the
    coarsest space: a symmetric positive definite preconditioner. `truncated_multigrid` makes it.
    """

    levels: list[_Level]  # spaces that have a coarser one, finest first, of n unknowns
    inverse: ng.BaseMatrix  # inverse of the matrix of the coarsest space

    def hold(self, free: Mask) -> None:
        """Let `free` (n,) be the unknowns; coarser spaces change only in what they correct."""
        self.levels[0].hold(free)

    def largest(self, residual: Array) -> float:
        """Largest size of `residual` (n,) at the free unknowns."""
        return float(np.abs(residual[self.levels[0].free]).max(initial=0.0))

    def cycle(self, right: ng.BaseVector, solution: ng.BaseVector, level: int = 0) -> None:
        """Set `solution` to the preconditioner times `right`; both vanish where not free."""
        if level == len(self.levels):
            solution.data = self.inverse * right
            return
        here = self.levels[level]
        here.smoother.before(right, solution)
        here.residual.data = right - here.matrix * solution
        here.projector.Project(here.residual)
        here.right.data = here.transposed * here.residual
        self.cycle(here.right, here.solution, level + 1)
        here.residual.data = here.P * here.solution
        here.projector.Project(here.residual)
        solution += here.residual
        here.smoother.after(right, solution)

    def solve(self, right: Array, target: float, most: int) -> tuple[Array, int]:
        """Solution (n,), its largest residual at most `target`, and the number of V-cycles.

        Of `right` (n,), which is read where unknowns are free. A target that is not reached in
        `most` V-cycles, or will not be at the rate so far, is a `StalledError`.
        """
        finest = self.levels[0]
        x, r, z, d, q = (finest.matrix.CreateColVector() for _ in range(5))
        residual = r.FV().NumPy()
        np.multiply(right, finest.free, out=residual)
        x[:] = 0.0
        d[:] = 0.0
        product = np.inf
        first = size = float(np.abs(residual).max())
        for count in range(most + 1):
            size = float(max(residual.max(), -residual.min()))
            if size <= target:
                return x.FV().NumPy().copy(), count
            expected = most * np.log(size / first) if count == TRIAL_CYCLES else -np.inf
            if count * np.log(target / first) < expected:
                break
            self.cycle(r, z)
            last, product = product, ng.InnerProduct(r, z)
            d *= product / last
            d.data += z
            q.data = finest.matrix * d
            finest.projector.Project(q)
            step = product / ng.InnerProduct(d, q)
            x.data += step * d
            r.data -= step * q
        raise StalledError(f"{count} V-cycles left {size / first:.1e} of a residual")


def truncated_multigrid(matrix: ng.BaseMatrix, steps: list[Coarsening], free: Mask) -> Multigrid:
    """Multigrid whose coarser functions vanish at the unknowns that are not free.

    As in truncated monotone multigrid (Kornhuber 1994, Numer. Math. 69:167). Both halves of the
    `matrix` (n, n) are there, at least one of the `steps`, finest first, and `free` (n,) unknowns.
    """
    levels: list[_Level] = []
    for step in steps:
        levels.append(_Level(matrix, free, step.P))
        coarse = free[step.kept]
        matrix = _galerkin(matrix, step.P, free, coarse)
        free = coarse
    return Multigrid(levels, inverse_of(matrix, ng.BitArray(free)))


class IterativeSystems(BorderedSystems):
    """The linear systems of one program with unit rows, by conjugate gradients and multigrid.

    Each system starts from the iterate of the one before, and is solved as closely as telling
    the next active set takes, to 1e-2 of its first residual, or to round-off if so asked. Where
    V-cycles or active sets do not converge, and for proximal terms, which motions that nothing
    resists need, the matrix is factorised for good. `prepare` makes multigrid for the unknowns
    (n,) that are free.
    """

    steps: int  # systems since the last `restart`

    def __init__(
        self, program: QuadraticProgram, factor: Factor, prepare: Callable[[Mask], Multigrid]
    ) -> None:
        self.prepare, self.stalled = prepare, False
        self.multigrid: Multigrid | None = None  # the solver, once there is one
        self.coarse: Mask | None = None  # (m,) the active set of its coarse matrices
        self.solved: Mask | None = None  # (m,) that of the last solution
        super().__init__(program, factor)

    def restart(self, program: QuadraticProgram) -> None:
        """Begin with another load, other values or bounds; multigrid stays."""
        super().restart(program)
        self.solved, self.steps = None, 0
        if self.coarse is not None:
            self._start(self.coarse)

    def forget(self) -> None:
        """Give the memory of multigrid and factorisation back."""
        super().forget()
        self.multigrid = self.coarse = None

    def solve(
        self, active: Mask, anchor: Anchor | None = None, *, refined: bool = False
    ) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) for `active` (m,), the residual at 1e-2.

        Or `refined` to round-off.
        """
        if not self.stalled:
            reason: object = "motions that nothing resists need it"
            if anchor is None:
                try:
                    (self._refine if refined else self._iterate)(active)
                    return self.y.copy(), self.force.copy()
                except ArithmeticError as error:
                    reason = error
            log.info("the matrix is factorised: %s", reason)
            self.forget()
            self.stalled = True
        return super().solve(active, anchor, refined=refined)

    def _held(self, active: Mask) -> Multigrid:
        """The solver for an active set; its coarse matrices may be those of another one."""
        p = self.program
        free = ~p.fixed
        free[p.null_space.held] = False
        free[p.unknown[active]] = False
        if self.multigrid is None:
            self.multigrid, self.coarse = self.prepare(free), active.copy()
        else:
            self.multigrid.hold(free)
        return self.multigrid

    def _iterate(self, active: Mask) -> None:
        """Reduce the residual that the last solution has for the active set."""
        p, multigrid = self.program, self._held(active)
        self.solved, self.steps = active, self.steps + 1
        if self.steps > MOST_STEPS:
            raise StalledError("active sets cycle")
        self.y[p.unknown[active]] = p.g[active]
        residual = self.unbalanced(active)
        size = multigrid.largest(residual)
        self.scale = max(self.scale, size)
        count = self._add(
            multigrid, residual, max(LOOSE_RESIDUAL * size, COARSE_RESIDUAL * self.scale)
        )
        self.unbalanced(active)  # sets the forces
        if count > RENEWAL_CYCLES and (active != self.coarse).any():
            self.multigrid = self.coarse = None

    def _add(self, multigrid: Multigrid, residual: Array, target: float) -> int:
        """Add the solution for a residual (n,); answer the number of V-cycles."""
        x, count = multigrid.solve(residual, target, MOST_CYCLES)
        self.back_solves += count
        self.y += x
        return count

    def _refine(self, active: Mask) -> None:
        """Reduce the residual of the solution for the active set to round-off."""
        if self.solved is None or (self.solved != active).any():
            self._iterate(active)
        multigrid = self.multigrid or self._held(active)
        floor = TERM_ROUND_OFF * float(terms(self.program.K, self.y).max(initial=0.0))
        target = max(FINE_RESIDUAL * self.scale, floor)
        residual = self.unbalanced(active)
        for _ in range(RESTARTS):
            if multigrid.largest(residual) <= target:
                return
            self._add(multigrid, residual, target)
            residual = self.unbalanced(active)
        if not multigrid.largest(residual) <= COARSE_RESIDUAL * self.scale:
            raise StalledError(f"{RESTARTS} solutions left more than {target:.1e}")
