"""NGSolve's mesh as arrays: the one place that reads and writes Netgen's own."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from itertools import combinations
from typing import Any

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from ..arrays import Array, Index, Mask

SIMPLICES = {2: (10, 12), 3: (20, 21)}  # Netgen's types of triangles and tetrahedra, by dimension
SIDES = {2: [[0, 1], [1, 2], [2, 0]], 3: [[0, 1, 2], [0, 1, 3], [0, 2, 3], [1, 2, 3]]}

PARAMETERS = 32  # bytes of Netgen's triangles before those of their corners' surface parameters

AXIS_RADIUS = 1e-9  # radius, relative to the largest, up to which a point lies on the axis x = 0

# Attribute of a mesh: by name what was found of its elements and facets, and the hash of these.
KEPT = "_ngcontact_kept"

POSITION = ng.CF((ng.x, ng.y, ng.z))  # of a mesh point, lengths

_RECORDS: dict[tuple[type, int], np.dtype] = {}  # Netgen's layouts, of kinds of so many bytes


def _records(elements: Any) -> np.ndarray:
    """Netgen's elements as they are, in its memory: `NumPy` takes 40 us for their type alone."""
    kind = type(elements), memoryview(elements).nbytes // max(1, len(elements))
    if kind not in _RECORDS:
        _RECORDS[kind] = elements.NumPy().dtype
    return np.frombuffer(elements, dtype=_RECORDS[kind])


