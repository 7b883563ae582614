"""The jump of a displacement on Gamma_K beside that of a unit force, and what of it is lifted."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ....fem import BoundaryTrace
from ..data import Units
from ..liftings import Gap, at_points, coefficients, derivative, panels
from ..pressures import Pieces, Zone, ZonePoints

NOISE = 1e-14  # of a jump, relative to the largest displacement


@dataclass(frozen=True, eq=False)
class Excess:
    """[G] - d.e of one pair on its k pieces, and what of it exceeds kappa times the gap.

    Attributes
    ----------
    gap : Gap
        The gap of the solution on the same pieces.
    values : ndarray (k, d + 1)
        Legendre coefficients of [G] - d.e.
    kappa : float
        In units of `values` over those of the gap.
    """

    gap: Gap
    values: Array
    kappa: float

    @property
    def zone(self) -> Zone:
        """The pair."""
        return self.gap.zone

    @property
    def pieces(self) -> Pieces:
        """Its parts."""
        return self.gap.pieces

    @property
    def points(self) -> ZonePoints:
        """Places on them."""
        return self.gap.points

    def lifted(self, at: Index, t: Array) -> tuple[Array, Array, Array]:
        """[G] - d.e (j, q) at `t` (j, q) of pieces `at` (j,), r (j, q), its derivative (j, q).

        [G + w] - d.e = [G] - d.e - r is at most kappa times the gap after its own lifting.
        """
        value, slope = (at_points(c, t) for c in (self.values[at], derivative(self.values[at])))
        gap, change = (
            at_points(c, t) for c in (self.gap.values[at], derivative(self.gap.values[at]))
        )
        closed, sign, kappa = self.gap.shut(at, t), np.sign(value), self.kappa
        room, opens = np.where(closed, 0.0, kappa * np.maximum(gap, 0.0)), (gap > 0) & ~closed
        over = np.abs(value) > room
        r = np.where(over, value - sign * room, 0.0)
        return value, r, np.where(over, slope - sign * kappa * change * opens, 0.0)

    def panels(self, at: Index) -> tuple[Array, Array]:
        """Points (j, q), weights (j, q) of pieces `at` (j,), cut where r has kinks."""
        closed = (self.gap.closed[at] == [0, 1]).all(axis=1)[:, None]
        value = np.where(closed, 0.0, self.values[at])
        gap = np.where(closed, 0.0, self.gap.values[at])
        room = self.kappa * gap
        return panels(gap, value, value - room, value + room)


def jump_beside(
    gap: Gap, displacement: ng.GridFunction, boundary: BoundaryTrace, unit: Array, units: Units
) -> Array:
    """Legendre coefficients (k, d + 1) of [G] - d.e for the direction e, `unit` (2,), or 0."""
    points = gap.points
    u = boundary.evaluate(displacement, points.segment, points.s)
    largest = np.abs(u).max(initial=0.0)
    met = points.facing >= 0
    if met.any():
        u[met] -= boundary.evaluate(displacement, points.facing[met], points.facing_s[met])
    value = ((u - unit) * points.direction).sum(axis=1)
    value[np.abs(value) <= NOISE * max(largest, float(np.abs(unit).max()))] = 0.0
    return coefficients(value.reshape(len(gap.pieces.local), -1)) / (units.strain * units.length)


def least_kappa(gap: Gap, values: Array) -> float:
    """The least kappa with which nothing is left at the ends of open pieces; infinite for none.

    `values` (k, d + 1) are the coefficients of [G] - d.e.
    """
    ends = np.tile([0.0, 1.0], (len(values), 1))
    value, room = np.abs(at_points(values, ends)), at_points(gap.values, ends)
    at_vertex = np.column_stack([gap.pieces.start == 0, gap.pieces.stop == 1])
    open_ = ~gap.shut(np.arange(len(ends)), ends) & at_vertex
    open_ &= value > NOISE * np.abs(value).max(initial=0.0)
    # Ends that a closed piece shares are closed.
    ratio = np.divide(value, room, out=np.full_like(value, np.inf), where=room > 0)
    return float(ratio[open_].max(initial=0.0))
