"""Force, peak pressure and ends of one contact, with estimated bars."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...contact import ContactState, ending_segments
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ..equilibrated import bernstein
from .table import Quantity

Star = tuple[Index, Array]  # segments (k,) of the secondary, Bernstein coefficients (k, d + 1)

SECOND_ORDER = 10.0  # relative error of the force over the square of the relative bound: at most 10
RESULTANTS = 3.0  # error of the force over the difference of both resultants, measured: at most 3
NEAR_PEAK = 0.9  # share of the peak from which pressures count for it
FITS = ((1, 3), (2, 5))  # degrees of fits at an end of contact, and how many points they take


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
        length, (t, w) = boundary.lengths(segments), gauss(c.shape[1] + boundary.model.extent)
        direction = pair.line.contact.direction
        if direction is not None:
            chord = boundary.curve[segments, -1] - boundary.curve[segments, 0]
            length = np.abs(chord @ np.array([-direction[1], direction[0]]))
        at, s = np.repeat(segments, len(t)), np.tile(t, len(segments))
        p = c @ bernstein(c.shape[1] - 1, t).T * boundary.measure(at, s).reshape(-1, len(t))
        error += RESULTANTS * abs(float(length @ p @ w) - force)
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
    off = _off_stress(pair, boundary, stress) if star is None else _off_star(pair, boundary, star)
    place = pair.line.position[at]
    return [Quantity("peak pressure", peak, float(off[near].max(initial=0.0)), "estimated", place)]


def _off_star(pair: ContactState, boundary: BoundaryTrace, star: Star) -> Array:
    """Differences (m,) of pressures to p* at contact points, of the last segment where two meet."""
    rows, c = pair.line.rows, star[1]
    basis = bernstein(c.shape[1] - 1, boundary.places(pair.line.segments).ravel())
    values = np.einsum("kj,kij->ki", c, basis.reshape(*rows.shape, -1))
    result = np.zeros(len(pair.force) + 1)
    result[rows] = values
    return np.abs(result[:-1] - pair.pressure)


def _off_stress(
    pair: ContactState, boundary: BoundaryTrace, stress: ng.CoefficientFunction
) -> Array:
    """Differences (m,) of pressures to the discrete stress of the secondary, the larger of two."""
    rows = pair.line.rows
    s = boundary.places(pair.line.segments).ravel()
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
    axis = int(np.ptp(line.position[pair.active], axis=0).argmax())
    name = f"end of contact, {'xy'[axis]}"
    beside = line.segments[ending_segments(line, ends)]
    h = float(boundary.lengths(beside).max(initial=0.0))
    found = []
    for inner, outer, position in zip(ends.inner, ends.outer, ends.position, strict=True):
        zone, spread = _spread(pair, int(inner), int(outer), position)
        error = h**2 / max(zone / 2, h) + spread
        found.append(Quantity(name, float(position[axis]), error, "estimated", position))
    return found


def _spread(pair: ContactState, inner: int, outer: int, position: Array) -> tuple[float, float]:
    """Length of the zone that ends at `position` (2,), and how far fits of its end are from there.

    Near the end gap^(2/3) outside and p^2 inside are smooth; their zeros are those of straight
    lines and parabolas through few points.
    """
    x, active = pair.line.position, pair.active
    away = x[outer] - x[inner]
    size = float(np.linalg.norm(away))
    if size == 0 or not active[inner]:  # both sides of a corner
        return 0.0, 0.0
    along = (x - position) @ (away / size)
    order = np.argsort(along, kind="stable")
    place = np.empty_like(order)
    place[order] = np.arange(len(order))
    before, after = order[place[inner] :: -1], order[place[outer] :]
    closed = before[: int(np.append(~active[before], True).argmax())]
    opened = after[: int(np.append(active[after], True).argmax())]
    gap, squares = np.maximum(pair.gap[opened], 0.0) ** (2 / 3), pair.pressure[closed] ** 2
    zone, found = float(-along[closed[-1]]), [0.0]
    for degree, points in FITS:
        for t, y in ((along[opened], gap), (along[closed[1:]], squares[1:])):
            if len(t) > degree:
                zeros = np.polynomial.Polynomial.fit(t[:points], y[:points], degree).roots()
                real = np.abs(zeros[np.isreal(zeros)].real)
                found.append(float(real.min(initial=np.inf)))
    spread = [off for off in found if off <= zone]
    return zone, max(spread)
