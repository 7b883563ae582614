"""What solves the linear systems of a quadratic program, one for each active set met.

NumPy and SciPy only.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..arrays import Array, Mask
from .quadratic_program import QuadraticProgram

ROUGH = 1e-11  # residual, relative to the largest met, of a system that tells the next active set
REFINED = 1e-14  # ... and of the last system


class SingularError(ArithmeticError):
    """A factorised matrix does not solve its system: some motion meets no resistance."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """Proximal terms stiffness / 2 (y - at)^2 on the q pins, which make every system definite.

    Attributes
    ----------
    stiffness : ndarray (q,)
        Force per displacement.
    at : ndarray (q,)
        Values of the pins from which they pull.
    """

    stiffness: Array
    at: Array


class LinearSystems(Protocol):
    """The systems K y + R' force = b, R y = g on the active rows, force = 0 on the others.

    Every solution starts from the one before. `solve` and `refine` may be called in any order.
    """

    @property
    def program(self) -> QuadraticProgram:
        """The program, n unknowns and m rows, of the last `restart`."""

    @property
    def factorizations(self) -> int:
        """Factorisations since then."""

    @property
    def back_solves(self) -> int:
        """Back-solves since then; V-cycles count as such."""

    def restart(self, program: QuadraticProgram) -> None:
        """Begin with another load, other values or bounds; what the matrix cost stays."""

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Solution (n,) and multipliers (m,) for the rows `active` (m,), to tell the next set.

        Raises
        ------
        SingularError
            The matrix is singular to working precision.
        """

    def refine(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Solution (n,), multipliers (m,) for `active` (m,) to round-off: little after `solve`."""

    def stiffness(self) -> Array:
        """Force per displacement at each row, (m,): an upper bound, infinite where unknown."""

    def forget(self) -> None:
        """Give memory back; what it held is made again when asked for."""


@dataclass(eq=False)
class Approximation:
    """The last solution of a system, where the next one starts.

    Attributes
    ----------
    program : QuadraticProgram
        With n unknowns and m rows.
    y : ndarray (n,)
        Solution.
    force : ndarray (m,)
        Multipliers.
    scale : float
        Largest force that a system was to balance.
    """

    program: QuadraticProgram
    y: Array
    force: Array
    scale: float = 0.0

    def unbalanced(self, active: Mask, anchor: Anchor | None) -> Array:
        """Unbalanced force b - K y - R' force, (n,), less that of the proximal terms.

        The unit rows `active` (m,) first take as their force what is left at their unknowns.
        """
        p = self.program
        residual = p.b - p.K @ self.y
        if anchor is not None:
            pins = p.null_space.pins
            residual[pins] -= anchor.stiffness * (self.y[pins] - anchor.at)
        if p.unit_rows:
            self.force[:] = 0.0
            self.force[active] = residual[p.unknown[active]]
            residual[p.unknown[active]] = 0.0
            return residual
        return residual - p.R.T @ self.force

    def copies(self) -> tuple[Array, Array]:
        """Solution (n,) and multipliers (m,), that no later system changes."""
        return self.y.copy(), self.force.copy()


def first_approximation(program: QuadraticProgram, closed: Mask | None = None) -> Approximation:
    """Prescribed values, and the bounds of the unit rows that are `closed` (m,)."""
    y = np.where(program.fixed, program.values, 0.0)
    if closed is not None and program.unit_rows:
        y[program.unknown[closed]] = program.g[closed]
    return Approximation(program=program, y=y, force=np.zeros(program.g.size))
