"""Residuals on Gamma_K: parts of segments that face, points opposite, tractions, gaps."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from numpy.polynomial import Polynomial

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
    fine_parts,
)

# Last step of Newton's method for a parameter: the next one would be its square.
NEWTON_TOLERANCE = 1e-8
SLIVER = 1e-9  # share of a segment below which a part of it is none
# Cosine of directions from which points of two pairs at a node are one.
SAME_DIRECTION_COSINE = 1 - 1e-6
GAP_NOISE = 4e-15  # of a gap, relative to the displacement and, where it is measured, to positions
# |w| |d_s w| over the largest w^2; 1 at least, 1.2 to 1.7 of hats, Gauss's, parabolas.
BUMP_FACTOR = 2.0


def covered_parts(
    boundary: BoundaryTrace, line: ContactLine, pieces: FacingPieces, whole: int
) -> Parts:
    """Parts of both bodies that face each other, two a piece; the first `whole` are segments."""
    segment = line.segments[pieces.local]
    own = Parts(segment, pieces.start, pieces.stop)
    if line.contact.primary is None:
        return own
    low, high = np.zeros(len(segment)), np.ones(len(segment))
    if whole < len(segment):
        rest = rows_of(pieces, np.arange(whole, len(segment)))
        s = np.concatenate([rest.start, rest.stop])
        twice = joined([rest, rest])
        d, _ = directions(boundary, line, twice.local, s)
        x = boundary.point(line.segments[twice.local], s)
        t, _ = opposite(boundary, x, d, twice.facing, twice.opposite, NEWTON_TOLERANCE)
        inside = (s > 0) & (s < 1)  # where a vertex of the primary is passed
        ends = np.where(inside, np.round(t), t).reshape(2, -1)
        low[whole:], high[whole:] = np.sort(ends, axis=0)
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
    boundary: BoundaryTrace, line: ContactLine, pieces: FacingPieces
) -> FacingPieces:
    """Parts of the pieces, as of `fine_parts`, where the gap is a function."""
    if line.contact.gap is None or isinstance(line.contact.gap, float):
        return pieces
    size = boundary.lengths(line.segments)[pieces.local] * pieces.share
    number, start, length = fine_parts(size, np.ones(len(size), dtype=bool))
    pieces = rows_of(pieces, number)
    start, share = pieces.start + pieces.share * start, pieces.share * length
    return replace(pieces, corners=np.stack([start, start + share], axis=1), share=share)


def directions(
    boundary: BoundaryTrace, line: ContactLine, local: Index, s: Array
) -> tuple[Array, Array]:
    """Unit directions d of contact (k, 2), and their derivatives (k, 2) with respect to s.

    At `s` (k,) of the line's segments of the numbers `local` (k,). On a bounded zone those of the
    rows at the nodes, interpolated: exact on circles, on other curves to the degree plus one.
    """
    if line.contact.direction is not None:
        d = np.full((len(s), 2), line.contact.direction)
        return d, np.zeros_like(d)
    nodal = line.on_segments(line.direction, 0.0)
    # At ends of Gamma_K on Gamma_u and on parts that do not face there are no rows. At an axis
    # nodes are those of a rule with the weight r.
    without = (line.rows < 0) | (boundary.axis[line.segments] != 0)[:, None]
    if without.any():
        segment, at_node = boundary.at_places(line.segments, gauss_lobatto(boundary.order))
        here = without.ravel()
        nodal[without] = boundary.exact_normal(segment[here], at_node[here])
    return between_nodes(nodal[local], s)


def between_nodes(nodal: Array, s: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 2) at `s` (k,), derivatives (k, 2), from `nodal` (k, order + 1, 2) ones."""
    degree = nodal.shape[1] - 1
    d = np.einsum("ki,kid->kd", lagrange(degree, s), nodal)
    slope = np.einsum("ki,kid->kd", lagrange_derivative(degree, s), nodal)
    size = np.linalg.norm(d, axis=1)[:, None]
    d, slope = d / size, slope / size
    return d, slope - d * (d * slope).sum(axis=1)[:, None]


@dataclass(frozen=True, eq=False)
class FacingPoints:
    """Points of quadrature on the parts of a contact line that face the primary, k of them."""

    local: Index  # (k,), rows of `line.rows`
    own: BoundaryPoints  # weights in arc length of the secondary (P1) or in eta (P2)
    facing: BoundaryPoints  # on the primary; segments are -1 for a rigid obstacle
    direction: Array  # (k, 2), d
    distance: Array  # (k,), eps along d before deformation, a length
    # (2, k), arc length on the secondary and on the primary, per arc length of the secondary (P1)
    # or per eta (P2); about an axis areas per area
    stretch: Array


