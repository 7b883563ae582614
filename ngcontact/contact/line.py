"""The contact line: the secondary side of a pair and its contact points C_j."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import accumulate, pairwise
from typing import Any, ClassVar, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from ..arrays import Array, Index, Mask, from_triplets, rows_of
from ..problem import Contact

LEAST_COVERED = 0.5  # of a point's weight on its whole facets, below which pressures are means


@dataclass(frozen=True, eq=False)
class ContactLine:
    """The secondary side of one pair and its m contact points.

    Of solids segments are facets, and weights areas, across a fixed direction as it sees them.
    """

    by_segment: ClassVar[tuple[str, ...]] = ("segments", "rows", "faces", "shares", "covered")
    contact: Contact
    segments: Index  # (k,) segments of the secondary boundary
    facing: Index  # (q,) segments of the primary boundary
    # (k, q) contact point at each of the q nodes of each segment, -1 where none is; at nodes of
    # solids that supports hold the one beside that stands for them
    rows: Index
    faces: Mask  # (k,) segments that face the primary with all their nodes
    node: Index  # (m,) node of the secondary
    position: Array  # (m, d)
    direction: Array  # (m, d) unit vectors towards the facing body
    gap: Array  # (m,) distance eps(C_j) along the direction before deformation
    weight: Array  # (m,) integral of the basis function over s or eta, one-sided at corners
    partner: Index  # (m,) segment of the primary, -1 for a rigid obstacle
    partner_s: Array  # (m,) parameter on it, of solids (m, 3) barycentric coordinates
    coupling: sp.csr_array  # (m, n) weights of the n nodes in the displacement that faces points
    on_axis: Mask  # (m,) points on the axis of a body of revolution
    means: Mask  # (m,) points whose row is a mean over facing segments, not one at the node
    shares: Array  # (k, q) what each whole segment adds to the weights of its points
    covered: Array  # (k, q) what its part that faces the primary adds to them
    searches: int  # 1 if partners had to be searched, 0 if all are nodes at the same place

    @property
    def dim(self) -> int:
        """Dimension of the bodies."""
        return int(self.position.shape[1])

    @cached_property
    def neighbours(self) -> Index:
        """Pairs (l, 2) of contact points along a plane line, over nodes without one; `twins`."""
        segment, place = np.nonzero(self.rows >= 0)
        point, same = self.rows[segment, place], segment[1:] == segment[:-1]
        return np.concatenate([np.column_stack([point[:-1], point[1:]])[same], self.twins])

    @cached_property
    def links(self) -> Index:
        """Pairs (l, 2) of contact points at nodes beside each other on a plane line; `twins`."""
        pairs = np.stack([self.rows[:, :-1], self.rows[:, 1:]], axis=2).reshape(-1, 2)
        return np.concatenate([pairs[(pairs >= 0).all(axis=1)], self.twins])

    @cached_property
    def twins(self) -> Index:
        """Pairs (t, 2) of contact points that share a node, a corner."""
        order = np.argsort(self.node, kind="stable")
        node = self.node[order]
        same = np.flatnonzero(node[1:] == node[:-1])
        return np.column_stack([order[same], order[same + 1]])

    def with_points(self, keep: Mask) -> ContactLine:
        """The line with its points `keep` (m,) alone; the segments still face the primary."""
        if keep.all():
            return self
        renumber = np.append(np.where(keep, np.cumsum(keep) - 1, -1), -1)
        names = ("node", "position", "direction", "gap", "weight", "partner", "partner_s")
        kept = rows_of(self, keep, *names, "coupling", "on_axis", "means")
        return replace(kept, rows=renumber[self.rows])

    def on_segments(self, values: NDArray[Any], missing: Any) -> NDArray[Any]:
        """Values (k, q) at nodes, of `values` (m,), of vectors (k, q, d); `missing` without."""
        last = np.full((1, *values.shape[1:]), missing, values.dtype)
        return np.asarray(np.concatenate([values, last])[self.rows])

    def rows_at(self, nodes: Index) -> Index:
        """Contact points (k, q) that lie at the `nodes` (k, q) of the segments; -1 where none."""
        return np.where(self.on_segments(self.node, -1) == nodes, self.rows, -1)

    def covered_shares(self, on_parts: Array, everywhere: Array) -> Array:
        """Integrals (k,) of functions over the parts that face, over those on whole facets.

        Of values `on_parts` (m,) and `everywhere` (m,) at the points; 0 at facets without points.
        The same values give 1 where nodes face nodes.
        """
        pairs = (self.covered, on_parts), (self.shares, everywhere)
        part, whole = ((x * self.on_segments(v, 0.0)).sum(axis=1) for x, v in pairs)
        return np.asarray(np.divide(part, whole, out=np.zeros(len(part)), where=whole > 0))

    def pressure(self, force: Array) -> Array:
        """Pressures (m,) of the `force` (m,) at its points: (3.10), (3.10').

        Force over weight, except at points of solids most of whose facets face nothing: there the
        force also carries the balance of moments of the points around, and force over weight is no
        pressure. These points get the mean over rings of facets around them, the smallest whose
        facing parts amount to half the area of the point's own facets.
        """
        pressure, (k, q) = np.asarray(force / self.weight), self.rows.shape
        if self.dim == 2:
            return pressure
        on = self.rows >= 0
        facet, point = np.repeat(np.arange(k), q)[on.ravel()], self.rows[on]
        at = from_triplets(np.ones(len(point)), point, facet, (len(force), k))
        whole, covered = (
            np.bincount(point, x[on], len(force)) for x in (self.shares, self.covered)
        )
        beside = np.flatnonzero(covered < LEAST_COVERED * whole)
        area, total = (
            np.bincount(facet, x, k) for x in (self.covered[on], self.covered[on] * pressure[point])
        )
        enough, near = LEAST_COVERED * (at @ self.shares.sum(axis=1))[beside], at[beside]
        while beside.size:
            reached = near @ area
            pressure[beside] = (near @ total) / reached
            wider = near @ (at.T @ at)
            wider.data[:] = 1.0
            small = (reached < enough) & (np.diff(wider.indptr) > np.diff(near.indptr))
            beside, near, enough = beside[small], wider[small], enough[small]
        return pressure


Values = TypeVar("Values", Array, Mask, Index)


def by_line(lines: Sequence[ContactLine], values: Values) -> list[Values]:
    """Parts (m_i,) of `values` (m,) over the points of all lines in order, one for each line."""
    stops = list(accumulate((len(line.node) for line in lines), initial=0))
    return [values[first:last] for first, last in pairwise(stops)]
