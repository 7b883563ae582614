"""Tractions on the boundary: those given, those of an equilibrated stress, what is missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...lagrange import lagrange
from ...problem import Problem
from ...quadrature import known_rough_load, moment_degree, numbers
from .cells import Cells
from .elements import Element, Multipliers, among, traces
from .facing import PLACES, THROUGH, WEIGHTS, at_places, bernstein
from .parts import LEVELS, PARTS
from .program import Rows

FINEST = PARTS**LEVELS  # parts of a side
SAME = 1e-10  # of a segment: breaks nearer to ends of sides are these
ROUND_OFF = 1e-10  # of tractions, relative to the largest stress: as equilibrium is accepted


@dataclass(frozen=True, eq=False)
class Given:
    """Conditions on e sides.

    Attributes
    ----------
    held : ndarray of bool (e, 2)
        Components with prescribed displacements: no traction is given.
    loads : list of (str, ndarray of int (k,))
        Keys of `Problem.traction` with their sides.
    supports : list of (values, ndarray of int (k,))
        u_D of `Problem.displacement` with their sides.
    guides : ndarray of int (k,)
        Sides of Gamma_0.
    breaks : ndarray (k, 2)
        Segments and s, rising: where rules on the boundary begin anew to follow tractions.
    """

    held: Mask
    loads: list[tuple[str, Index]]
    supports: list[tuple[Sequence[Any], Index]]
    guides: Index
    breaks: Array

    def followed(self, cells: Cells) -> Index:
        """How often triangles (n,) are divided for tractions: `LEVELS` where these are rough."""
        found = np.zeros(len(cells.triangles), dtype=np.intp)
        side = np.flatnonzero(cells.segment >= 0)
        breaks = np.bincount(self.breaks[:, 0].astype(np.intp), minlength=len(cells.trace.region))
        count = breaks[cells.segment[side]]
        np.maximum.at(found, cells.owner[side], np.where(count >= FINEST, LEVELS, count > 0))
        return found


def given_on(problem: Problem, cells: Cells) -> Given:
    """The conditions of a problem."""

    def sides(*patterns: str | None) -> Index:
        return np.flatnonzero(np.isin(cells.segment, cells.trace.segments(*patterns)))

    held = np.zeros((len(cells.ends), 2), dtype=bool)
    supports = [(values, sides(pattern)) for pattern, values in problem.displacement.items()]
    for values, at in supports:
        held[at] |= [value is not None for value in values]
    loads = [(pattern, sides(pattern)) for pattern in problem.traction]
    guided = None if problem.sliding is None else str(problem.sliding)
    return Given(held, loads, supports, sides(guided), _breaks(problem, cells, loads))


def _breaks(problem: Problem, cells: Cells, loads: Sequence[tuple[str, Index]]) -> Array:
    """`Given.breaks`: ends of parts, and of those that `quadrature` integrates rough loads on."""
    segments, places = [np.zeros(0)], [np.zeros(0)]
    for name, side in loads:
        data, load = problem.traction[name], problem.traction_vector(name)
        if numbers(data):
            continue
        a, b = cells.span[side].T[..., None]
        inner = np.arange(1, FINEST) / FINEST
        segments.append(np.repeat(cells.segment[side], len(inner)))
        places.append((a + (b - a) * inner).ravel())
        region = cells.trace.mesh.Boundaries(name)
        rough = known_rough_load(data, load, region, moment_degree(cells.trace.order))
        if rough is not None:  # NGSolve's segments run from s = 1 to s = 0
            start = rough.cells.origin[:, 0]
            segments.append(np.tile(rough.cells.element, 2))
            places += [1 - start, 1 - start - rough.cells.side[:, 0, 0]]
    found = np.column_stack([np.concatenate(segments), np.concatenate(places)])
    return np.unique(found, axis=0)


@dataclass(frozen=True, eq=False)
class Along:
    """Quadrature along sides of cells, j points on each of m pieces.

    Attributes
    ----------
    side : ndarray of int (m,)
        Of each piece.
    t, weight : ndarray (m, j)
        Parameters of the sides, and weights in these.
    x : ndarray (m, j, 2)
        Points, lengths.
    normal : ndarray (m, j, 2)
        Unit normals, out of the owners of the sides.
    ds : ndarray (m, j)
        Length per t, with the model's measure.
    length : ndarray (m, j)
        Length per t.
    """

    side: Index
    t: Array
    weight: Array
    x: Array
    normal: Array
    ds: Array
    length: Array

    def moments(self, mu: Multipliers, values: Array) -> Array:
        """Integrals (d,) of tractions `values` (m, j, 2) times the multipliers."""
        total, load = np.zeros(int(mu.start[-1])), (self.weight * self.ds)[..., None] * values
        for k in np.unique(mu.degree[self.side]).tolist():
            at = np.flatnonzero(mu.degree[self.side] == k)
            parts = np.einsum("mjc,mji->mci", load[at], traces(k, self.t[at])).reshape(len(at), -1)
            np.add.at(total, mu.start[self.side[at], None] + np.arange(2 * (k + 1)), parts)
        return total

    def norms(self, cells: Cells, missed: Array) -> Array:
        """L2 norms (n, 3) of tractions `missed` (m, j, 2), times the model's measure."""
        squares = np.zeros((len(cells.triangles), 3))
        square = ((self.weight * self.ds**2 / self.length)[..., None] * missed**2).sum(axis=(1, 2))
        np.add.at(squares, (cells.owner[self.side], cells.local[self.side]), square)
        return np.sqrt(squares)