def facing_points(
    boundary: BoundaryTrace, line: ContactLine, pieces: FacingPieces, order: int
) -> FacingPoints:
    """Gauss points of degree `order` on the pieces of a line, and what is opposite to them."""
    parts = Parts(line.segments[pieces.local], pieces.start, pieces.stop)
    part, (segment, s, weight) = parts.points(order)
    local, facing = pieces.local[part], pieces.facing[part]
    d, turning_rate = directions(boundary, line, local, s)
    x, slope = boundary.point(segment, s), boundary.derivative(segment, s)
    length = np.linalg.norm(slope, axis=1) * boundary.measure(segment, s)
    # Where the direction is tangent to a curve d eta is 0.
    speed = np.maximum(jacobian(boundary, line.contact, segment, s), FACING_COSINE * length)
    weight, stretch = weight * speed, np.ones((2, len(s)))
    stretch[0] = length / speed
    if line.contact.primary is None:
        s_there, distance = np.zeros(len(s)), np.zeros(len(s))
    else:
        near = pieces.opposite[part]
        s_there, distance = opposite(boundary, x, d, facing, near, NEWTON_TOLERANCE)
        distance[np.abs(distance) <= GAP_ROUND_OFF * np.abs(x).max(initial=0.0)] = 0.0
        # Of (y(t) - x(s)) x d(s) = 0: dt / ds = (x' x d - (y - x) x d') / (y' x d).
        there = boundary.derivative(facing, s_there)
        turning, size = np.abs((there * across(d)).sum(axis=1)), np.linalg.norm(there, axis=1)
        turning = np.maximum(turning, FACING_COSINE * size)
        rate = (slope * across(d)).sum(axis=1) - distance * (d * across(turning_rate)).sum(axis=1)
        length = size * boundary.measure(facing, s_there)
        stretch[1] = np.abs(rate) / turning * length / speed
    if line.contact.gap is not None:
        distance = prescribed_gap(line.contact, boundary, segment, s, x)
    own, other = BoundaryPoints(segment, s, weight), BoundaryPoints(facing, s_there, weight)
    return FacingPoints(local, own, other, d, distance, stretch)


def closing_energy(
    solution: ScaledSolution,
    points: BoundaryPoints,
    stiffness: Array,
    w: Array,
    *,
    or_more: bool = False,
) -> Array:
    """Energy (k,) of a displacement `w` (k,) of the boundary, without a unit: c |w|^2 h / l.

    The `stiffness` (k,) is c, a modulus over h; l is the element's diameter h, or where it is
    shorter the length |w| / |d_s w| in which w changes on the segment: |w| |d_s w| bounds the
    square of w in H^(1/2). Of a w that jumps it is infinite; where more than w does as well
    (`or_more`) it is at most that of a bump as high as w.
    """
    segment, s, weight = points
    boundary = solution.boundary
    same = segment[1:] == segment[:-1]
    change = np.diff(w) ** 2 * same
    if not change.any():
        return stiffness * w**2
    size, position = len(boundary.region), boundary.point(segment, s)
    measure = solution.model.measure(position)
    apart = chords(position)
    # Points coincide to round-off at a jump.
    steep = np.divide(change, apart, out=np.zeros_like(change), where=apart > 0) * measure[1:]
    square = np.bincount(segment, weight * w**2, size)
    rise, seen = (np.bincount(segment[1:], x, size) for x in (steep, apart * same))
    whole = boundary.lengths(np.arange(size))
    sloping = rise * whole / np.where(seen > 0, seen, np.inf)
    h = solution.diameter[boundary.element]

    def over_square(values: Array) -> Array:
        return np.divide(values, square, out=np.zeros(size), where=square > 0)

    times = h * np.sqrt(over_square(sloping))
    if or_more:
        largest = np.zeros(size)
        np.maximum.at(largest, segment, measure * w**2)
        times = np.minimum(times, BUMP_FACTOR * h * over_square(largest))
    return stiffness * w**2 * np.maximum(times, 1)[segment]


