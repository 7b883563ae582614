"""Tractions on the boundary: those given, those of an equilibrated stress, what is missed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...lagrange import gauss
from ...problem import Problem
from .cells import Cells
from .elements import Element, Multipliers, traces
from .facing import PLACES, WEIGHTS, bernstein
from .program import Rows

ROUND_OFF = 1e-12  # of tractions, relative to the largest stress


@dataclass(frozen=True, eq=False)
class Given:
    """Conditions on e sides.

    Attributes
    ----------
    held : ndarray of bool (e, 2)
        Components with prescribed displacements: no traction is given.
    loads : list of (str, ndarray of int)
        Keys of `Problem.traction` with their sides.
    supports : list of (values, ndarray of int)
        u_D of `Problem.displacement` with their sides.
    guides : ndarray of int (k,)
        Sides of Gamma_0.
    """

    held: Mask
    loads: list[tuple[str, Index]]
    supports: list[tuple[Sequence[Any], Index]]
    guides: Index


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
    return Given(held, loads, supports, sides(guided))


def moments_of(problem: Problem, cells: Cells, mu: Multipliers, given: Given) -> tuple[Array, Mask]:
    """Moments (d,) of the given tractions with the multipliers, and fixed multipliers (d,)."""
    size = int(mu.start[-1])
    moments, fixed = np.zeros(size), np.zeros(size, dtype=bool)
    for pattern, side in given.loads:
        for k in np.unique(mu.degree[side]):
            at = side[mu.degree[side] == k]
            t, w = gauss(2 * int(k) + 10)
            values = _at(cells, problem.traction_vector(pattern), at, t)
            x, dx = cells.points(np.repeat(at, len(t)), np.tile(t, len(at)))
            ds = np.linalg.norm(dx, axis=1) * cells.trace.model.measure(x)
            load = (w * ds.reshape(len(at), -1))[..., None] * values
            parts = np.einsum("sqc,qj->scj", load, traces(int(k), t)).reshape(len(at), -1)
            np.add.at(moments, mu.start[at, None] + np.arange(parts.shape[1]), parts)
    for side, c in zip(*np.nonzero(given.held), strict=True):
        n = mu.degree[side] + 1
        fixed[mu.start[side] + c * n : mu.start[side] + (c + 1) * n] = True
    moments[fixed] = 0.0
    return moments, fixed


def _at(cells: Cells, function: ng.CoefficientFunction, side: Index, t: Array) -> Array:
    """Values (k, q, dim) on sides (k,) at `t` (q,)."""
    segment, s = cells.on_side(np.repeat(side, len(t)), np.tile(t, len(side)))
    return cells.trace.evaluate(function, segment, s).reshape(len(side), len(t), -1)


@dataclass(frozen=True, eq=False)
class BoundaryTractions:
    """s n at `PLACES` of the k sides of the boundary.

    Attributes
    ----------
    side : ndarray of int (k,)
    position : ndarray of int (e,)
        Of each side among them, -1 elsewhere.
    ds : ndarray (k, j)
        Length per t, with the model's measure.
    length : ndarray (k, j)
        Length per t.
    values : ndarray (k, j, 2)
        Stresses.
    """

    side: Index
    position: Index
    ds: Array
    length: Array
    values: Array

    def work(self, cells: Cells, given: Given, displacement: ng.CoefficientFunction) -> float:
        """Of s n on u_D - u_h."""
        total = 0.0
        for wanted, side in given.supports:
            at = self.position[side]
            u = _at(cells, displacement, side, PLACES)
            for c, value in enumerate(wanted):
                if value is not None:
                    rest = _at(cells, ng.CF(value), side, PLACES)[..., 0] - u[..., c]
                    total += float((WEIGHTS * self.ds[at] * self.values[at][..., c] * rest).sum())
        return total


def boundary_tractions(
    cells: Cells, elements: Sequence[Element], coefficients: Sequence[Array]
) -> BoundaryTractions:
    """Those of a stress."""
    side = np.flatnonzero(cells.segment >= 0)
    k, j = len(side), len(PLACES)
    position = np.full(len(cells.ends), -1)
    position[side] = np.arange(k)
    x, dx = (z.reshape(k, j, 2) for z in cells.points(np.repeat(side, j), np.tile(PLACES, k)))
    length = np.linalg.norm(dx, axis=2)
    owner = cells.owner[side]
    back = cells.backward[owner, cells.local[side]]
    normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1) / length[..., None]
    normal[back] *= -1
    values, number = np.zeros((k, j, 2)), np.empty(len(cells.triangles), dtype=np.intp)
    for e, c in zip(elements, coefficients, strict=True):
        number[:] = -1
        number[e.places.at] = np.arange(len(e.places.at))
        mine = np.flatnonzero(number[owner] >= 0)
        if mine.size:
            s = e.stress(c, x[mine], number[owner[mine]])
            nx, ny = normal[mine][..., 0], normal[mine][..., 1]
            values[mine, :, 0] = s[:, :, 0] * nx + s[:, :, -1] * ny
            values[mine, :, 1] = s[:, :, -1] * nx + s[:, :, 1] * ny
    ds = length * cells.trace.model.measure(x.reshape(-1, 2)).reshape(k, j)
    return BoundaryTractions(side, position, ds, length, values)


def missed_tractions(
    problem: Problem,
    cells: Cells,
    given: Given,
    lines: Sequence[Rows],
    pressure: Sequence[Array],
    have: BoundaryTractions,
    largest: float,
) -> Array:
    """L2 norms (n, 3) of what tractions miss, times the model's measure, for loads of a problem."""
    asked = np.zeros_like(have.values)
    for pattern, side in given.loads:
        if pattern in problem.traction:
            load = problem.traction_vector(pattern)
            asked[have.position[side]] += _at(cells, load, side, PLACES)
    for line, p in zip(lines, pressure, strict=True):
        f = line.facing
        density = p @ bernstein(p.shape[1] - 1, PLACES).T * f.weight / WEIGHTS
        force = density[..., None] * f.direction
        own = have.position[f.side]
        asked[own] -= force / have.ds[own][..., None]
        if line.opposite:
            there = have.position[f.other]
            force = f.on_primary(force) * f.rates[..., None]
            asked[there] += force / have.ds[there][..., None]
    miss = np.where(given.held[have.side][:, None], 0.0, asked - have.values)
    miss[np.abs(miss) <= ROUND_OFF * largest] = 0.0
    weight = WEIGHTS * have.ds**2 / have.length
    norms = np.zeros((len(cells.triangles), 3))
    square = (weight[..., None] * miss**2).sum(axis=(1, 2))
    norms[cells.owner[have.side], cells.local[have.side]] = np.sqrt(square)
    return norms
