"""Force, peak pressure, ends of contact, energy, von Mises stress, and how far they may be wrong.

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
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...contact import ContactState, ending_segments
from ...fem import BoundaryTrace
from ...lagrange import gauss_lobatto
from ...output import von_mises
from ..equilibrated import EquilibratedStress, bernstein

SECOND_ORDER = 10.0  # relative error of the force over the square of the relative bound: at most 10
RESULTANTS = 3.0  # error of the force over the difference of both resultants, measured: at most 3
NEAR_PEAK = 0.9  # share of the peak from which pressures count for it
SAME = 1e-9  # distance, relative to an element, at which points of two elements are one
ON_LINE = 3  # points of which squared pressures are continued by a straight line

# Where stresses are looked at in the unit triangle: its middle, then sixths of its sides.
SIXTHS = [(i / 6, j / 6) for i in range(7) for j in range(7 - i) if (i, j) != (2, 2)]
LATTICE = np.array([(1 / 3, 1 / 3), *SIXTHS])


@dataclass(frozen=True, eq=False)
class Quantity:
    """One figure and its bar.

    Attributes
    ----------
    name : str
        What it is.
    value, error : float
        In the units of the data, forces and energies per unit thickness.
    guaranteed : bool
        Whether the true value of the problem lies within `error` of `value`, or it is estimated.
    place : ndarray (2,) or None
        Where it is.
    """

    name: str
    value: float
    error: float
    guaranteed: bool
    place: Array | None = None

    def __str__(self) -> str:
        """One line: value, bar, how sure it is, where."""
        sure = "guaranteed" if self.guaranteed else "estimated"
        at = "" if self.place is None else f"  at ({self.place[0]:.6g}, {self.place[1]:.6g})"
        return f"{self.name:22s} {self.value:14.7g} +- {self.error:8.2g}  {sure:10s}{at}"


@dataclass(frozen=True, eq=False)
class Quantities:
    """The quantities of one pair; printed as a table, found by name.

    Attributes
    ----------
    rows : tuple of Quantity
        In order.
    """

    rows: tuple[Quantity, ...]

    def __iter__(self) -> Iterator[Quantity]:
        """Rows in order."""
        return iter(self.rows)

    def __getitem__(self, name: str) -> Quantity:
        """The first row of that name."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"{name!r} is none of {[row.name for row in self.rows]}")

    def __str__(self) -> str:
        """A table."""
        return "\n".join(map(str, self.rows))

    __repr__ = __str__


def quantities_of(
    pair: ContactState,
    pressure_star: tuple[Index, Array],
    boundary: BoundaryTrace,
    stresses: tuple[ng.CoefficientFunction, ng.CoefficientFunction],
    equilibrated: EquilibratedStress,
    energy: tuple[float, float, float],
    relative_bound: float,
) -> Quantities:
    """Quantities of one pair.

    Parameters
    ----------
    pair : ContactState
        Its points.
    pressure_star : tuple of ndarray (k,), (k, d + 1)
        Segments of the secondary, and Bernstein coefficients of p* there.
    boundary : BoundaryTrace
        The boundary.
    stresses : tuple
        Stress (2, 2) in the plane, and normal to it.
    equilibrated : EquilibratedStress
        The stress that proves the bound.
    energy : tuple of float
        L(u_h), and the bounds of L(u).
    relative_bound : float
        B over the energy norm of u_h.
    """
    value, low, high = energy
    rows = [
        _force(pair, pressure_star, boundary, relative_bound),
        *_peak(pair, pressure_star, boundary),
        *_ends(pair, boundary),
        Quantity("energy", value, max(high - value, value - low), guaranteed=True),
        _largest_von_mises(boundary, stresses, equilibrated),
    ]
    return Quantities(tuple(rows))


def _force(
    pair: ContactState, star: tuple[Index, Array], boundary: BoundaryTrace, relative: float
) -> Quantity:
    """Size of the resultant; its error is at most that of the sum of forces along directions."""
    force, (segments, c) = float(pair.force.sum()), star
    resultant = np.linalg.norm((pair.force[:, None] * pair.line.direction).sum(axis=0))
    length = boundary.lengths(segments)
    direction = pair.line.contact.direction
    if direction is not None:
        chord = boundary.curve[segments, -1] - boundary.curve[segments, 0]
        length = np.abs(chord @ np.array([-direction[1], direction[0]]))
    error = SECOND_ORDER * relative**2 * abs(force)
    error += RESULTANTS * abs(float(length @ c.mean(axis=1)) - force)
    return Quantity("force", float(resultant), error, guaranteed=False)


