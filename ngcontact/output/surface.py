"""The side of a pair of solids that carries contact points, as triangles with values at nodes."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array, Index
from ..contact import with_vertices
from ..estimator import pressure_field
from ..fem import BoundaryTrace
from ..reference import triangle
from ..solved import Solved


@dataclass(frozen=True, eq=False)
class ContactSurface:
    """Facets of a secondary with contact points; n nodes, at a corner of the body one a side."""

    trace: BoundaryTrace
    pair: int
    facets: Index  # (k,), in `trace`
    nodes: Index  # (k, q), of each facet, as `reference.triangle` has them
    points: Array  # (n, 3), places of the nodes, lengths
    row: Index  # (n,), number in ``solution.points``; -1 where none is

    @property
    def edges(self) -> Index:
        """Nodes (3 k, order + 1) of the edges of all facets, in order."""
        inner = triangle.edge_nodes(self.trace.order)
        local = np.column_stack([triangle.EDGES[:, 0], inner, triangle.EDGES[:, 1]])
        return np.asarray(self.nodes[:, local].reshape(-1, self.trace.order + 1))

    @property
    def triangles(self) -> Index:
        """Nodes (t, 3) of small triangles, order^2 of them to each facet."""
        return np.asarray(self.nodes[:, triangle.parts(self.trace.order)].reshape(-1, 3))

    def looking(self, direction: Array) -> ContactSurface:
        """The part whose facets look along `direction` (3,): none lies behind another."""
        middle = np.tile(triangle.CENTRE, (len(self.facets), 1))
        ahead = self.trace.normal(self.facets, middle) @ direction > 0
        used, nodes = np.unique(self.nodes[ahead], return_inverse=True)
        nodes, facets = nodes.reshape(-1, self.nodes.shape[1]), self.facets[ahead]
        return replace(
            self, facets=facets, nodes=nodes, points=self.points[used], row=self.row[used]
        )

    def values(self, values: Array) -> Array:
        """Values (n,) of `values` (m,) at contact points, at other nodes means or NaN."""
        rows, found = self.row[self.nodes], np.empty(len(self.row))
        size = self.trace.sizes(self.facets)
        known = np.append(values, np.nan)[rows]
        found[self.nodes] = with_vertices(known, rows < 0, self.nodes, size)
        return found

    def pressure(self, solution: Solved) -> Array:
        """Pressure (n,) at the nodes: that of `pressure_field`, the mean over facets at a node."""
        field = pressure_field(solution, solution.pairs[self.pair])
        found = self.trace.evaluate(field, *self.trace.at_nodes(self.facets))[:, 0]
        at = self.nodes.ravel()
        # Means beside the end of contact go on below 0, where no row is.
        least = min(0.0, float(solution.pressure.min()))
        return np.maximum(np.bincount(at, found) / np.bincount(at), least)


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
    points = trace.point(facet[one], place[one])
    return ContactSurface(trace, pair, facets, nodes.reshape(key.shape), points, row)
