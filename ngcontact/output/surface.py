"""The side of a pair of solids that carries contact points, as triangles with values at nodes."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from scipy.spatial import Delaunay

from ..arrays import Array, Index
from ..fem import BoundaryTrace
from ..reference import triangle
from ..solved import Solved


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """Facets of a secondary with contact points; n nodes, at a corner of the body one a side."""

    trace: BoundaryTrace
    nodes: Index  # (k, q), of each facet, as `reference.triangle` has them
    facet: Index  # (n,), one with the node, in `trace`
    place: Array  # (n, 3), of the node there
    row: Index  # (n,), number in ``solution.points``; -1 where none is

    @property
    def points(self) -> Array:
        """Places (n, 3) of the nodes, lengths."""
        return self.trace.point(self.facet, self.place)

    @property
    def edges(self) -> Index:
        """Nodes (3 k, order + 1) of the edges of all facets, in order."""
        inner = triangle.edge_nodes(self.trace.order)
        local = np.column_stack([triangle.EDGES[:, 0], inner, triangle.EDGES[:, 1]])
        return np.asarray(self.nodes[:, local].reshape(-1, self.trace.order + 1))

    @property
    def triangles(self) -> Index:
        """Nodes (t, 3) of small triangles, order^2 of them to each facet."""
        corners = triangle.nodes(self.trace.order)[:, :2]
        return np.asarray(self.nodes[:, Delaunay(corners).simplices].reshape(-1, 3))

    def values(self, values: Array) -> Array:
        """Values (n,) at the nodes, of `values` (m,) at contact points.

        Vertices of order 2, which are none, have the mean by area of the linear functions through
        the middles of edges; what has no value is NaN.
        """
        found = np.append(values, np.nan)[self.row]
        if self.trace.order == 2:
            a, b, c = found[self.nodes[:, 3:]].T  # edges 20, 12, 01
            ends = np.stack([a + c - b, b + c - a, a + b - c], axis=1)
            known = np.isfinite(ends).all(axis=1)
            x, y, z = self.points[self.nodes[known, :3]].transpose(1, 0, 2)
            area = np.linalg.norm(np.cross(y - x, z - x), axis=1)[:, None]
            at, shares = self.nodes[known, :3], (area * ends[known], area * np.ones(3))
            total, size = (np.bincount(at.ravel(), s.ravel(), len(found)) for s in shares)
            with np.errstate(invalid="ignore"):
                found = np.where(np.isnan(found), total / size, found)
        return np.asarray(found)

    def pressure(self, solution: Solved) -> Array:
        """Pressure (n,) at the nodes for the eye; 0 where nothing is faced.

        Of order 2 it is linear between the means at vertices. Of order 3, whose rows alternate, it
        is the normal stress, the mean over the facets at a node.
        """
        trace, rows = self.trace, solution.pressure
        found = np.nan_to_num(self.values(rows))
        if trace.order == 2:
            found[self.nodes[:, 3:]] = found[self.nodes[:, triangle.EDGES]].mean(axis=2)
        elif trace.order == 3:
            facet = np.repeat(self.facet[self.nodes[:, -1]], self.nodes.shape[1])
            place, at = np.tile(triangle.nodes(3), (len(self.nodes), 1)), self.nodes.ravel()
            n = trace.normal(facet, place)
            on_it = ng.BoundaryFromVolumeCF(solution.stress)
            stress = trace.evaluate(on_it, facet, place).reshape(-1, 3, 3)
            normal = -np.einsum("ki,kij,kj->k", n, stress, n)
            found = np.bincount(at, normal) / np.bincount(at)
            found = np.where(np.isnan(self.values(rows)), 0.0, found)
        # Means beside the end of contact go on below 0, where no row is.
        return np.maximum(found, min(0.0, float(rows.min())))


def contact_surface(solution: Solved, pair: int) -> ContactSurface:
    """The surface of one pair: the facets that have contact points."""
    trace, zone = solution.discrete.space.trace, solution.pairs[pair].line
    first = int(np.searchsorted(solution.pair, pair))
    kept = (zone.rows >= 0).any(axis=1)
    facets, rows = zone.segments[kept], zone.rows[kept]
    key = trace.nodes[facets] * (len(solution.points) + 1) + rows + 1
    _, one, nodes = np.unique(key, return_index=True, return_inverse=True)
    facet, place = trace.at_nodes(facets)
    row = np.where(rows < 0, -1, first + rows).ravel()[one]
    return ContactSurface(trace, nodes.reshape(key.shape), facet[one], place[one], row)
