"""Tractions on the boundary: those given, those of an equilibrated stress, what is missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Index, Mask
from ...fem import BoundaryTrace
from ...lagrange import gauss_derivative, lagrange
from ...problem import Problem
from ...quadrature import loads_of
from .cells import Cells
from .elements import Multipliers
from .facing import DATA_DEGREE, POINTS, WEIGHTS, FacingSides, jump

FINEST_PARTS = 16  # of a side of an element: cells do not become smaller
LEAST_PART = 0.25  # of a segment, between vertices beside rough places
TRACTION_ROUND_OFF = 1e-10  # relative to the largest stress: as equilibrium is accepted


@dataclass(frozen=True, eq=False)
class BoundaryData:
    """Tractions that are given on m sides of the boundary, at j points of each."""

    cells: Cells
    held: Mask  # (e, 2) components with prescribed displacements: no traction is given
    side: Index  # (m,)
    weight: Array  # (m, j) of Gauss at `POINTS`, in arc length times the model's measure
    measure: Array  # (m, j) the model's
    x: Array  # (m, j, 2) points, lengths
    normal: Array  # (m, j, 2) unit normals, out of the bodies
    loads: Array  # (m, j, 2) given tractions

    def fixed(self, mu: Multipliers) -> Mask:
        """Multipliers (d,) of components with prescribed displacements."""
        return np.repeat(self.held.ravel(), np.repeat(mu.degree + 1, 2))

    def moments(self, mu: Multipliers) -> Array:
        """Moments (d,) of the loads with the multipliers."""
        return mu.moments(self.side, POINTS, self.weight[..., None] * self.loads)  # (3.7)

    def work(self, tractions: Array, side: Index, direction: Array, amount: Array) -> float:
        """Work of `tractions` (m, j, 2) on a displacement of sides `side` (k,).

        It is an `amount` (k, i) along a `direction` (k, i, 2) at Gauss-Lobatto points of each side.
        """
        at = np.searchsorted(self.side, side)
        u = lagrange(DATA_DEGREE, POINTS) @ (amount[..., None] * direction)
        return float((self.weight[at, :, None] * tractions[at] * u).sum())

    def missed(
        self,
        tractions: Array,
        lines: Sequence[FacingSides],
        pressure: Sequence[Array],
        largest: float,
    ) -> Array:
        """L2 norms (n, 3) on sides of what `tractions` (m, j, 2) miss, times the model's measure.

        Of the loads, and of the pressures on lines: `pressure` (k, n) are coefficients on each.
        What is round-off beside the `largest` stress counts as 0.
        """
        cells, density = self.cells, self.weight / WEIGHTS
        asked, at = density[..., None] * self.loads, np.full(len(cells.ends), -1)
        at[self.side] = np.arange(len(self.side))
        for f, p in zip(lines, pressure, strict=True):
            force = (f.force(p) / WEIGHTS)[..., None] * f.direction
            np.add.at(asked, at[f.side], -force)
            if (f.other >= 0).any():
                rate = np.abs(f.there @ gauss_derivative(2 * DATA_DEGREE).T)  # of t there by t
                np.add.at(asked, at[f.other], f.on_primary(force / rate[..., None]))
        length = density / np.where(self.measure > 0, self.measure, 1.0)
        density = np.where(density > 0, density, np.inf)[..., None]
        lost = (asked / density - tractions) * self.measure[..., None]
        owner, local = cells.owner[self.side], cells.local[self.side]
        lost[np.broadcast_to(self.held[self.side][:, None], lost.shape)] = 0.0
        size = cells.measure(cells.corners[owner]).max(axis=1)  # stresses lose it at an axis
        lost[np.abs(lost) <= TRACTION_ROUND_OFF * largest * size[:, None, None]] = 0.0
        found = np.zeros((len(cells.triangles), 3))
        found[owner, local] = np.sqrt((WEIGHTS * length * (lost**2).sum(axis=2)).sum(axis=1))
        return found


def rough_places(problem: Problem, trace: BoundaryTrace) -> tuple[Index, Array]:
    """Segments (r,) and parameters s (r,) at which tractions have a jump or a kink.

    There cells get vertices, so that both sides are smooth: in the middle of the smallest cells of
    quadrature.
    """
    found = [(np.zeros(0, dtype=np.intp), np.zeros(0))]
    for load in loads_of(problem, trace.mesh):
        rough = load.where_rough(trace.order) if load.kind == "traction" else None
        if rough is None:
            continue
        size = rough.cells.side[:, 0, 0]
        middle = 1 - rough.cells.origin[:, 0] - size / 2  # s falls in NGSolve
        for k in np.unique(rough.cells.element):
            own = np.flatnonzero(rough.cells.element == k)
            s = np.median(middle[own[size[own] == size[own].min()]])
            if min(s, 1 - s) > 1 / FINEST_PARTS:
                found.append((np.array([k]), np.array([s])))
    segments, places = (np.concatenate(x) for x in zip(*found, strict=True))
    return segments, places


def boundary_data(problem: Problem, cells: Cells) -> BoundaryData:
    """The conditions of a problem."""
    held = np.zeros((len(cells.ends), 2), dtype=bool)
    for name, values in problem.displacement.items():
        held[cells.sides_on(cells.trace.segments(name))] |= [value is not None for value in values]
    side = np.flatnonzero(~cells.inner)
    x, dx = cells.points(side, np.tile(POINTS, (len(side), 1)))
    length, measure = np.linalg.norm(dx, axis=2), cells.measure(x)
    normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1) / length[..., None]
    normal[cells.backward[cells.owner[side], cells.local[side]]] *= -1
    loads = np.zeros(x.shape)
    for name in problem.traction:
        own, load = cells.sides_on(cells.trace.segments(name)), problem.traction_vector(name)
        values, _ = jump(cells.trace, load, cells.on_side(own, POINTS[None]))
        loads[np.searchsorted(side, own)] += values
    weight = WEIGHTS * length * measure
    return BoundaryData(cells, held, side, weight, measure, x, normal, loads)
