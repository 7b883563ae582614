"""Residuals on Gamma_K: parts of segments that face, points opposite, tractions, gaps."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from ..arrays import Array, Index, Mask, across, chords, joined, rows_of
from ..contact import (
    FACING_COSINE,
    GAP_ROUND_OFF,
    ContactLine,
    ContactState,
    FacingPieces,
    facing_pieces,
    interpolated_rays,
    jacobian,
    opposite,
    prescribed_gap,
    rays,
)
from ..fem import BoundaryTrace
from ..lagrange import gauss_lobatto, lagrange, lagrange_derivative
from ..problem import Contact
from ..reference import triangle
from .terms import (
    DATA_BONUS,
    BoundaryPoints,
    BoundaryResidual,
    BoundaryTerms,
    Parts,
    PressureShare,
    ScaledSolution,
    Squares,
)

# Last step of Newton's method for a parameter: the next one would be its square.
NEWTON_TOLERANCE = 1e-8
SLIVER = 1e-9  # share of a segment below which a part of it is none
# Cosine of directions from which points of two pairs at a node are one.
SAME_DIRECTION_COSINE = 1 - 1e-6
GAP_NOISE = 4e-15  # of a gap, relative to the displacement and, where it is measured, to positions
# |w| |d_s w| over the largest w^2; 1 at least, 1.2 to 1.7 of hats, Gauss's, parabolas.
BUMP_FACTOR = 2.0
# Parts of a line by which gaps that are functions are integrated: of 60 waves each has four.
GAP_PIECES = 256


def covered_parts(boundary: BoundaryTrace, zone: Zone, pieces: FacingPieces, whole: Mask) -> Parts:
    """Parts of both bodies that face each other, two a piece; of the `whole` (r,) all of both."""
    own = Parts(zone.segments[pieces.local], pieces.start, pieces.stop)
    if zone.contact.primary is None:
        return own
    low, high = np.zeros(len(whole)), np.ones(len(whole))
    if not whole.all():
        rest = rows_of(pieces, ~whole)
        s = np.concatenate([rest.start, rest.stop])
        twice = joined([rest, rest])
        d, _ = zone.directions(twice.local, s)
        x = boundary.point(zone.segments[twice.local], s)
        t, _ = opposite(boundary, x, d, twice.facing, twice.opposite, NEWTON_TOLERANCE)
        inside = (s > 0) & (s < 1)  # where a vertex of the primary is passed
        ends = np.where(inside, np.round(t), t).reshape(2, -1)
        low[~whole], high[~whole] = np.sort(ends, axis=0)
    return joined([own, Parts(pieces.facing, low, high)])


def remaining(inner: Mask, covered: list[Parts]) -> Parts:
    """Parts of all segments that are not `inner` (q,) which `covered` leaves."""
    outer = np.flatnonzero(~inner)
    # Every segment as an interval [2 n, 2 n + 1] of one axis; an empty part at both of its ends.
    start, stop = np.repeat([[0.0], [1.0]], len(outer), axis=1)
    every = joined([*covered, Parts(outer, start, start), Parts(outer, stop, stop)])
    start, stop = 2 * every.segment + every.start, 2 * every.segment + every.stop
    order = np.lexsort((stop, start))
    reached = np.maximum.accumulate(stop[order])
    low, high, number = reached[:-1], start[order][1:], every.segment[order]
    left = (number[1:] == number[:-1]) & (high - low > SLIVER)
    number = number[1:][left]
    return Parts(number, low[left] - 2 * number, high[left] - 2 * number)


def as_fine_as_gap(
    boundary: BoundaryTrace, contact: Contact, segments: Index, pieces: FacingPieces
) -> FacingPieces:
    """Pieces of `segments` (k,) no longer than a `GAP_PIECES`-th of all, for gap functions."""
    if contact.gap is None or isinstance(contact.gap, float):
        return pieces
    size = boundary.lengths(segments)[pieces.local] * pieces.share
    count = np.ceil(GAP_PIECES * size / size.sum()).astype(np.intp)
    number, first = np.arange(len(count)).repeat(count), np.cumsum(count) - count
    share = (pieces.share / count)[number]
    start = pieces.start[number] + share * (np.arange(len(number)) - first[number])
    corners = np.stack([start, start + share], axis=1)
    return replace(rows_of(pieces, number), corners=corners, share=share)


def nodal_directions(boundary: BoundaryTrace, line: ContactLine) -> Array:
    """Unit directions d of contact (k, order + 1, 2) at the nodes of a line's segments.

    On a bounded zone those of the rows, whose interpolation is exact on circles, on other curves to
    the degree plus one.
    """
    if line.contact.direction is not None:
        return np.full((*line.rows.shape, 2), line.contact.direction)
    nodal = line.on_segments(line.direction, 0.0)
    # At ends of Gamma_K on Gamma_u and on parts that do not face there are no rows. At an axis
    # nodes are those of a rule with the weight r.
    without = (line.rows < 0) | (boundary.axis[line.segments] != 0)[:, None]
    if without.any():
        segment, at_node = boundary.at_places(line.segments, gauss_lobatto(boundary.order))
        here = without.ravel()
        nodal[without] = boundary.exact_normal(segment[here], at_node[here])
    return nodal


def between_nodes(nodal: Array, s: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 2) at `s` (k,), derivatives (k, 2), from `nodal` (k, order + 1, 2) ones."""
    degree = nodal.shape[1] - 1
    d = np.einsum("ki,kid->kd", lagrange(degree, s), nodal)
    slope = np.einsum("ki,kid->kd", lagrange_derivative(degree, s), nodal)
    size = np.linalg.norm(d, axis=1)[:, None]
    d, slope = d / size, slope / size
    return d, slope - d * (d * slope).sum(axis=1)[:, None]


