"""What facets of solids face: points at which rays meet them, and parts that face one facet each.

NumPy only. Facets are surfaces (q, n, 3) given by their points at the nodes of
`reference.triangle`, as in `FacetTrace.curve`; `side` (q,) is +1 where the outward normal is that
of the vertices' order. They are divided by clipping: in barycentric coordinates of a facet, in
whose plane the corners of a facing one are projected, it is the triangle where no coordinate is
negative, and each of three half-planes cuts the polygon that is left.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import NEWTON_STEPS, Array, Index
from ..reference.triangle import CENTRE, DEGREES, lagrange, lagrange_gradient
from .projection import (
    GRAZING_COSINE,
    MATCHING_DISTANCE,
    PAIRS_AT_ONCE,
    Partners,
    enter,
    none_met,
    opposes,
)

NEAREST_FACETS = 8  # facets by their middles, at which a ray is tried before all others
# Barycentric coordinate, negative, up to which a ray meets a facet: on planes of symmetry points
# lie on the rim, and curved edges of both sides differ by round-off.
OUTSIDE_COORDINATE = 1e-7
NEWTON_TOLERANCE = 1e-14  # change of barycentric coordinates at which Newton's method has arrived
MISSING_CHANGE = 1e-8  # ... above which it has found no crossing in the end
SLIVER_SHARE = 1e-13  # share of a facet below which a part of it is none
MOST_CORNERS = 7  # of a triangle that is cut three times, and one more
ON_EDGE = 1e-12  # barycentric coordinate up to which a corner lies on the edge where it is 0
# The corner of a polygon furthest along this, in barycentric coordinates, is the apex of its fan.
# No edge of rational coordinates is perpendicular to it: of two corners round-off would tell which.
APEX_DIRECTION = np.array([1.0, 2**0.5, 5**0.5])


def onto(
    points: Array, directions: Array, surface: Array, facet: Index, start: Array | None = None
) -> tuple[Array, Array]:
    """Barycentric coordinates (k, 3) where lines meet facets, or planes that go on, and distances.

    Lines through `points` (k, 3) along `directions` (k, 3), `facet` (k,) of `surface` (q, n, 3), by
    Newton's method from `start` (k, 3); NaN where a line does not cross. Distances are (k,).
    """
    degree = DEGREES[surface.shape[1]]
    L = np.tile(CENTRE, (len(points), 1)) if start is None else start.copy()
    distance, change, moving = np.zeros(len(points)), np.zeros(len(points)), np.arange(len(points))
    for _ in range(NEWTON_STEPS if degree > 1 else 2):
        places, d, here = surface[facet[moving]], directions[moving], L[moving]
        x = np.einsum("ki,kid->kd", lagrange(degree, here), places)
        tangents = places.transpose(0, 2, 1) @ lagrange_gradient(degree, here)
        matrix = np.concatenate([tangents, -d[:, :, None]], axis=2)
        step = _solved(matrix, points[moving] + distance[moving, None] * d - x)
        move = np.clip(step[:, :2], -2.0, 2.0) if degree > 1 else step[:, :2]
        L[moving, :2] += move
        L[moving, 2] -= move.sum(axis=1)
        distance[moving] += step[:, 2]
        change[moving] = np.abs(step[:, :2]).max(axis=1)
        moving = moving[change[moving] > NEWTON_TOLERANCE]
        if not moving.size:
            break
    L[change > MISSING_CHANGE] = np.nan
    return L, distance


def _solved(matrices: Array, right: Array) -> Array:
    """Solutions (k, 3) of systems (k, 3, 3), NaN where they are singular."""
    a, b, c = matrices.transpose(2, 0, 1)
    bc = np.cross(b, c)
    determinant = (a * bc).sum(axis=1)
    size = np.linalg.norm(a, axis=1) * np.linalg.norm(b, axis=1) * np.linalg.norm(c, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.abs(determinant) > GRAZING_COSINE * size, 1 / determinant, np.nan)
    parts = [(right * bc).sum(axis=1), (right * np.cross(c, a)).sum(axis=1)]
    parts.append((right * np.cross(a, b)).sum(axis=1))
    return np.stack(parts, axis=1) * inverse[:, None]


def line_coordinates(points: Array, corners: Array, directions: Array) -> Array:
    """Barycentric coordinates (k, 3) where lines meet the planes of triangles.

    Lines through `points` (k, 3) along `directions` (k, 3), triangles by `corners` (k, 3, 3).
    """
    edges = np.stack([corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]], axis=2)
    matrix = np.concatenate([edges, -directions[:, :, None]], axis=2)
    L = _solved(matrix, points - corners[:, 2])[:, :2]
    return np.column_stack([L, 1 - L.sum(axis=1)])


def cast(
    points: Array, directions: Array, surface: Array, side: Array, *, ahead: bool = False
) -> Partners:
    """Nearest points, along given directions, of facets whose outward normal opposes them.

    From `points` (k, 3) along unit vectors `directions` (k, 3) to the `surface` (q, n, 3), `side`
    (q,). Both senses count unless only points `ahead` do, so that overlapping bodies give negative
    distances.
    """
    found = none_met(len(points), CENTRE[0])

    def take(point: Index, facet: Index) -> None:
        """Enter the nearest of what the pairs (r,) of `point` and `facet` meet."""
        d = directions[point]
        L, distance = onto(points[point], d, surface, facet)
        at = np.flatnonzero(L.min(axis=1) >= -OUTSIDE_COORDINATE)
        gradient = lagrange_gradient(DEGREES[surface.shape[1]], L[at])
        tangents = np.einsum("kij,kid->jkd", gradient, surface[facet[at]])
        meets = opposes(np.cross(*tangents) * side[facet[at], None], d[at])
        if ahead:
            meets &= distance[at] >= -MATCHING_DISTANCE * np.abs(surface).max()
        at = at[meets]
        enter(found, point[at], Partners(facet[at], L[at], distance[at]))

    middle = surface[:, :3].mean(axis=1)
    radius = np.linalg.norm(surface - middle[:, None], axis=2).max(axis=1)
    _, near = cKDTree(middle).query(points, k=min(NEAREST_FACETS, len(middle)))
    near = near.reshape(len(points), -1)
    take(np.repeat(np.arange(len(points)), near.shape[1]), near.ravel())
    block = max(1, PAIRS_AT_ONCE // len(middle))
    # Of the others those whose ball the line passes; a nearer one of these may hide what was met.
    for first in range(0, len(points), block):
        here = np.arange(first, min(first + block, len(points)))
        here = here[found.segment[here] < 0]
        d, x = directions[here], points[here]
        along = d @ middle.T - (d * x).sum(axis=1)[:, None]
        square = (x**2).sum(axis=1)[:, None] - 2 * x @ middle.T + (middle**2).sum(axis=1)
        passes = square - along**2 <= radius**2 * (1 + OUTSIDE_COORDINATE)
        at, facet = np.nonzero(passes)
        take(here[at], facet)
    return found


def pieces(
    corners: Array, direction: Array, facing: Array, reach: Array
) -> tuple[Index, Array, Index]:
    """Divide facets with `corners` (k, 3, 3) by the `facing` (q, 3, 3) ones.

    Along one `direction` (k, 3) each; facing facets lie within `reach` (k,) of the lines' starts,
    everywhere along the lines where that is infinite, and run anticlockwise as seen from outside.
    Of the parts numbers (r,) of facets, barycentric coordinates (r, 3, 3) of the corners there, and
    numbers (r,) of facing facets.
    """
    local, other = _near(corners, direction, facing, reach)
    a, b, c = facing[other].transpose(1, 0, 2)
    d = direction[local]
    opposed = (np.cross(b - a, c - a) * d).sum(axis=1) < 0
    local, other, d = local[opposed], other[opposed], d[opposed]
    own = corners[local]
    L = np.stack([line_coordinates(facing[other, i], own, d) for i in range(3)], axis=1)
    apart = (L.min(axis=1) >= 1).any(axis=1) | (L.max(axis=1) <= 0).any(axis=1)
    apart |= ~np.isfinite(L).all(axis=(1, 2))
    local, other = local[~apart], other[~apart]
    polygon, count = clipped(L[~apart])
    i = np.arange(1, MOST_CORNERS - 1)  # a fan of triangles
    number, which = np.nonzero(count > i[:, None] + 1)
    part = polygon[which[:, None], np.stack([0 * i, i, i + 1], axis=1)[number]]
    kept = np.abs(np.linalg.det(part)) > SLIVER_SHARE
    which = which[kept]
    return local[which], part[kept], other[which]


def _near(corners: Array, direction: Array, facing: Array, reach: Array) -> tuple[Index, Index]:
    """Pairs (r,) of a facet and a facing one whose balls the lines through the former may meet."""
    middle, other = corners.mean(axis=1), facing.mean(axis=1)
    radius = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    other_radius = np.linalg.norm(facing - other[:, None], axis=2).max(axis=1)
    far = ~np.isfinite(reach)
    if far.any():  # one direction for all: distances across it
        d = direction[0]
        middle, other = (x - np.outer(x @ d, d) for x in (middle, other))
        reach = np.zeros(len(reach))
    local, found = [np.zeros(0, dtype=np.intp)], [np.zeros(0, dtype=np.intp)]
    size = np.floor(np.log2(other_radius))
    for kind in np.unique(size):  # facets of about one size: none is far from what is asked
        some = np.flatnonzero(size == kind)
        bound = radius + reach + other_radius[some].max()
        near = cKDTree(other[some]).query_ball_point(middle, bound)
        local.append(np.repeat(np.arange(len(near)), [len(x) for x in near]))
        found.append(some[np.array([i for x in near for i in x], dtype=np.intp)])
    return np.concatenate(local), np.concatenate(found)


def clipped(polygon: Array) -> tuple[Array, Index]:
    """Triangles `polygon` (r, 3, 3), barycentric, cut to the facet by Sutherland and Hodgman.

    Corners (r, 7, 3) of convex polygons from the apex on, of which the first (r,) count.
    """
    number, count = np.arange(MOST_CORNERS), np.full(len(polygon), 3)
    twice = len(polygon), 2 * MOST_CORNERS
    corners = np.pad(polygon, ((0, 0), (0, MOST_CORNERS - 3), (0, 0)))
    for i in range(3):  # L_i >= 0
        corners[np.abs(corners[:, :, i]) < ON_EDGE, i] = 0.0
        some = number < count[:, None]
        before = (number - 1) % np.maximum(count, 1)[:, None]
        last = np.take_along_axis(corners, before[:, :, None], axis=1)
        a, b = last[:, :, i], corners[:, :, i]
        crossed = some & ((a >= 0) != (b >= 0))
        t = np.divide(a, a - b, out=np.zeros_like(a), where=crossed)[:, :, None]
        cut = np.stack([last + t * (corners - last), corners], axis=2).reshape(*twice, 3)
        kept = np.stack([crossed, some & (b >= 0)], axis=2).reshape(twice)
        first = np.argsort(~kept, axis=1, kind="stable")[:, :MOST_CORNERS]
        corners, count = np.take_along_axis(cut, first[:, :, None], axis=1), kept.sum(axis=1)
    along = np.where(number < count[:, None], corners @ APEX_DIRECTION, -np.inf)
    turned = (along.argmax(axis=1)[:, None] + number) % np.maximum(count, 1)[:, None]
    return np.take_along_axis(corners, turned[:, :, None], axis=1), count
