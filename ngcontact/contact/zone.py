"""Contact points of a pair of solids: as `contact.line` and `contact.dual` have them in the plane.

Rows stand at the nodes whose basis functions have a positive integral: all nodes at orders 1 and 3,
the middles of edges at order 2, where those of vertices vanish.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, from_triplets
from ..fem import BoundaryTrace, FacetTrace
from ..problem import Contact, MeshArrays
from ..reference import triangle
from .casting import cast, coincident, none_met, onto, snap
from .clipping import FacetPieces, pieces
from .dual import FacingMeans, contact_line, with_means
from .line import (
    FACING_COSINE,
    GAP_ROUND_OFF,
    SIDE_DIFFERENCE,
    ContactLine,
    no_point_faces,
    prescribed_gap,
    with_roles,
    without,
)
from .projection import MATCHING_DISTANCE, Partners

BASIS_ROUND_OFF = 1e-13  # of basis functions at nodes, which vanish there
SLIVER = 1e-9  # share of a facet, in all its facing parts, below which it faces nothing
WHOLE_SHARE = 1 - SLIVER  # ... and from which it faces wholly
LEAST_COVERED = 0.5  # of a node's weight on its whole facets, below which pressures are means
SMALLEST_SHARE = 1e-8  # of a node's weight on its whole facets, below which it carries no row


@dataclass(frozen=True, eq=False)
class ContactZone(ContactLine):
    """The secondary side of one pair of solids: facets for segments, surfaces for lines.

    Weights are areas, across a fixed direction as the direction sees them.
    """

    @property
    def dim(self) -> int:
        """Dimension of the bodies."""
        return 3

    def covered_shares(self, on_parts: Array, everywhere: Array) -> Array:
        """Integrals (k,) of functions over the parts that face, over those on whole facets.

        Of values `on_parts` (m,) and `everywhere` (m,) at the points; 0 at facets without points.
        The same values give 1 where nodes face nodes.
        """
        pairs = (self.covered, on_parts), (self.shares, everywhere)
        part, whole = ((x * np.append(v, 0.0)[self.rows]).sum(axis=1) for x, v in pairs)
        return np.asarray(np.divide(part, whole, out=np.zeros(len(part)), where=whole > 0))

    def pressure(self, force: Array) -> Array:
        """Pressures (m,) of the `force` (m,) at its points.

        Force over weight, except at points most of whose facets face nothing: there the force also
        carries the balance of moments of the points around, and force over weight is no pressure.
        These points get the mean over rings of facets around them, the smallest whose facing parts
        amount to half the area of the point's own facets.
        """
        pressure, (k, q) = np.asarray(force / self.weight), self.rows.shape
        on = self.rows >= 0
        facet, point = np.repeat(np.arange(k), q)[on.ravel()], self.rows[on]
        at = from_triplets(np.ones(len(point)), point, facet, (len(force), k))
        whole, covered = (
            np.bincount(point, x[on], len(force)) for x in (self.shares, self.covered)
        )
        beside = np.flatnonzero(covered < LEAST_COVERED * whole)
        area, total = (
            np.bincount(facet, x, k) for x in (self.covered[on], self.covered[on] * pressure[point])
        )
        enough, near = LEAST_COVERED * (at @ self.shares.sum(axis=1))[beside], at[beside]
        while beside.size:
            reached = near @ area
            pressure[beside] = (near @ total) / reached
            wider = near @ (at.T @ at)
            wider.data[:] = 1.0
            small = (reached < enough) & (np.diff(wider.indptr) > np.diff(near.indptr))
            beside, near, enough = beside[small], wider[small], enough[small]
        return pressure


def rays(trace: FacetTrace, contact: Contact, facet: Index, s: Array) -> Array:
    """Unit vectors (k, 3) to the primary from points at `s` (k, 3) of facets `facet` (k,)."""
    if contact.direction is None:
        return trace.exact_normal(facet, s)
    return np.tile(contact.direction, (len(facet), 1))


def partners(
    trace: FacetTrace,
    facing: Index,
    own: Index,
    points: Array,
    directions: Array,
) -> Partners:
    """Points of facets `facing` (q,) opposite to `points` (k, 3), which lie on facets `own` (k,).

    As in the plane: nodes at the same place first, the nearest along the `directions` (k, 3) then,
    except those behind the far side of the own body.
    """
    found = none_met(len(points))
    if facing.size == 0:
        return found
    surface, side = trace.curve[facing], trace.side[facing]
    found = coincident(points, directions, surface, side, triangle.nodes(trace.order))
    rest = np.flatnonzero(found.segment < 0)
    if rest.size:
        other = cast(points[rest], directions[rest], surface, side)
        behind = (other.segment >= 0) & (other.distance < 0)
        for body in np.unique(trace.body[own[rest[behind]]]):
            here = np.flatnonzero(behind & (trace.body[own[rest]] == body))
            rim = np.flatnonzero(trace.body == body)
            back = cast(
                points[rest[here]],
                -directions[rest[here]],
                trace.curve[rim],
                -trace.side[rim],
                ahead=True,
            )
            beyond = (back.segment >= 0) & (-other.distance[here] > back.distance)
            other.segment[here[beyond]] = -1
        found.segment[rest], found.s[rest] = other.segment, other.s
        found.distance[rest] = other.distance
    found.distance[np.abs(found.distance) <= GAP_ROUND_OFF * np.abs(points).max(initial=0.0)] = 0.0
    segment = np.where(found.segment < 0, -1, facing[found.segment])
    return replace(found, segment=segment, searched=rest.size > 0)


def measure(trace: FacetTrace, contact: Contact, facet: Index, s: Array) -> Array:
    """Area (k,) for a unit of the weights of `triangle.gauss`, at `s` (k, 3) of `facet` (k,)."""
    vectors = trace.area_vector(facet, s)
    if contact.direction is None:
        return np.linalg.norm(vectors, axis=1)
    return np.abs(vectors @ np.array(contact.direction))


def facet_weights(trace: FacetTrace, contact: Contact, facets: Index) -> Array:
    """Integrals (k, q) of the basis functions over each of the `facets` (k,).

    At order 2 those of the vertices are exactly 0.
    """
    s, w = triangle.gauss(trace.order + 2 * trace.geometry_order)
    k = len(facets)
    every, places = np.repeat(facets, len(s)), np.tile(s, (k, 1))
    scale = measure(trace, contact, every, places).reshape(k, len(s)) * w
    shapes = trace.shapes(every, places).reshape(k, len(s), -1)
    weights = np.einsum("kg,kgi->ki", scale, shapes)
    weights[~weighs(trace, facets)] = 0.0
    return weights


def weighs(trace: FacetTrace, facets: Index) -> Mask:
    """Nodes (k, q) of `facets` (k,) whose basis functions have a positive integral there."""
    nodes = trace.nodes[facets]
    carries = np.ones(nodes.shape, dtype=bool)
    if trace.order == 2:  # a vertex takes a share of edges with Bernstein coefficients
        carries[:, :3] = False
        if trace.bernstein.any():
            for (i, j), inner in zip(triangle.EDGES, triangle.edge_nodes(2), strict=True):
                chosen = trace.bernstein[nodes[:, inner[0]]]
                carries[:, [i, j]] |= chosen[:, None]
    return carries


def nodal_zone(
    trace: FacetTrace, contact: Contact, taken: Index | None = None
) -> tuple[ContactZone, Mask]:
    """Contact points of one pair at all nodes of its secondary, and which (m,) face the primary.

    All of them face a rigid obstacle. Facets `taken` (j,) are left to other pairs.
    """
    segments, facing = trace.segments(contact.secondary), trace.segments(contact.primary)
    if taken is not None:
        segments = np.setdiff1d(segments, taken)
    segment, s = trace.at_nodes(segments)
    node = trace.nodes[segments].ravel()
    normal = trace.exact_normal(segment, s)
    if contact.direction is None:
        number, direction = trace.number_points(segment, node, normal)
    else:
        number = np.full(len(node), -1)
        xi = np.tile(np.array(contact.direction), (len(node), 1))
        faces = (normal * xi).sum(axis=1) > FACING_COSINE
        number[faces], direction = trace.number_points(segment[faces], node[faces], xi[faces])
    rows = number.reshape(len(segments), -1)
    _, first = np.unique(number, return_index=True)
    first = first[len(first) - len(direction) :]  # without -1
    position = trace.point(segment[first], s[first])
    found = partners(trace, facing, segment[first], position, direction)
    facing_points, gap = (found.segment >= 0) | (contact.primary is None), found.distance
    if contact.gap is not None:
        gap = prescribed_gap(contact, trace, segment[first], s[first], position)
    shares = facet_weights(trace, contact, segments)
    if contact.direction is None:
        shares *= (normal * direction[number]).sum(axis=1).reshape(rows.shape)
    weight = np.zeros(len(first))
    met = np.append(facing_points, False)[rows]
    faces = met.all(axis=1)
    np.add.at(weight, rows[faces], shares[faces])
    partly = met & (np.append(weight, 1.0)[rows] == 0)
    np.add.at(weight, rows[partly], shares[partly])
    zone = ContactZone(
        contact=contact,
        segments=segments,
        facing=facing,
        rows=rows,
        faces=np.asarray(faces),
        node=node[first],
        position=position,
        direction=direction,
        gap=gap,  # eps(C_j) in (2.10)
        weight=weight,
        partner=found.segment,
        partner_s=found.s,
        coupling=_coupling(trace, found.segment, found.s),
        on_axis=np.zeros(len(first), dtype=bool),
        means=np.zeros(len(first), dtype=bool),
        shares=shares,
        covered=shares,
        searches=int(found.searched),
    )
    return zone, facing_points


def _coupling(trace: FacetTrace, partner: Index, place: Array) -> sp.csr_array:
    """Basis functions (m, n) of the facing nodes at the partner points; none of an obstacle."""
    met = np.flatnonzero(partner >= 0)
    place = snap(place[met], triangle.nodes(trace.order))
    share = trace.shapes(partner[met], place)
    row = np.repeat(met, share.shape[1])
    size = (len(partner), trace.space.ndof)
    coupling = from_triplets(share.ravel(), row, trace.nodes[partner[met]].ravel(), size)
    coupling.data[np.abs(coupling.data) < BASIS_ROUND_OFF] = 0.0
    coupling.eliminate_zeros()
    return coupling


def facing_pieces(
    trace: FacetTrace, contact: Contact, facets: Index, facing: Index, reach: Array
) -> FacetPieces:
    """Parts of `facets` (k,) that face one of the facets `facing` (q,) each.

    Without a direction, along the normal at the centroid, no further away than `reach` (k,).
    """
    d = rays(trace, contact, facets, np.tile(triangle.CENTRE, (len(facets), 1)))
    far = np.inf if contact.direction is not None else reach
    corners, other = trace.curve[facets][:, :3], trace.curve[facing][:, :3]
    outward = trace.side[facing, None, None] > 0
    other = np.where(outward, other, other[:, ::-1])  # anticlockwise from outside
    parts = pieces(corners, d, other, np.broadcast_to(far, (len(facets),)))
    faces = (trace.normal(facets, np.tile(triangle.CENTRE, (len(facets), 1))) * d).sum(axis=1)
    kept = faces[parts.local] > FACING_COSINE
    return FacetPieces(
        parts.local[kept], parts.corners[kept], parts.facing[kept], parts.share[kept]
    )


def _means(trace: FacetTrace, zone: ContactZone, facets: Index, parts: FacetPieces) -> FacingMeans:
    """The integrals of dual rows over the facing parts of `facets` (k,), by area.

    As in the plane; directions between the nodes are interpolated.
    """
    p, k, r, q = trace.order, len(facets), len(parts.local), trace.nodes.shape[1]
    points, weights = triangle.gauss(2 * p + 2 * (trace.geometry_order - 1))
    g = len(points)
    s = parts.places(points)
    local, facing = (np.repeat(x, g) for x in (parts.local, zone.facing[parts.facing]))
    facet, x = facets[local], trace.point(facets[local], s)
    w = measure(trace, zone.contact, facet, s).reshape(r, g) * parts.share[:, None] * weights
    d = interpolated_rays(trace, zone.contact, facets, local, s)
    there, eps = onto(x, d, trace.curve, facing)
    if zone.contact.gap is not None:
        eps = prescribed_gap(zone.contact, trace, facet, s, x)
    eps = eps.reshape(r, g)
    phi = trace.shapes(facet, s).reshape(r, g, q)
    phi_there = trace.shapes(facing, there).reshape(r, g, q)
    D, gap, mass = np.zeros((k, q)), np.zeros((k, q)), np.zeros((k, q, q))
    np.add.at(D, parts.local, np.einsum("rg,rgi->ri", w, phi))
    np.add.at(gap, parts.local, np.einsum("rg,rgi->ri", w * eps, phi))
    np.add.at(mass, parts.local, np.einsum("rg,rgi,rgj->rij", w, phi, phi))
    D[~weighs(trace, facets)] = 0.0
    covered = parts.covered(k)
    change = np.zeros_like(mass)
    faces = covered > SLIVER
    change[faces] = D[faces][:, :, None] * np.linalg.inv(mass[faces])
    blocks = change[parts.local] @ np.einsum("rg,rgi,rgj->rij", w, phi, phi_there)
    row = parts.local[:, None] * q + np.arange(q)
    column = trace.nodes[zone.facing[parts.facing]]
    row, column = np.broadcast_arrays(row[:, :, None], column[:, None, :])
    size = (k * q, trace.space.ndof)
    coupling = from_triplets(blocks.ravel(), row.ravel(), column.ravel(), size)
    return FacingMeans(D, np.einsum("kij,kj->ki", change, gap), coupling, covered > WHOLE_SHARE)


def matched_facets(trace: FacetTrace, zone: ContactZone) -> Mask:
    """Facets (k,) of the secondary whose three vertices face those of one facet of the primary."""
    vertex = np.full(len(zone.node) + 1, -1)
    met = np.flatnonzero(zone.partner >= 0)
    corner = snap(zone.partner_s[met], np.eye(3))
    at = (corner == 1.0).any(axis=1)
    vertex[met[at]] = trace.nodes[zone.partner[met[at]], corner[at].argmax(axis=1)]
    size = trace.mesh.nv
    met_vertices = np.sort(np.where(zone.rows[:, :3] < 0, -1, vertex[zone.rows[:, :3]]), axis=1)
    keys = [np.sort(trace.nodes[zone.facing, :3], axis=1), met_vertices]
    powers = size ** np.arange(3)
    one, other = (x @ powers for x in keys)
    return np.asarray((met_vertices[:, 0] >= 0) & np.isin(other, one))


def with_dual_rows(trace: FacetTrace, zone: ContactZone, facing: Mask) -> tuple[ContactZone, Mask]:
    """The zone with dual rows where nodes do not face nodes, and which points (m,) carry rows.

    As `dual.with_dual_rows` of a line; `facing` (m,) are the points that face the primary.
    """
    if len(zone.facing) == 0:
        return zone, facing
    matched = matched_facets(trace, zone) & (zone.contact.rows != "dual")
    if matched.all():
        return zone, facing
    facets = zone.segments[~matched]
    parts = facing_pieces(trace, zone.contact, facets, zone.facing, _reach(trace, zone)[~matched])
    whole = np.bincount(zone.rows.ravel() + 1, zone.shares.ravel(), len(facing) + 1)[1:]
    means = _means(trace, zone, facets, parts)
    zone, carries = with_means(trace, zone, facing, matched, means)
    # Slivers: their forces are less than the round-off of the others.
    return zone, carries & (zone.weight > SMALLEST_SHARE * whole)


def _reach(trace: FacetTrace, zone: ContactLine) -> Array:
    """Distance (k,) of what faces the nodes of each facet; the largest where none is known."""
    met = np.flatnonzero(zone.partner >= 0)
    apart = np.full(len(zone.node) + 1, -1.0)
    there = trace.point(zone.partner[met], zone.partner_s[met])
    apart[met] = np.linalg.norm(there - zone.position[met], axis=1)
    reach = apart[zone.rows].max(axis=1)
    return np.where(reach < 0, apart.max(initial=0.0), reach)


def with_zone_roles(trace: FacetTrace, contact: Contact) -> Contact:
    """The pair with `roles` decided, as `line.with_roles` does in the plane."""
    if contact.roles == "given" or contact.primary is None:
        return contact

    def covered(pair: Contact) -> float:
        """Share of the secondary's area that faces the primary, by facets that wholly do."""
        zone, _ = nodal_zone(trace, pair)
        area = trace.sizes(zone.segments)
        return float(area[zone.faces].sum() / area.sum())

    def length(pair: Contact) -> float:
        return float(trace.lengths(trace.segments(pair.secondary)).mean())

    def bulge(pair: Contact) -> float:
        """Slope of normals at vertices away from the middles of their facets, relative."""
        facets = trace.segments(pair.secondary)
        every, corners = np.repeat(facets, 3), np.tile(np.eye(3), (len(facets), 1))
        out = trace.point(every, corners).reshape(-1, 3, 3)
        out = (out - out.mean(axis=1, keepdims=True)).reshape(-1, 3)
        away = (trace.exact_normal(every, corners) * out).sum(axis=1)
        return float(away.mean() / trace.lengths(facets).mean())

    one, other = replace(contact, roles="given"), replace(contact, roles="given").swapped()
    a, b = covered(one), covered(other)
    if abs(a - b) > SIDE_DIFFERENCE:
        return one if a > b else other
    a, b = length(one), length(other)
    if abs(a - b) > SIDE_DIFFERENCE * max(a, b):
        return one if a < b else other
    return other if bulge(other) > bulge(one) + SIDE_DIFFERENCE else one