def along(cells: Cells, given: Given, side: Index) -> Along:
    """The rule on sides `side` (k,), which begins anew at `Given.breaks`."""
    inside = cells.segment[side] < 0
    ends = np.where(inside[:, None], [0.0, 1.0], np.sort(cells.span[side], axis=1))
    key, own = given.breaks @ [4.0, 1.0], 4.0 * cells.segment[side]
    low = np.searchsorted(key, own + ends[:, 0] + SAME)
    count = np.maximum(np.searchsorted(key, own + ends[:, 1] - SAME) - low, 0) + 1
    piece = np.repeat(np.arange(len(side)), count)
    place = np.arange(len(piece)) - np.repeat(np.cumsum(count) - count, count)
    first, last = place == 0, place == count[piece] - 1
    s = np.append(given.breaks[:, 1], 0.0)
    base, size = ends[piece, 0], (ends[:, 1] - ends[:, 0])[piece]
    start = np.where(first, 0.0, (s[low[piece] + place - 1] - base) / size)
    stop = np.where(last, 1.0, (s[np.minimum(low[piece] + place, len(s) - 1)] - base) / size)
    back = ((cells.span[side, 0] > cells.span[side, 1]) & ~inside)[piece]
    start, stop = np.where(back, 1 - stop, start), np.where(back, 1 - start, stop)
    every = side[piece]
    t = start[:, None] + (stop - start)[:, None] * PLACES
    x, dx = (z.reshape(*t.shape, 2) for z in cells.points(np.repeat(every, len(PLACES)), t.ravel()))
    length = np.linalg.norm(dx, axis=2)
    normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1) / length[..., None]
    normal[cells.backward[cells.owner[every], cells.local[every]]] *= -1
    ds = length * cells.trace.model.measure(x.reshape(-1, 2)).reshape(t.shape)
    return Along(every, t, (stop - start)[:, None] * WEIGHTS, x, normal, ds, length)


