"""What a solution says of its quantities of interest.

The bar of the energy is proved, and beside its estimate that of the force, by a dual problem. The
others are estimated, by measurement (docs/bounds.md):

* force: of second order, 0.3 times the square of the relative estimate, 1.5 times at order 4;
  where Gamma_K ends on Gamma_u, more by what acts at the held point; where sides are curved, by
  what the shape of the mesh changes of the loads;
* peak pressure and von Mises stress: the largest lies between those of the discrete field less and
  plus an error, which is one number on each segment or element: of pressures twice the largest
  difference to p* there, or once that to the discrete stress; of von Mises 1.1 times the largest
  difference to that of the equilibrated stress, or half of the jump between elements;
* end of contact: how far from it the lines through the first two values of gap^(2/3) outside and
  of p^2 inside vanish, and 0.3 of the distance of the points between which it lies; contact
  area: the sum of those of its ends;
* approach: of second order, twice the square of the relative estimate, where it is not prescribed.

Where no bound is known, all are estimated, without the equilibrated stress and p*: the difference
to the discrete stress and the jump count twice as much. Peak and von Mises have no bar where the
relative estimate is more than 1.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cached_property

import numpy as np

from ...arrays import Array
from ...contact import ContactState, state_of
from ...discrete import load_by_shape
from ...errors import ContactError, warn
from ...fem import BoundaryTrace
from ..bound import EquilibratedStress, Guaranteed
from .contact import approach_of, area_in_contact, direction_of, ends_of, left_out, peak_of
from .force import proved_force_errors
from .stresses import largest_von_mises, singular_corners
from .table import Quantities, Quantity, unknown

# Relative errors over the square of the relative estimate, measured on random scenes of all orders.
FORCE = {1: 0.3, 2: 0.3, 3: 0.3, 4: 1.5}  # by order: 96 % of 118 are at most that, most of Hertz
APPROACH = 2.0  # 97 % of 187 are at most that
ROUND_OFF = 64 * np.finfo(float).eps  # of what is prescribed


class Measured(Guaranteed):
    """Members of `Solution` that tell figures with their errors."""

    @cached_property
    def _proved(self) -> tuple[EquilibratedStress | None, str]:
        """The stress that proves the bound, or why there is none."""
        try:
            return self.equilibrated, ""
        except (ContactError, ValueError) as error:
            return None, f"nothing is guaranteed: {error}"

    @cached_property
    def _force_errors(self) -> dict[int, tuple[float, float, str]]:
        """By pair what is proved of the force, infinite where nothing is, and why."""
        return {}

    def contact_area(self, pair: int = 0) -> float:
        """Length of a pair's line in contact, an area about an axis; any consistent units."""
        return area_in_contact(state_of(self.pairs, pair), self.discrete.space.trace)[0]

    def quantities(self, pair: int = 0) -> Quantities:
        """Force, contact area, pressures, ends, approach, energy, von Mises stress, with errors.

        Each in units of the data, any consistent units; printed as a table, found by name:
        "force", along a direction that the note tells, "force, x", "force, y", "contact area" (a
        length in planes), "mean pressure", "peak pressure", "end of contact, x" or "y",
        "approach", "energy", "von Mises". The bar of the energy is proved, and that of the force
        as a rule beside its estimate. Where no bound is known all are estimates, and a
        `ContactWarning` and a note below the table say why. Where corners make a stress infinite
        the row names them; its value is the largest farther away.
        """
        state = state_of(self.pairs, pair)
        known = "_proved" in self.__dict__
        proof, reason = self._proved
        if proof is None and not known:
            warn(f"{reason}; all errors of quantities() are estimates")
        relative = self.relative_error_estimate
        star = None if proof is None else proof.pressure[pair]
        boundary = self.discrete.space.trace
        corners = singular_corners(self.problem, boundary, self.pairs)
        e, along = direction_of(self, pair, state)
        e = e + 0.0  # no -0
        largest = max(abs(float(one.force.sum())) for one in self.pairs)
        sum_error = FORCE[self.order] * relative**2 * largest + left_out(state, boundary)
        of_shape = float(np.linalg.norm(load_by_shape(self.problem, self.mesh)))
        forces = _forces(self.contact_force(pair), e, sum_error)
        if proof is not None:
            *errors, reason = _force_error(self, pair, e)
            forces = _with_proofs(forces, e, *errors)
        if of_shape > ROUND_OFF * largest:
            forces = [replace(x, error=x.error + of_shape, kind="estimated") for x in forces]
        stresses = self.stress, self.out_of_plane_stress
        rows = [
            *forces,
            *_means(state, boundary, sum_error + of_shape),
            peak_of(state, boundary, self.stress, star, corners, relative),
            *ends_of(state),
            _approach(self, state, e, relative, forces[0].error if along == "itself" else 0.0),
            _energy(self, proof is not None),
            largest_von_mises(boundary.mesh, self.order, stresses, proof, corners, relative),
        ]
        size = float(np.abs(boundary.curve).max())
        told = f"force along {along}, ({e[0]:.4g}, {e[1]:.4g})" if along != "itself" else ""
        notes = [told, reason, "" if proof is None else _domain(proof, boundary)]
        note = "; ".join(text for text in notes if text)
        return Quantities(tuple(_without_round_off(row, size) for row in rows), note)