def decided(trace: BoundaryTrace, contact: Contact) -> Contact:
    """The pair with `roles` decided, in the plane and in space."""
    if isinstance(trace, FacetTrace):
        return with_zone_roles(trace, contact)
    return with_roles(trace, contact)


def contact_zone(trace: FacetTrace, contact: Contact, taken: Index | None = None) -> ContactZone:
    """Contact points of one pair of solids; facets `taken` (j,) belong to other pairs.

    Errors are those of `contact_line`.
    """
    contact = with_zone_roles(trace, contact)
    zone, facing = nodal_zone(trace, contact, taken)
    carries = np.zeros(len(facing) + 1, dtype=bool)
    carries[zone.rows[weighs(trace, zone.segments)]] = True
    carries = carries[:-1] & facing
    if contact.primary is not None and contact.rows != "nodal":
        zone, facing = with_dual_rows(trace, zone, facing)
        carries = np.where(zone.means, facing, carries)
    if len(zone.segments) and not facing.any():
        raise ValueError(no_point_faces(contact))
    return without(zone, np.flatnonzero(~carries))


def interpolated_rays(
    trace: FacetTrace, contact: Contact, facets: Index, local: Index, s: Array
) -> Array:
    """Unit vectors (k, 3) to the primary at `s` (k, 3) of `facets` (j,), by number `local` (k,).

    Between the nodes they are interpolated: a normal of CAD costs Newton's method.
    """
    at_nodes = rays(trace, contact, *trace.at_nodes(facets)).reshape(len(facets), -1, 3)
    d = np.einsum("ki,kid->kd", triangle.lagrange(trace.order, s), at_nodes[local])
    return np.asarray(d / np.linalg.norm(d, axis=1)[:, None])


