"""Contact points C_j on Gamma_K: directions, partners, gaps eps(C_j), weights.

HH81 (2.3), (2.5): on a bounded zone the direction is the outward normal of the secondary body
and a corner of the contact line carries two points, one per side. HH81 (2.10): on an enlarging
zone the direction is the fixed xi.

Both rows of a corner hold at one node. When it touches the corner, its force splits between the two
normals, and where these are nearly parallel the split is no measure of the pressure: a part of the
force across the corner weighs 1 / turn in it, and one of the two rows may even be open.
"""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, from_triplets
from ..fem import BoundaryTrace
from ..problem import Contact
from .facing import FACING_COSINE, partners, snapped
from .line import ContactLine

BASIS_ROUND_OFF = 1e-13  # of basis functions at nodes, which vanish there
SIDE_DIFFERENCE = 0.05  # relative difference of two sides from which their roles are not alike
# ... of slopes of normals: from segments as long as 1/20 of a radius on, a convex side is another.
BULGE_DIFFERENCE = 0.0125


def prescribed_gap(
    contact: Contact, trace: BoundaryTrace, segment: Index, s: Array, position: Array
) -> Array:
    """Values (k,) of `Contact.gap` at `s` (k,) of segments `segment` (k,), at `position` (k, d)."""
    if isinstance(contact.gap, ng.CoefficientFunction):
        return trace.evaluate(contact.gap, segment, s)[:, 0]
    if callable(contact.gap):
        return np.asarray(contact.gap(*position.T), dtype=float)
    return np.full(len(s), contact.gap, dtype=float)


def jacobian(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """Size (P1) or eta (P2) of the body per weight, (k,), at `s` (k,) of `segment` (k,)."""
    if contact.direction is None:
        return trace.surface_element(segment, s)
    return np.abs(trace.area_vector(segment, s) @ np.array(contact.direction))


def segment_weights(trace: BoundaryTrace, contact: Contact, segments: Index) -> Array:
    """Integrals (k, q) of the basis functions over `segments` (k,), exactly 0 but for `weighs`."""
    s, w = trace.rule(trace.order + 2 * trace.geometry_order)
    every, places = trace.at_places(segments, s)
    scale = jacobian(trace, contact, every, places).reshape(-1, 1, len(w)) * w
    shapes = trace.shapes(every, places).reshape(len(segments), len(w), trace.nodes.shape[1])
    return np.where(trace.weighs(segments), (scale @ shapes)[:, 0], 0.0)


def _coupling(trace: BoundaryTrace, partner: Index, partner_s: Array) -> sp.csr_array:
    """Basis functions (m, n) of the facing nodes at the partner points; none of an obstacle."""
    met = np.flatnonzero(partner >= 0)
    if met.size == 0:
        return sp.csr_array((len(partner), trace.space.ndof))
    share = trace.shapes(partner[met], partner_s[met])
    row, place = (np.abs(share) > BASIS_ROUND_OFF).nonzero()
    facing = trace.nodes[partner[met[row]], place]
    return from_triplets(share[row, place], met[row], facing, (len(partner), trace.space.ndof))


def nodal_line(
    trace: BoundaryTrace, contact: Contact, taken: Index | None = None
) -> tuple[ContactLine, Mask]:
    """Contact points of one pair at all nodes of its secondary, and which (m,) face the primary.

    All of them face a rigid obstacle. Segments `taken` (j,) are left to other pairs.
    """
    segments, facing = trace.segments(contact.secondary), trace.segments(contact.primary)
    if taken is not None:
        segments = np.setdiff1d(segments, taken)
    segment, s = trace.at_nodes(segments)
    node = trace.nodes[segments].ravel()
    normal = trace.exact_normal(segment, s)
    if contact.direction is None:
        number, direction = trace.number_points(segment, node, normal)  # n^i in (2.3), (2.5)
    else:  # (2.10): one point at a node that faces the other body
        number, xi = np.full(len(node), -1), np.full(normal.shape, contact.direction)
        faces = (normal * xi).sum(axis=1) > FACING_COSINE
        number[faces], direction = trace.number_points(segment[faces], node[faces], xi[faces])
    rows = number.reshape(len(segments), trace.nodes.shape[1])
    _, first = np.unique(number, return_index=True)
    first = first[len(first) - len(direction) :]  # without -1
    position = trace.point(segment[first], s[first])
    found = partners(trace, facing, segment[first], position, direction)
    facing_points, gap = (found.segment >= 0) | (contact.primary is None), found.distance
    if contact.gap is not None:
        gap = prescribed_gap(contact, trace, segment[first], s[first], position)
    partner_s = snapped(trace, found.segment, found.s)
    shares = segment_weights(trace, contact, segments)
    if contact.direction is None:  # their components, where two sides share a point
        shares *= (normal * direction[number]).sum(axis=1).reshape(rows.shape)
    weight = np.zeros(len(first))
    met = np.append(facing_points, False)[rows]
    faces = met.all(axis=1)
    np.add.at(weight, rows[faces], shares[faces])
    # Points all of whose segments face the primary in part take the weights of these.
    partly = met & (np.append(weight, 1.0)[rows] == 0)
    np.add.at(weight, rows[partly], shares[partly])
    line = ContactLine(
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
        partner_s=partner_s,
        coupling=_coupling(trace, found.segment, partner_s),
        on_axis=trace.model.on_axis(position),
        means=np.zeros(len(first), dtype=bool),
        shares=shares,
        covered=shares,
        searches=int(found.searched),
    )
    return line, facing_points


def with_roles(trace: BoundaryTrace, contact: Contact) -> Contact:
    """The pair with `roles` decided: the covered side is secondary, else the finer, else convex."""
    if contact.roles == "given" or contact.primary is None:
        return contact

    def covered(pair: Contact) -> float:
        """Share of the secondary that faces the primary, by segments that wholly do."""
        line, _ = nodal_line(trace, pair)
        size = trace.sizes(line.segments)
        return float(size[line.faces].sum() / size.sum())

    def length(pair: Contact) -> float:
        return float(trace.lengths(trace.segments(pair.secondary)).mean())

    def bulge(pair: Contact) -> float:
        """Slope of normals at vertices away from the middles of their segments, relative."""
        segments = trace.segments(pair.secondary)
        every, s = trace.at_places(segments, trace.vertices)
        x, normal = trace.point(every, s), trace.exact_normal(every, s)
        x = x.reshape(len(segments), len(trace.corners), trace.model.dim)
        out = (x - x.mean(axis=1, keepdims=True)).reshape(normal.shape)
        return float((normal * out).sum(axis=1).mean()) / length(pair)

    one, other = replace(contact, roles="given"), replace(contact, roles="given").swapped()
    a, b = covered(one), covered(other)
    if abs(a - b) > SIDE_DIFFERENCE:
        return one if a > b else other
    a, b = length(one), length(other)
    if abs(a - b) > SIDE_DIFFERENCE * max(a, b):
        return one if a < b else other
    return other if bulge(other) > bulge(one) + BULGE_DIFFERENCE else one
