"""Where the ray from a contact point meets the facing curve. NumPy only.

Curves are segments (q, degree + 1, 2) given by their points at the Gauss-Lobatto parameters, as
in `BoundaryTrace.curve`; `side` (q,) is +1 where the outward normal lies to the right.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index, Mask
from ..lagrange import gauss_lobatto, lagrange, lagrange_derivative, zeros

MATCHED = 1e-9  # distance, relative to a segment's length, below which two points are one
GRAZING = 1e-9  # cosine between ray and normal up to which the ray does not meet the curve
NEWTON_STEPS = 20
# Change of a parameter in [0, 1] at which Newton's method has arrived: the next one would be of
# its square. Below 1e-15, the round-off of places, no change falls, and all steps were taken.
SETTLED = 1e-12
LEBESGUE = 2.0  # bounds interpolation at Gauss-Lobatto points: 1.98 at degree 7
PAIRS_AT_ONCE = 4_000_000  # of points and segments: bounds the memory of a search


@dataclass(frozen=True, eq=False)
class Partners:
    """Partner points of k contact points.

    Attributes
    ----------
    segment : ndarray of int (k,)
        Facing segment, -1 where none is met.
    s : ndarray (k,)
        Parameter on it.
    distance : ndarray (k,)
        Distance along the direction, a length; negative where the curves overlap, inf without one.
    """

    segment: Index
    s: Array
    distance: Array


def at(curve: Array, segment: Index, s: Array) -> Array:
    """Points (k, 2) of segments `curve` (q, p + 1, 2) at `segment` (k,) and `s` (k,)."""
    return np.einsum("ki,kid->kd", lagrange(curve.shape[1] - 1, s), curve[segment])


def _slope(curve: Array, segment: Index, s: Array) -> Array:
    """Derivatives (k, 2) of the segments with respect to s."""
    return np.einsum("ki,kid->kd", lagrange_derivative(curve.shape[1] - 1, s), curve[segment])


def normals(curve: Array, side: Array, segment: Index, s: Array) -> Array:
    """Outward normals (k, 2), not normalised, at `s` (k,) of segments `segment` (k,).

    `curve` (q, p + 1, 2) and `side` (q,) as in `cast`.
    """
    tangent = _slope(curve, segment, s)
    return np.column_stack([tangent[:, 1], -tangent[:, 0]]) * side[segment, None]


def none_met(size: int) -> Partners:
    """Partners of points (size,) that meet nothing."""
    return Partners(np.full(size, -1), np.zeros(size), np.full(size, np.inf))


def _bend(curve: Array) -> Array:
    """Bound (q,) of how far segments leave the uniform motion along their chords, lengths."""
    ends = lagrange(1, gauss_lobatto(curve.shape[1] - 1))
    along = np.einsum("ji,qid->qjd", ends, curve[:, [0, -1]])
    return LEBESGUE * np.linalg.norm(curve - along, axis=2).max(axis=1)


def _turning(curve: Array, across: Array) -> Mask:
    """Whether segments (k, p + 1, 2) go back and forth along `across` (k, 2)."""
    degree = curve.shape[1] - 1
    rates = lagrange_derivative(degree, gauss_lobatto(max(1, degree - 1)))
    which, _ = zeros(max(1, degree - 1), np.einsum("ji,kid,kd->kj", rates, curve, across))
    return np.isin(np.arange(len(curve)), which)


def _candidates(
    points: Array, across: Array, curve: Array, pairs_at_once: int
) -> tuple[Index, Index, Array]:
    """Pairs (point, segment) whose ray crosses it, once for each crossing, and where about."""
    ends, degree = curve[:, [0, -1]], curve.shape[1] - 1
    slack = MATCHED * np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    bend = _bend(curve)
    bend[bend <= slack] = 0.0  # straight
    reach = slack + bend
    block = max(1, pairs_at_once // max(1, len(curve)))
    pairs = []
    for first in range(0, len(points), block):
        t = across[first : first + block]
        here = (points[first : first + block] * t).sum(axis=1)
        h0 = t @ ends[:, 0].T - here[:, None]
        h1 = t @ ends[:, 1].T - here[:, None]
        near = (np.minimum(h0, h1) <= reach) & (np.maximum(h0, h1) >= -reach)
        point, segment = np.nonzero(near)
        a, b = h0[point, segment], h1[point, segment]
        s = np.clip(np.divide(a, a - b, out=np.full(a.shape, 0.5), where=a != b), 0, 1)
        passes = np.minimum(a, b) <= slack[segment]
        passes &= np.maximum(a, b) >= -slack[segment]
        # Markov: what is no larger than the bend on [0, 1] has a slope up to 2 p^2 times that.
        turns, bent = np.flatnonzero(np.abs(a - b) <= 2 * degree**2 * bend[segment]), []
        if len(turns):
            turns = turns[_turning(curve[segment[turns]], t[point[turns]])]
            height = np.einsum("kid,kd->ki", curve[segment[turns]], t[point[turns]])
            which, zero = zeros(degree, height - here[point[turns], None])
            passes[turns[which]] = False  # all their crossings are known
            bent = [(point[turns[which]] + first, segment[turns[which]], zero)]
        pairs += [(point[passes] + first, segment[passes], s[passes]), *bent]
    point, segment, s = (np.concatenate(part) for part in zip(*pairs, strict=True))
    return point, segment, s


def _settled(s: Array, step: Callable[[Array], Array], settled: float = SETTLED) -> Array:
    """Parameters (k,) in [0, 1] after s - step(s) has been repeated until it stands still."""
    for _ in range(NEWTON_STEPS):
        new = np.clip(s - step(s), 0, 1)
        moved = np.abs(new - s).max(initial=0.0)
        s = new
        if moved <= settled:
            break
    return s


def crossings(
    points: Array,
    across: Array,
    curve: Array,
    segment: Index,
    s: Array,
    settled: float = SETTLED,
) -> Array:
    """Parameters (k,) of segments on lines through `points` (k, 2) normal to `across` (k, 2).

    By Newton's method from `s` (k,) on `segment` (k,) of `curve` (q, p + 1, 2), until no step is
    larger than `settled`.
    """

    def step(s: Array) -> Array:
        # (2.10): A_j and B_j on one perpendicular
        miss = ((at(curve, segment, s) - points) * across).sum(axis=1)
        rate = (_slope(curve, segment, s) * across).sum(axis=1)
        return np.divide(miss, rate, out=np.zeros_like(miss), where=rate != 0)

    return _settled(s, step, settled)


def cast(
    points: Array,
    directions: Array,
    curve: Array,
    side: Array,
    *,
    ahead: bool = False,
    pairs_at_once: int = PAIRS_AT_ONCE,
) -> Partners:
    """Nearest points, along given directions, of a curve whose outward normal opposes them.

    The scalar equation (x(s) - x) x d = 0 is solved by Newton's method at every crossing of ray
    and segment, HH81 (2.10): A_j and B_j on one perpendicular.

    Parameters
    ----------
    points : ndarray (k, 2)
        Where the rays pass; both senses count, so overlapping bodies give negative distances.
    directions : ndarray (k, 2)
        Unit vectors towards the facing body.
    curve, side : ndarray (q, degree + 1, 2), (q,)
        The facing segments.
    ahead : bool
        Only points in the sense of the direction.
    pairs_at_once : int
        Of points and segments that are looked at together; bounds the memory, changes no result.

    Returns
    -------
    Partners
        Of least absolute distance; parameters within `MATCHED` of an end are that end.
    """
    found = none_met(len(points))
    if len(curve) == 0 or len(points) == 0:
        return found
    across = np.column_stack([-directions[:, 1], directions[:, 0]])
    point, segment, s = _candidates(points, across, curve, pairs_at_once)
    s = crossings(points[point], across[point], curve, segment, s)
    s = np.where(s < MATCHED, 0.0, np.where(s > 1 - MATCHED, 1.0, s))
    offset = at(curve, segment, s) - points[point]
    miss = np.abs((offset * across[point]).sum(axis=1))
    lengths = np.linalg.norm(curve[segment, -1] - curve[segment, 0], axis=1)
    normal = normals(curve, side, segment, s)
    # A ray along a straight boundary, such as a symmetry plane, does not meet it.
    grazing = GRAZING * np.linalg.norm(normal, axis=1)
    faces = (normal * directions[point]).sum(axis=1) < -grazing
    faces &= miss <= 2 * MATCHED * lengths
    distance = (offset * directions[point]).sum(axis=1)
    if ahead:
        faces &= distance >= -MATCHED * lengths
    point, segment, s, distance = point[faces], segment[faces], s[faces], distance[faces]
    order = np.lexsort((np.abs(distance), point))  # by point, nearest first
    point, first = np.unique(point[order], return_index=True)
    best = order[first]
    found.segment[point], found.s[point] = segment[best], s[best]
    found.distance[point] = distance[best]
    return found


def snap(s: Array, nodes: Array) -> Array:
    """Parameters `s` (k,) moved to those of the `nodes` (k, p + 1) that they match, (k,)."""
    nearest = nodes[np.arange(len(s)), np.abs(s[:, None] - nodes).argmin(axis=1)]
    return np.where(np.abs(s - nearest) <= MATCHED, nearest, s)


def feet(
    points: Array, curve: Array, direction: Array | None, pairs_at_once: int = PAIRS_AT_ONCE
) -> tuple[Index, Array]:
    """Where segments pass points: on the lines along `direction`, or on their own normals.

    Parameters
    ----------
    points, curve : ndarray (k, 2), (q, p + 1, 2)
        Any points, and the segments; `pairs_at_once` as in `cast`.
    direction : ndarray (2,) or None for the normal of the segment at the foot.

    Returns
    -------
    segment, s : ndarray (r,), (r,)
        Segments that pass a point between their ends, once for each, and parameters.
    """
    if direction is not None:
        across = np.tile([-direction[1], direction[0]], (len(points), 1))
        point, segment, s = _candidates(points, across, curve, pairs_at_once)
        return segment, crossings(points[point], across[point], curve, segment, s)

    def ahead(point: Index, segment: Index, s: Array) -> Array:
        return ((points[point] - at(curve, segment, s)) * _slope(curve, segment, s)).sum(axis=1)

    block = max(1, pairs_at_once // max(1, curve.size))  # each pair holds its curve
    found = []
    for first in range(0, len(points), block):
        point, segment = np.divmod(
            np.arange(first * len(curve), min(first + block, len(points)) * len(curve)), len(curve)
        )
        none, one = np.zeros(len(point)), np.ones(len(point))
        # The nearest point of the segment, not the farthest.
        passed = (ahead(point, segment, none) > 0) & (ahead(point, segment, one) < 0)
        found.append((point[passed], segment[passed]))
    point, segment = (np.concatenate(part) for part in zip(*found, strict=True))

    def step(s: Array) -> Array:  # of Gauss and Newton: at once where the point is on the segment
        return -ahead(point, segment, s) / (_slope(curve, segment, s) ** 2).sum(axis=1)

    return segment, _settled(np.full(len(point), 0.5), step)