def zone_pieces(trace: FacetTrace, zone: ContactZone) -> FacetPieces:
    """Parts of the facets of a zone, each of which faces one of the primary or an obstacle.

    Whole facets where the vertices of both are at the same places.
    """
    k = len(zone.segments)
    if zone.contact.primary is None:
        own = np.flatnonzero((zone.rows >= 0).any(axis=1))
        facing = np.zeros(len(own), dtype=np.intp)
    else:
        vertices = MeshArrays(trace.mesh).vertices
        ends = trace.nodes[zone.facing, :3]
        there = np.unique(ends)
        distance, near = cKDTree(vertices[there]).query(vertices[trace.nodes[zone.segments, :3]])
        close = (distance <= MATCHING_DISTANCE * trace.lengths(zone.segments)[:, None]).all(axis=1)
        powers = trace.mesh.nv ** np.arange(3)
        keys, wanted = (np.sort(x, axis=1) @ powers for x in (ends, there[near]))
        order = np.argsort(keys)
        found = order[np.minimum(np.searchsorted(keys, wanted, sorter=order), len(keys) - 1)]
        own = np.flatnonzero(close & (keys[found] == wanted))
        facing = found[own]
    whole = FacetPieces(own, np.tile(np.eye(3), (len(own), 1, 1)), facing, np.ones(len(own)))
    rest = np.setdiff1d(np.arange(k), own)
    if zone.contact.primary is None or not rest.size:
        return whole
    reach = _reach(trace, zone)[rest]
    parts = facing_pieces(trace, zone.contact, zone.segments[rest], zone.facing, reach)
    return FacetPieces(
        np.concatenate([whole.local, rest[parts.local]]),
        np.concatenate([whole.corners, parts.corners]),
        np.concatenate([whole.facing, parts.facing]),
        np.concatenate([whole.share, parts.share]),
    )