@dataclass(frozen=True)
class MeshArrays:
    """A mesh of simplices as arrays, each copied when it is first asked for; numbers count from 0.

    Attributes
    ----------
    mesh : ng.Mesh
        Of dimension d, with nv vertices, ne elements and k facets of the boundary: triangles and
        segments in the plane. A mesh that is refined or moved in place needs another object.
    """

    mesh: ng.Mesh

    @cached_property
    def dim(self) -> int:
        """The dimension d."""
        return int(self.mesh.dim)

    @cached_property
    def vertices(self) -> Array:
        """Coordinates (nv, d), lengths."""
        return np.array(self.mesh.ngmesh.Coordinates())[:, : self.dim]

    @cached_property
    def elements(self) -> Index:
        """Vertices (ne, d + 1) of each element, in the plane anticlockwise."""
        return self._elements["nodes"][:, : self.dim + 1].astype(np.intp) - 1

    @cached_property
    def bodies(self) -> Index:
        """Material region number (ne,) of each element."""
        return self._elements["index"].astype(np.intp) - 1

    @cached_property
    def facets(self) -> Index:
        """Vertices (k, d) of each facet of the boundary, also of those inside bodies."""
        return self._facets["nodes"][:, : self.dim].astype(np.intp) - 1

    @cached_property
    def boundaries(self) -> Index:
        """Boundary region number (k,) of each facet."""
        return self._facets["index"].astype(np.intp) - 1

    @property
    def surface_parameters(self) -> Array:
        """Parameters (k, 3, 2) of the CAD face at the corners of each facet of a solid."""
        elements = self.mesh.ngmesh.Elements2D()
        records = np.frombuffer(elements, np.uint8).reshape(len(elements), -1)
        corners = records[:, PARAMETERS : PARAMETERS + 72]  # a number, u and v of each
        return np.ascontiguousarray(corners).view(float).reshape(-1, 3, 3)[..., 1:]

    @cached_property
    def corners(self) -> Array:
        """Coordinates (ne, d + 1, d) of the vertices of each element, lengths."""
        return self.vertices[self.elements]

    @property
    def sides(self) -> Index:
        """Vertices (ne, d + 1, d) of the sides of each element."""
        return self.elements[:, SIDES[self.dim]]

    @property
    def diameters(self) -> Array:
        """Longest edge (ne,) of each element, lengths."""
        one, other = map(list, zip(*combinations(range(self.dim + 1), 2), strict=True))
        edges = self.corners[:, one] - self.corners[:, other]
        return np.linalg.norm(edges, axis=2).max(axis=1)

    @property
    def measures(self) -> Array:
        """Signed area (ne,) of each triangle, or volume of each tetrahedron."""
        corners = self.corners
        # Netgen's tetrahedra are positive with the fourth vertex below the first three.
        size = math.factorial(self.dim) * (-1) ** self.dim
        return np.linalg.det(corners[:, 1:] - corners[:, :1]) / size

    @cached_property
    def extent(self) -> float:
        """Largest extent along an axis of coordinates, a length."""
        return float(np.ptp(self.vertices, axis=0).max())

    @cached_property
    def angles(self) -> Array:
        """Sum (nv,) of the angles of plane triangles at each vertex, radians."""
        side = np.roll(self.corners, -1, axis=1) - self.corners
        back = -np.roll(side, 1, axis=1)
        sine = side[..., 0] * back[..., 1] - side[..., 1] * back[..., 0]
        angles = np.arctan2(sine, (side * back).sum(axis=2))
        sums = np.bincount(self.elements.ravel(), angles.ravel(), len(self.vertices))
        return np.asarray(sums, dtype=float)

    @cached_property
    def pieces(self) -> Index:
        """Number (nv,) of the connected piece of the mesh that each vertex belongs to."""
        return np.asarray(self._kept("pieces", self._connected))

    def _kept(self, name: str, find: Callable[[], Any]) -> Any:
        """What `find` answers, once for the elements and facets of a mesh and of its copies."""
        key = hash((self.elements.tobytes(), self.facets.tobytes()))
        kept = self.mesh.__dict__.setdefault(KEPT, {})
        if name not in kept or kept[name][0] != key:
            kept[name] = key, find()
        return kept[name][1]

    def _connected(self) -> Index:
        """The `pieces`."""
        nv, (ne, corners) = len(self.vertices), self.elements.shape
        # Vertices first, to be numbered first, then elements, each joined to its vertices.
        starts = np.concatenate([np.zeros(nv), corners * np.arange(ne + 1)]).astype(np.int32)
        joins = self.elements.ravel().astype(np.int32)
        graph = sp.csr_array((np.ones(joins.size), joins, starts), (nv + ne, nv + ne))
        return connected_components(graph, directed=False)[1][:nv].astype(np.intp)

    @property
    def facet_elements(self) -> Index:
        """Number (k,) of an element at each facet."""
        return self._at_facets[0]

    @property
    def inner_facets(self) -> Mask:
        """Facets (k,) between two elements: lines inside bodies."""
        one, other = self._at_facets
        return one != other

    @property
    def shared_facets(self) -> Mask:
        """Facets (k,) between two bodies that are glued."""
        names, (one, other) = np.array(self.mesh.GetMaterials()), self._at_facets
        shared = one != other
        sides = names[self.bodies[one[shared]]], names[self.bodies[other[shared]]]
        shared[shared] = sides[0] != sides[1]
        return shared

    def keys(self, vertices: Index) -> Index:
        """Numbers (k, ...) of sets of `vertices` (k, ..., d), whatever the order of these is."""
        return np.sort(vertices, axis=-1) @ len(self.vertices) ** np.arange(self.dim)[::-1]

    def near(self, points: Array, reach: float = 1.0) -> tuple[Index, Index]:
        """Numbers (q,) of `points` (k, d) and of elements (q,) in whose balls they lie.

        About the middle of the vertices, `reach` times as large as to contain these.
        """
        corners, middle = self.corners, self.corners.mean(axis=1)
        radius = reach * np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
        low, high = points.min(axis=0, initial=np.inf), points.max(axis=0, initial=-np.inf)
        r = radius[:, None]
        some = np.flatnonzero(((low <= middle + r) & (middle - r <= high)).all(axis=1))
        found = KDTree(points).query_ball_point(middle[some], radius[some])
        element = np.repeat(some, [len(numbers) for numbers in found])
        return np.concatenate([*found, []]).astype(np.intp), element

    def without_simplices(self) -> int:
        """Number of elements that are no simplices."""
        kind, (one, other) = self._elements["type"], SIMPLICES[self.dim]
        return int(np.count_nonzero((kind != one) & (kind != other)))

    @property
    def _elements(self) -> np.ndarray:
        mesh = self.mesh.ngmesh
        return _records(mesh.Elements2D() if self.dim == 2 else mesh.Elements3D())

    @property
    def _facets(self) -> np.ndarray:
        mesh = self.mesh.ngmesh
        return _records(mesh.Elements1D() if self.dim == 2 else mesh.Elements2D())

    @cached_property
    def _at_facets(self) -> tuple[Index, Index]:
        one, other = self._kept("sides", self._sides_at_facets)
        return one, other

    def _sides_at_facets(self) -> tuple[Index, Index]:
        """Both elements (k,) at each facet, one twice on the outer boundary."""
        marked = np.zeros(len(self.vertices), dtype=bool)
        marked[self.facets] = True
        sides = self.sides.reshape(-1, self.dim)
        some = np.flatnonzero(marked[sides].all(axis=1))  # few, which are sorted in no time
        keys, wanted = self.keys(sides[some]), self.keys(self.facets)
        order = np.argsort(keys)
        first = np.searchsorted(keys[order], wanted)
        last = np.searchsorted(keys[order], wanted, side="right")
        one, other = (some[order[at]] // (self.dim + 1) for at in (first, last - 1))
        return one, other


def move_vertices(mesh: ng.Mesh, positions: Array) -> None:
    """Move the vertices of a mesh to `positions` (nv, d), in place; curves stay as they were."""
    mesh.ngmesh.Coordinates()[:, : positions.shape[1]] = positions


def bisect(mesh: ng.Mesh, marked: Mask) -> None:
    """Refine the elements `marked` (ne,) of a mesh in place, which straightens it."""
    MeshArrays(mesh)._elements["refine"] = marked  # all of them: they are True by default
    mesh.Refine(mark_surface_elements=mesh.dim == 2)  # of solids all are marked by default


def on_axis(points: Array) -> Mask:
    """Mask (k,) of the `points` (k, 2) of a mesh, or of its whole boundary, at which r = 0."""
    r = np.abs(points[:, 0])
    return np.asarray(r <= AXIS_RADIUS * r.max(initial=0.0))
