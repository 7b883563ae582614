"""Tractions on the boundary: those given, those of an equilibrated stress, what is missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index, Mask
from ...fem import BoundaryTrace
from ...problem import Problem
from ...quadrature import known_rough_load, moment_degree, numbers
from .cells import Cells
from .elements import Element, Multipliers, among, traces
from .facing import DATA, LEGENDRE, PLACES, WEIGHTS, bernstein
from .parts import LEVELS, PARTS
from .program import Rows

FINEST = PARTS**LEVELS  # parts of a side
SAME = 1e-10  # of a side: breaks nearer to its ends are these
ROUND_OFF = 1e-10  # of tractions, relative to the largest stress: as equilibrium is accepted


@dataclass(frozen=True, eq=False)
class SideRule:
    """Quadrature along sides of cells, j points on each of m pieces.

    Attributes
    ----------
    side : ndarray of int (m,)
        Of each piece.
    t, weight : ndarray (m, j)
        Parameters of the sides, and weights in arc length.
    x, normal : ndarray (m, j, 2)
        Points, lengths; unit normals, out of the owners of the sides.
    measure : ndarray (m, j)
        The model's.
    """

    side: Index
    t: Array
    weight: Array
    x: Array
    normal: Array
    measure: Array

    def moments(self, mu: Multipliers, values: Array) -> Array:
        """Integrals (d,) of tractions `values` (m, j, 2) times the multipliers."""
        total, load = np.zeros(int(mu.start[-1])), (self.weight * self.measure)[..., None] * values
        for k in np.unique(mu.degree[self.side]).tolist():
            at = np.flatnonzero(mu.degree[self.side] == k)
            parts = np.einsum("mjc,mji->mci", load[at], traces(k, self.t[at])).reshape(len(at), -1)
            np.add.at(total, mu.start[self.side[at], None] + np.arange(2 * (k + 1)), parts)
        return total

    def missed(self, cells: Cells, values: Array, largest: float) -> Array:
        """L2 norms (n, 3) of tractions `values` (m, j, 2) on sides, times the model's measure.

        What is round-off beside the `largest` stress counts as 0.
        """
        owner, lost = cells.owner[self.side], values * self.measure[..., None]
        size = cells.measure(cells.corners[owner]).max(axis=1)  # stresses lose it at an axis
        lost[np.abs(lost) <= ROUND_OFF * largest * size[:, None, None]] = 0.0
        squares = np.zeros((len(cells.triangles), 3))
        square = (self.weight[..., None] * lost**2).sum(axis=(1, 2))
        np.add.at(squares, (owner, cells.local[self.side]), square)
        return np.sqrt(squares)

    def on_segments(self, cells: Cells) -> tuple[Index, Array]:
        """Segments (m,) and parameters s (m, j) of a rule along sides of the boundary."""
        a, b = cells.span[self.side].T[..., None]
        return cells.segment[self.side], a + (b - a) * self.t


def side_rule(cells: Cells, breaks: Array, side: Index) -> SideRule:
    """The rule on sides `side` (k,), which begins anew at `breaks` (r, 2) of `Given`."""
    segment, s = breaks[:, 0].astype(np.intp), breaks[:, 1]
    at = cells.side_at(segment, s)
    some = (cells.segment[at] == segment) & np.isin(at, side)
    t = cells.own_parameter(at[some], s[some, None])[:, 0]
    inside = (t > SAME) & (t < 1 - SAME)
    every = np.concatenate([side, side, at[some][inside]])
    t = np.concatenate([np.zeros(len(side)), np.ones(len(side)), t[inside]])
    order = np.lexsort((t, every))
    one = np.diff(every[order]) == 0
    piece, start, stop = every[order][:-1][one], t[order][:-1][one], t[order][1:][one]
    t = start[:, None] + (stop - start)[:, None] * PLACES
    x, dx = _points(cells, piece, t)
    length = np.linalg.norm(dx, axis=2)
    normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1) / length[..., None]
    normal[cells.backward[cells.owner[piece], cells.local[piece]]] *= -1
    measure = cells.measure(x)
    return SideRule(piece, t, (stop - start)[:, None] * WEIGHTS * length, x, normal, measure)


def _points(cells: Cells, side: Index, t: Array) -> tuple[Array, Array]:
    """`Cells.points`, (m, j, 2) each, at `t` (m, j) of sides `side` (m,)."""
    x, dx = cells.points(np.repeat(side, t.shape[1]), t.ravel())
    return x.reshape(*t.shape, 2), dx.reshape(*t.shape, 2)


def _evaluated(
    trace: BoundaryTrace, function: ng.CoefficientFunction, segment: Index, s: Array
) -> Array:
    """Values (m, j, dim) at `s` (m, j) of segments `segment` (m,)."""
    values = trace.evaluate(function, np.repeat(segment, s.shape[1]), s.ravel())
    return values.reshape(*s.shape, -1)


@dataclass(frozen=True, eq=False)
class Given:
    """Conditions on e sides.

    Attributes
    ----------
    problem : Problem
    cells : Cells
    held : ndarray of bool (e, 2)
        Components with prescribed displacements: no traction is given.
    loads : dict of ndarray of int (k,)
        Sides of each P of `Problem.traction`.
    supports : list of (values, ndarray of int (k,))
        u_D of `Problem.displacement` with their sides.
    guides : ndarray of int (k,)
        Sides of Gamma_0.
    breaks : ndarray (r, 2)
        Segments and s, rising: where rules on the boundary begin anew to follow tractions.
    pressed : ndarray (e, j, 2)
        What pressures of lines exert: forces per t, with the measure, at `PLACES`.
    """

    problem: Problem
    cells: Cells
    held: Mask
    loads: dict[str, Index]
    supports: list[tuple[Sequence[Any], Index]]
    guides: Index
    breaks: Array
    pressed: Array

    def followed(self) -> Index:
        """How often triangles (n,) are divided for tractions: `LEVELS` where these are rough."""
        cells, found = self.cells, np.zeros(len(self.cells.triangles), dtype=np.intp)
        side = np.flatnonzero(cells.segment >= 0)
        breaks = np.bincount(self.breaks[:, 0].astype(np.intp), minlength=len(cells.trace.region))
        count = breaks[cells.segment[side]]
        np.maximum.at(found, cells.owner[side], np.where(count >= FINEST, LEVELS, count > 0))
        return found

    def under(self, lines: Sequence[Rows], pressure: Sequence[Array]) -> Given:
        """The same with pressures on lines.

        Parameters
        ----------
        pressure : sequence of ndarray (k, n)
            Bernstein coefficients on the k sides of each line.
        """
        pressed = np.zeros_like(self.pressed)
        for line, p in zip(lines, pressure, strict=True):
            f = line.facing
            density = p @ bernstein(p.shape[1] - 1, PLACES).T * f.weight / WEIGHTS
            force = density[..., None] * f.direction
            np.add.at(pressed, f.side, -force)
            if line.opposite:
                np.add.at(pressed, f.other, f.on_primary(force / f.rate[..., None]))
        return replace(self, pressed=pressed)

    def tractions(self, segment: Index, s: Array) -> tuple[Array, Mask]:
        """Tractions (m, j, 2) at `s` (m, j) of `segment` (m,), and held components (m, 2)."""
        cells, total = self.cells, np.zeros((*s.shape, 2))
        side = cells.side_at(segment, s[:, s.shape[1] // 2])
        for name, loaded in self.loads.items():
            at = np.flatnonzero(np.isin(side, loaded))
            if at.size:
                load = self.problem.traction_vector(name)
                total[at] += _evaluated(cells.trace, load, segment[at], s[at])
        at = np.flatnonzero(self.pressed[side].any(axis=(1, 2)))
        if at.size:
            t = cells.own_parameter(side[at], s[at])
            x, dx = _points(cells, side[at], t)
            measure = cells.measure(x)[..., None]
            ds = np.linalg.norm(dx, axis=2, keepdims=True) * measure
            force = legendre.legvander(2 * t - 1, DATA) @ (LEGENDRE @ self.pressed[side[at]])
            total[at] += np.divide(force, ds, out=np.zeros_like(force), where=ds > 0)
        return total, self.held[side]

    def asked(self, cells: Cells, rule: SideRule, own: Array) -> Array:
        """Tractions (m, j, 2) on sides of `cells`, parts of these; `own` (m, j, 2) without any."""
        segment, s = rule.on_segments(cells)
        on, asked = np.flatnonzero(segment >= 0), own.copy()
        if on.size:
            values, held = self.tractions(segment[on], s[on])
            asked[on] = np.where(held[:, None], own[on], values)
        return asked

    def moments(self, mu: Multipliers) -> tuple[Array, Mask]:
        """Moments (d,) of the loads with the multipliers, and which of these are fixed, (d,).

        Fixed are those of components with prescribed displacements.
        """
        moments, fixed = np.zeros(int(mu.start[-1])), np.zeros(int(mu.start[-1]), dtype=bool)
        if self.loads:
            side = np.unique(np.concatenate(list(self.loads.values())))
            rule = side_rule(self.cells, self.breaks, side)
            values, _ = self.tractions(*rule.on_segments(self.cells))
            moments = rule.moments(mu, values)  # (3.7)
        for side, c in zip(*np.nonzero(self.held), strict=True):
            n = mu.degree[side] + 1
            fixed[mu.start[side] + c * n : mu.start[side] + (c + 1) * n] = True
        return np.where(fixed, 0.0, moments), fixed


def given_on(problem: Problem, cells: Cells) -> Given:
    """The conditions of a problem."""

    def sides(pattern: str | None) -> Index:
        return np.flatnonzero(np.isin(cells.segment, cells.trace.segments(pattern)))

    held = np.zeros((len(cells.ends), 2), dtype=bool)
    supports = [(values, sides(pattern)) for pattern, values in problem.displacement.items()]
    for values, at in supports:
        held[at] |= [value is not None for value in values]
    loads = {name: sides(name) for name in problem.traction}
    guided = None if problem.sliding is None else str(problem.sliding)
    return Given(
        problem,
        cells,
        held,
        loads,
        supports,
        sides(guided),
        _breaks(problem, cells, loads),
        np.zeros((len(cells.ends), len(PLACES), 2)),
    )


def _breaks(problem: Problem, cells: Cells, loads: dict[str, Index]) -> Array:
    """`Given.breaks`: ends of parts, and of those that `quadrature` integrates rough loads on."""
    found = [np.zeros((0, 2))]
    for name, side in loads.items():
        data, load = problem.traction[name], problem.traction_vector(name)
        if numbers(data):
            continue
        a, b = cells.span[side].T[..., None]
        s = a + (b - a) * np.arange(1, FINEST) / FINEST
        found.append(np.column_stack([np.repeat(cells.segment[side], FINEST - 1), s.ravel()]))
        region = cells.trace.mesh.Boundaries(name)
        rough = known_rough_load(data, load, region, moment_degree(cells.trace.order))
        if rough is not None:  # NGSolve's segments run from s = 1 to s = 0
            start = rough.cells.origin[:, 0]
            for stop in (start, start + rough.cells.side[:, 0, 0]):
                found.append(np.column_stack([rough.cells.element, 1 - stop]))
    return np.unique(np.concatenate(found), axis=0)


def tractions_of(
    elements: Sequence[Element],
    coefficients: Sequence[Array],
    at: Index,
    x: Array,
    normal: Array,
) -> Array:
    """Tractions s n (m, j, 2) of a stress at points `x` (m, j, 2) of triangles `at` (m,).

    Parameters
    ----------
    coefficients : sequence of ndarray (b, m)
        Of the stress on the triangles of each element.
    x, normal : ndarray (m, j, 2)
        Points, lengths, and unit normals there.
    """
    values = np.empty_like(x)
    for e, c, mine, some in among(elements, coefficients, at):
        s = e.stress(c, x[mine], some)
        nx, ny = normal[mine, :, 0], normal[mine, :, 1]
        values[mine, :, 0] = s[:, :, 0] * nx + s[:, :, -1] * ny
        values[mine, :, 1] = s[:, :, -1] * nx + s[:, :, 1] * ny
    return values


@dataclass(frozen=True, eq=False)
class BoundaryTractions:
    """Tractions s n of a stress along the boundary: `values` (m, j, 2) at the points of `rule`."""

    rule: SideRule
    values: Array

    def work(self, given: Given, displacement: ng.CoefficientFunction) -> float:
        """Work of s n on u_D - u_h, an energy per thickness."""
        total, trace, rule = 0.0, given.cells.trace, self.rule
        segment, s = rule.on_segments(given.cells)
        density = (rule.weight * rule.measure)[..., None] * self.values
        for wanted, side in given.supports:
            at = np.flatnonzero(np.isin(rule.side, side))
            u = _evaluated(trace, displacement, segment[at], s[at])
            for c, value in enumerate(wanted):
                if value is not None:
                    rest = _evaluated(trace, ng.CF(value), segment[at], s[at])[..., 0] - u[..., c]
                    total += float((density[at, :, c] * rest).sum())
        return total

    def missed(self, given: Given, largest: float) -> Array:
        """`SideRule.missed`, (n, 3), of what is asked for."""
        lost = given.asked(given.cells, self.rule, self.values) - self.values
        return self.rule.missed(given.cells, lost, largest)


def boundary_tractions(
    given: Given, elements: Sequence[Element], coefficients: Sequence[Array]
) -> BoundaryTractions:
    """Tractions along the boundary of a stress, with `coefficients` (b, m) on each element."""
    cells = given.cells
    rule = side_rule(cells, given.breaks, np.flatnonzero(cells.segment >= 0))
    at = cells.owner[rule.side]
    return BoundaryTractions(rule, tractions_of(elements, coefficients, at, rule.x, rule.normal))