def for_partial_cover(trace: BoundaryTrace, contacts: Sequence[Contact]) -> BoundaryTrace:
    """The trace with Bernstein coefficients where facets of a secondary face their primary in part.

    There the integrals of the other functions may be negative, and without some of these rows the
    psi would not add up to 1. In the plane hat functions replace phi, in the rows alone.
    """
    if not isinstance(trace, FacetTrace) or trace.order == 1:
        return trace
    chosen = np.zeros(trace.space.ndof, dtype=bool)
    for contact in (with_zone_roles(trace, contact) for contact in contacts):
        facets, facing = trace.segments(contact.secondary), trace.segments(contact.primary)
        vertices, others = (np.unique(trace.nodes[x, :3]) for x in (facets, facing))
        if contact.rows == "nodal" or not others.size or _coincide(trace, vertices, others):
            continue
        reach = np.zeros(len(facets))
        if contact.direction is None:
            reach = _reach(trace, nodal_zone(trace, contact)[0])
        share = facing_pieces(trace, contact, facets, facing, reach).covered(len(facets))
        partly = (share > SLIVER) & (share < WHOLE_SHARE)
        chosen[trace.nodes[facets[partly], 3:]] = True
    return replace(trace, bernstein=chosen) if chosen.any() else trace


def _coincide(trace: FacetTrace, vertices: Index, others: Index) -> bool:
    """Whether all `vertices` (k,) lie at one of the `others` (q,)."""
    x = MeshArrays(trace.mesh).vertices
    distance, _ = cKDTree(x[others]).query(x[vertices])
    return bool(distance.max(initial=0.0) <= MATCHING_DISTANCE * np.ptp(x[vertices], axis=0).max())


def contact_points(
    trace: BoundaryTrace, contact: Contact, taken: Index | None = None
) -> ContactLine:
    """Contact points of one pair, on a line in the plane and on a surface in space.

    Segments or facets `taken` (j,) of its secondary belong to other pairs.
    """
    if isinstance(trace, FacetTrace):
        return contact_zone(trace, contact, taken)
    return contact_line(trace, contact, taken)
