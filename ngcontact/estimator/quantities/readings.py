"""What a solution says of its quantities of interest."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import ngsolve as ng
import numpy as np

from ...contact import ContactState, state_of
from ...fem import BoundaryTrace, Space
from ..equilibrated import EquilibratedStress, Guaranteed
from .quantities import Quantities, quantities_of


class _Assembled(Protocol):
    """A discrete problem, of which the space is asked."""

    @property
    def space(self) -> Space: ...


class _Solved(Protocol):
    """What of a solution is asked."""

    @property
    def discrete(self) -> _Assembled: ...
    @property
    def stress(self) -> ng.CoefficientFunction: ...
    @property
    def out_of_plane_stress(self) -> ng.CoefficientFunction: ...
    @property
    def pairs(self) -> Sequence[ContactState]: ...
    @property
    def energy(self) -> float: ...
    @property
    def energy_bounds(self) -> tuple[float, float]: ...
    @property
    def relative_error_bound(self) -> float: ...
    @property
    def equilibrated(self) -> EquilibratedStress: ...


class Measured(Guaranteed):
    """Members of `Solution` that tell figures with their errors."""

    def quantities(self: _Solved, pair: int = 0) -> Quantities:
        """Force, peak pressure, ends of contact, energy, largest von Mises stress, with errors.

        Each in units of the data, any consistent units; printed as a table. The energy's bar is
        proved, the others are estimated.

        Raises
        ------
        ValueError
            A problem for which no bound is known.
        """
        state = state_of(self.pairs, pair)
        star = self.equilibrated.pressure[pair]
        boundary: BoundaryTrace = self.discrete.space.trace
        return quantities_of(
            state,
            (star.segments, np.asarray(star.coefficients)),
            boundary,
            (self.stress, self.out_of_plane_stress),
            self.equilibrated,
            (self.energy, *self.energy_bounds),
            self.relative_error_bound,
        )