@dataclass(frozen=True, eq=False)
class Zone:
    """The k segments of the secondaries of pairs of one kind, one pair after the other."""

    contact: Contact  # one of them: others differ in their boundaries and directions alone
    lines: list[ContactLine]
    segments: Index  # (k,)
    nodal: Array  # (k, order + 1, 2), directions of contact at the nodes
    pressure: Array  # (k, order + 1), pi_h at the nodes, NaN where no pair has a point
    active: Mask  # (k, order + 1), nodes in contact, and those where no pair has a point

    def directions(self, number: Index, s: Array) -> tuple[Array, Array]:
        """Unit directions d (j, 2) at `s` (j,) of the segments `number` (j,), their d/ds (j, 2)."""
        if self.contact.direction is not None:
            return self.nodal[number, 0], np.zeros((len(s), 2))
        return between_nodes(self.nodal[number], s)

    def pieces(self, boundary: BoundaryTrace) -> tuple[FacingPieces, Mask, FacingPieces]:
        """Parts that face the primary, whether (r,) they are whole segments, and as gaps ask."""
        found, last = [], 0
        for line in self.lines:
            first, last = last, last + len(line.segments)
            carrying = np.isfinite(self.pressure[first:last]).any(axis=1)  # points, of any pair
            carrying &= self.contact.primary is not None
            parts, count = facing_pieces(boundary, line, np.asarray(line.faces | carrying))
            parts = replace(parts, local=first + parts.local)
            fine = as_fine_as_gap(boundary, self.contact, self.segments, parts)
            found.append((parts, np.arange(len(parts.local)) < count, fine))
        every, whole, finer = zip(*found, strict=True)
        return joined(every), np.concatenate(whole), joined(finer)


@dataclass(frozen=True, eq=False)
class FacingPoints:
    """Points of quadrature on the parts of a zone that face the primary, k of them."""

    number: Index  # (k,), of their segments in the zone
    own: BoundaryPoints  # weights in arc length of the secondary (P1) or in eta (P2)
    facing: BoundaryPoints | None  # on the primary; none of a rigid obstacle
    direction: Array  # (k, 2), d
    distance: Array  # (k,), eps along d before deformation, a length
    # (2, k), arc length on the secondary and on the primary, per arc length of the secondary (P1)
    # or per eta (P2); about an axis areas per area
    stretch: Array


