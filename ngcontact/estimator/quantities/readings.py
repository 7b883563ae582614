"""What a solution says of its quantities of interest.

The bars of the energy and of the force, the size of `contact_force`, are proved; that of the force
takes a dual problem. The others are estimated, by measurement on Hertz contact at orders 1 to 4:

* force, where its bar cannot be proved: of second order in the error, 10 (B / |u_h|)^2 times the
  sum of forces, and three times the difference to the integral of p*;
* peak pressure: largest difference to p* where the pressure is within a tenth of its peak;
* end of contact: h^2 over half of the zone's length, h that of the segment there, and the largest
  distance to where fits of gap^(2/3) outside and of p^2 inside vanish, of degrees 1 and 2;
* von Mises stress, the largest anywhere, which grows with refinement where a corner is singular:
  its difference to that of the equilibrated stress in the middle of the element, or the jump
  between elements at the place if that is more.

Where no bound is known, all are estimated: the estimate stands for B, the discrete stress of the
secondary for p*, jumps around the element for the equilibrated stress.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property
from typing import Protocol

import ngsolve as ng
import numpy as np

from ...contact import state_of
from ...errors import ContactError, warn
from ...fem import BoundaryTrace
from ..equilibrated import EquilibratedStress, Guaranteed
from .contact import ends_of, force_on, peak_of
from .force import Forced, proved_force_error
from .stresses import largest_von_mises
from .table import Quantities, Quantity


class _Solved(Forced, Protocol):
    """What of a solution is asked."""

    @property
    def stress(self) -> ng.CoefficientFunction: ...
    @property
    def out_of_plane_stress(self) -> ng.CoefficientFunction: ...
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
    def _proved(self) -> tuple[EquilibratedStress | None, str]: ...
    @property
    def _force_errors(self) -> dict[int, tuple[float, str]]: ...


class Measured(Guaranteed):
    """Members of `Solution` that tell figures with their errors."""

    @cached_property
    def _proved(self: _Solved) -> tuple[EquilibratedStress | None, str]:
        """The stress that proves the bound, or why there is none."""
        try:
            return self.equilibrated, ""
        except (ContactError, ValueError) as error:
            return None, f"nothing is guaranteed: {error}"

    @cached_property
    def _force_errors(self) -> dict[int, tuple[float, str]]:
        """By pair what is proved of the force, infinite where nothing is, and why."""
        return {}

    def quantities(self: _Solved, pair: int = 0) -> Quantities:
        """Force, peak pressure, ends of contact, energy, largest von Mises stress, with errors.

        Each in units of the data, any consistent units; printed as a table. The bars of energy and,
        as a rule, force are proved, the others are estimated. Where no bound is known all of them
        are, and a `ContactWarning` and a note below the table say why.
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
        force = force_on(state, self.contact_force(pair), boundary, star, relative)
        if proof is not None:
            error, reason = _force_error(self, pair)
            if error < np.inf:
                force = replace(force, error=error, kind="guaranteed")
        rows = [
            force,
            *peak_of(state, boundary, self.stress, star),
            *ends_of(state, boundary),
            _energy(self, proof is not None),
            largest_von_mises(boundary.mesh, stresses, proof),
        ]
        size = float(np.abs(boundary.curve).max())
        notes = [reason, "" if proof is None else _domain(proof, boundary)]
        note = "; ".join(text for text in notes if text)
        return Quantities(tuple(_without_round_off(row, size) for row in rows), note)


def _domain(proof: EquilibratedStress, boundary: BoundaryTrace) -> str:
    """What is to be said of curved boundaries: what is proved is proved on the mesh's domain."""
    if not (proof.proof.discrete.curves.number >= 0).any():
        return ""
    return f"guaranteed on the domain of the mesh, of curves of degree {boundary.geometry_order}"


def _without_round_off(row: Quantity, size: float) -> Quantity:
    """The row with 0 for coordinates of its place that are round-off of bodies of extent `size`."""
    if row.place is None:
        return row
    return replace(row, place=np.where(np.abs(row.place) < 1e-14 * size, 0.0, row.place))


def _force_error(solution: _Solved, pair: int) -> tuple[float, str]:
    """What is proved of a pair's force, once for all: infinite where nothing is, and why."""
    known = solution._force_errors
    if pair not in known:
        try:
            known[pair] = proved_force_error(solution, pair), ""
        except (ContactError, ValueError) as error:
            known[pair] = np.inf, f"the error of the force is an estimate: {error}"
    return known[pair]


def _energy(solution: _Solved, proved: bool) -> Quantity:
    """L(u_h); it exceeds L(u) by half the square of the error, but for gaps and supports."""
    value = solution.energy
    if not proved:
        return Quantity("energy", value, solution.error_estimate**2, "estimated")
    low, high = solution.energy_bounds
    return Quantity("energy", value, float(max(high - value, value - low)), "guaranteed")
