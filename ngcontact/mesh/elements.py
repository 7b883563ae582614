"""Sizes and sides of elements."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..problem import Triangulation, triangle_sides


def diameters(mesh: ng.Mesh) -> Array:
    """Longest side of each triangle, (ne,), lengths."""
    corners = Triangulation(mesh).corners
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def neighbours(segments: Index, triangles: Index, vertices: int) -> tuple[Index, Mask]:
    """Number (k,) of a triangle at each segment, and whether there is another one, (k,).

    `segments` (k, 2) and `triangles` (ne, 3) are those of a mesh of so many `vertices`.
    """
    marked = np.zeros(vertices, dtype=bool)
    marked[segments] = True
    sides = triangle_sides(triangles)
    some = np.flatnonzero(marked[sides].all(axis=1))  # few, which are sorted in no time
    sides = np.sort(sides[some], axis=1)
    keys = sides[:, 0] * vertices + sides[:, 1]
    order = np.argsort(keys)
    low, high = np.sort(segments, axis=1).T
    wanted = low * vertices + high
    first = np.searchsorted(keys[order], wanted)
    last = np.searchsorted(keys[order], wanted, side="right")
    return some[order[first]] // 3, last - first > 1


def rightward(vectors: Array) -> Array:
    """Unit vectors (k, 2) to the right of `vectors` (k, 2)."""
    right = np.column_stack([vectors[:, 1], -vectors[:, 0]])
    return right / np.linalg.norm(right, axis=1)[:, None]