def facing_points(
    boundary: BoundaryTrace, zone: Zone, pieces: FacingPieces, order: int
) -> FacingPoints:
    """Gauss points of degree `order` on the pieces of a zone, and what is opposite to them."""
    parts = Parts(zone.segments[pieces.local], pieces.start, pieces.stop)
    part, own = parts.points(boundary, order)
    number, model, facing = pieces.local[part], boundary.model, None
    d, turning_rate = zone.directions(number, own.s)
    length = own.lengths(model)
    # Per eta along a fixed direction; where that is tangent to a curve d eta is 0.
    cosine = (own.normal * d).sum(axis=1) if zone.contact.direction is not None else np.ones(1)
    speed = length * np.maximum(np.abs(cosine), FACING_COSINE)
    own = replace(own, weight=own.weight * speed)
    stretch, distance = np.stack([length / speed, np.ones(len(speed))]), np.zeros(len(speed))
    if zone.contact.primary is not None:
        there, near = pieces.facing[part], pieces.opposite[part]
        s, distance = opposite(boundary, own.position, d, there, near, NEWTON_TOLERANCE)
        noise = GAP_ROUND_OFF * np.abs(own.position).max(initial=0.0)
        distance[np.abs(distance) <= noise] = 0.0
        facing = BoundaryPoints.at(boundary, there, s, own.weight)
        # Of (y(t) - x(s)) x d(s) = 0: dt / ds = (x' x d - (y - x) x d') / (y' x d).
        turning = np.abs((facing.slope * across(d)).sum(axis=1))
        turning = np.maximum(turning, FACING_COSINE * np.linalg.norm(facing.slope, axis=1))
        rate = (own.slope * across(d) - distance[:, None] * d * across(turning_rate)).sum(axis=1)
        stretch[1] = np.abs(rate) / turning * facing.lengths(model) / speed
    if zone.contact.gap is not None:
        distance = prescribed_gap(zone.contact, boundary, own.segment, own.s, own.position)
    return FacingPoints(number, own, facing, d, distance, stretch)


def closing_energy(
    solution: ScaledSolution,
    points: BoundaryPoints,
    stiffness: Array,
    w: Array,
    *,
    number: Index | None = None,
    or_more: bool = False,
) -> Array:
    """Energy (k,) of a displacement `w` (k,) of the boundary, without a unit: c |w|^2 h / l.

    The `stiffness` (k,) is c, a modulus over h; l is the element's diameter h, or where it is
    shorter the length |w| / |d_s w| in which w changes on the segment: |w| |d_s w| bounds the
    square of w in H^(1/2). Of a w that jumps it is infinite; where more than w does as well
    (`or_more`) it is at most that of a bump as high as w. A `number` (k,) tells segments apart that
    occur twice.
    """
    number, start = points.segment if number is None else number, np.ones(len(w), dtype=bool)
    start[1:] = number[1:] != number[:-1]
    change, apart = np.zeros((2, len(w)))  # from the point before on a segment
    change[1:] = np.diff(w) ** 2
    change[start] = 0.0
    if not change.any():
        return stiffness * w**2
    apart[1:] = chords(points.position)
    apart[start] = 0.0
    measure, first = solution.model.measure(points.position), np.flatnonzero(start)
    # Points coincide to round-off at a jump.
    steep = change / np.where(apart > 0, apart, np.inf) * measure
    sums = np.add.reduceat([steep, apart, points.weight * w**2], first, axis=1)
    rise, seen, square = np.where(sums > 0, sums, [[0.0], [np.inf], [np.inf]])
    segment = points.segment[first]
    h = solution.diameter[solution.boundary.element[segment]]
    times = h * np.sqrt(rise * solution.boundary.lengths(segment) / seen / square)
    if or_more:
        largest = np.maximum.reduceat(measure * w**2, first)
        times = np.minimum(times, BUMP_FACTOR * h * largest / square)
    return stiffness * w**2 * np.maximum(times, 1)[np.cumsum(start) - 1]


def on_contact(
    solution: ScaledSolution, pairs: Sequence[ContactState]
) -> tuple[BoundaryTerms, list[Parts]]:
    """Terms on both sides of all `pairs`, and the parts of the boundary that they cover."""
    boundary, kinds = solution.boundary, defaultdict[Any, list[ContactState]](list)
    for pair in pairs:
        c = pair.line.contact
        gap = id(c.gap) if callable(c.gap) else c.gap
        kinds[c.primary is None, c.direction is None, c.bilateral, gap].append(pair)
    terms, covered = BoundaryTerms(), list[Parts]()
    for group in kinds.values():
        lines = [pair.line for pair in group]
        of_lines = [
            (line.segments, nodal_directions(boundary, line), *at_nodes(boundary, pair, pairs))
            for pair, line in zip(group, lines, strict=True)
        ]
        arrays = map(np.concatenate, zip(*of_lines, strict=True))
        on_zone, parts = _on_zone(solution, Zone(lines[0].contact, lines, *arrays))
        terms += on_zone
        covered.append(parts)
    return terms, covered


