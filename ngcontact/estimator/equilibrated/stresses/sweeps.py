"""Steps towards the nearest of all equilibrated stresses where that of the patches is far.

What a patch finds is near to hat times sigma_h, and not to sigma_h. Where these differ much, as in
corners between supports of nearly incompressible bodies, or where laws are stiff in one direction,
the sum of all patches is improved by stresses of patches without divergence: a direction of a
conjugate gradient method is their sum.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ....arrays import Array, Index
from ..data import MANDEL, Discrete, EdgeConditions
from .elements import Condensed, gathered, without_opposite
from .equilibration import Equilibrated, blocks, operators
from .patches import multipliers

STIFF = 100.0  # ratio of moduli in one law from which a patch's stress may be far anywhere
FAR = 6.0  # square on a triangle, over the mean of all, from which it is far
SHARE = 0.2  # of the sum of squares on far triangles from which steps pay
MOST = 0.03  # share of triangles that are called far
FEWEST = 60  # which may be far on any mesh
KEPT = 5_000_000  # numbers in operators of triangles that are kept from step to step
STEPS = 12
STIFF_STEPS = 24  # at most, where laws are stiff in one direction and a step brings less
PAYS = 0.04  # of the square of the norm, what a step must take off for another to be made


def improved(discrete: Discrete, conditions: EdgeConditions, found: Equilibrated) -> Equilibrated:
    """The same stress, nearer to the discrete one around the triangles on which it is far."""
    region, stiff = _region(discrete, (found.change**2).sum(axis=1))
    if region.size == 0:
        return found
    problem, whole = _Region(discrete, conditions, region), float((found.change**2).sum())
    b = found.change[region]
    direction, last = np.zeros_like(b), 1.0
    for _ in range(STIFF_STEPS if stiff else STEPS):
        d = problem.direction(b)
        slope = float((b * d).sum())
        if slope >= 0:  # but for round-off it is the nearest
            break
        direction = d + slope / last * direction
        along, square = float((b * direction).sum()), float((direction**2).sum())
        b -= along / square * direction
        last, gain = slope, along**2 / square
        if gain < PAYS * whole:
            break
        whole -= gain
    change = found.change.copy()
    change[region] = b
    return replace(found, change=change)


def _region(discrete: Discrete, squares: Array) -> tuple[Index, bool]:
    """Triangles (j,) around those that are far, by squares (n,); whether for their laws."""
    n, partition = len(squares), discrete.partition
    mandel = MANDEL[discrete.law.shape[1]]
    moduli = np.linalg.eigvalsh(discrete.law * mandel[:, None] * mandel)
    stiff = np.flatnonzero(moduli[:, -1] > STIFF * moduli[:, 0])
    if squares[stiff].sum() > SHARE * squares.sum():
        return stiff, True
    order = np.argsort(-squares)[: max(FEWEST, int(MOST * n))]
    far = order[squares[order] > FAR * squares.mean()]
    if squares[far].sum() <= SHARE * squares.sum():
        return np.zeros(0, dtype=np.intp), False
    near = np.zeros(len(partition.vertices), dtype=bool)
    for _ in range(2):
        near[partition.triangles[far]] = True
        far = np.flatnonzero(near[partition.triangles].any(axis=1))
    return far, False


class _Region:
    """Some triangles `at` (j,), on whose common boundary nothing changes."""

    def __init__(self, discrete: Discrete, conditions: EdgeConditions, at: Index) -> None:
        whole = discrete.partition
        edges, number = np.unique(whole.edges[at], return_inverse=True)
        count = np.bincount(number.ravel(), minlength=len(edges))
        cut = (count == 1) & (whole.segment[edges] < 0)
        self.discrete, self.at, self.conditions = discrete, at, conditions
        self.partition = replace(
            whole,
            triangles=whole.triangles[at],
            edges=number.reshape(-1, 3),
            ends=whole.ends[edges],
            segment=whole.segment[edges],
            along=whole.along[edges],
        )
        self.mine = replace(
            conditions,
            constrained=conditions.constrained[edges] | cut[:, None],
            soft=conditions.soft[edges],
        )
        self.given = np.zeros_like(conditions.given[edges])
        self.kept: dict[int, Condensed] = {}

    def operators(self, part: Index) -> Condensed:
        """Those of a part (b,) of the triangles; of the first parts they are kept."""
        number = int(part[0])
        if number in self.kept:
            return self.kept[number]
        found = operators(self.discrete, self.at[part], self.conditions.frames)
        if (number + len(part)) * found.size <= KEPT * len(part):
            self.kept[number] = found
        return found

    def direction(self, b: Array) -> Array:
        """The sum (j, n) of the least stresses of all patches added to `b` (j, n)."""
        n, r = len(self.at), self.mine.constrained.shape[1]
        S, g = np.empty((n, 3, 2 * r, 2 * r)), np.empty((n, 3, 2 * r))
        X, x = np.empty((n, 3, r, 2 * r)), np.empty((n, 3, r))
        free = np.empty_like(b)
        for part in blocks(n, 3 * b.shape[1] ** 2):
            parts = self.operators(part)
            c = b[part, :, None]
            free[part] = (parts.Q @ (parts.Q.transpose(0, 2, 1) @ c) - c)[:, :, 0]
            t = np.repeat(free[part][:, None], 3, axis=1) @ parts.N.transpose(0, 2, 1)
            lacking = self.discrete.lacking[self.at[part]]
            S[part], g[part], X[part], x[part] = without_opposite(parts.G, t, lacking)
        lam = multipliers(self.partition, S, g, self.mine, self.given)
        total = 3 * free
        for part in blocks(n, 3 * b.shape[1] ** 2):
            parts = self.operators(part)
            y = gathered(lam[part], X[part], x[part])
            total[part] -= parts.of_multipliers(y)
        return total
