"""Pressure, ends and size of one contact, with estimated bars."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...contact import ContactState, ending_segments, in_contact
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ..bound import bernstein
from .singular import Singular
from .table import Quantity, unknown

Star = tuple[Index, Array]  # segments (k,) of the secondary, Bernstein coefficients (k, d + 1)

NEAR_PEAK = 0.9  # share of the peak from which pressures count for it
FITS = ((1, 3), (2, 5))  # degrees of fits at an end of contact, and how many points they take
# Error of the peak over the largest difference near it to p*, and to the discrete stress: chosen on
# 38 solves of 32 random scenes, orders 1 to 4, of which one bar (with a coarse reference) missed.
OFF_STAR, OFF_STRESS, OFF_ALONE = 2.0, 0.75, 1.5  # the last where there is no p*
ENDS = 0.6  # error of an end over h^2 / zone and the spread of fits, measured: at most 0.55
SAMPLES = np.linspace(0, 1, 9)  # where pressures are looked at on a segment


def peak_of(
    pair: ContactState,
    boundary: BoundaryTrace,
    stress: ng.CoefficientFunction,
    star: Star | None,
    corners: Singular,
    relative: float,
) -> Quantity:
    """The largest pressure, away from corners at which it is infinite.

    `star` is p*, if there is one; `relative` the estimated error of the displacement.
    """
    line, pressure = pair.line, pair.pressure
    infinite = corners.places[corners.pressed & _beside(corners.places, line.position)]
    infinite = np.unique(infinite, axis=0)
    away = ~corners.near(line.position, pressed=True)
    if not (pair.active & away).any():
        return unknown("peak pressure", 0.0 if not pair.active.any() else np.nan, infinite=infinite)
    at = int(np.where(away, pressure, -np.inf).argmax())
    peak, place = float(pressure[at]), line.position[at]
    share = OFF_ALONE if star is None else OFF_STRESS
    off = share * _off_stress(pair, boundary, stress)
    most = peak
    if star is not None and len(star[0]):
        other, values = _off_star(pair, boundary, star)
        off = np.maximum(off, OFF_STAR * other)
        segment = np.repeat(star[0], len(SAMPLES))
        x = boundary.point(segment, np.tile(SAMPLES, len(star[0])))
        most = float(values[~corners.near(x, pressed=True)].max(initial=peak))
    near = (pressure >= NEAR_PEAK * peak) & away
    error = max(float(off[near].max(initial=0.0)), OFF_STAR * (most - peak))
    alone = np.count_nonzero(pair.active) <= boundary.order  # not even one segment
    if (
        relative > 1
        or alone
        or (len(infinite) and corners.near(place[None], pressed=True, reach=2.0)[0])
    ):
        return unknown("peak pressure", peak, place, infinite)
    return Quantity("peak pressure", peak, error, "estimated", place, infinite=infinite)


def _beside(places: Array, points: Array) -> Mask:
    """Which of the `places` (k, 2) are nearer to one of the `points` (m, 2) than these are far."""
    if not len(points):
        return np.zeros(len(places), dtype=bool)
    away = np.linalg.norm(places[:, None] - points, axis=2).min(axis=1)
    return np.asarray(away <= 0.05 * np.ptp(points, axis=0).max())


def _off_star(pair: ContactState, boundary: BoundaryTrace, star: Star) -> tuple[Array, Array]:
    """Differences (m,) of pressures to p* at contact points, the largest; samples (q,) of p*."""
    rows, (segments, c) = pair.line.rows, star
    result = np.zeros(len(pair.force) + 1)
    order = np.argsort(segments, kind="stable")
    at = np.searchsorted(segments, pair.line.segments, sorter=order)
    known = order[np.minimum(at, len(order) - 1)]
    met = segments[known] == pair.line.segments
    basis = bernstein(c.shape[1] - 1, boundary.places(pair.line.segments).ravel())
    values = np.einsum("kj,kij->ki", c[known], basis.reshape(*rows.shape, -1))
    off = np.abs(values - np.append(pair.pressure, 0.0)[rows])
    np.maximum.at(result, rows[met], off[met])
    return result[:-1], (c @ bernstein(c.shape[1] - 1, SAMPLES).T).ravel()


def _off_stress(
    pair: ContactState, boundary: BoundaryTrace, stress: ng.CoefficientFunction
) -> Array:
    """Differences (m,) of pressures to the discrete stress of the secondary, the larger of two."""
    rows = pair.line.rows
    s = boundary.places(pair.line.segments).ravel()
    point, segment = rows.ravel(), np.repeat(pair.line.segments, rows.shape[1])
    s, segment, point = s[point >= 0], segment[point >= 0], point[point >= 0]
    result = np.zeros(len(pair.force))
    if len(point):
        traction = boundary.evaluate(ng.BoundaryFromVolumeCF(stress), segment, s)
        sigma, normal = traction.reshape(-1, 2, 2), boundary.normal(segment, s)
        d = pair.line.direction[point]
        traction = np.einsum("ki,kij,kj->k", d, sigma, normal) / np.abs((normal * d).sum(axis=1))
        np.maximum.at(result, point, np.abs(traction + pair.pressure[point]))
    return result


def ends_of(pair: ContactState, boundary: BoundaryTrace) -> list[Quantity]:
    """Ends of contact, by the coordinate along which the points in contact extend.

    The bar is a length along the line of contact: of either coordinate, too.
    """
    line, ends = pair.line, pair.transitions
    if len(ends.position) == 0:
        return []
    axis = int(np.ptp(line.position[pair.active], axis=0).argmax()) if pair.active.any() else 0
    name = f"end of contact, {'xy'[axis]}"
    return [
        Quantity(name, float(x[axis]), error, "estimated", x)
        for x, error in zip(ends.position, _errors_of_ends(pair, boundary), strict=True)
    ]


def _errors_of_ends(pair: ContactState, boundary: BoundaryTrace) -> list[float]:
    """Bar of each end: h^2 over half of the zone's length, and where fits end the contact."""
    line, ends = pair.line, pair.transitions
    h = float(boundary.lengths(line.segments[ending_segments(line, ends)]).max(initial=0.0))
    errors = []
    for number in range(len(ends.position)):
        zone, spread = _spread(pair, number)
        errors.append(ENDS * (h**2 / max(zone / 2, h) + spread) if h > 0 else spread)
    return errors


