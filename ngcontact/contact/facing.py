"""What faces a secondary: directions, points opposite to points, pieces of segments that face.

In the plane rays meet curves and segments are divided where they pass vertices of the primary
(`contact.projection`); in space rays meet surfaces and facets are clipped (`contact.surfaces`). All
else is the same.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, across, joined, places_of, rows_of
from ..fem import BoundaryTrace
from ..lagrange import at
from ..problem import Contact
from ..reference import triangle
from . import projection, surfaces
from .line import ContactLine
from .projection import MATCHING_DISTANCE, NEWTON_TOLERANCE, Partners, coincident, none_met

FACING_COSINE = 1e-8  # cosine between normal and direction from which a point faces the other body
SLIVER = 1e-9  # share of a segment below which a piece of it is none
RIM_PARTS = 4  # chords of a curved edge on the rim of a primary
WHOLE_SHARE = 1 - SLIVER  # ... of all its pieces, from which it faces wholly
GAP_ROUND_OFF = 4 * np.finfo(float).eps  # round-off of a measured gap, relative to the coordinates


def rays(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """Unit vectors (k, d) to the primary from points at `s` (k,) of segments `segment` (k,)."""
    if contact.direction is None:
        return trace.exact_normal(segment, s)
    return np.full((len(segment), trace.model.dim), contact.direction)


def interpolated_rays(
    trace: BoundaryTrace, contact: Contact, segments: Index, local: Index, s: Array
) -> Array:
    """Unit vectors (k, d) to the primary at `s` (k,) of `segments` (j,), by number `local` (k,).

    On facets they are interpolated between the nodes: a normal of CAD costs Newton's method.
    """
    if trace.model.dim == 2 or contact.direction is not None:
        return rays(trace, contact, segments[local], s)
    at_nodes = trace.exact_normal(*trace.at_nodes(segments)).reshape(len(segments), -1, 3)
    d = np.einsum("ki,kid->kd", triangle.lagrange(trace.order, s), at_nodes[local])
    return np.asarray(d / np.linalg.norm(d, axis=1)[:, None])


def partners(
    trace: BoundaryTrace,
    facing: Index,
    own: Index,
    points: Array,
    directions: Array,
    *,
    nodes: bool = True,
) -> Partners:
    """Points of segments `facing` (q,) opposite to `points` (k, d): A_j and B_j of HH81 (2.10).

    The points lie on the segments `own` (k,); `directions` (k, d) are unit vectors towards the
    facing body. Some `nodes` may lie at others. None is met on a rigid obstacle.
    """
    found = none_met(len(points), trace.vertices[0])
    if facing.size == 0:
        return found
    if nodes:
        segment, s = trace.at_nodes(facing)
        places, reach = trace.point(segment, s), MATCHING_DISTANCE * trace.lengths(segment)
        node = coincident(points, directions, places, trace.normal(segment, s), reach)
        same = np.flatnonzero(node >= 0)
        node = node[same]
        found.segment[same], found.s[same] = segment[node], s[node]
        found.distance[same] = ((places[node] - points[same]) * directions[same]).sum(axis=1)
    rest = np.flatnonzero(found.segment < 0)
    if rest.size:
        x, d = points[rest], directions[rest]
        cast = projection.cast if trace.model.dim == 2 else surfaces.cast
        other = cast(x, d, trace.curve[facing], trace.side[facing])
        # Overlap puts a partner behind the point, inside the own body; one that the backward ray
        # meets only after it has left that body belongs to a far side.
        behind = (other.segment >= 0) & (other.distance < 0)
        body = trace.body[own[rest]]
        for one in set(body[behind].tolist()):
            here = np.flatnonzero(behind & (body == one))
            rim = np.flatnonzero(trace.body == one)
            out = cast(x[here], -d[here], trace.curve[rim], -trace.side[rim], ahead=True)
            beyond = (out.segment >= 0) & (-other.distance[here] > out.distance)
            other.segment[here[beyond]] = -1
        found.segment[rest] = np.where(other.segment < 0, -1, facing[other.segment])
        found.s[rest], found.distance[rest] = other.s, other.distance
    # Points that only round-off keeps apart touch: no load is too small to be felt.
    found.distance[np.abs(found.distance) <= GAP_ROUND_OFF * np.abs(points).max(initial=0.0)] = 0.0
    return replace(found, searched=rest.size > 0)


def snapped(trace: BoundaryTrace, segment: Index, s: Array) -> Array:
    """Parameters `s` (k,) on segments `segment` (k,), of those that match nodes theirs: (k,)."""
    nodes, every = trace.places(segment), np.arange(len(segment))
    apart = np.abs(s[:, None] - nodes)
    if apart.ndim == 3:
        apart = apart.max(axis=2)
    nearest = apart.argmin(axis=1)
    match = apart[every, nearest] <= MATCHING_DISTANCE
    s = s.copy()
    s[match] = nodes[every[match], nearest[match]]
    return s


def opposite(
    trace: BoundaryTrace,
    points: Array,
    directions: Array,
    facing: Index,
    near: Array,
    settled: float = NEWTON_TOLERANCE,
) -> tuple[Array, Array]:
    """Parameters (k,) at which rays meet segments `facing` (k,) known to face, and distances (k,).

    Of `points` (k, d) along the `directions` (k, d), by Newton's method from `near` (k,); in the
    plane until no step is larger than `settled`. Rays may miss a curved facet whose plane they
    meet: the distance is NaN, the parameter that of `near`.
    """
    if trace.model.dim == 3:
        there, distance = surfaces.onto(points, directions, trace.curve, facing, near)
        lost = ~np.isfinite(np.column_stack([there, distance])).all(axis=1)
        there[lost], distance[lost] = near[lost], np.nan
        return there, distance
    s = projection.crossings(points, across(directions), trace.curve, facing, near, settled)
    return s, ((at(trace.curve, facing, s) - points) * directions).sum(axis=1)


@dataclass(frozen=True, eq=False)
class FacingPieces:
    """Parts of secondary segments or facets that face one of the primary each, r of them."""

    local: Index  # (r,) number of the segment among those divided
    # (r, 2) parameters of both ends, (r, 3, 3) barycentric coordinates of the corners of a triangle
    corners: Array
    facing: Index  # (r,) segment of the primary that it faces, -1 for a rigid obstacle
    opposite: Array  # (r,) parameter there near to what faces its middle
    share: Array  # (r,) of the segment, by parameter

    @property
    def start(self) -> Array:
        """Parameters (r,) at which the intervals begin."""
        return self.corners[:, 0]

    @property
    def stop(self) -> Array:
        """Parameters (r,) at which they end."""
        return self.corners[:, 1]

    def covered(self, count: int) -> Array:
        """Share (k,) of each of the segments, `count` of them, that faces the primary."""
        return np.asarray(np.bincount(self.local, self.share, count), dtype=float)

    def places(self, points: Array) -> Array:
        """Parameters (r * g,) on the segments of the `points` (g,) of a rule on each piece."""
        if self.corners.ndim == 3:
            return np.einsum("gi,rij->rgj", points, self.corners).reshape(-1, 3)
        return (self.start[:, None] + self.share[:, None] * points).ravel()


def divided(
    trace: BoundaryTrace,
    contact: Contact,
    segments: Index,
    facing: Index,
    reach: Array | None = None,
) -> FacingPieces:
    """Parts of `segments` (k,), which rise, that face one of `facing` (q,), all of the primary.

    Facets without a direction look along the normals in their middles, no further away than
    `reach` (k,), which is left out with one.
    """
    if trace.model.dim == 3:
        return _clipped(trace, contact, segments, facing, reach)
    pair = contact.primary, contact.direction
    if pair not in trace.pieces or not np.isin(segments, trace.pieces[pair][0]).all():
        trace.pieces[pair] = segments, _passed(trace, contact, segments, facing)
    known, pieces = trace.pieces[pair]
    number = np.full(len(known), -1)
    number[np.searchsorted(known, segments)] = np.arange(len(segments))
    local = number[pieces.local]
    return replace(rows_of(pieces, local >= 0), local=local[local >= 0])


def _passed(trace: BoundaryTrace, contact: Contact, segments: Index, facing: Index) -> FacingPieces:
    """Pieces of `segments` (k,) between the vertices that they pass, as of `divided`."""
    k, ends = len(segments), trace.nodes[facing][:, trace.corners]
    _, first = np.unique(ends, return_index=True)
    x = trace.curve[facing][:, [0, -1]].reshape(-1, 2)[first]
    xi = None if contact.direction is None else np.array(contact.direction)
    passing, s = projection.feet(x, trace.curve[segments], xi)
    local = np.concatenate([passing, np.arange(k), np.arange(k)])
    cut = np.concatenate([s, np.zeros(k), np.ones(k)])
    order = np.lexsort((cut, local))
    local, cut = local[order], cut[order]
    one = (local[1:] == local[:-1]) & (np.diff(cut) > SLIVER)
    local, corners = local[:-1][one], np.stack([cut[:-1][one], cut[1:][one]], axis=1)
    segment, middle = segments[local], corners.sum(axis=1) / 2
    d = rays(trace, contact, segment, middle)
    met = partners(trace, facing, segment, trace.point(segment, middle), d, nodes=False)
    on = (met.segment >= 0) & ((trace.normal(segment, middle) * d).sum(axis=1) > FACING_COSINE)
    share = corners[on, 1] - corners[on, 0]
    return FacingPieces(local[on], corners[on], met.segment[on], met.s[on], share)


def _clipped(
    trace: BoundaryTrace, contact: Contact, facets: Index, facing: Index, reach: Array | None
) -> FacingPieces:
    """Pieces of `facets` (k,) by clipping, as of `divided`."""
    middle = np.tile(triangle.CENTRE, (len(facets), 1))
    d = rays(trace, contact, facets, middle)
    far = np.full(len(facets), np.inf) if reach is None else reach
    faces = np.flatnonzero((trace.normal(facets, middle) * d).sum(axis=1) > FACING_COSINE)
    corners, (other, part) = trace.curve[facets[faces]][:, :3], _outlines(trace, facing)
    outward = trace.side[facing[part], None, None] > 0
    other = np.where(outward, other, other[:, ::-1])  # anticlockwise from outside
    local, parts, number = surfaces.pieces(corners, d[faces], other, far[faces])
    number = part[number]
    start, share = np.tile(triangle.CENTRE, (len(local), 1)), np.abs(np.linalg.det(parts))
    pieces = FacingPieces(faces[local], parts, facing[number], start, share)
    return rows_of(pieces, _seen(trace, facets, pieces, d[pieces.local], facing))


def _outlines(trace: BoundaryTrace, facing: Index) -> tuple[Array, Index]:
    """Triangles (t, 3, 3) in place of the facets `facing` (q,), and the numbers (t,) of these.

    Facets with a curved edge on the rim are fans around their middles, which follow it.
    """
    x, t = trace.curve[facing], np.arange(1, RIM_PARTS)[:, None] / RIM_PARTS
    i, j = triangle.EDGES.T
    a, b = x[:, i, None], x[:, j, None]
    places = np.eye(3)[i, None] * (1 - t) + np.eye(3)[j, None] * t
    shapes = triangle.lagrange(trace.geometry_order, places.reshape(-1, 3))
    inner = np.einsum("ki,qid->qkd", shapes, x).reshape(len(x), 3, -1, 3)
    chord = a * (1 - t) + b * t
    edges = np.sort(trace.nodes[facing][:, triangle.EDGES], axis=2).reshape(-1, 2)
    _, at, count = np.unique(edges, axis=0, return_inverse=True, return_counts=True)
    off = np.abs(inner - chord).max(axis=(2, 3))
    bent = (count[at].reshape(-1, 3) == 1) & (off > SLIVER * np.abs(b - a).max(axis=(2, 3)))
    points = np.concatenate([a, np.where(bent[..., None, None], inner, b), b], axis=2)
    middle = np.broadcast_to(x[:, None, None, :3].mean(axis=3), points[:, :, 1:].shape)
    some, whole = np.flatnonzero(bent.any(axis=1)), np.flatnonzero(~bent.any(axis=1))
    fans = np.stack([middle, points[:, :, :-1], points[:, :, 1:]], axis=3)[some]
    used = bent[some][..., None] | (np.arange(RIM_PARTS) == 0)  # of straight edges one chord
    number = np.repeat(some, used.sum(axis=(1, 2)))
    return np.concatenate([x[whole, :3], fans[used]]), np.append(whole, number)


def _seen(
    trace: BoundaryTrace, facets: Index, pieces: FacingPieces, d: Array, facing: Index
) -> Mask:
    """Pieces (r,) of `facets` (k,) that are not behind others or the own body.

    Of all of the facets `facing` (q,), along rays `d` (r, 3). Where all pieces of a facet make it
    up, none hides another.
    """
    own, other = facets[pieces.local], pieces.facing
    middles = trace.curve[:, trace.corners].mean(axis=1)
    ahead = ((middles[other] - middles[own]) * d).sum(axis=1) >= -SLIVER * trace.lengths(own)
    whole = np.abs(pieces.covered(len(facets)) - 1) <= SLIVER
    seen = np.asarray(whole[pieces.local] & ahead)
    asked = np.flatnonzero(~seen)
    x = trace.point(own[asked], pieces.corners[asked].mean(axis=1))
    first = partners(trace, facing, own[asked], x, d[asked], nodes=False).segment
    vertices = trace.nodes[:, trace.corners]
    beside = vertices[first][:, :, None] == vertices[other[asked]][:, None]  # itself, as a rule
    seen[asked] = (first >= 0) & beside.any(axis=(1, 2))
    return seen


def faced_vertices(trace: BoundaryTrace, line: ContactLine, facing: Mask) -> Index:
    """Vertices (m,) of the primary that points face, of those `facing` (m,) it; -1 where none."""
    vertex = np.full(len(facing), -1)
    for corner, place in zip(trace.corners, trace.vertices, strict=True):
        at = facing & (line.partner_s == place).reshape(len(facing), place.size).all(axis=1)
        vertex[at] = trace.nodes[line.partner[at], corner]
    return vertex


def opposite_segments(
    trace: BoundaryTrace, line: ContactLine, facing: Mask, some: Mask | None = None
) -> Index:
    """Segment of the primary whose vertices those of a segment face, (k,), -1 where none.

    `facing` (m,) are the points that face the primary. Vertices without a point, as on Gamma_u,
    face those at the same place, on `some` (k,) of the segments.
    """
    corners = line.rows_at(trace.nodes[line.segments])[:, trace.corners]
    vertices = np.append(faced_vertices(trace, line, facing), -1)[corners]
    sides, x = trace.nodes[line.facing][:, trace.corners], trace.arrays.vertices
    alone = (corners < 0) & (some is not None and some[:, None])
    if alone.any():
        local, there = alone.nonzero()[0], np.unique(sides)
        own = trace.nodes[line.segments][:, trace.corners][alone]
        distance, near = cKDTree(x[there]).query(x[own])
        close = distance <= MATCHING_DISTANCE * trace.lengths(line.segments[local])
        vertices[alone] = np.where(close, there[near], -1)
    found = places_of(trace.arrays.keys(vertices), trace.arrays.keys(sides))
    same = (vertices >= 0).all(axis=1) & (found >= 0)
    return np.where(same, line.facing[found], -1)


def distances(trace: BoundaryTrace, line: ContactLine) -> Array:
    """Distance (k,) of what faces nodes of segments, else the largest; inf along a direction."""
    if line.contact.direction is not None:
        return np.full(len(line.segments), np.inf)
    met = np.flatnonzero(line.partner >= 0)
    apart = np.full(len(line.node) + 1, -1.0)
    there = trace.point(line.partner[met], line.partner_s[met])
    apart[met] = np.linalg.norm(there - line.position[met], axis=1)
    reach = apart[line.rows].max(axis=1)
    return np.where(reach < 0, apart.max(initial=0.0), reach)


def facing_pieces(trace: BoundaryTrace, line: ContactLine, some: Mask) -> tuple[FacingPieces, int]:
    """Parts of `some` (k,) of the segments that face one of the primary each, or the obstacle.

    So many of them, the first ones, are whole segments whose vertices face those of one.
    """
    rigid = line.contact.primary is None
    facing = np.full(len(some), -1)
    if not rigid:
        facing = opposite_segments(trace, line, line.partner >= 0, some)
    whole = np.flatnonzero(some & ((facing >= 0) | rigid))
    count, vertices = len(whole), trace.vertices
    corners, middle = (x[None].repeat(count, axis=0) for x in (vertices, vertices.mean(axis=0)))
    pieces = FacingPieces(whole, corners, facing[whole], middle, np.ones(count))
    rest = np.flatnonzero(some & (facing < 0))
    if rigid or not len(rest):
        return pieces, count
    reach = distances(trace, line)[rest]
    parts = divided(trace, line.contact, line.segments[rest], line.facing, reach)
    return joined([pieces, replace(parts, local=rest[parts.local])]), count
