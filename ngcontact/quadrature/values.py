"""Prescribed values that are finer than the mesh."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from .cells import following, whole
from .constant_data import numbers
from .lattice import divisions, extent
from .view import View, looked_at

ENOUGH = 8  # points on a segment at least, which show any interpolation error
RESOLVED = 0.1  # what polynomials miss of values, relative to what the mesh does: they are rough
NOISE = 1e-10  # ... and relative to the values
FOLLOWED = 1e-3  # error of the squares on a part, relative to all of them


def rough_segments(
    values: Sequence[ng.CoefficientFunction], mesh: ng.Mesh, segments: Index, missed: float
) -> Mask:
    """Which `segments` (k,) have values, scalars, that are not seen at a few points, (k,).

    `missed` is how far a displacement is from them there. Numbers are nowhere rough.
    """
    if all(map(numbers, values)):
        return np.zeros(len(segments), dtype=bool)
    left, largest = np.zeros(mesh.GetNE(ng.BND)), 0.0
    for here, found, beyond in looked_at(ng.CF(tuple(values)), View(mesh, 1), segments, ENOUGH):
        left[here] = beyond
        largest = max(largest, float(np.abs(found).max()))
    return np.asarray(left[segments] > max(RESOLVED * missed, NOISE * largest))


def pieces(
    miss: Callable[[Index, Array], Array], mesh: ng.Mesh, sizes: Array, at: Index
) -> tuple[Index, Array, Array]:
    """Pieces on which Gauss points tell a function's squares.

    Segment (n,), start (n,) and length (n,) of each, the latter in [0, 1].

    Parameters
    ----------
    miss : function
        Its values (k, m, c) at parameters (k, m) of segments (k,).
    mesh : ng.Mesh
        The mesh.
    sizes : ndarray (q,)
        Lengths of the segments.
    at : ndarray of int (k,)
        The segments to be taken to pieces.
    """

    def squares(segment: Index, s: Array) -> Array:
        return np.asarray(sizes[segment, None, None] * miss(segment, s[..., 0]) ** 2)

    n = max(ENOUGH, int(divisions(1, sizes[at], extent(mesh)).max()))
    cells = whole(1, at).divided(n)
    total = float((cells.weights * squares(cells.element, cells.points).sum(axis=2)).sum())
    cells, *_ = following(squares, cells, FOLLOWED * total)
    return cells.element, cells.origin[:, 0], cells.side[:, 0, 0]