def on_contact(
    solution: ScaledSolution, pair: ContactState, pairs: Sequence[ContactState]
) -> tuple[BoundaryTerms, Parts]:
    """Terms on both sides of one pair of all `pairs`, and the parts of the boundary they cover."""
    boundary, line = solution.boundary, pair.line
    nodal, active = at_nodes(boundary, pair, pairs)
    known = np.isfinite(nodal)
    carrying = known.any(axis=1) & (line.contact.primary is not None)  # points, of any pair
    pieces, whole = facing_pieces(boundary, line, np.asarray(line.faces | carrying))
    # Without contact a boundary is free, and may face several others.
    closed = (known & (active | (nodal != 0))).any(axis=1)
    held = closed[pieces.local]
    covered = covered_parts(boundary, line, rows_of(pieces, held), int(held[:whole].sum()))
    if len(pieces.local) == 0:
        return [], covered
    order, fine = 2 * solution.order + DATA_BONUS, as_fine_as_gap(boundary, line, pieces)
    points = facing_points(boundary, line, fine, order)
    nodal = _pressure_on_segments(nodal, boundary.places(line.segments))
    pressure = (boundary.shapes(*points.own[:2]) * nodal[points.local]).sum(axis=1) / solution.unit
    full = np.asarray(active.all(axis=1))[points.local]
    meets = closed[points.local]
    sides = [_side(solution, points, pressure, meets, own=True)]
    if line.contact.primary is not None:
        sides.append(_side(solution, points, -pressure, meets, own=False))
    # An overlap of two bodies costs the energy of the softer one.
    stiffness = np.min([side.stiffness for side in sides], axis=0)
    closed, depth = _gap_squares(solution, line, points, pressure, full, stiffness)
    terms: BoundaryTerms = _normal(sides, pressure, full, line.contact.bilateral)  # (3.10), (3.10')
    every, weight = np.arange(len(pressure)), points.own.weight / len(sides)
    for x in sides:  # (3.11), (3.11'): no friction
        share = PressureShare(every, x.points.segment, x.points.s, x.across[..., 1])
        terms += [
            BoundaryResidual("tangential", x.element, x.weight, x.across[..., 0], [share]),
            Squares("complementarity", x.element, weight * closed),
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
    nodes, (segment, s) = boundary.nodes[line.segments].ravel(), boundary.at_nodes(line.segments)
    for other in pairs if (line.rows < 0).any() else ():
        if other is pair:
            continue
        missing = np.isnan(pressure).ravel()
        at = np.flatnonzero(missing & np.isin(nodes, other.line.node))
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
        through = Polynomial.fit(places[k, known], values[k, known], known.sum() - 1)
        values[k, missing[k]] = through(places[k, missing[k]])
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
    solution: ScaledSolution, points: FacingPoints, pressure: Array, meets: Mask, *, own: bool
) -> _Side:
    """Tractions of one body where segments meet the other; `pressure` (k,) is pi_h or -pi_h."""
    boundary, d = solution.boundary, points.direction
    here = points.own if own else points.facing
    segment, s, weight = here
    stretch, element = points.stretch[0 if own else 1], boundary.element[segment]
    t = np.stack([solution.traction(segment, s), boundary.normal(segment, s)], axis=2)
    t *= stretch[:, None, None]
    along = np.einsum("kij,ki->kj", t, d)
    across = t - d[:, :, None] * along[:, None, :]
    along[:, 0] += pressure
    return _Side(
        points=here,
        element=element,
        weight=solution.edge_weight[element] * weight * meets / stretch,
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
        (segment, s, _), (there, s_there, _) = side.points, faced.points
        shares = [
            PressureShare(at, there[at], s_there[at], faced.along[at, 1:] / 2),
            PressureShare(np.arange(len(s)), segment, s, value[:, 1:]),
        ]
        weight = np.where(full, least, side.weight)
        residuals.append(BoundaryResidual("pressure", side.element, weight, value[:, :1], shares))
    return residuals


def _gap_squares(
    solution: ScaledSolution,
    line: ContactLine,
    points: FacingPoints,
    pressure: Array,
    full: Mask,
    stiffness: Array,
) -> tuple[Array, Array]:
    """Squares (k,) of complementarity and penetration, per unit of s or eta, by the softer body."""
    boundary, contact = solution.boundary, line.contact
    segment, s, _ = points.own
    u = boundary.evaluate(solution.displacement, segment, s)
    noise = np.full(len(s), GAP_NOISE * np.abs(u).max())
    if contact.gap is None:
        position = boundary.point(segment, s)
        noise[points.distance != 0] += GAP_NOISE * np.abs(position).max()
    if contact.primary is not None:
        u -= boundary.evaluate(solution.displacement, *points.facing[:2])
    gap = points.distance - (u * points.direction).sum(axis=1)
    gap[np.abs(gap) <= noise] = 0.0  # the estimate has its square root: 1e-8 of 1e-16
    gap /= solution.strain
    opening, depth = np.maximum(gap, 0), np.minimum(gap, 0)
    cost = partial(closing_energy, solution, points.own, stiffness)
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
    sides = [(trace.element[facet], solution.traction(facet, s) * (size / seen)[:, None], 1.0)]
    x, distance, shared = trace.point(facet, s), np.zeros(len(pi)), np.zeros_like(full)
    if zone.contact.primary is not None:
        there, distance = opposite(trace, x, d, facing, each.opposite)
        met = np.isfinite(distance)
        weight, distance = weight * met, np.where(met, distance, 0.0)
        across = np.abs((trace.normal(facing, there) * d).sum(axis=1))
        u = u - trace.evaluate(solution.displacement, facing, there)
        other = solution.traction(facing, there) / across[:, None]
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
