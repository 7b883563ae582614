"""Boundary facets of a mesh of solids, with nodes as segments of a plane mesh have them.

Nodes are those of `reference.triangle`; a place on a facet is given by barycentric coordinates. On
the facets where conditions are posed, values at the nodes replace NGSolve's edge and face
functions: coefficients are Phi^-1 times the values, Phi (q, q) the functions at the nodes. On some,
where a facet faces another body in part, the unknowns are Bernstein coefficients c instead: values
are B c, of functions that are nowhere negative.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import ClassVar

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, rightward
from ..mesh import CadEdge, CadFace, feet_on_faces
from ..reference import triangle
from .boundary import BoundaryTrace
from .model import PLANE, SOLID_MODEL, Model


@dataclass(frozen=True, eq=False)
class FacetTrace(BoundaryTrace):
    """Facets of the whole boundary of solids, k of them, with q nodes each.

    What `BoundaryTrace` says of segments holds of facets; parameters s are barycentric coordinates
    (k, 3), curves are surfaces by the points (k, q', 3) at the nodes of their degree, the `side` is
    +1 where the outward normal is that of the vertices' order, and nothing lies on an axis.
    """

    corners: ClassVar[list[int]] = [0, 1, 2]
    vertices: ClassVar[Array] = np.eye(3)  # (3, 3)

    @staticmethod
    def nodes_of(degree: int) -> Array:
        """Barycentric coordinates (q, 3) of the nodes of a surface of a degree."""
        return triangle.nodes(degree)

    @staticmethod
    def barycentric(s: Array) -> list[Array]:
        """Barycentric coordinates (k,) of places `s` (k, 3), which are given by these."""
        return list(np.moveaxis(s, -1, 0))

    @staticmethod
    def _numbered(ends: Index, functions: Index) -> Index:
        nodes, order = functions.copy(), triangle.DEGREES[functions.shape[1]]
        for (first, last), inner in zip(triangle.EDGES, triangle.edge_nodes(order), strict=True):
            reversed_edges = np.flatnonzero(ends[:, first] > ends[:, last])[:, None]
            nodes[reversed_edges, inner] = nodes[reversed_edges, inner[::-1]]
        return nodes

    def point(self, segment: Index, s: Array) -> Array:
        """Points (k, 3) of the mesh's surface at `s` (k, 3) of facets `segment` (k,)."""
        return np.einsum(
            "ki,kid->kd", triangle.lagrange(self.geometry_order, s), self.curve[segment]
        )

    def derivative(self, segment: Index, s: Array) -> Array:
        """Derivatives (k, 3, 2) with respect to L0, L1, at `s` (k, 3) of facets `segment` (k,)."""
        weights = triangle.lagrange_gradient(self.geometry_order, s)
        return np.einsum("kij,kid->kdj", weights, self.curve[segment])

    def area_vector(self, segment: Index, s: Array) -> Array:
        """Outward normals (k, 3), areas per weight of `rule`, at `s` (k, 3) of `segment` (k,)."""
        tangents = self.derivative(segment, s)
        vectors = np.cross(tangents[..., 0], tangents[..., 1]) / 2
        return np.asarray(vectors * self.side[segment, None])

    def rule(self, degree: int) -> tuple[Array, Array]:
        """Barycentric coordinates (g, 3) and weights (g,) of `triangle.gauss`."""
        return triangle.gauss(degree)

    def outward(self, segment: Index, slope: Array) -> Array:
        """Outward unit normals (k, 3) of `segment` (k,), by the derivatives `slope` (k, 3, 2)."""
        return rightward(slope[..., 0], slope[..., 1]) * self.side[segment, None]

    def _feet(
        self, segment: Index, points: Array, s: Array
    ) -> Iterator[tuple[CadEdge | CadFace, Index | Mask, Array, bool]]:
        return feet_on_faces(self.mesh, segment, points, s)

    def places(self, segments: Index) -> Array:
        """Barycentric coordinates (k, q, 3) of the nodes of `segments` (k,)."""
        return np.broadcast_to(triangle.nodes(self.order), (len(segments), self.nodes.shape[1], 3))

    def shapes(self, segment: Index, s: Array) -> Array:
        """Functions (k, q) of the unknowns at the nodes, at `s` (k, 3) of `segment` (k,)."""
        values = triangle.lagrange(self.order, s)
        if self.bernstein.any():
            values = np.einsum("ki,kij->kj", values, self.values_of_unknowns(segment))
        return values

    def weighs(self, segments: Index) -> Mask:
        """Nodes (k, q) of `segments` (k,) whose functions have a positive integral there.

        All at orders 1 and 3. At order 2 a vertex takes a share of edges with Bernstein
        coefficients; the integral of its own function vanishes.
        """
        carries = super().weighs(segments)
        if self.order == 2:
            carries[:, :3] = False
            chosen = self.bernstein[self.nodes[segments]]
            for ends, [inner] in zip(triangle.EDGES, triangle.edge_nodes(2), strict=True):
                carries[:, ends] |= chosen[:, [inner]]
        return carries

    def values_of_unknowns(self, segments: Index) -> Array:
        """B (k, q, q), from the unknowns at the nodes of `segments` (k,) to the values there."""
        q = self.nodes.shape[1]
        if not self.bernstein.any():
            return np.broadcast_to(np.eye(q), (len(segments), q, q))
        chosen = self.bernstein[self.nodes[segments]]
        B = np.where(chosen[:, :, None], triangle.bernstein(self.order), np.eye(q))
        return np.asarray(B)

    def unknowns_of_values(self, segments: Index, values: Array) -> Array:
        """Unknowns (k, q, ...) of functions of `values` (k, q, ...) at nodes of `segments` (k,)."""
        if not self.bernstein.any():
            return values
        flat = values.reshape(*values.shape[:2], -1)
        found = np.linalg.solve(self.values_of_unknowns(segments), flat)
        return np.asarray(found.reshape(values.shape))

    def lengths(self, segments: Index) -> Array:
        """Longest straight edges (k,) of `segments` (k,)."""
        corners = self.curve[segments, :3]
        return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)

    def sizes(self, segments: Index) -> Array:
        """Areas (k,) of the plane triangles of the vertices of `segments` (k,)."""
        a, b, c = self.curve[segments, :3].transpose(1, 0, 2)
        return np.asarray(np.linalg.norm(np.cross(b - a, c - a), axis=1) / 2)

    def _grouped(self, segment: Index) -> Index:
        return self.region[segment]  # facets of one face after another

    def _functions_by_unknowns(self, segments: Index) -> Array:
        return super()._functions_by_unknowns(segments) @ self.values_of_unknowns(segments)


def boundary_trace(mesh: ng.Mesh, order: int, model: Model = PLANE) -> BoundaryTrace:
    """Trace of the displacements of degree `order` on the boundary of `mesh`, in a model."""
    if mesh.dim == 3:
        return FacetTrace.of(mesh, order, SOLID_MODEL)
    return BoundaryTrace.of(mesh, order, model)