def _star_at_points(pair: ContactState, star: tuple[Index, Array]) -> Array:
    """The pressure p* (m,) at contact points, of the last segment where two meet."""
    rows, c = pair.line.rows, star[1]
    values = c @ bernstein(c.shape[1] - 1, gauss_lobatto(rows.shape[1] - 1)).T
    result = np.zeros(len(pair.force) + 1)
    result[rows] = values
    return result[:-1]


def _peak(
    pair: ContactState, star: tuple[Index, Array], boundary: BoundaryTrace
) -> Sequence[Quantity]:
    """The largest pressure, if there are points."""
    if pair.pressure.size == 0:
        return []
    at = int(pair.pressure.argmax())
    peak = float(pair.pressure[at])
    near = pair.pressure >= NEAR_PEAK * peak
    off = np.abs(_star_at_points(pair, star) - pair.pressure)[near]
    place = pair.line.position[at]
    return [Quantity("peak pressure", peak, float(off.max(initial=0.0)), False, place)]


def _ends(pair: ContactState, boundary: BoundaryTrace) -> list[Quantity]:
    """Ends of contact, by the coordinate along which the points in contact extend."""
    line, ends = pair.line, pair.transitions
    if len(ends.position) == 0:
        return []
    inside = line.position[pair.active]
    middle = (inside.min(axis=0) + inside.max(axis=0)) / 2
    extent = float(np.linalg.norm(np.ptp(inside, axis=0)))
    axis = int(np.ptp(inside, axis=0).argmax())
    name = f"end of contact, {'xy'[axis]}"
    beside = line.segments[ending_segments(line, ends)]
    h = float(boundary.lengths(beside).max(initial=0.0))
    found = []
    for position in ends.position:
        away = float(np.linalg.norm(position - middle))
        towards = (position - middle) / max(away, np.finfo(float).tiny)
        along = (line.position - middle) @ towards
        chosen = np.flatnonzero(pair.active & (along > 0))
        chosen = chosen[np.argsort(along[chosen])][-ON_LINE - 1 : -1]
        other = away
        if len(chosen) == ON_LINE:
            fit = np.polynomial.Polynomial.fit(along[chosen], pair.pressure[chosen] ** 2, 1)
            slope = fit.convert().coef[-1]
            if slope < 0:
                other = float(fit.roots()[0].real)
        error = h**2 / max(extent, h) + abs(other - away)
        found.append(Quantity(name, float(position[axis]), error, False, position))
    return found


def _largest_von_mises(
    boundary: BoundaryTrace,
    stresses: tuple[ng.CoefficientFunction, ng.CoefficientFunction],
    equilibrated: EquilibratedStress,
) -> Quantity:
    """The largest one on a lattice over all elements, their sides and vertices included."""
    mesh, n = boundary.mesh, len(LATTICE)
    rule = ng.IntegrationRule([(x, y, 0) for x, y in LATTICE.tolist()], [1 / n] * n)
    points = mesh.MapToAllElements(rule, ng.VOL)
    (s, z), xy = stresses, np.asarray(ng.CF((ng.x, ng.y))(points))
    values = np.asarray(s(points)).reshape(-1, 4)[:, [0, 3, 1]]
    normal = np.asarray(z(points)).reshape(-1, 1)
    mises = von_mises(np.hstack([values, normal]))
    at = int(mises.argmax())
    element = at // n
    middle = element * n  # the lattice begins there
    other = equilibrated.at_middles()[np.flatnonzero(equilibrated.element == element)]
    # Out of the plane the stress follows that in it: nu times the trace, or 0.
    trace = values[middle, 0] + values[middle, 1]
    ratio = normal[middle, 0] / trace if trace != 0 else 0.0
    across = ratio * (other[:, :1] + other[:, 1:2])
    off = float(np.abs(von_mises(np.hstack([other, across])) - mises[middle]).max())
    same = (
        np.linalg.norm(xy - xy[at], axis=1) <= SAME * np.ptp(xy[middle : middle + n], axis=0).max()
    )
    return Quantity(
        *("largest von Mises", float(mises[at]), max(off, float(np.ptp(mises[same])))),
        False,
        xy[at],
    )
