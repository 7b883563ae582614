"""NGSolve's mesh as arrays: the one place that reads and writes Netgen's own."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask

TRIANGLES = (10, 12)  # Netgen's element types TRIG and TRIG6

_RECORDS: dict[tuple[type, int], np.dtype] = {}  # Netgen's layouts, of kinds of so many bytes


def _records(elements: Any) -> np.ndarray:
    """Netgen's elements as they are, in its memory: `NumPy` takes 40 us for their type alone."""
    kind = type(elements), memoryview(elements).nbytes // max(1, len(elements))
    if kind not in _RECORDS:
        _RECORDS[kind] = elements.NumPy().dtype
    return np.frombuffer(elements, dtype=_RECORDS[kind])


@dataclass(frozen=True)
class Triangulation:
    """A plane mesh as arrays, each copied when it is first asked for; numbers count from 0.

    Attributes
    ----------
    mesh : ng.Mesh
        With nv vertices, ne triangles and k boundary segments. A mesh that is refined or moved
        in place needs another view.
    """

    mesh: ng.Mesh

    @cached_property
    def vertices(self) -> Array:
        """Coordinates (nv, 2), lengths."""
        return np.array(self.mesh.ngmesh.Coordinates())[:, :2]

    @cached_property
    def triangles(self) -> Index:
        """Vertices (ne, 3) of each triangle, anticlockwise."""
        return _records(self.mesh.ngmesh.Elements2D())["nodes"][:, :3].astype(np.intp) - 1

    @cached_property
    def bodies(self) -> Index:
        """Material region number (ne,) of each triangle."""
        return _records(self.mesh.ngmesh.Elements2D())["index"].astype(np.intp) - 1

    @cached_property
    def segments(self) -> Index:
        """Vertices (k, 2) of each boundary segment, lines inside bodies included."""
        return _records(self.mesh.ngmesh.Elements1D())["nodes"][:, :2].astype(np.intp) - 1

    @cached_property
    def boundaries(self) -> Index:
        """Boundary region number (k,) of each segment."""
        return _records(self.mesh.ngmesh.Elements1D())["index"].astype(np.intp) - 1

    @property
    def corners(self) -> Array:
        """Coordinates (ne, 3, 2) of the vertices of each triangle, lengths."""
        return self.vertices[self.triangles]

    @cached_property
    def angles(self) -> Array:
        """Sum (nv,) of the triangles' angles at each vertex, radians."""
        side = np.roll(self.corners, -1, axis=1) - self.corners
        back = -np.roll(side, 1, axis=1)
        sine = side[..., 0] * back[..., 1] - side[..., 1] * back[..., 0]
        angles = np.arctan2(sine, (side * back).sum(axis=2))
        sums = np.bincount(self.triangles.ravel(), angles.ravel(), len(self.vertices))
        return np.asarray(sums, dtype=float)

    def others(self) -> int:
        """Number of elements that are no triangles."""
        types = _records(self.mesh.ngmesh.Elements2D())["type"]
        return int(np.count_nonzero(~np.isin(types, TRIANGLES)))


def triangle_sides(triangles: Index) -> Index:
    """Vertices (3 ne, 2) of the three sides of each triangle in turn, `triangles` (ne, 3)."""
    return triangles[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2)


def move_vertices(mesh: ng.Mesh, positions: Array) -> None:
    """Move the vertices of a mesh to `positions` (nv, 2), in place; curves stay as they were."""
    mesh.ngmesh.Coordinates()[:, :2] = positions


def bisect(mesh: ng.Mesh, marked: Mask) -> None:
    """Refine the elements `marked` (ne,) of a mesh in place, which straightens it."""
    _records(mesh.ngmesh.Elements2D())["refine"] = marked  # all of them: they are True by default
    mesh.Refine()
