"""What is given on the boundary: tractions on sides, and components on which none is given."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Index, Mask
from ...lagrange import gauss
from ...problem import Problem
from .cells import Cells
from .elements import Multipliers, traces


@dataclass(frozen=True, eq=False)
class Given:
    """Tractions on e sides.

    Attributes
    ----------
    held : ndarray of bool (e, 2)
        Components on which none is given: of prescribed displacements.
    load : list of (pattern, sides)
        Where P is given.
    guides : ndarray of int (k,)
        Sides of Gamma_0.
    """

    held: Mask
    loads: list[tuple[str, Index]]
    guides: Index


def given_on(problem: Problem, cells: Cells) -> Given:
    """The conditions of a problem."""
    trace = cells.trace
    held = np.zeros((len(cells.ends), 2), dtype=bool)

    def sides(*patterns: str) -> Index:
        return np.flatnonzero(np.isin(cells.segment, trace.segments(*patterns)))

    for pattern, values in problem.displacement.items():
        at = sides(pattern)
        for c, value in enumerate(values):
            held[at, c] |= value is not None
    loads = [(pattern, sides(pattern)) for pattern in problem.traction]
    return Given(held, loads, sides(problem.sliding) if problem.sliding is not None else sides())


def moments_of(problem: Problem, cells: Cells, mu: Multipliers, given: Given) -> tuple[Array, Mask]:
    """Moments (d,) of the given tractions with the multipliers, and fixed multipliers (d,)."""
    size = int(mu.start[-1])
    moments, fixed = np.zeros(size), np.zeros(size, dtype=bool)
    for pattern, side in given.loads:
        P = problem.traction_vector(pattern)
        for k in np.unique(mu.degree[side]):
            at = side[mu.degree[side] == k]
            t, w = gauss(2 * int(k) + 10)
            values, ds = _load(cells, P, at, t)
            chi = traces(int(k), t)
            parts = np.einsum("sq,sqc,qj->scj", w * ds, values, chi).reshape(len(at), -1)
            np.add.at(moments, mu.start[at, None] + np.arange(parts.shape[1]), parts)
    for side, c in zip(*np.nonzero(given.held), strict=True):
        n = mu.degree[side] + 1
        fixed[mu.start[side] + c * n : mu.start[side] + (c + 1) * n] = True
    moments[fixed] = 0.0
    return moments, fixed


def _load(cells: Cells, P, side: Index, t: Array) -> tuple[Array, Array]:
    """P (k, q, 2) and ds / dt with the model's measure (k, q) on sides (k,) at `t` (q,)."""
    own, tt = np.repeat(side, len(t)), np.tile(t, len(side))
    segment, s = cells.on_side(own, tt)
    values = cells.trace.evaluate(P, segment, s).reshape(len(side), len(t), 2)
    x, dx = cells.points(own, tt)
    ds = np.linalg.norm(dx, axis=1) * cells.trace.model.measure(x)
    return values, ds.reshape(len(side), len(t))