def _on_zone(solution: ScaledSolution, zone: Zone) -> tuple[BoundaryTerms, Parts]:
    """Terms on both sides of a zone, and the parts of the boundary that it covers."""
    boundary, contact = solution.boundary, zone.contact
    pieces, whole, fine = zone.pieces(boundary)
    # Without contact a boundary is free, and may face several others.
    known = np.isfinite(zone.pressure)
    closed = (known & (zone.active | (zone.pressure != 0))).any(axis=1)
    held = closed[pieces.local]
    covered = covered_parts(boundary, zone, rows_of(pieces, held), whole[held])
    if len(pieces.local) == 0:
        return [], covered
    points = facing_points(boundary, zone, fine, 2 * solution.order + DATA_BONUS)
    own, number = points.own, points.number
    nodal = _pressure_on_segments(zone.pressure, boundary.places(zone.segments))
    pressure = (boundary.shapes(own.segment, own.s) * nodal[number]).sum(axis=1) / solution.unit
    full, meets = np.asarray(zone.active.all(axis=1))[number], closed[number]
    sides = [_side(solution, points, own, pressure, meets, points.stretch[0])]
    if points.facing is not None:
        stretch = points.stretch[1]
        sides.append(_side(solution, points, points.facing, -pressure, meets, stretch))
    # An overlap of two bodies costs the energy of the softer one.
    stiffness = np.min([side.stiffness for side in sides], axis=0)
    opened, depth = _gap_squares(solution, contact, points, pressure, full, stiffness)
    terms: BoundaryTerms = _normal(sides, pressure, full, contact.bilateral)  # (3.10), (3.10')
    every, weight = np.arange(len(pressure)), own.weight / len(sides)
    for x in sides:  # (3.11), (3.11'): no friction
        share = PressureShare(every, x.points.segment, x.points.s, x.across[..., 1])
        terms += [
            BoundaryResidual("tangential", x.element, x.weight, x.across[..., 0], [share]),
            Squares("complementarity", x.element, weight * opened),
            Squares("penetration", x.element, weight * depth),
        ]
    return terms, covered


def at_nodes(
    boundary: BoundaryTrace, pair: ContactState, pairs: Sequence[ContactState]
) -> tuple[Array, Mask]:
    """Pressure and state of the points at the nodes of each segment of the secondary.

    Where the point is another pair's, as between two primaries, that one's. Of k segments the
    pressure (k, order + 1) is force over weight, NaN without a point, at an end of Gamma_K on
    Gamma_u; the state (k, order + 1) is whether it is in contact, without a point true.
    """
    line = pair.line
    pressure = line.on_segments(pair.pressure, np.nan)
    active = line.on_segments(pair.active, True)
    nodes = boundary.nodes[line.segments].ravel()
    without = nodes[np.isnan(pressure).ravel()]
    for other in pairs if without.size else ():
        if other is pair or not np.isin(other.line.node, without).any():
            continue
        missing = np.isnan(pressure).ravel()
        at = np.flatnonzero(missing & np.isin(nodes, other.line.node))
        segment, s = boundary.at_nodes(line.segments)
        d = rays(boundary, line.contact, segment[at], s[at])
        # At a corner the point whose direction is the nearer one.
        alike = np.where(nodes[at, None] == other.line.node, d @ other.line.direction.T, -1.0)
        same = alike.max(axis=1, initial=-1.0) > SAME_DIRECTION_COSINE
        best = alike[same].argmax(axis=1)
        pressure.ravel()[at[same]] = other.pressure[best]
        active.ravel()[at[same]] = other.active[best]
    return pressure, active


def _pressure_on_segments(values: Array, places: Array) -> Array:
    """Nodal values (k, order + 1) of pi_h on each segment of the secondary.

    From `values` at the nodes with the parameters `places` (k, order + 1); at a node without one,
    NaN, what the polynomial through the other nodes has there, 0 where there are none.
    """
    missing = np.isnan(values)
    values = np.where(missing, 0.0, values)
    for k in np.flatnonzero(missing.any(axis=1) & ~missing.all(axis=1)):
        known = ~missing[k]
        powers = np.vander(2 * places[k] - 1, known.sum())
        through = np.linalg.solve(powers[known], values[k, known])
        values[k, missing[k]] = powers[missing[k]] @ through
    return values


@dataclass(frozen=True, eq=False)
class _Side:
    """One body's tractions at the k points of a line, per unit of s (P1) or eta (P2).

    The last axis of tractions is sigma_h n, along d with pi_h, and that of a unit pressure.
    """

    points: BoundaryPoints
    element: Index  # (k,)
    weight: Array  # (k,), of squared tractions
    stiffness: Array  # (k,), of squared depths
    along: Array  # (k, 2)
    across: Array  # (k, 2, 2)