@dataclass(frozen=True, eq=False)
class Requested:
    """Tractions on the boundary that are given, and those of pressures on lines.

    Attributes
    ----------
    problem : Problem
    cells : Cells
    given : Given
    pressed : dict of int to ndarray (j, 2)
        Of the lines at `PLACES` of sides: forces per t, with the measure.
    """

    problem: Problem
    cells: Cells
    given: Given
    pressed: dict[int, Array]

    def values(self, segment: Index, s: Array) -> tuple[Array, Mask]:
        """Tractions (m, j, 2) at `s` (m, j) of `segment` (m,), and held components (m, 2)."""
        cells, total = self.cells, np.zeros((*s.shape, 2))
        side = cells.side_at(segment, s[:, s.shape[1] // 2])
        every = np.repeat(segment, s.shape[1])
        for pattern, loaded in self.given.loads:
            at = np.flatnonzero(np.isin(side, loaded))
            if at.size and pattern in self.problem.traction:
                load = self.problem.traction_vector(pattern)
                where = every.reshape(s.shape)[at].ravel(), s[at].ravel()
                total[at] += cells.trace.evaluate(load, *where).reshape(len(at), -1, 2)
        at = np.flatnonzero(np.isin(side, list(self.pressed)))
        if at.size:
            t = cells.own_parameter(side[at], s[at])
            x, dx = cells.points(np.repeat(side[at], t.shape[1]), t.ravel())
            ds = np.linalg.norm(dx, axis=1) * cells.trace.model.measure(x)
            ds = ds.reshape(*t.shape, 1)
            nodes = THROUGH @ np.stack([self.pressed[i] for i in side[at].tolist()])
            force = at_places(lagrange, t) @ nodes
            total[at] += np.divide(force, ds, out=np.zeros_like(force), where=ds > 0)
        return total, self.given.held[side]


def requested(
    problem: Problem,
    cells: Cells,
    given: Given,
    lines: Sequence[Rows] = (),
    pressure: Sequence[Array] = (),
) -> Requested:
    """The loads of a problem, and what pressures on lines exert.

    Parameters
    ----------
    pressure : sequence of ndarray (k, j)
        Bernstein coefficients of p* on the sides of each line.
    """
    pressed: dict[int, Array] = {}

    def add(side: Index, force: Array) -> None:
        for i, value in zip(side.tolist(), force, strict=True):
            pressed[i] = pressed.get(i, 0.0) + value

    for line, p in zip(lines, pressure, strict=True):
        f = line.facing
        density = p @ bernstein(p.shape[1] - 1, PLACES).T * f.weight / WEIGHTS
        force = density[..., None] * f.direction
        add(f.side, -force)
        if line.opposite:
            add(f.other, f.on_primary(force) * f.rates[..., None])
    return Requested(problem, cells, given, pressed)


def moments_of(problem: Problem, cells: Cells, mu: Multipliers, given: Given) -> tuple[Array, Mask]:
    """Moments (d,) of the given tractions with the multipliers, and which of these are fixed, (d,).

    Fixed are those of components with prescribed displacements.
    """
    moments, fixed = np.zeros((2, int(mu.start[-1])))
    loaded = [side for _, side in given.loads]
    if loaded:
        rule = along(cells, given, np.unique(np.concatenate(loaded)))
        values, _ = requested(problem, cells, given).values(*on_segments(cells, rule))
        moments = rule.moments(mu, values)  # (3.7)
    for side, c in zip(*np.nonzero(given.held), strict=True):
        n = mu.degree[side] + 1
        fixed[mu.start[side] + c * n : mu.start[side] + (c + 1) * n] = True
    held = fixed.astype(bool)
    moments[held] = 0.0
    return moments, held


def on_segments(cells: Cells, rule: Along) -> tuple[Index, Array]:
    """Segments (m,) and parameters s (m, j) of a rule along sides of the boundary."""
    a, b = cells.span[rule.side].T[..., None]
    return cells.segment[rule.side], a + (b - a) * rule.t


def _at(cells: Cells, function: ng.CoefficientFunction, rule: Along) -> Array:
    """Values (m, j, dim) on sides of the boundary."""
    segment, s = on_segments(cells, rule)
    every = np.repeat(segment, s.shape[1])
    return cells.trace.evaluate(function, every, s.ravel()).reshape(*s.shape, -1)


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
    at : ndarray of int (m,)
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

    rule: Along
    values: Array

    def work(self, cells: Cells, given: Given, displacement: ng.CoefficientFunction) -> float:
        """Work of s n on u_D - u_h, an energy per thickness."""
        total, rule = 0.0, self.rule
        density = (rule.weight * rule.ds)[..., None] * self.values
        for wanted, side in given.supports:
            at = np.flatnonzero(np.isin(rule.side, side))
            here = replace(rule, side=rule.side[at], t=rule.t[at])
            u = _at(cells, displacement, here)
            for c, value in enumerate(wanted):
                if value is not None:
                    rest = _at(cells, ng.CF(value), here)[..., 0] - u[..., c]
                    total += float((density[at, :, c] * rest).sum())
        return total


def boundary_tractions(
    cells: Cells, given: Given, elements: Sequence[Element], coefficients: Sequence[Array]
) -> BoundaryTractions:
    """Tractions of a stress along the boundary.

    Parameters
    ----------
    coefficients : sequence of ndarray (b, m)
        Of the stress on the triangles of each element.
    """
    rule = along(cells, given, np.flatnonzero(cells.segment >= 0))
    at = cells.owner[rule.side]
    return BoundaryTractions(rule, tractions_of(elements, coefficients, at, rule.x, rule.normal))


def missed_tractions(
    wanted: Requested, cells: Cells, have: BoundaryTractions, largest: float
) -> Array:
    """L2 norms (n, 3) of what tractions miss on sides, times the model's measure.

    What is round-off beside the `largest` stress counts as 0.
    """
    values, held = wanted.values(*on_segments(cells, have.rule))
    miss = np.where(held[:, None], 0.0, values - have.values)
    rule, size = have.rule, np.zeros(len(cells.ends))
    np.maximum.at(size, rule.side, rule.ds.max(axis=1))  # at an axis stresses lose digits by it
    noise = ROUND_OFF * largest * size[rule.side, None, None]
    miss[np.abs(miss) * rule.ds[..., None] <= noise] = 0.0
    return have.rule.norms(cells, miss)
