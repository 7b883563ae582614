"""What a solution says of its quantities of interest.

Only the bar of the energy is proved. The others are estimated, by measurement on Hertz contact at
orders 1 to 4:

* force, the size of `contact_force`: of second order in the error, 10 (B / |u_h|)^2 times the sum
  of forces, and three times the difference to the integral of p*;
* peak pressure: largest difference to p* where the pressure is within a tenth of its peak;
* end of contact: h^2 over the extent of the zone, h the length of the segment there, and the
  distance to where a straight line through the last squares of the pressure vanishes;
* von Mises stress, the largest anywhere, which grows with refinement where a corner is singular:
  its difference to that of the equilibrated stress in the middle of the element, or the jump
  between elements at the place if that is more.

Where no bound is known, all are estimated: the estimate stands for B, the discrete stress of the
secondary for p*, jumps around the element for the equilibrated stress.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property
from typing import Protocol

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...contact import ContactState, state_of
from ...errors import ContactError, warn
from ...fem import BoundaryTrace, Space
from ..equilibrated import EquilibratedStress, Guaranteed
from .contact import ends_of, force_on, peak_of
from .stresses import largest_von_mises
from .table import Quantities, Quantity


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
    def error_estimate(self) -> float: ...
    @property
    def relative_error_bound(self) -> float: ...
    @property
    def relative_error_estimate(self) -> float: ...
    @property
    def equilibrated(self) -> EquilibratedStress: ...
    def contact_force(self, pair: int = 0) -> Array: ...
    @property
    def _proved(self) -> tuple[EquilibratedStress | None, str]: ...


class Measured(Guaranteed):
    """Members of `Solution` that tell figures with their errors."""

    @cached_property
    def _proved(self: _Solved) -> tuple[EquilibratedStress | None, str]:
        """The stress that proves the bound, or why there is none."""
        try:
            return self.equilibrated, ""
        except (ContactError, ValueError) as error:
            return None, f"nothing is guaranteed: {error}"

    def quantities(self: _Solved, pair: int = 0) -> Quantities:
        """Force, peak pressure, ends of contact, energy, largest von Mises stress, with errors.

        Each in units of the data, any consistent units; printed as a table. The energy's bar is
        proved, the others are estimated. Where no bound is known all of them are, and a
        `ContactWarning` and a note below the table say why.
        """
        state = state_of(self.pairs, pair)
        known = "_proved" in self.__dict__
        proof, reason = self._proved
        if proof is None and not known:
            warn(f"{reason}; all errors of quantities() are estimates")
        star, relative = None, self.relative_error_estimate if proof is None else 0.0
        if proof is not None:
            found = proof.pressure[pair]
            star = found.segments, np.asarray(found.coefficients)
            relative = self.relative_error_bound
        boundary: BoundaryTrace = self.discrete.space.trace
        stresses = self.stress, self.out_of_plane_stress
        rows = [
            force_on(state, self.contact_force(pair), boundary, star, relative),
            *peak_of(state, boundary, self.stress, star),
            *ends_of(state, boundary),
            _energy(self, proof is not None),
            largest_von_mises(boundary.mesh, stresses, proof),
        ]
        return Quantities(tuple(rows), reason)


def _energy(solution: _Solved, proved: bool) -> Quantity:
    """L(u_h); it exceeds L(u) by half the square of the error, but for gaps and supports."""
    value = solution.energy
    if not proved:
        return Quantity("energy", value, solution.error_estimate**2, "estimated")
    low, high = solution.energy_bounds
    return Quantity("energy", value, max(high - value, value - low), "guaranteed")
