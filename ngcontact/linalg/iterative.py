"""Linear systems of large programs for changing active sets, by multigrid in place of a factor."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from ..arrays import Array, Factor, Mask
from ..qp import REFINED, ROUGH, Anchor, BorderedSystems, QuadraticProgram, terms
from .multigrid import Multigrid, StalledError

LOOSE = 1e-2  # residual, relative to the one a system starts from, that tells its active set
DEAR = 20  # V-cycles for that, the price of new coarse matrices, with those of another set
MOST = 100  # V-cycles for a system, two to three times those of nu = 0.3
RESTARTS = 3  # solutions from the residual itself, which the iteration's own drifts from
FLOOR = 4 * np.finfo(float).eps  # round-off of the residual, relative to its terms

log = logging.getLogger("ngcontact")


class IterativeSystems(BorderedSystems):
    """The linear systems of one program with unit rows, by conjugate gradients and multigrid.

    Each system starts from the iterate of the one before, and is solved as closely as telling
    the next active set takes; `refine` takes the last one to round-off. `back_solves` counts
    V-cycles. Where they do not converge, and for proximal terms, the matrix is factorised and
    everything is as in `BorderedSystems`.

    Parameters
    ----------
    program : QuadraticProgram
    factor : Factor
        For the fallback.
    prepare : callable
        Makes the solver for the unknowns that are free.
    """

    def __init__(
        self, program: QuadraticProgram, factor: Factor, prepare: Callable[[Mask], Multigrid]
    ) -> None:
        self.prepare = prepare
        self.multigrid: Multigrid | None = None
        self.direct = False
        super().__init__(program, factor)

    def forget(self) -> None:
        """Give the memory of multigrid and factorisation back."""
        super().forget()
        self.multigrid = None

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser and multipliers for one active set, rows of the set held at their bound.

        The residual is 1e-2 of the one from the solution before; `refine` takes it to round-off.
        """
        self.active, self.anchor = active, anchor
        if anchor is not None and not self.direct:
            self._turn_direct("motions that nothing resists need it")
        if not self.direct:
            try:
                self._iterate()
            except ArithmeticError as error:
                self._turn_direct(error)
        if self.direct:
            return super().solve(active, anchor)
        return self.y.copy(), self.force.copy()

    def refine(self) -> tuple[Array, Array]:
        """The last solution, its residual at round-off."""
        if not self.direct:
            try:
                return self._refined()
            except StalledError as stalled:
                self._turn_direct(stalled)
                super().solve(self.active)
        return super().refine()

    def _turn_direct(self, reason: object) -> None:
        log.info("the matrix is factorised: %s", reason)
        self.direct = True
        self.multigrid = None

    def _iterate(self) -> None:
        """Reduce the residual that the last iterate has for the active set."""
        p, active = self.program, self.active
        self.free = ~p.fixed
        self.free[p.null_space.held] = False
        self.free[p.unknown[active]] = False
        if self.multigrid is None:
            self.multigrid = self.prepare(self.free)
            self.base = active.copy()
        else:
            self.multigrid.hold(self.free)
        self.at = np.zeros(0, dtype=np.intp)  # nothing is bordered
        self.y[p.unknown[active]] = p.g[active]
        residual = self.residual()
        size = self._size(residual)
        self.scale = max(self.scale, size)
        count = self._correct_by(self.multigrid, residual, max(LOOSE * size, ROUGH * self.scale))
        if count > DEAR and (active != self.base).any():
            self.multigrid = None

    def _correct_by(self, multigrid: Multigrid, residual: Array, target: float) -> int:
        x, count = multigrid.solve(residual, target, MOST)
        self.back_solves += count
        self.y += x
        self.residual()  # sets the forces
        return count

    def _refined(self) -> tuple[Array, Array]:
        p = self.program
        self.multigrid = self.multigrid or self.prepare(self.free)
        floor = FLOOR * float(terms(p.K, self.y).max(initial=0.0))
        target = max(REFINED * self.scale, floor)
        for _ in range(RESTARTS):
            residual = self.residual()
            if self._size(residual) <= target:
                return self.y.copy(), self.force.copy()
            self._correct_by(self.multigrid, residual, target)
        if not self._size(self.residual()) <= ROUGH * self.scale:
            raise StalledError(f"{RESTARTS} solutions left a residual above {target:.1e}")
        return self.y.copy(), self.force.copy()
