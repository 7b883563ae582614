"""The side of a pair of solids that carries contact points, as triangles with values at nodes."""

from __future__ import annotations

from dataclasses import dataclass

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