def _spread(pair: ContactState, number: int) -> tuple[float, float]:
    """Length of the zone at an end of contact, and how far fits of the end are from there.

    Near the end gap^(2/3) outside and p^2 inside are smooth in the length along the line; their
    zeros are those of straight lines and parabolas through few points.
    """
    x, ends = pair.line.position, pair.transitions
    closed, opened = ends.closed[number], ends.opened[number]
    step = float(np.linalg.norm(x[opened[0]] - x[closed[0]]))
    if step == 0 or not pair.active[closed[0]]:  # both sides of a corner
        return 0.0, 0.0

    def along(run: Index) -> Array:
        steps = np.linalg.norm(np.diff(x[run], axis=0), axis=1)
        return np.concatenate([[0.0], np.cumsum(steps)])

    inside = -along(closed) - ends.beyond[number]
    outside = step + along(opened) - ends.beyond[number]
    gap, squares = np.maximum(pair.gap[opened], 0.0) ** (2 / 3), pair.pressure[closed] ** 2
    zone, found = float(-inside[-1]), [0.0]
    for degree, points in FITS:
        for t, y in ((outside, gap), (inside[1:], squares[1:])):
            if len(t) > degree and np.ptp(y[:points]) > 0:
                zeros = np.polynomial.Polynomial.fit(t[:points], y[:points], degree).roots()
                real = np.abs(zeros[np.isreal(zeros)].real)
                found.append(float(real.min(initial=np.inf)))
    spread = [off for off in found if off <= zone]
    return zone, max(spread, default=0.0)


def area_in_contact(pair: ContactState, boundary: BoundaryTrace) -> tuple[float, float]:
    """Length of the line in contact, area about an axis, and its estimated error.

    Each interval between two points in contact counts, and what is left of the way to an end of
    contact. Where a point in contact has no neighbour that faces the other body, half of the way
    counts, with a bar of that size. A curve of degree 1 is shorter than its arc by the square of
    half of its turn over 6, one of degree p by less than that power 2 p.
    """
    line, ends = pair.line, pair.transitions
    if not pair.active.any():
        return 0.0, 0.0
    closed = np.append(in_contact(line, pair.active), False)[line.rows] & (line.rows >= 0)
    places, (t, w) = boundary.places(line.segments), gauss(boundary.geometry_order + 2)
    start, width = places[:, :-1], np.diff(places, axis=1)
    s = start[:, :, None] + width[:, :, None] * t
    at = np.repeat(line.segments, s[0].size)
    ds = np.linalg.norm(boundary.derivative(at, s.ravel()), axis=1) * boundary.measure(
        at, s.ravel()
    )
    sizes = width * (ds.reshape(s.shape) @ w)
    whole = closed[:, :-1] & closed[:, 1:]
    alone = (closed[:, :-1] & (line.rows[:, 1:] < 0)) | (closed[:, 1:] & (line.rows[:, :-1] < 0))
    half = 0.5 * float(sizes[alone].sum())
    area, error = float(sizes[whole].sum()) + half, half
    if len(ends.position):
        measure = boundary.model.measure(ends.position)
        area += float((ends.beyond * measure).sum())
        error += float((np.array(_errors_of_ends(pair, boundary)) * measure).sum())
    return max(area, 0.0), error + float((sizes.sum(axis=1) * _bent(boundary, line.segments)).sum())


def _bent(boundary: BoundaryTrace, segments: Index) -> Array:
    """Relative errors (k,) of the lengths of curved segments, by the turn of their normals."""
    ends = [boundary.exact_normal(segments, np.full(len(segments), s)) for s in (0.0, 1.0)]
    half = np.linalg.norm(ends[1] - ends[0], axis=1) / 2
    return np.asarray(half ** (2 * boundary.geometry_order) / 6)