def _side(
    solution: ScaledSolution,
    faced: FacingPoints,
    points: BoundaryPoints,
    pressure: Array,
    meets: Mask,
    stretch: Array,
) -> _Side:
    """Tractions of one body, at its `points`, where segments meet the other: a mask `meets` (k,).

    The `pressure` (k,) is pi_h or -pi_h, the `stretch` (k,) that of the body's own arc length.
    """
    d, element = faced.direction, solution.boundary.element[points.segment]
    traction = solution.traction(points.segment, points.s, points.normal)
    t = np.stack([traction, points.normal], axis=2) * stretch[:, None, None]
    along = np.einsum("kij,ki->kj", t, d)
    across = t - d[:, :, None] * along[:, None, :]
    along[:, 0] += pressure
    return _Side(
        points=points,
        element=element,
        weight=solution.edge_weight[element] * points.weight * meets / stretch,
        stiffness=solution.rigidity[element] / solution.diameter[element],
        along=along,
        across=across,
    )


def _normal(sides: list[_Side], pressure: Array, full: Mask, bilateral: bool) -> BoundaryTerms:
    """The traction along d plus the positive part of pi_h; in contact half the jump.

    Any pressure that is not negative may stand for pi_h, by which the estimate compares both sides:
    where a segment is in contact with all its nodes (`full`) that is the mean of both tractions,
    and the difference counts for the stiffer body. `pressure` and `full` (k,) are at all points.
    """
    own, other = sides[0], sides[-1]
    tension = np.zeros_like(pressure) if bilateral else np.maximum(-pressure, 0)
    signs = (1, -1)[: len(sides)]
    if len(sides) == 1:
        full = np.zeros_like(full)
    elif not bilateral:
        full = full & (pressure + (other.along[:, 0] - own.along[:, 0]) / 2 >= 0)
    at, least = np.flatnonzero(full), np.min([side.weight for side in sides], axis=0)
    residuals: BoundaryTerms = []
    for side, faced, sign in zip(sides, sides[::-1], signs, strict=True):
        value = side.along.copy()
        value[:, 0] += sign * tension
        value[at] = side.along[at] / 2
        value[at, 0] += faced.along[at, 0] / 2
        here, there = side.points, faced.points
        shares = [
            PressureShare(at, there.segment[at], there.s[at], faced.along[at, 1:] / 2),
            PressureShare(np.arange(len(full)), here.segment, here.s, value[:, 1:]),
        ]
        weight = np.where(full, least, side.weight)
        residuals.append(BoundaryResidual("pressure", side.element, weight, value[:, :1], shares))
    return residuals


def _gap_squares(
    solution: ScaledSolution,
    contact: Contact,
    points: FacingPoints,
    pressure: Array,
    full: Mask,
    stiffness: Array,
) -> tuple[Array, Array]:
    """Squares (k,) of complementarity and penetration, per unit of s or eta, by the softer body."""
    boundary, own, facing = solution.boundary, points.own, points.facing
    u = boundary.evaluate(solution.displacement, own.segment, own.s)
    noise = np.full(len(u), GAP_NOISE * np.abs(u).max())
    if contact.gap is None:
        noise[points.distance != 0] += GAP_NOISE * np.abs(own.position).max()
    if facing is not None:
        u -= boundary.evaluate(solution.displacement, facing.segment, facing.s)
    gap = points.distance - (u * points.direction).sum(axis=1)
    gap[np.abs(gap) <= noise] = 0.0  # the estimate has its square root: 1e-8 of 1e-16
    gap /= solution.strain
    opening, depth = np.maximum(gap, 0), np.minimum(gap, 0)
    cost = partial(closing_energy, solution, own, stiffness, number=points.number)
    if contact.bilateral:  # Remark 3.3: apart is as wrong as overlapping, and any force is right
        return np.zeros_like(gap), cost(gap)
    closed = np.maximum(pressure, 0) * opening  # (3.12), (3.12')
    # (3.9), (3.9')
    return np.where(full, np.minimum(closed, cost(opening)), closed), cost(depth, or_more=True)


