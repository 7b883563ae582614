"""Partner points: where the facing body is met from points of the secondary."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask
from ..fem import BoundaryTrace
from ..lagrange import lagrange
from .projection import GRAZING, MATCHED, Partners, cast, none_met, normals

TOUCHING = 4 * np.finfo(float).eps  # round-off of a measured gap, relative to the coordinates


def coincident(
    points: Array, directions: Array, curve: Array, side: Array, nodes: Array
) -> Partners:
    """Partners among the nodes of the facing segments that lie at the points themselves.

    Parameters
    ----------
    points, directions : ndarray (k, 2)
        Contact points and unit vectors towards the facing body.
    curve, side : ndarray (q, degree + 1, 2), (q,)
        The facing segments.
    nodes : ndarray (q, order + 1)
        Parameters of the nodes on them.

    Returns
    -------
    Partners
        Segment -1 where no node is within `MATCHED` of the point, or the curve does not face it.
    """
    found = none_met(len(points))
    if len(curve) == 0 or len(points) == 0:
        return found
    shapes = lagrange(curve.shape[1] - 1, nodes.ravel()).reshape(*nodes.shape, -1)
    at = np.einsum("qji,qid->qjd", shapes, curve)
    lengths = np.linalg.norm(curve[:, -1] - curve[:, 0], axis=1)
    tree = cKDTree(at.reshape(-1, 2))
    # A vertex belongs to two segments; the ray may face only one of them.
    distances, numbers = tree.query(points, k=2, distance_upper_bound=MATCHED * lengths.max())
    for column in (1, 0):
        near = np.flatnonzero(np.isfinite(distances[:, column]))
        segment, local = np.divmod(numbers[near, column], nodes.shape[1])
        normal = normals(curve, side, segment, nodes[segment, local])
        grazing = GRAZING * np.linalg.norm(normal, axis=1)  # round-off must not decide
        faces = (normal * directions[near]).sum(axis=1) < -grazing
        faces &= distances[near, column] <= MATCHED * lengths[segment]
        near, segment, local = near[faces], segment[faces], local[faces]
        found.segment[near] = segment
        found.s[near] = nodes[segment, local]
        offset = at[segment, local] - points[near]
        found.distance[near] = (offset * directions[near]).sum(axis=1)
    return found


def _beyond_own_body(
    trace: BoundaryTrace, own: Index, points: Array, directions: Array, found: Partners
) -> Mask:
    """Whether bodies overlap so far that the partner lies on the other side of the own body.

    Overlap puts a partner behind the point, inside the own body; one that the backward ray meets
    only after it has left that body belongs to a far side.
    """
    beyond = np.zeros(len(points), dtype=bool)
    behind = (found.segment >= 0) & (found.distance < 0)
    for body in np.unique(trace.body[own[behind]]):
        at = np.flatnonzero(behind & (trace.body[own] == body))
        rim = np.flatnonzero(trace.body == body)
        leaves = cast(points[at], -directions[at], trace.curve[rim], -trace.side[rim], ahead=True)
        beyond[at] = (leaves.segment >= 0) & (-found.distance[at] > leaves.distance)
    return beyond


def partners(
    trace: BoundaryTrace,
    facing: Index,
    own: Index,
    points: Array,
    directions: Array,
    *,
    nodes: bool = True,
) -> tuple[Index, Array, Array, int]:
    """Points of the segments `facing` opposite to `points`: A_j and B_j of HH81 (2.10).

    Parameters
    ----------
    trace : BoundaryTrace
    facing : ndarray of int (q,)
        Segments of the facing body; none for a rigid obstacle.
    own : ndarray of int (k,)
        Segments on which the points lie.
    points, directions : ndarray (k, 2)
        The points, and unit vectors towards the facing body.
    nodes : bool
        Whether they are nodes, some of which may lie at others.

    Returns
    -------
    segment : ndarray of int (k,)
        Of the facing body, -1 where none is met.
    s, distance : ndarray (k,)
        Parameter on it, and its distance along the direction, a length, inf where none is met.
    searches : int
        0 if there is nothing to search, as where all of them are nodes at the same place.
    """
    curve, side = trace.curve[facing], trace.side[facing]
    found = none_met(len(points))
    if nodes:
        found = coincident(points, directions, curve, side, trace.places(facing))
    rest = np.flatnonzero(found.segment < 0) if facing.size else facing
    if rest.size:
        other: Partners = cast(points[rest], directions[rest], curve, side)
        other.segment[
            _beyond_own_body(trace, own[rest], points[rest], directions[rest], other)
        ] = -1
        found.segment[rest] = other.segment
        found.s[rest], found.distance[rest] = other.s, other.distance
    # Points that only round-off keeps apart touch: no load is too small to be felt.
    found.distance[np.abs(found.distance) <= TOUCHING * np.abs(points).max(initial=0.0)] = 0.0
    segment = np.where(found.segment < 0, -1, facing[found.segment] if facing.size else -1)
    return segment, found.s, found.distance, int(rest.size > 0)
