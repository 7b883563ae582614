"""Force, peak pressure and ends of one contact, with estimated bars."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...contact import ContactState, ending_segments
from ...fem import BoundaryTrace
from ...lagrange import gauss_lobatto
from ..equilibrated import bernstein
from .table import Quantity

Star = tuple[Index, Array]  # segments (k,) of the secondary, Bernstein coefficients (k, d + 1)

SECOND_ORDER = 10.0  # relative error of the force over the square of the relative bound: at most 10
RESULTANTS = 3.0  # error of the force over the difference of both resultants, measured: at most 3
NEAR_PEAK = 0.9  # share of the peak from which pressures count for it
ON_LINE = 3  # points of which squared pressures are continued by a straight line


def force_on(
    pair: ContactState,
    resultant: Array,
    boundary: BoundaryTrace,
    star: Star | None,
    relative: float,
) -> Quantity:
    """Size of the `resultant` (2,); its error is at most that of the sum along directions.

    `star` is p*, if there is one; `relative` the error of the displacement, relative.
    """
    force = float(pair.force.sum())
    error = SECOND_ORDER * relative**2 * abs(force)
    if star is not None:
        segments, c = star
        length = boundary.lengths(segments)
        direction = pair.line.contact.direction
        if direction is not None:
            chord = boundary.curve[segments, -1] - boundary.curve[segments, 0]
            length = np.abs(chord @ np.array([-direction[1], direction[0]]))
        error += RESULTANTS * abs(float(length @ c.mean(axis=1)) - force)
    return Quantity("force", float(np.linalg.norm(resultant)), error, "estimated")


def peak_of(
    pair: ContactState, boundary: BoundaryTrace, stress: ng.CoefficientFunction, star: Star | None
) -> Sequence[Quantity]:
    """The largest pressure, if there are points."""
    if pair.pressure.size == 0:
        return []
    at = int(pair.pressure.argmax())
    peak = float(pair.pressure[at])
    near = pair.pressure >= NEAR_PEAK * peak
    off = _off_stress(pair, boundary, stress) if star is None else _off_star(pair, star)
    place = pair.line.position[at]
    return [Quantity("peak pressure", peak, float(off[near].max(initial=0.0)), "estimated", place)]


def _off_star(pair: ContactState, star: Star) -> Array:
    """Differences (m,) of pressures to p* at contact points, of the last segment where two meet."""
    rows, c = pair.line.rows, star[1]
    values = c @ bernstein(c.shape[1] - 1, gauss_lobatto(rows.shape[1] - 1)).T
    result = np.zeros(len(pair.force) + 1)
    result[rows] = values
    return np.abs(result[:-1] - pair.pressure)


def _off_stress(
    pair: ContactState, boundary: BoundaryTrace, stress: ng.CoefficientFunction
) -> Array:
    """Differences (m,) of pressures to the discrete stress of the secondary, the larger of two."""
    rows = pair.line.rows
    s = np.tile(gauss_lobatto(rows.shape[1] - 1), len(rows))
    point, segment = rows.ravel(), np.repeat(pair.line.segments, rows.shape[1])
    s, segment, point = s[point >= 0], segment[point >= 0], point[point >= 0]
    sigma = boundary.evaluate(ng.BoundaryFromVolumeCF(stress), segment, s).reshape(-1, 2, 2)
    normal, d = boundary.normal(segment, s), pair.line.direction[point]
    traction = np.einsum("ki,kij,kj->k", d, sigma, normal) / np.abs((normal * d).sum(axis=1))
    result = np.zeros(len(pair.force))
    np.maximum.at(result, point, np.abs(traction + pair.pressure[point]))
    return result


def ends_of(pair: ContactState, boundary: BoundaryTrace) -> list[Quantity]:
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
        found.append(Quantity(name, float(position[axis]), error, "estimated", position))
    return found
