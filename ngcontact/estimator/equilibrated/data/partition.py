"""The triangles on which stresses are equilibrated: those of the mesh, some of them in parts."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ....arrays import Array, Index, Mask
from .polynomials import barycentric

BEFORE_ONE = 1 - 1e-9  # the last parameter that is looked up on a segment


@dataclass(frozen=True, eq=False)
class Partition:
    """Triangles, n of them, with e edges; edge i of a triangle lies opposite to its vertex i.

    Attributes
    ----------
    mesh : ng.Mesh
        Whose elements they divide.
    vertices : ndarray (v, 2)
        In units of `length`.
    length : float
        Unit of length.
    triangles : ndarray of int (n, 3)
        Vertices, anticlockwise.
    parent : ndarray of int (n,)
        Element of the mesh.
    within : ndarray (n, 3, 2)
        Where the vertices lie in the reference triangle of the element.
    edges : ndarray of int (n, 3)
        Number of each edge.
    ends : ndarray of int (e, 2)
        Vertices of each edge, the lower number first: from there it runs.
    segment : ndarray of int (e,)
        Segment of the boundary, -1 of edges between two triangles.
    along : ndarray of bool (e,)
        Whether the segment runs as the edge does.
    start, stop : ndarray (e,)
        Its part of the segment's parameter, 0 and 1 but in fans.
    """

    mesh: ng.Mesh
    vertices: Array
    length: float
    triangles: Index
    parent: Index
    within: Array
    edges: Index
    ends: Index
    segment: Index
    along: Mask
    start: Array
    stop: Array

    @cached_property
    def sides(self) -> Array:
        """Columns (n, 2, 2) of the affine maps from the reference triangle."""
        x = self.vertices[self.triangles]
        return np.stack([x[:, 0] - x[:, 2], x[:, 1] - x[:, 2]], axis=2)

    @cached_property
    def areas(self) -> Array:
        """Areas (n,)."""
        return np.asarray(np.linalg.det(self.sides) / 2)

    @cached_property
    def inverses(self) -> Array:
        """Gradients (n, 2, 2) of the two reference coordinates, as rows."""
        return np.asarray(np.linalg.inv(self.sides))

    @cached_property
    def hat_gradients(self) -> Array:
        """Gradients (n, 3, 2) of the hats of the vertices."""
        return np.concatenate([self.inverses, -self.inverses.sum(axis=1, keepdims=True)], axis=1)

    @cached_property
    def diameters(self) -> Array:
        """Longest sides (n,)."""
        return np.asarray(self.edge_lengths[self.edges].max(axis=1))

    @cached_property
    def edge_lengths(self) -> Array:
        """Lengths (e,)."""
        x = self.vertices[self.ends]
        return np.asarray(np.linalg.norm(x[:, 1] - x[:, 0], axis=1))

    @cached_property
    def normals(self) -> Array:
        """Outward unit normals (n, 3, 2) of the edges: hats fall towards them."""
        return -self.hat_gradients / np.linalg.norm(self.hat_gradients, axis=2)[:, :, None]

    @cached_property
    def flips(self) -> Mask:
        """Whether a triangle's edge, from vertex i + 1 to i + 2, runs against the edge, (n, 3)."""
        first, last = self.triangles[:, [1, 2, 0]], self.triangles[:, [2, 0, 1]]
        return first > last

    @cached_property
    def owner(self) -> tuple[Index, Index]:
        """A triangle of each edge (e,), and which of its edges it is."""
        number = np.zeros(len(self.ends), dtype=np.intp)
        number[self.edges.ravel()] = np.arange(self.edges.size)
        return np.divmod(number, 3)

    @cached_property
    def edge_of_segment(self) -> Index:
        """Number of an edge of each segment of the boundary, (q,); -1 of lines inside a body.

        Of several that at the end with the lower number, so that both run the same way.
        """
        numbers = np.full(int(self.segment.max(initial=-1)) + 1, -1)
        at = np.flatnonzero(self.segment >= 0)
        at = at[np.argsort(-self.ends[at, 0], kind="stable")]
        numbers[self.segment[at]] = at
        return numbers

    def of_elements(self, norms: Array) -> Array:
        """Norms (ne,) on the elements from those `norms` (n,) on the triangles."""
        return np.sqrt(np.bincount(self.parent, norms**2, minlength=self.mesh.ne))

    def touching(self, vertices: Mask) -> Mask:
        """Edges (e,) of which a triangle has one of some `vertices` (v,)."""
        at: Mask = np.any(vertices[self.triangles], axis=1, keepdims=True)[:, 0]
        return np.asarray(at[self.owner[0]])

    @property
    def shares(self) -> Array:
        """Shares (e,) of the edges of the boundary in their segments."""
        return self.stop - self.start

    def edge_at(self, segment: Index, s: Array) -> Index:
        """Edges (k,) at parameters `s` (k,) of segments `segment` (k,) of the boundary."""
        edges, keys = self._in_order
        places = segment + np.clip(s, 0.0, BEFORE_ONE)
        return np.asarray(edges[np.searchsorted(keys, places, side="right") - 1])

    def on_edges(self, edge: Index, s: Array) -> Array:
        """Parameters on edges `edge` (k,), as they run, at `s` (k,) or (k, q) of segments."""
        shape = (-1,) + (1,) * (s.ndim - 1)
        start, stop, along = (x[edge].reshape(shape) for x in (self.start, self.stop, self.along))
        t = (s - start) / (stop - start)
        return np.where(along, t, 1 - t)

    @cached_property
    def _in_order(self) -> tuple[Index, Array]:
        edges = np.flatnonzero(self.segment >= 0)
        keys = self.segment[edges] + self.start[edges]
        order = np.argsort(keys)
        return edges[order], keys[order]

    @cached_property
    def _mesh_points(self) -> NDArray:
        return self.mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)

    def evaluate(self, function: ng.CoefficientFunction, at: Index, points: Array) -> Array:
        """Values (k, q, d) at the reference `points` (q, 2) of the triangles `at` (k,)."""
        where = barycentric(points) @ self.within[at]
        places = self._mesh_points[np.repeat(self.parent[at], len(points))].copy()
        places["x"], places["y"] = where.reshape(-1, 2).T
        return np.asarray(function(places)).reshape(len(at), len(points), function.dim)

    def places(self, at: Index, points: Array) -> Array:
        """Places (k, q, 2) of reference `points` (q, 2) of the triangles `at` (k,)."""
        return self.evaluate(ng.CF((ng.x, ng.y)), at, points) / self.length

    def jacobians(self, at: Index, points: Array) -> Array:
        """Jacobians (k, q, 2, 2) of the triangles `at` (k,), curved ones, at `points` (q, 2)."""
        to_element = self.evaluate(ng.specialcf.JacobianMatrix(2), at, points) / self.length
        corners = self.within[at]
        inner = np.stack([corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]], axis=2)
        return np.asarray(to_element.reshape(len(at), -1, 2, 2) @ inner[:, None])


def of_body(mesh: ng.Mesh, pattern: str, region: Index) -> Index:
    """Triangles, of the `region` (n,), of the bodies that a pattern selects, (j,)."""
    return np.flatnonzero(np.array(mesh.Materials(pattern).Mask())[region])
