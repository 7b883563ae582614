"""Linear systems of large programs for changing active sets, by multigrid in place of a factor."""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Factor, Mask
from ..qp import (
    REFINED,
    ROUGH,
    Anchor,
    Approximation,
    BorderedSystems,
    QuadraticProgram,
    bordered_systems,
    first_approximation,
    terms,
)
from .multigrid import Multigrid, StalledError

LOOSE = 1e-2  # residual, relative to the one a system starts from, that tells its active set
FLOOR = 4 * np.finfo(float).eps  # round-off of the residual, relative to its terms

PROXIMAL_TERMS = "motions that nothing resists need it"  # why it is factorised

log = logging.getLogger("ngcontact")


@dataclass(frozen=True)
class Limits:
    """What the iterations may cost.

    Attributes
    ----------
    dear : int
        V-cycles for a system that tells an active set, with the coarse matrices of another one:
        the price of new ones.
    most : int
        V-cycles for a system, two to three times those of nu = 0.3; then the matrix is factorised.
    restarts : int
        Solutions from the residual itself, which the iteration's own drifts from; likewise.
    """

    dear: int = 20
    most: int = 100
    restarts: int = 3


@dataclass(frozen=True, eq=False)
class _Prepared:
    """Multigrid whose coarse matrices are those of the active set `active`, (m,)."""

    multigrid: Multigrid
    active: Mask

    def largest(self, residual: Array) -> float:
        """Largest unbalanced force of `residual` (n,) at the free unknowns."""
        return float(np.abs(residual[self.multigrid.levels[0].free]).max(initial=0.0))


@dataclass(eq=False)
class IterativeSystems:
    """The linear systems of one program with unit rows, by conjugate gradients and multigrid.

    Each system starts from the iterate of the one before, and is solved as closely as telling
    the next active set takes; `refine` takes it to round-off. Where V-cycles do not converge, and
    for proximal terms, `direct` takes over for good. `iterative_systems` makes them.

    Attributes
    ----------
    prepare : callable
        Makes the solver for the unknowns (n,) that are free.
    limits : Limits
    direct : BorderedSystems
        The same systems by factorisation.
    approximation : Approximation
        The last solution.
    solved : ndarray of bool (m,), optional
        The active set of the last solution.
    prepared : _Prepared, optional
        The solver, once there is one.
    stalled : bool
        Whether `direct` has taken over.
    cycles : int
        V-cycles since the last `restart`.
    """

    prepare: Callable[[Mask], Multigrid]
    limits: Limits
    direct: BorderedSystems
    approximation: Approximation
    solved: Mask | None = None
    prepared: _Prepared | None = None
    stalled: bool = False
    cycles: int = 0

    @property
    def program(self) -> QuadraticProgram:
        """The program of the last `restart`."""
        return self.approximation.program

    @property
    def factorizations(self) -> int:
        """Factorisations since then."""
        return self.direct.factorizations

    @property
    def back_solves(self) -> int:
        """V-cycles and back-solves since then."""
        return self.cycles + self.direct.back_solves

    def restart(self, program: QuadraticProgram) -> None:
        """Begin with another load, other values or bounds; multigrid stays."""
        self.direct.restart(program)
        closed = None if self.prepared is None else self.prepared.active
        self.approximation = first_approximation(program, closed)
        self.solved = None
        self.cycles = 0

    def forget(self) -> None:
        """Give the memory of multigrid and factorisation back."""
        self.direct.forget()
        self.prepared = None

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) with the rows `active` (m,) held at their bounds.

        The residual is 1e-2 of the one from the solution before; `refine` takes it to round-off.

        Raises
        ------
        SingularError
            The matrix is singular to working precision.
        """
        if anchor is not None:
            self._turn_direct(PROXIMAL_TERMS)
        if not self.stalled:
            try:
                self._iterate(active)
                return self.approximation.copies()
            except ArithmeticError as error:
                self._turn_direct(error)
        return self.direct.solve(active, anchor)

    def refine(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) for `active` (m,), the residual at round-off."""
        if anchor is not None:
            self._turn_direct(PROXIMAL_TERMS)
        if not self.stalled:
            try:
                if self.solved is None or not np.array_equal(self.solved, active):
                    self._iterate(active)
                self._refine(active)
                return self.approximation.copies()
            except ArithmeticError as error:
                self._turn_direct(error)
        return self.direct.refine(active, anchor)

    def stiffness(self) -> Array:
        """Force per displacement at each row, (m,): an upper bound."""
        return self.program.diagonal[self.program.unknown]

    def _turn_direct(self, reason: object) -> None:
        if not self.stalled:
            log.info("the matrix is factorised: %s", reason)
        self.stalled = True
        self.prepared = None

    def _prepared_for(self, active: Mask) -> _Prepared:
        """The solver for the system of an active set, with coarse matrices of its own."""
        p = self.program
        free = ~p.fixed
        free[p.null_space.held] = False
        free[p.unknown[active]] = False
        if self.prepared is None:
            self.prepared = _Prepared(self.prepare(free), active.copy())
        else:
            self.prepared.multigrid.hold(free)
        return self.prepared

    def _iterate(self, active: Mask) -> None:
        """Reduce the residual that the last solution has for the active set."""
        p, now = self.program, self.approximation
        prepared = self._prepared_for(active)
        self.solved = active
        now.y[p.unknown[active]] = p.g[active]
        residual = now.unbalanced(active, None)
        size = prepared.largest(residual)
        now.scale = max(now.scale, size)
        target = max(LOOSE * size, ROUGH * now.scale)
        count = self._correct(prepared, active, residual, target)
        if count > self.limits.dear and (active != prepared.active).any():
            self.prepared = None

    def _correct(self, prepared: _Prepared, active: Mask, residual: Array, target: float) -> int:
        """Add the solution for a residual (n,); answer the number of V-cycles."""
        x, count = prepared.multigrid.solve(residual, target, self.limits.most)
        self.cycles += count
        self.approximation.y += x
        self.approximation.unbalanced(active, None)  # sets the forces
        return count

    def _refine(self, active: Mask) -> None:
        """Reduce the residual of the last solution to round-off."""
        now = self.approximation
        prepared = self.prepared or self._prepared_for(active)
        floor = FLOOR * float(terms(self.program.K, now.y).max(initial=0.0))
        target = max(REFINED * now.scale, floor)
        for _ in range(self.limits.restarts):
            residual = now.unbalanced(active, None)
            if prepared.largest(residual) <= target:
                return
            self._correct(prepared, active, residual, target)
        if not prepared.largest(now.unbalanced(active, None)) <= ROUGH * now.scale:
            raise StalledError(f"{self.limits.restarts} solutions left more than {target:.1e}")


def iterative_systems(
    program: QuadraticProgram,
    factor: Factor,
    prepare: Callable[[Mask], Multigrid],
    limits: Limits | None = None,
) -> IterativeSystems:
    """The linear systems of a program with unit rows, by multigrid.

    Parameters
    ----------
    program : QuadraticProgram
        With n unknowns.
    factor : Factor
        Factorises the matrix of the free unknowns (n,), where V-cycles do not converge.
    prepare : callable
        Makes the solver for the unknowns (n,) that are free.
    limits : Limits, optional
        What the iterations may cost.
    """
    return IterativeSystems(
        prepare=prepare,
        limits=limits or Limits(),
        direct=bordered_systems(program, factor),
        approximation=first_approximation(program),
    )
