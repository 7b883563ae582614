"""Quadrature points of a contact line: opposite points, gaps, and parts of segments that face."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...arrays import Array, Index, Mask
from ...contact import (
    FACING,
    MATCHED,
    TOUCHING,
    ContactLine,
    Pieces,
    at,
    crossings,
    divided,
    end_to_end,
    jacobian,
    prescribed_gap,
)
from ...fem import BoundaryTrace
from ...lagrange import gauss_lobatto, lagrange, lagrange_derivative
from ..terms import Parts

ARRIVED = 1e-8  # last step of Newton's method for a parameter: the next one would be its square
SLIVER = 1e-9  # share of a segment below which a part of it is none


def pieces_of(boundary: BoundaryTrace, line: ContactLine, carrying: Mask) -> tuple[Pieces, int]:
    """Parts of the secondary that face one segment of the primary each, or the obstacle.

    On segments that wholly face, and on those `carrying` (k,) contact points, of any pair. So many
    of them, the first ones, are whole segments whose ends face the ends of one.
    """
    if line.contact.primary is None:
        whole, facing = np.flatnonzero(line.faces), np.full(len(line.segments), -1)
    else:
        facing = _whole_segments(boundary, line, carrying)
        whole = np.flatnonzero(facing >= 0)
    ends = np.zeros(len(whole)), np.ones(len(whole))
    pieces = Pieces(whole, *ends, facing[whole], np.full(len(whole), 0.5))
    rest = np.flatnonzero((facing < 0) & (line.faces | carrying))
    if line.contact.primary is None or len(rest) == 0:
        return pieces, len(whole)
    parts = _parts(boundary, line, rest)
    both = Pieces(
        np.concatenate([pieces.local, rest[parts.local]]),
        np.concatenate([pieces.start, parts.start]),
        np.concatenate([pieces.stop, parts.stop]),
        np.concatenate([pieces.facing, parts.facing]),
        np.concatenate([pieces.opposite, parts.opposite]),
    )
    return both, len(whole)


def _whole_segments(boundary: BoundaryTrace, line: ContactLine, carrying: Mask) -> Index:
    """Segment of the primary whose ends the ends of each segment (k,) face, -1 where none.

    Ends without a point, as on Gamma_u, face the ends at the same place; they are looked at on
    segments `carrying` (k,) others.
    """
    faces = line.partner >= 0
    local, end = np.nonzero((line.rows[:, [0, -1]] < 0) & carrying[:, None])
    if len(local):
        segment = line.segments[local]
        x = boundary.curve[segment, -end]
        ends = boundary.curve[line.facing][:, [0, -1]].reshape(-1, 2)
        apart = np.linalg.norm(x[:, None] - ends, axis=2)
        nearest = apart.argmin(axis=1)
        rows = line.rows.copy()
        rows[local, -end] = len(faces) + np.arange(len(local))
        faces = np.append(faces, apart.min(axis=1) <= MATCHED * boundary.lengths(segment))
        partner = np.append(line.partner, line.facing[nearest // 2])
        partner_s = np.append(line.partner_s, nearest % 2)
        line = replace(line, rows=rows, partner=partner, partner_s=partner_s)
    return end_to_end(boundary, line, faces)


def _parts(boundary: BoundaryTrace, line: ContactLine, rest: Index) -> Pieces:
    """Pieces of the segments `rest` (j,), by their numbers there.

    Looked for beside the partners of their points; elsewhere where those do not cover them.
    """
    points, segments = line.rows[rest], line.segments[rest]
    ends = boundary.nodes[line.facing][:, [0, -1]]
    met = boundary.nodes[line.partner[points[points >= 0]]][:, [0, -1]]
    near = line.facing[np.isin(ends, met).any(axis=1)]
    if len(near):
        parts = divided(boundary, line.contact, segments, near)
        covered = np.bincount(parts.local, parts.stop - parts.start, len(rest))
        if (covered > 1 - SLIVER).all():
            return parts
    return divided(boundary, line.contact, segments, line.facing)


def covered_parts(boundary: BoundaryTrace, line: ContactLine, pieces: Pieces, whole: int) -> Parts:
    """Parts of both bodies' boundaries that face each other, two of every piece.

    The first `whole` ones are segments whose ends face the ends of another.
    """
    segment = line.segments[pieces.local]
    own = Parts(segment, pieces.start, pieces.stop)
    if line.contact.primary is None:
        return own
    low, high = np.zeros(len(segment)), np.ones(len(segment))
    rest = slice(whole, None)
    if whole < len(segment):
        s = np.concatenate([pieces.start[rest], pieces.stop[rest]])
        local, facing = np.tile(pieces.local[rest], 2), np.tile(pieces.facing[rest], 2)
        near = np.tile(pieces.opposite[rest], 2)
        d, _ = directions(boundary, line, local, s)
        t = opposite(boundary, boundary.point(line.segments[local], s), d, facing, near)
        inside = (s > 0) & (s < 1)  # where a vertex of the primary is passed
        ends = np.where(inside, np.round(t), t).reshape(2, -1)
        low[rest], high[rest] = np.sort(ends, axis=0)
    return Parts(
        np.concatenate([segment, pieces.facing]),
        np.concatenate([pieces.start, low]),
        np.concatenate([pieces.stop, high]),
    )


def remaining(inner: Mask, covered: list[Parts]) -> Parts:
    """What `covered` leaves of all segments that are not `inner` (q,)."""
    segment, start, stop = (
        np.concatenate([getattr(parts, name) for parts in covered] or [np.zeros(0)])
        for name in ("segment", "start", "stop")
    )
    outer = np.flatnonzero(~inner)
    # Every segment as an interval [2 n, 2 n + 1] of one axis; an empty part at both of its ends.
    both = np.concatenate([segment, outer, outer]).astype(np.intp)
    start = 2 * both + np.concatenate([start, np.zeros(len(outer)), np.ones(len(outer))])
    stop = 2 * both + np.concatenate([stop, np.zeros(len(outer)), np.ones(len(outer))])
    order = np.lexsort((stop, start))
    reached = np.maximum.accumulate(stop[order])
    low, high, number = reached[:-1], start[order][1:], both[order]
    left = (number[1:] == number[:-1]) & (high - low > SLIVER)
    number = number[1:][left]
    return Parts(number, low[left] - 2 * number, high[left] - 2 * number)


@dataclass(frozen=True, eq=False)
class FacingPoints:
    """Quadrature points on the parts of a contact line that face the primary, k of them.

    Attributes
    ----------
    local, segment : ndarray of int (k,)
        Row of `line.rows` and segment of the secondary.
    s : ndarray (k,)
        Parameter on it.
    weight : ndarray (k,)
        Of the quadrature in arc length (P1) or eta (P2).
    position, direction : ndarray (k, 2)
        The point, and d.
    facing : ndarray of int (k,)
        Segment of the primary, -1 for a rigid obstacle.
    facing_s : ndarray (k,)
        Parameter on it.
    distance : ndarray (k,)
        eps along d before deformation, a length.
    stretch : ndarray (2, k)
        Arc length on the secondary and on the primary, per arc length of the secondary (P1) or
        per eta (P2); about an axis areas per area.
    """

    local: Index
    segment: Index
    s: Array
    weight: Array
    position: Array
    direction: Array
    facing: Index
    facing_s: Array
    distance: Array
    stretch: Array


def directions(
    boundary: BoundaryTrace, line: ContactLine, local: Index, s: Array
) -> tuple[Array, Array]:
    """Directions of contact between nodes.

    On a bounded zone those of the rows at the nodes, interpolated: exact on circles, on other
    curves to the degree plus one.

    Parameters
    ----------
    boundary : BoundaryTrace
        The boundary.
    line : ContactLine
        Of any segments.
    local : ndarray of int (k,)
        Numbers of its segments.
    s : ndarray (k,)
        Parameters on them.

    Returns
    -------
    d, derivative : ndarray (k, 2)
        Unit vectors, and their derivatives with respect to s.
    """
    if line.contact.direction is not None:
        d = np.tile(line.contact.direction, (len(s), 1))
        return d, np.zeros_like(d)
    nodal = np.append(line.direction, np.zeros((1, 2)), axis=0)[line.rows]
    without = line.rows < 0  # ends of Gamma_K on Gamma_u; parts that do not face
    if without.any():
        segment, at_node = boundary.at_nodes(line.segments)
        here = without.ravel()
        nodal[without] = boundary.exact_normal(segment[here], at_node[here])
    for k in np.flatnonzero(boundary.axis[line.segments]):  # whose nodes are others
        s_here = gauss_lobatto(boundary.order)
        nodal[k] = boundary.exact_normal(np.full(len(s_here), line.segments[k]), s_here)
    return between_nodes(nodal[local], s)


def between_nodes(nodal: Array, s: Array) -> tuple[Array, Array]:
    """Unit vectors (k, 2) at `s` (k,), derivatives (k, 2), from `nodal` (k, order + 1, 2) ones."""
    degree = nodal.shape[1] - 1
    d = np.einsum("ki,kid->kd", lagrange(degree, s), nodal)
    slope = np.einsum("ki,kid->kd", lagrange_derivative(degree, s), nodal)
    size = np.linalg.norm(d, axis=1)[:, None]
    d, slope = d / size, slope / size
    return d, slope - d * (d * slope).sum(axis=1)[:, None]


def facing_points(
    boundary: BoundaryTrace, line: ContactLine, pieces: Pieces, order: int
) -> FacingPoints:
    """Gauss points of degree `order` on the pieces of a line, and what is opposite to them."""
    parts = Parts(line.segments[pieces.local], pieces.start, pieces.stop)
    part, segment, s, weight = parts.points(order)
    local, facing = pieces.local[part], pieces.facing[part]
    d, turn = directions(boundary, line, local, s)
    x, slope = boundary.point(segment, s), boundary.derivative(segment, s)
    speed = jacobian(boundary, line.contact, segment, s)
    length = np.linalg.norm(slope, axis=1) * boundary.measure(segment, s)
    along = speed <= FACING * length  # the direction touches a curve: nothing is per eta there
    weight, speed = weight * speed, np.where(along, length, speed)
    stretch = np.ones((2, len(s)))
    stretch[0] = length / speed
    if line.contact.primary is None:
        s_there, distance = np.zeros(len(s)), np.zeros(len(s))
    else:
        s_there = opposite(boundary, x, d, facing, pieces.opposite[part])
        offset = at(boundary.curve, facing, s_there) - x
        distance = (offset * d).sum(axis=1)
        distance[np.abs(distance) <= TOUCHING * np.abs(x).max(initial=0.0)] = 0.0
        # Of (y(t) - x(s)) x d(s) = 0: dt / ds = (x' x d - (y - x) x d') / (y' x d).
        there = boundary.derivative(facing, s_there)
        across, size = _cross(there, d), np.linalg.norm(there, axis=1)
        along |= np.abs(across) <= FACING * size
        across = np.where(along, size, across)
        rate = (_cross(slope, d) - _cross(offset, turn)) / across
        length = size * boundary.measure(facing, s_there)
        stretch[1] = np.abs(rate) * length / speed
    weight[along], stretch[:, along] = 0.0, 1.0
    if line.contact.gap is not None:
        distance = prescribed_gap(line.contact, boundary, segment, s, x)
    return FacingPoints(
        *(local, segment, s, weight, x, d),
        *(facing, s_there, distance, stretch),
    )


def _cross(a: Array, b: Array) -> Array:
    """A x b (k,) of vectors (k, 2)."""
    return a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]


def opposite(boundary: BoundaryTrace, x: Array, d: Array, facing: Index, near: Array) -> Array:
    """Parameters (k,) on segments `facing` (k,) on the rays from `x` (k, 2) along `d` (k, 2).

    Those that Newton's method reaches from `near` (k,).
    """
    across = np.column_stack([-d[:, 1], d[:, 0]])
    return crossings(x, across, boundary.curve, facing, near, ARRIVED)
