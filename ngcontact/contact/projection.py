"""Partners on facing curves: points at which rays meet them. NumPy only.

Curves are segments (q, degree + 1, 2) given by their points at the Gauss-Lobatto parameters, as
in `BoundaryTrace.curve`; `side` (q,) is +1 where the outward normal lies to the right.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, across, newton
from ..lagrange import at, gauss_lobatto, lagrange, lagrange_derivative, slope, zeros

MATCHING_DISTANCE = 1e-9  # distance, relative to a segment's length, below which two points are one
GRAZING_COSINE = 1e-9  # cosine between ray and normal up to which the ray does not meet the curve
# Change of a parameter in [0, 1] at which Newton's method has arrived: the next one would be of
# its square. Below 1e-15, the round-off of places, no change falls, and all steps were taken.
NEWTON_TOLERANCE = 1e-12
LEBESGUE_CONSTANT = 2.0  # bounds interpolation at Gauss-Lobatto points: 1.98 at degree 7
NEAREST_PLACES = 8  # among which the place of a point is sought
PAIRS_AT_ONCE = 4_000_000  # of points and segments that are looked at together: bounds memory


@dataclass(frozen=True, eq=False)
class Partners:
    """Partner points of k contact points."""

    segment: Index  # (k,) facing segment, -1 where none is met
    s: Array  # (k,) parameter on it
    distance: Array  # (k,) along the direction; negative where curves overlap, inf without one
    searched: bool = False  # False where all are nodes at the same place


def none_met(size: int, place: Array) -> Partners:
    """Partners of points (size,) that meet nothing, with any parameter `place` (...,)."""
    return Partners(np.full(size, -1), place[None].repeat(size, axis=0), np.full(size, np.inf))


def enter(found: Partners, point: Index, met: Partners) -> None:
    """Let `found` be the nearest of the partners `met` (r,) of each `point` (r,)."""
    order = np.lexsort((np.abs(met.distance), point))
    at, first = np.unique(point[order], return_index=True)
    best = order[first]
    found.segment[at], found.s[at] = met.segment[best], met.s[best]
    found.distance[at] = met.distance[best]


def opposes(normals: Array, directions: Array) -> Mask:
    """Whether outward `normals` (k, d) oppose unit vectors `directions` (k, d), a mask (k,).

    A ray along a straight boundary, such as a symmetry plane, does not meet it.
    """
    grazing = GRAZING_COSINE * np.linalg.norm(normals, axis=1)  # round-off must not decide
    return np.asarray((normals * directions).sum(axis=1) < -grazing)


def _bend(curve: Array) -> tuple[Array, Array]:
    """Bounds (q,) of how far segments, and their velocities, leave motion along the chords."""
    degree = curve.shape[1] - 1
    nodes = gauss_lobatto(degree)
    apart = curve - np.einsum("ji,qid->qjd", lagrange(1, nodes), curve[:, [0, -1]])
    turn = np.einsum("ji,qid->qjd", lagrange_derivative(degree, nodes), apart)
    size, rate = (LEBESGUE_CONSTANT * np.linalg.norm(x, axis=2).max(axis=1) for x in (apart, turn))
    return size, rate


def _candidates(points: Array, normal: Array, curve: Array) -> tuple[Array, Array]:
    """Pairs (2, r) of point and segment whose lines cross it, once a crossing, and s (r,)."""
    ends = curve[:, [0, -1]]
    slack = MATCHING_DISTANCE * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    bend, turn = _bend(curve)
    bend[bend <= slack] = turn[bend <= slack] = 0.0  # straight
    reach = slack + bend
    block = max(1, PAIRS_AT_ONCE // max(1, len(curve)))
    pairs, places = [], []
    for first in range(0, len(points), block):
        t = normal[first : first + block]
        here = (points[first : first + block] * t).sum(axis=1)
        h0 = t @ ends[:, 0].T - here[:, None]
        h1 = t @ ends[:, 1].T - here[:, None]
        near = (np.minimum(h0, h1) <= reach) & (np.maximum(h0, h1) >= -reach)
        point, segment = np.nonzero(near)
        a, b = h0[point, segment], h1[point, segment]
        s = np.clip(np.divide(a, a - b, out=np.full(a.shape, 0.5), where=a != b), 0, 1)
        passes = np.minimum(a, b) <= slack[segment]
        passes &= np.maximum(a, b) >= -slack[segment]
        turns = np.flatnonzero(np.abs(a - b) <= turn[segment])
        if len(turns):
            height = np.einsum("kid,kd->ki", curve[segment[turns]], t[point[turns]])
            which, zero = zeros(curve.shape[1] - 1, height - here[point[turns], None])
            passes[turns[which]] = False  # all their crossings are known
            pairs.append([point[turns[which]] + first, segment[turns[which]]])
            places.append(zero)
        pairs.append([point[passes] + first, segment[passes]])
        places.append(s[passes])
    return np.concatenate(pairs, axis=1), np.concatenate(places)


def crossings(
    points: Array,
    normal: Array,
    curve: Array,
    segment: Index,
    s: Array,
    settled: float = NEWTON_TOLERANCE,
) -> Array:
    """Parameters (k,) of segments on lines through `points` (k, 2) with normals `normal` (k, 2).

    By Newton's method from `s` (k,) on `segment` (k,) of `curve` (q, p + 1, 2), until no step is
    larger than `settled`.
    """
    degree = curve.shape[1] - 1
    height = np.einsum("kid,kd->ki", curve[segment] - points[:, None], normal)

    def step(s: Array, number: Index) -> Array:
        # (2.10): A_j and B_j on one perpendicular
        miss = (lagrange(degree, s) * height[number]).sum(axis=1)
        rate = (lagrange_derivative(degree, s) * height[number]).sum(axis=1)
        return np.divide(miss, rate, out=np.zeros_like(miss), where=rate != 0)

    return newton(s, step, (0, 1), settled)


def cast(
    points: Array, directions: Array, curve: Array, side: Array, *, ahead: bool = False
) -> Partners:
    """Nearest points, along given directions, of a curve whose outward normal opposes them.

    The scalar equation (x(s) - x) x d = 0 is solved by Newton's method at every crossing of ray
    and segment, HH81 (2.10): A_j and B_j on one perpendicular. Rays pass `points` (k, 2) along the
    unit vectors `directions` (k, 2) towards segments `curve` (q, p + 1, 2), `side` (q,). Both
    senses count unless only points `ahead` do, so that overlapping bodies give negative distances;
    parameters within `MATCHING_DISTANCE` of an end are that end.
    """
    found, t = none_met(len(points), np.zeros(())), across(directions)
    (point, segment), s = _candidates(points, t, curve)
    s = crossings(points[point], t[point], curve, segment, s)
    s = np.where(s < MATCHING_DISTANCE, 0.0, np.where(s > 1 - MATCHING_DISTANCE, 1.0, s))
    offset = at(curve, segment, s) - points[point]
    length = MATCHING_DISTANCE * np.linalg.norm(curve[segment, -1] - curve[segment, 0], axis=1)
    distance = (offset * directions[point]).sum(axis=1)
    normals = -across(slope(curve, segment, s)) * side[segment, None]
    meets = opposes(normals, directions[point])
    meets &= np.abs((offset * t[point]).sum(axis=1)) <= 2 * length
    if ahead:
        meets &= distance >= -length
    enter(found, point[meets], Partners(segment[meets], s[meets], distance[meets]))
    return found


def coincident(
    points: Array, directions: Array, places: Array, normals: Array, reach: Array
) -> Index:
    """Numbers (k,) of the nearest `places` (n, d) at which `points` (k, d) lie, -1 for none.

    Places lie within `reach` (n,) of their points, and their outward unit `normals` (n, d) oppose
    the unit vectors `directions` (k, d): of a vertex that belongs to several segments the ray may
    face only one of them.
    """
    found = np.full(len(points), -1)
    if len(places) == 0 or len(points) == 0:
        return found
    distances, numbers = cKDTree(places).query(
        points, k=NEAREST_PLACES, distance_upper_bound=reach.max()
    )
    point, column = np.isfinite(distances).nonzero()
    place = numbers[point, column]
    meets = opposes(normals[place], directions[point])
    meets &= distances[point, column] <= reach[place]
    # The nearest one is entered last.
    found[point[meets][::-1]] = place[meets][::-1]
    return found


def feet(points: Array, curve: Array, direction: Array | None) -> tuple[Index, Array]:
    """Parameters at which segments pass points: on lines along `direction`, or on own normals.

    For `points` (k, 2) and segments `curve` (q, p + 1, 2); without a `direction` (2,) on their
    normals at the foot. Segments (r,) that pass a point between their ends, once for each, and
    parameters (r,).
    """
    if direction is not None:
        normal = np.tile(across(direction), (len(points), 1))
        (point, segment), s = _candidates(points, normal, curve)
        return segment, crossings(points[point], normal[point], curve, segment, s)

    degree = curve.shape[1] - 1
    velocity = np.einsum("ji,qid->qjd", lagrange_derivative(degree, gauss_lobatto(degree)), curve)

    ends, slopes = curve[:, [0, -1]], velocity[:, [0, -1]]
    block = max(1, PAIRS_AT_ONCE // max(1, ends.size))
    found = [np.zeros((2, 0), dtype=np.intp)]
    for first in range(0, len(points), block):
        apart = points[first : first + block, None, None] - ends
        ahead, behind = np.einsum("kqed,qed->ekq", apart, slopes)
        # The nearest point of the segment, not the farthest.
        point, segment = ((ahead > 0) & (behind < 0)).nonzero()
        found.append(np.stack([point + first, segment]))
    point, segment = np.concatenate(found, axis=1)

    def step(s: Array, number: Index) -> Array:
        here = segment[number]
        apart, v = points[point[number]] - at(curve, here, s), at(velocity, here, s)
        square = (v**2).sum(axis=1)
        rate = square - (apart * slope(velocity, here, s)).sum(axis=1)
        # Gauss's and Newton's where that of Newton leads to a farthest point.
        return -(apart * v).sum(axis=1) / np.where(rate > 0, rate, square)

    return segment, newton(np.full(len(point), 0.5), step, (0, 1), NEWTON_TOLERANCE)
