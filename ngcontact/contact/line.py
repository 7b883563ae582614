"""Contact points C_j on Gamma_K: directions, partners, gaps eps(C_j), weights.

HH81 (2.3), (2.5): on a bounded zone the direction is the outward normal of the secondary body
and a corner of the contact line carries two points, one per side. HH81 (2.10): on an enlarging
zone the direction is the fixed xi.

Both rows of a corner hold at one node. When it touches the corner, its force splits between the two
normals, and where these are nearly parallel the split is no measure of the pressure: a part of the
force across the corner weighs 1 / turn in it, and one of the two rows may even be open.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import accumulate, pairwise
from typing import ClassVar, TypeVar

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, across, from_triplets, rows_of
from ..fem import BoundaryTrace
from ..lagrange import gauss, lagrange
from ..problem import Contact
from .projection import Partners, cast, coincident, none_met, snap

FACING_COSINE = 1e-8  # cosine between normal and direction from which a point faces the other body
SIDE_DIFFERENCE = 0.05  # relative difference of two sides from which their roles are not alike
GAP_ROUND_OFF = 4 * np.finfo(float).eps  # round-off of a measured gap, relative to the coordinates


@dataclass(frozen=True, eq=False)
class ContactLine:
    """The secondary side of one pair and its m contact points."""

    by_segment: ClassVar[tuple[str, ...]] = ("segments", "rows", "faces", "shares", "covered")
    contact: Contact
    segments: Index  # (k,) segments of the secondary boundary
    facing: Index  # (q,) segments of the primary boundary
    rows: Index  # (k, order + 1) contact point at each node of each segment, -1 where none is
    faces: Mask  # (k,) segments that face the primary with all their nodes
    node: Index  # (m,) node of the secondary
    position: Array  # (m, 2)
    direction: Array  # (m, 2) unit vectors towards the facing body
    gap: Array  # (m,) distance eps(C_j) along the direction before deformation
    weight: Array  # (m,) integral of the basis function over s or eta, one-sided at corners
    partner: Index  # (m,) segment of the primary, -1 for a rigid obstacle
    partner_s: Array  # (m,) parameter on it
    coupling: sp.csr_array  # (m, n) weights of the n nodes in the displacement that faces points
    on_axis: Mask  # (m,) points on the axis of a body of revolution
    means: Mask  # (m,) points whose row is a mean over facing segments, not one at the node
    shares: Array  # (k, order + 1) what each whole segment adds to the weights of its points
    covered: Array  # (k, order + 1) what its part that faces the primary adds to them
    searches: int  # 1 if partners had to be searched, 0 if all are nodes at the same place

    @property
    def dim(self) -> int:
        """Dimension of the bodies."""
        return 2

    def pressure(self, force: Array) -> Array:
        """Pressures (m,) of the `force` (m,) at its points: (3.10), (3.10')."""
        return np.asarray(force / self.weight)


Values = TypeVar("Values", Array, Mask)
Line = TypeVar("Line", bound=ContactLine)


def by_line(lines: Sequence[ContactLine], values: Values) -> list[Values]:
    """Parts (m_i,) of `values` (m,) over the points of all lines in order, one for each line."""
    stops = list(accumulate((len(line.node) for line in lines), initial=0))
    return [values[first:last] for first, last in pairwise(stops)]


def twins(line: ContactLine) -> Index:
    """Pairs (t, 2) of contact points that share a node."""
    order = np.argsort(line.node, kind="stable")
    node = line.node[order]
    same = np.flatnonzero(node[1:] == node[:-1])
    return np.column_stack([order[same], order[same + 1]])


def in_contact(line: ContactLine, active: Mask) -> Mask:
    """Points in contact (m,): the `active` (m,) and open ones at corners inside the contact.

    The node touches the other side of the corner, and the next point on this side is active: one
    of the two rows is released where the node would rather slide off the corner.
    """
    state = active.copy()
    corners = twins(line)
    for i in corners[active[corners].sum(axis=1) == 1].ravel():
        if not active[i]:
            first, last = line.rows[:, :-1], line.rows[:, 1:]
            next_to = np.concatenate([last[first == i], first[last == i]])
            state[i] = (next_to >= 0).all() and active[next_to].all()
    return state


def rays(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """Unit vectors (k, 2) to the primary from points at `s` (k,) of segments `segment` (k,)."""
    if contact.direction is None:
        return trace.exact_normal(segment, s)
    return np.tile(contact.direction, (len(s), 1))


def partners(
    trace: BoundaryTrace,
    facing: Index,
    own: Index,
    points: Array,
    directions: Array,
    *,
    nodes: bool = True,
) -> Partners:
    """Points of segments `facing` (q,) opposite to `points` (k, 2): A_j and B_j of HH81 (2.10).

    The points lie on the segments `own` (k,); `directions` (k, 2) are unit vectors towards the
    facing body. Some `nodes` may lie at others. None is met on a rigid obstacle.
    """
    curve, side = trace.curve[facing], trace.side[facing]
    found = none_met(len(points))
    if facing.size == 0:
        return found
    if nodes:
        found = coincident(points, directions, curve, side, trace.places(facing))
    rest = np.flatnonzero(found.segment < 0)
    if rest.size:
        other = cast(points[rest], directions[rest], curve, side)
        own, points_, along = own[rest], points[rest], directions[rest]
        # Overlap puts a partner behind the point, inside the own body; one that the backward ray
        # meets only after it has left that body belongs to a far side.
        behind = (other.segment >= 0) & (other.distance < 0)
        for body in np.unique(trace.body[own[behind]]):
            here = np.flatnonzero(behind & (trace.body[own] == body))
            rim = np.flatnonzero(trace.body == body)
            out = cast(points_[here], -along[here], trace.curve[rim], -trace.side[rim], ahead=True)
            beyond = (out.segment >= 0) & (-other.distance[here] > out.distance)
            other.segment[here[beyond]] = -1
        found.segment[rest], found.s[rest] = other.segment, other.s
        found.distance[rest] = other.distance
    # Points that only round-off keeps apart touch: no load is too small to be felt.
    found.distance[np.abs(found.distance) <= GAP_ROUND_OFF * np.abs(points).max(initial=0.0)] = 0.0
    segment = np.where(found.segment < 0, -1, facing[found.segment])
    return replace(found, segment=segment, searched=rest.size > 0)


def no_point_faces(contact: Contact) -> str:
    """Message for a pair of which no point faces."""
    along = (
        "along its outward normals: choose boundaries that look at each other, or give the "
        "direction from the secondary body to the primary one"
    )
    if contact.direction is not None:
        xi = ", ".join(f"{x:.6g}" for x in contact.direction)
        along = (
            f"along direction=({xi}): the direction points from the secondary body to the primary "
            "one"
        )
    return (
        f'no point of the secondary "{contact.secondary}" faces the primary '
        f'"{contact.primary}" {along}'
    )


def prescribed_gap(
    contact: Contact, trace: BoundaryTrace, segment: Index, s: Array, position: Array
) -> Array:
    """Values (k,) of `Contact.gap`, lengths, at points of the secondary.

    They lie at `s` (k,) of segments `segment` (k,), which is `position` (k, 2).
    """
    if isinstance(contact.gap, ng.CoefficientFunction):
        return trace.evaluate(contact.gap, segment, s)[:, 0]
    if callable(contact.gap):
        return np.asarray(contact.gap(*position.T), dtype=float)
    return np.full(len(s), contact.gap, dtype=float)


def jacobian(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """Arc length (P1) or eta (P2) per s, (k,), at `s` (k,) of segments `segment` (k,).

    Times the measure of the model.
    """
    derivative, measure = trace.derivative(segment, s), trace.measure(segment, s)
    if contact.direction is None:
        return np.linalg.norm(derivative, axis=1) * measure
    return np.abs(derivative @ across(np.array(contact.direction))) * measure


def segment_weights(trace: BoundaryTrace, contact: Contact, segments: Index) -> Array:
    """Integrals (k, order + 1) of the basis functions over each of the `segments` (k,)."""
    s, w = gauss(trace.order + 2 * trace.geometry_order)
    k = len(segments)
    scale = jacobian(trace, contact, np.repeat(segments, len(s)), np.tile(s, k)).reshape(k, len(s))
    weights = (scale * w) @ lagrange(trace.order, s)
    for end in (-1, 1):  # nodes of their own
        at = trace.axis[segments] == end
        weights[at] = (scale[at] * w) @ lagrange(trace.order, s, end)
    return weights


def _coupling(trace: BoundaryTrace, partner: Index, partner_s: Array) -> sp.csr_array:
    """Basis functions (m, n) of the facing nodes at the partner points; none of an obstacle."""
    if (partner < 0).all():
        return sp.csr_array((len(partner), trace.space.ndof))
    share = trace.shapes(partner, snap(partner_s, trace.places(partner)))
    share[partner < 0] = 0.0
    row, place = np.nonzero(share)
    facing = trace.nodes[partner[row], place]
    return from_triplets(share[row, place], row, facing, (len(share), trace.space.ndof))


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
        number = np.full(len(node), -1)
        xi = np.tile(np.array(contact.direction), (len(node), 1))
        faces = (normal * xi).sum(axis=1) > FACING_COSINE
        number[faces], direction = trace.number_points(segment[faces], node[faces], xi[faces])
    rows = number.reshape(len(segments), trace.order + 1)
    _, first = np.unique(number, return_index=True)
    first = first[len(first) - len(direction) :]  # without -1
    position, at_end = trace.point(segment[first], s[first]), np.isin(s[first], (0.0, 1.0))
    found = partners(trace, facing, segment[first], position, direction)
    facing_points, gap = (found.segment >= 0) | (contact.primary is None), found.distance
    if contact.gap is not None:
        gap = prescribed_gap(contact, trace, segment[first], s[first], position)
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
        partner_s=found.s,
        coupling=_coupling(trace, found.segment, found.s),
        on_axis=np.where(s[first] < 0.5, -1, 1) * trace.axis[segment[first]] * at_end == 1,
        means=np.zeros(len(first), dtype=bool),
        shares=shares,
        covered=shares,
        searches=int(found.searched),
    )
    return line, facing_points


def without(line: Line, dropped: Index) -> Line:
    """The line without its points `dropped` (j,); the segments still face the primary."""
    if dropped.size == 0:
        return line
    m = len(line.node)
    keep = np.ones(m, dtype=bool)
    keep[dropped] = False
    renumber = np.full(m + 1, -1)
    renumber[:-1][keep] = np.arange(np.count_nonzero(keep))
    names = ("node", "position", "direction", "gap", "weight", "partner", "partner_s")
    kept = rows_of(line, keep, *names, "coupling", "on_axis", "means")
    return replace(kept, rows=renumber[line.rows])


def with_roles(trace: BoundaryTrace, contact: Contact) -> Contact:
    """The pair with `roles` decided: the covered side is secondary, else the finer, else convex."""
    if contact.roles == "given" or contact.primary is None:
        return contact

    def covered(pair: Contact) -> float:
        """Share of the secondary's length that faces the primary, by segments that wholly do."""
        line, _ = nodal_line(trace, pair)
        length = trace.lengths(line.segments)
        return float(length[line.faces].sum() / length.sum())

    def length(pair: Contact) -> float:
        return float(trace.lengths(trace.segments(pair.secondary)).mean())

    def bulge(pair: Contact) -> float:
        """Distance of the middles of segments from their chords, outwards, relative."""
        segments = trace.segments(pair.secondary)
        normal = trace.exact_normal(*trace.at_nodes(segments)).reshape(len(segments), -1, 2)
        along = trace.curve[segments, -1] - trace.curve[segments, 0]
        turn = ((normal[:, -1] - normal[:, 0]) * along).sum(axis=1)
        return float(turn.sum() / trace.lengths(segments).sum())

    one, other = replace(contact, roles="given"), replace(contact, roles="given").swapped()
    a, b = covered(one), covered(other)
    if abs(a - b) > SIDE_DIFFERENCE:
        return one if a > b else other
    a, b = length(one), length(other)
    if abs(a - b) > SIDE_DIFFERENCE * max(a, b):
        return one if a < b else other
    return other if bulge(other) > bulge(one) + SIDE_DIFFERENCE else one