def discrete_pressure(trace: BoundaryTrace, pair: ContactState, local: Index, s: Array) -> Array:
    """The pressure (k,) that the forces stand for, at `s` (k, 3) of facets `local` (k,) of a zone.

    At order 2 linear through the middles of edges, with Bernstein's polynomials where vertices have
    rows, too.
    """
    value = pair.line.on_segments(pair.force / pair.line.weight, 0.0)
    if trace.order != 2:
        return np.asarray((triangle.lagrange(trace.order, s) * value[local]).sum(axis=1))
    linear = np.linalg.solve(triangle.nodes(2)[3:], value[:, 3:].T).T  # at the vertices
    has = pair.line.rows[:, :3] >= 0
    value[:, :3] = np.where(has, value[:, :3], linear)
    shapes = triangle.lagrange(2, s)
    quadratic = np.einsum("ki,ij,kj->k", shapes, triangle.bernstein(2), value[local])
    return np.where(has[local].any(axis=1), quadratic, (s * linear[local]).sum(axis=1))


def on_surfaces(solution: ScaledSolution, pair: ContactState) -> tuple[BoundaryTerms, Index]:
    """Terms of one pair of solids, and the facets (j,) of both bodies that face each other.

    Where all rows of a facet are active both bodies have one pressure, and half the jump of their
    tractions counts; elsewhere the difference from the discrete forces. Gaps count where they are
    negative, and where they are open under pressure.
    """
    trace, zone = solution.boundary, pair.line
    parts, _ = facing_pieces(trace, zone, np.asarray((zone.rows >= 0).any(axis=1)))
    places, w = triangle.gauss(2 * solution.order)
    each = rows_of(parts, np.arange(len(parts.local)).repeat(len(places)))
    local, facing = each.local, each.facing
    facet, s = zone.segments[local], parts.places(places)
    size, seen = trace.surface_element(facet, s), jacobian(trace, zone.contact, facet, s)
    weight = seen * (parts.share[:, None] * w).ravel()  # across a fixed direction
    d = interpolated_rays(trace, zone.contact, zone.segments, local, s)
    pi = discrete_pressure(trace, pair, local, s) / solution.unit
    active, has = zone.on_segments(pair.active, False), zone.rows >= 0
    full = np.asarray((active | ~has).all(axis=1) & has.any(axis=1))[local]
    u = trace.evaluate(solution.displacement, facet, s)
    own = solution.traction(facet, s, trace.normal(facet, s)) * (size / seen)[:, None]
    sides = [(trace.element[facet], own, 1.0)]
    x, distance, shared = trace.point(facet, s), np.zeros(len(pi)), np.zeros_like(full)
    if zone.contact.primary is not None:
        there, distance = opposite(trace, x, d, facing, each.opposite)
        met = np.isfinite(distance)
        weight, distance = weight * met, np.where(met, distance, 0.0)
        normal = trace.normal(facing, there)
        across = np.abs((normal * d).sum(axis=1))
        u = u - trace.evaluate(solution.displacement, facing, there)
        other = solution.traction(facing, there, normal) / across[:, None]
        sides.append((trace.element[facing], other, -1.0))
        shared = full
    if zone.contact.gap is not None:
        distance = prescribed_gap(zone.contact, trace, facet, s, x)
    gap = (distance - (u * d).sum(axis=1)) / solution.strain
    half_jump = sum((t * d).sum(axis=1) for _, t, _ in sides) / 2
    least = np.min([solution.edge_weight[e] for e, _, _ in sides], axis=0)
    stiff = np.min([solution.mu[e] / solution.diameter[e] for e, _, _ in sides], axis=0)
    closing, product = stiff * gap**2, np.maximum(pi, 0.0) * np.maximum(gap, 0.0) / 2
    product, depth = np.where(full, np.minimum(product, closing), product), closing * (gap < 0)
    if zone.contact.bilateral:
        depth, product = closing, np.zeros(len(gap))
    terms, share = BoundaryTerms(), weight / len(sides)
    for e, t, sign in sides:
        own_weight, along = solution.edge_weight[e], (t * d).sum(axis=1)
        values = np.where(shared, half_jump, sign * along + pi)[:, None]
        factor = np.where(shared, least, own_weight) * weight
        shear = t - along[:, None] * d
        terms += [
            BoundaryResidual("pressure", e, factor, values, []),
            BoundaryResidual("tangential", e, own_weight * weight, shear, []),
            Squares("penetration", e, depth * share),
            Squares("complementarity", e, product * share),
        ]
    covered = np.concatenate([zone.segments[parts.local], parts.facing[parts.facing >= 0]])
    return terms, covered
