"""Tractions on the boundary: those given, those of an equilibrated stress, what is missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index, Mask
from ...fem import BoundaryTrace
from ...lagrange import gauss_derivative, lagrange
from ...problem import Problem, numbers
from ...quadrature import loads_of
from .cells import Cells
from .elements import Multipliers, traces
from .facing import DATA_DEGREE, POINTS, TO_LEGENDRE, WEIGHTS, FacingSides, jump, on_segments
from .force_quadrature import DIVISIONS, PARTS_OF_A_SIDE

FINEST_PARTS = PARTS_OF_A_SIDE**DIVISIONS  # parts of a side
SAME_BREAK = 1e-10  # of a side: breaks nearer to its ends are these
TRACTION_ROUND_OFF = 1e-10  # relative to the largest stress: as equilibrium is accepted


@dataclass(frozen=True, eq=False)
class SideRule:
    """Quadrature along sides of cells, j points on each of m pieces."""

    side: Index  # (m,) of each piece
    t: Array  # (m, j) parameters of the sides
    weight: Array  # (m, j) in arc length
    x: Array  # (m, j, 2) points, lengths
    normal: Array  # (m, j, 2) unit normals, out of the owners of the sides
    measure: Array  # (m, j) the model's

    def moments(self, mu: Multipliers, values: Array) -> Array:
        """Integrals (d,) of tractions `values` (m, j, 2) times the multipliers."""
        total, load = np.zeros(int(mu.start[-1])), (self.weight * self.measure)[..., None] * values
        for k in np.unique(mu.degree[self.side]).tolist():
            at = np.flatnonzero(mu.degree[self.side] == k)
            parts = np.einsum("mjc,mji->mci", load[at], traces(k, self.t[at])).reshape(len(at), -1)
            np.add.at(total, mu.start[self.side[at], None] + np.arange(2 * (k + 1)), parts)
        return total

    def work(self, values: Array, side: Index, direction: Array, amount: Array) -> float:
        """Work of tractions `values` (m, j, 2) on a displacement of sides `side` (k,).

        It is an `amount` (k, i) along a `direction` (k, i, 2) at Gauss-Lobatto points of each side.
        """
        order, at = np.argsort(side), np.flatnonzero(np.isin(self.side, side))
        own = order[np.searchsorted(side[order], self.side[at])]
        basis = lagrange(DATA_DEGREE, self.t[at].ravel()).reshape(-1, len(POINTS), DATA_DEGREE + 1)
        u = basis @ (amount[..., None] * direction)[own]
        return float(((self.weight * self.measure)[at, :, None] * values[at] * u).sum())

    def missed(self, cells: Cells, values: Array, largest: float) -> Array:
        """L2 norms (n, 3) of tractions `values` (m, j, 2) on sides, times the model's measure.

        What is round-off beside the `largest` stress counts as 0.
        """
        owner, lost = cells.owner[self.side], values * self.measure[..., None]
        size = cells.measure(cells.corners[owner]).max(axis=1)  # stresses lose it at an axis
        lost[np.abs(lost) <= TRACTION_ROUND_OFF * largest * size[:, None, None]] = 0.0
        squares = np.zeros((len(cells.triangles), 3))
        square = (self.weight[..., None] * lost**2).sum(axis=(1, 2))
        np.add.at(squares, (owner, cells.local[self.side]), square)
        return np.sqrt(squares)


def side_rule(cells: Cells, breaks: Array, side: Index) -> SideRule:
    """The rule on sides `side` (k,), which begins anew at `breaks` (r, 2) of `BoundaryData`."""
    segment, s = breaks[:, 0].astype(np.intp), breaks[:, 1]
    at = cells.side_at(segment, s)
    some = (cells.segment[at] == segment) & np.isin(at, side)
    t = cells.own_parameter(at[some], s[some, None])[:, 0]
    inside = (t > SAME_BREAK) & (t < 1 - SAME_BREAK)
    every = np.concatenate([side, side, at[some][inside]])
    t = np.concatenate([np.zeros(len(side)), np.ones(len(side)), t[inside]])
    order = np.lexsort((t, every))
    one = np.diff(every[order]) == 0
    piece, start, stop = every[order][:-1][one], t[order][:-1][one], t[order][1:][one]
    t = start[:, None] + (stop - start)[:, None] * POINTS
    x, dx = cells.points(piece, t)
    length = np.linalg.norm(dx, axis=2)
    normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1) / length[..., None]
    normal[cells.backward[cells.owner[piece], cells.local[piece]]] *= -1
    measure = cells.measure(x)
    return SideRule(piece, t, (stop - start)[:, None] * WEIGHTS * length, x, normal, measure)


@dataclass(frozen=True, eq=False)
class BoundaryData:
    """Prescribed displacements and tractions on e sides."""

    problem: Problem
    cells: Cells
    held: Mask  # (e, 2) components with prescribed displacements: no traction is given
    loads: dict[str, Index]  # sides (k,) of each P of `Problem.traction`
    supports: list[tuple[Sequence[Any], Index]]  # u_D of `Problem.displacement`, with sides (k,)
    # (r, 2) segments and s, rising: where rules on the boundary begin anew to follow tractions
    breaks: Array
    # (e, j, 2) what pressures of lines exert: forces per t, with the measure, at `POINTS`
    pressed: Array

    def followed(self) -> Index:
        """Number of divisions (n,) of triangles that follow tractions, `DIVISIONS` at most."""
        cells, found = self.cells, np.zeros(len(self.cells.triangles), dtype=np.intp)
        breaks = np.bincount(self.breaks[:, 0].astype(np.intp), minlength=len(cells.trace.region))
        count = np.append(breaks, 0)[cells.segment]  # none inside, -1
        np.maximum.at(found, cells.owner, np.where(count >= FINEST_PARTS, DIVISIONS, count > 0))
        return found

    def with_pressure(
        self, lines: Sequence[FacingSides], pressure: Sequence[Array]
    ) -> BoundaryData:
        """These data with pressures on lines: coefficients `pressure` (k, n) on each."""
        pressed = np.zeros_like(self.pressed)
        for f, p in zip(lines, pressure, strict=True):
            force = (f.force(p) / WEIGHTS)[..., None] * f.direction
            np.add.at(pressed, f.side, -force)
            if (f.other >= 0).any():
                rate = np.abs(f.there @ gauss_derivative(2 * DATA_DEGREE).T)  # of t there by t
                np.add.at(pressed, f.other, f.on_primary(force / rate[..., None]))
        return replace(self, pressed=pressed)

    def tractions(self, cells: Cells, rule: SideRule, own: Array) -> Array:
        """Given tractions (m, j, 2) on sides of `cells`, which are parts; else `own` (m, j, 2)."""
        segment, s = on_segments(cells, rule.side, rule.t)
        on, asked = np.flatnonzero(segment >= 0), own.copy()
        segment, s, total = segment[on], s[on], np.zeros((len(on), *own.shape[1:]))
        side = self.cells.side_at(segment, s[:, s.shape[1] // 2])
        for name, loaded in self.loads.items():
            at = np.flatnonzero(np.isin(side, loaded))
            if at.size:
                load = self.problem.traction_vector(name)
                total[at] += jump(cells.trace, load, (segment[at], s[at]))[0]
        at = np.flatnonzero(self.pressed[side].any(axis=(1, 2)))
        if at.size:
            t = self.cells.own_parameter(side[at], s[at])
            x, dx = self.cells.points(side[at], t)
            ds = np.linalg.norm(dx, axis=2, keepdims=True) * cells.measure(x)[..., None]
            force = TO_LEGENDRE @ self.pressed[side[at]]
            force = legendre.legvander(2 * t - 1, DATA_DEGREE) @ force
            total[at] += np.divide(force, ds, out=np.zeros_like(force), where=ds > 0)
        asked[on] = np.where(self.held[side][:, None], own[on], total)
        return asked

    def moments(self, mu: Multipliers) -> tuple[Array, Mask]:
        """Moments (d,) of the loads with the multipliers, and which of these are fixed, (d,).

        Fixed are those of components with prescribed displacements.
        """
        rule = side_rule(self.cells, self.breaks, np.flatnonzero(~self.cells.inner))
        values = self.tractions(self.cells, rule, np.zeros(rule.x.shape))
        fixed = np.repeat(self.held.ravel(), np.repeat(mu.degree + 1, 2))
        return rule.moments(mu, values), fixed  # (3.7)


def rough_places(problem: Problem, trace: BoundaryTrace) -> dict[int, Array]:
    """Rising parameters s, (j,), at which tractions are rough, by segment: vertices of the cells.

    First the middle of the smallest cells of quadrature, where a jump or a kink is, so that both
    sides of it are smooth; then ends of cells, the smallest first, that are 1 / `PARTS_OF_A_SIDE`
    of the segment away from all others: flat triangles lose digits.
    """
    found: dict[int, list[float]] = {}
    for load in loads_of(problem, trace.mesh):
        rough = load.where_rough(trace.order) if load.kind == "traction" else None
        if rough is None:
            continue
        start, size = 1 - rough.cells.origin[:, 0], rough.cells.side[:, 0, 0]  # s falls in NGSolve
        for k in np.unique(rough.cells.element).tolist():
            own = np.flatnonzero(rough.cells.element == k)
            own = own[np.argsort(size[own], kind="stable")]
            least = own[size[own] == size[own[0]]]
            places = [np.median(start[least] - size[least] / 2)]
            places += np.column_stack([start, start - size])[own].ravel().tolist()
            limits = [1 / FINEST_PARTS] + [1 / PARTS_OF_A_SIDE] * (len(places) - 1)
            kept = found.setdefault(k, [])
            for s, apart in zip(places, limits, strict=True):
                if min(abs(s - other) for other in (0.0, 1.0, *kept)) > apart:
                    kept.append(float(s))
    return {k: np.sort(s) for k, s in found.items() if s}


def boundary_data(problem: Problem, cells: Cells) -> BoundaryData:
    """The conditions of a problem."""

    def sides(pattern: str) -> Index:
        return np.flatnonzero(np.isin(cells.segment, cells.trace.segments(pattern)))

    held, breaks = np.zeros((len(cells.ends), 2), dtype=bool), [np.zeros((0, 2))]
    supports = [(values, sides(pattern)) for pattern, values in problem.displacement.items()]
    for values, at in supports:
        held[at] |= [value is not None for value in values]
    loads = {name: sides(name) for name in problem.traction}
    # Ends of parts, and of those for quadrature of rough loads.
    for load in loads_of(problem, cells.trace.mesh):
        if load.kind != "traction" or numbers(load.data):
            continue
        side = loads[load.name]
        segment, s = on_segments(cells, side, np.arange(1, FINEST_PARTS) / FINEST_PARTS)
        breaks.append(np.column_stack([np.repeat(segment, FINEST_PARTS - 1), s.ravel()]))
        rough = load.where_rough(cells.trace.order)
        if rough is not None:  # NGSolve's segments run from s = 1 to s = 0
            start = rough.cells.origin[:, 0]
            for stop in (start, start + rough.cells.side[:, 0, 0]):
                breaks.append(np.column_stack([rough.cells.element, 1 - stop]))
    none = np.zeros((len(cells.ends), len(POINTS), 2))
    rising = np.unique(np.concatenate(breaks), axis=0)
    return BoundaryData(problem, cells, held, loads, supports, rising, none)
