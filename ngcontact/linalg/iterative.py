"""Linear systems of large programs for changing active sets, by multigrid in place of a factor."""

from __future__ import annotations

import logging
from collections.abc import Callable

import numpy as np

from ..arrays import Array, Factor, Mask
from ..qp import COARSE_RESIDUAL, FINE_RESIDUAL, Anchor, BorderedSystems, QuadraticProgram, terms
from .multigrid import Multigrid, StalledError

LOOSE_RESIDUAL = 1e-2  # relative to the first one, at which the next active set is chosen
TERM_ROUND_OFF = 4 * np.finfo(float).eps  # round-off of the residual, relative to its terms
# V-cycles with coarse matrices of another active set, from which new ones are cheaper.
RENEWAL_CYCLES = 20
# V-cycles for a system, two to three times those of nu = 0.3; then the matrix is factorised.
MOST_CYCLES = 100
MOST_STEPS = 50  # systems of one program; likewise
RESTARTS = 3  # from the residual itself, which the iteration's own drifts from; likewise

log = logging.getLogger("ngcontact")


class IterativeSystems(BorderedSystems):
    """The linear systems of one program with unit rows, by conjugate gradients and multigrid.

    Each system starts from the iterate of the one before, and is solved as closely as telling
    the next active set takes, to 1e-2 of its first residual; `refine` takes it to round-off. Where
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

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) for `active` (m,), the residual at 1e-2."""
        if self._converges(anchor, lambda: self._iterate(active)):
            return self.y.copy(), self.force.copy()
        return super().solve(active, anchor)

    def refine(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) for `active` (m,), the residual at round-off."""

        def to_round_off() -> None:
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

        if self._converges(anchor, to_round_off):
            return self.y.copy(), self.force.copy()
        return super().refine(active, anchor)

    def _converges(self, anchor: Anchor | None, iterate: Callable[[], None]) -> bool:
        """Iterate; whether that can be done, and has reached its target."""
        if self.stalled:
            return False
        reason: object = "motions that nothing resists need it"
        if anchor is None:
            try:
                iterate()
                return True
            except ArithmeticError as error:
                reason = error
        log.info("the matrix is factorised: %s", reason)
        self.forget()
        self.stalled = True
        return False

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
