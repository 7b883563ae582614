"""How far surfaces in contact are inclined to the fixed direction of their pair.

Along a fixed direction xi the tangential part of the jump does not enter (2.10), and forces act
along xi. That is right to first order where one of the two surfaces lies across xi: points of the
other one, wherever they slide, meet the same line. Where both are inclined by an angle, as the two
sides of a groove are, forces that should act along the normals are wrong by its cosine.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Index, Mask
from ..contact import ContactState
from ..fem import BoundaryTrace
from ..lagrange import gauss_lobatto, lagrange_derivative

INCLINED = np.deg2rad(15)  # from which forces along the direction are wrong by 1 - cos = 3.4 %
TURN = np.cos(INCLINED / 2)  # mean of two unit normals at a vertex below which it is a corner


def _at_vertices(
    point: Index, at_end: Mask, normal: Array, xi: Array, count: int
) -> tuple[Array, Mask]:
    """Cosine (count,) of the normal nearest to `xi` at each point, and where the curve is smooth.

    `point` (k,) numbers those of the unit normals `normal` (k, 2), `at_end` (k,) tells which are
    one-sided at an end of a segment: at ends of the line and at corners no mean is a unit vector.
    """
    cosine, mean = np.full(count, -1.0), np.zeros((count, 2))
    np.maximum.at(cosine, point, normal @ xi)
    np.add.at(mean, point, np.where(at_end, 0.5, 1.0)[:, None] * normal)
    return cosine, np.linalg.norm(mean, axis=1) > TURN


def _of_secondary(trace: BoundaryTrace, state: ContactState, xi: Array) -> tuple[Array, Mask]:
    """Cosine (m,) of the secondary's normal at the points in contact, and where it is smooth."""
    line, m = state.line, len(state.active)
    touching = np.flatnonzero(np.append(state.active, False)[line.rows].any(axis=1))
    point = line.rows[touching].ravel()
    segment, s = trace.at_nodes(line.segments[touching])
    normal = trace.exact_normal(segment, s)
    has = point >= 0
    return _at_vertices(point[has], np.isin(s[has], (0.0, 1.0)), normal[has], xi, m)


def _of_primary(
    trace: BoundaryTrace, state: ContactState, points: Index, xi: Array
) -> tuple[Array, Mask]:
    """The same of the primary, where it is met from the `points` (k,) of the secondary."""
    line = state.line
    segment, s = line.partner[points], line.partner_s[points]
    point, end = np.arange(len(points)), np.isin(s, (0.0, 1.0))
    vertex = trace.nodes[segment, np.where(s < 0.5, 0, -1)]
    # Both segments at a vertex: all that end there.
    ends = trace.nodes[line.facing][:, [0, -1]]
    which, local, side = np.nonzero(vertex[end, None, None] == ends)
    point = np.concatenate([point[~end], point[end][which]])
    at_end = np.concatenate([np.zeros(np.count_nonzero(~end), bool), np.ones(len(which), bool)])
    segment = np.concatenate([segment[~end], line.facing[local]])
    s = np.concatenate([s[~end], side.astype(float)])
    return _at_vertices(point, at_end, -trace.exact_normal(segment, s), xi, len(points))


def _of_obstacle(state: ContactState, points: Index, xi: Array) -> tuple[Array, Mask]:
    """The same of a rigid obstacle, whose curve is that of the secondary moved by the gap."""
    line = state.line
    order = line.rows.shape[1] - 1
    whole = line.rows[(line.rows >= 0).all(axis=1)]
    curve = (line.position + line.gap[:, None] * xi)[whole]
    slope = np.einsum("ni,kid->knd", lagrange_derivative(order, gauss_lobatto(order)), curve)
    tangent = slope / np.linalg.norm(slope, axis=2)[:, :, None]
    cosine = np.full(len(line.node), -1.0)
    np.maximum.at(cosine, whole, np.abs(tangent[:, :, 0] * xi[1] - tangent[:, :, 1] * xi[0]))
    return cosine[points], np.ones(len(points), dtype=bool)


def lies_across(trace: BoundaryTrace, state: ContactState) -> bool:
    """Whether the secondary has straight edges alone in contact, none inclined to the direction."""
    line = state.line
    if line.contact.direction is None or trace.edges is None:
        return False
    touching = np.append(state.active, False)[line.rows].any(axis=1)
    segments = line.segments[touching]
    chord = trace.curve[segments, -1] - trace.curve[segments, 0]
    along = np.abs(chord @ np.array(line.contact.direction))
    straight = all(trace.edges[k].straight for k in set(trace.region[segments].tolist()))
    return straight and bool((along <= np.sin(INCLINED) * trace.lengths(segments)).all())


def inclinations(trace: BoundaryTrace, state: ContactState) -> Array:
    """Angles (m,) in radians between a pair's fixed direction and the surfaces; 0 where open.

    The smaller one of both surfaces; ends of their lines and corners have no normal of their own
    and count only where neither surface has.
    """
    line = state.line
    if line.contact.direction is None or not state.active.any():
        return np.zeros(len(state.active))
    xi = np.array(line.contact.direction)
    cosine, smooth = _of_secondary(trace, state, xi)
    cosine[~state.active] = 1.0
    steep = np.flatnonzero(cosine < np.cos(INCLINED))
    if len(steep):
        rigid = line.contact.primary is None
        other, plain = (
            _of_obstacle(state, steep, xi) if rigid else _of_primary(trace, state, steep, xi)
        )
        mine = np.where(smooth[steep] | ~plain, cosine[steep], -1.0)
        cosine[steep] = np.maximum(mine, np.where(plain | ~smooth[steep], other, -1.0))
    return np.arccos(np.clip(cosine, -1.0, 1.0))
