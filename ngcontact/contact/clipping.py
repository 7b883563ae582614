"""Parts of facets that face one facet of another surface each, by clipping. NumPy only.

In barycentric coordinates of a facet, in whose plane the corners of a facing one are projected, it
is the triangle where no coordinate is negative: each of three half-planes cuts the polygon that is
left.
"""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Index
from .casting import line_coordinates

SLIVER = 1e-13  # share of a facet below which a part of it is none
MOST_CORNERS = 7  # of a triangle that is cut three times, and one more
ON_EDGE = 1e-12  # barycentric coordinate up to which a corner lies on the edge where it is 0
# The corner of a polygon furthest along this, in barycentric coordinates, is the apex of its fan.
# No edge of rational coordinates is perpendicular to it: of two corners round-off would tell which.
APEX_DIRECTION = np.array([1.0, 2**0.5, 5**0.5])


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
    opposes = (np.cross(b - a, c - a) * d).sum(axis=1) < 0
    local, other, d = local[opposes], other[opposes], d[opposes]
    own = corners[local]
    L = np.stack([line_coordinates(facing[other, i], own, d) for i in range(3)], axis=1)
    apart = (L.min(axis=1) >= 1).any(axis=1) | (L.max(axis=1) <= 0).any(axis=1)
    apart |= ~np.isfinite(L).all(axis=(1, 2))
    local, other, L = local[~apart], other[~apart], L[~apart]
    polygon, count = _from_apex(*clipped(L))
    found = [
        (np.flatnonzero(count > i + 1), i) for i in range(1, MOST_CORNERS - 1)
    ]  # a fan of triangles
    which = np.concatenate([np.zeros(0, dtype=np.intp), *(k for k, _ in found)])
    parts = [polygon[k][:, [0, i, i + 1]] for k, i in found]
    part = np.concatenate([np.zeros((0, 3, 3)), *parts])
    kept = np.flatnonzero(np.abs(np.linalg.det(part)) > SLIVER)
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


def _from_apex(polygon: Array, count: Index) -> tuple[Array, Index]:
    """Corners (r, 7, 3), of which `count` (r,) count, from the apex on: not by round-off."""
    number = np.arange(MOST_CORNERS)
    along = np.where(number < count[:, None], polygon @ APEX_DIRECTION, -np.inf)
    turned = (along.argmax(axis=1)[:, None] + number) % np.maximum(count, 1)[:, None]
    return np.take_along_axis(polygon, turned[:, :, None], axis=1), count


def clipped(polygon: Array) -> tuple[Array, Index]:
    """Triangles `polygon` (r, 3, 3), barycentric, cut to the facet by Sutherland and Hodgman.

    Corners (r, 7, 3) of convex polygons, of which the first (r,) count.
    """
    r = len(polygon)
    every = np.arange(r)
    corners = np.zeros((r, MOST_CORNERS, 3))
    corners[:, :3] = polygon
    count = np.full(r, 3)
    for i in range(3):  # L_i >= 0
        corners[np.abs(corners[:, :, i]) < ON_EDGE, i] = 0.0
        cut, size = np.zeros_like(corners), np.zeros(r, dtype=np.intp)

        def append(at: Index, x: Array, cut: Array = cut, size: Index = size) -> None:
            cut[at, size[at]] = x
            size[at] += 1

        for k in range(count.max(initial=0)):
            here = corners[:, k]
            before = corners[every, (k - 1) % np.maximum(count, 1)]
            a, b = before[:, i], here[:, i]
            crossed = np.flatnonzero((k < count) & ((a >= 0) != (b >= 0)))
            t = (a[crossed] / (a[crossed] - b[crossed]))[:, None]
            append(crossed, before[crossed] + t * (here[crossed] - before[crossed]))
            inside = np.flatnonzero((k < count) & (b >= 0))
            append(inside, here[inside])
        corners, count = cut, size
    return corners, count