def _forces(force: Array, e: Array, error: float) -> list[Quantity]:
    """The force (2,) along `e` (2,) and its components; each within the `error` of the sum."""
    return [
        Quantity(name, float(value), error, "estimated")
        for name, value in zip(
            ("force", "force, x", "force, y"), (e @ force, *(force + 0.0)), strict=True
        )
    ]


def _with_proofs(rows: list[Quantity], e: Array, along: float, across: float) -> list[Quantity]:
    """With what is proved `along` and `across` e (2,), where anything is."""
    if not along < np.inf:
        return rows
    proved = [along, *(np.abs(e) * along + np.abs(e[::-1]) * across)]
    return [row.with_proof(float(bar)) for row, bar in zip(rows, proved, strict=True)]


def _means(state: ContactState, boundary: BoundaryTrace, error: float) -> list[Quantity]:
    """Contact area and mean pressure, of a sum of forces with an `error`."""
    area, bar = area_in_contact(state, boundary)
    name, other = "contact area", "mean pressure"
    if not area > 0:
        return [unknown(name, 0.0), unknown(other, 0.0)]
    mean = float(state.force.sum()) / area
    return [
        Quantity(name, area, bar, "estimated"),
        Quantity(other, mean, error / area + abs(mean) * bar / area, "estimated"),
    ]


def _approach(
    solution: Measured, state: ContactState, e: Array, relative: float, turning: float
) -> Quantity:
    """The approach along `e` (2,); what is prescribed has an error of round-off alone.

    And that of e, where that is the direction of the force itself, with an error `turning`.
    """
    moved, free = approach_of(solution, state)
    value = abs(float(moved @ e))
    size = float(np.linalg.norm(state.line.direction.T @ state.force))
    turn = turning / size if size > 0 else 0.0
    error = APPROACH * relative**2 * float(free @ np.abs(e)) + ROUND_OFF * value
    error += turn * float(np.linalg.norm(moved))
    return Quantity("approach", value, error, "estimated")


def _domain(proof: EquilibratedStress, boundary: BoundaryTrace) -> str:
    """What is to be said of curved boundaries: what is proved is proved on the mesh's domain."""
    if not (proof.proof.dual.cells.curved).any():
        return ""
    return f"guaranteed on the domain of the mesh, of curves of degree {boundary.geometry_order}"


def _without_round_off(row: Quantity, size: float) -> Quantity:
    """The row with 0 for coordinates of its place that are round-off of bodies of extent `size`."""
    if row.place is None:
        return row
    return replace(row, place=np.where(np.abs(row.place) < 1e-14 * size, 0.0, row.place))


def _force_error(solution: Measured, pair: int, e: Array) -> tuple[float, float, str]:
    """What is proved of a pair's force along `e` (2,) and across it, infinite where nothing is."""
    known = solution._force_errors
    if pair not in known:
        try:
            known[pair] = *proved_force_errors(solution, pair, e), ""
        except (ContactError, ValueError) as error:
            known[pair] = np.inf, np.inf, f"no error of the force is proved: {error}"
    return known[pair]


def _energy(solution: Measured, proved: bool) -> Quantity:
    """L(u_h); it exceeds L(u) by half the square of the error, but for gaps and supports."""
    value = solution.energy
    if not proved:
        return Quantity("energy", value, solution.error_estimate**2, "estimated")
    low, high = solution.energy_bounds
    return Quantity("energy", value, float(max(high - value, value - low)), "guaranteed")
