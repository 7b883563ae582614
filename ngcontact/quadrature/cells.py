"""Elements in equal parts, and parts that are halved until a rule integrates a function on them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

import ngsolve as ng
import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, root_of_squares

DEEPEST = {1: 38, 2: 10}  # halvings of the sides: points beside corners of smaller parts are these
MOST_CELLS = 20_000  # parts that are halved at a time: rougher functions are noise
AT_CORNERS = 1e-4  # distance of the points at corners from these, relative to a part
BEYOND = 0.05  # share of a part beyond the last point of the rule
GOLDEN = (1 + 5**0.5) / 2  # takes points on a line out of step with waves

# Orders of the rules on a part, and the degree of the polynomial through their points that tells
# their corners: of loads, whose moments are taken again, and of integrals that are wanted as such.
MOMENTS = {1: (7, 3), 2: (4, 2)}
INTEGRALS = {1: (15, 6), 2: (10, 5)}

Integrand = Callable[[Index, Array], Array]  # values (k, m, c) at (k, m, dim) of elements (k,)


@lru_cache
def parts(dim: int, n: int) -> tuple[Array, Array]:
    """The k = n^dim equal parts of the unit segment or triangle.

    Origins (k, dim), and sides (k, dim, dim) as rows.
    """
    if dim == 1:
        return np.arange(n)[:, None] / n, np.full((n, 1, 1), 1 / n)
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright, turned = i + j < n, i + j < n - 1
    origin = np.concatenate(
        [np.column_stack([i, j])[upright], np.column_stack([i + 1, j + 1])[turned]]
    )
    side = np.repeat([1.0, -1.0], [upright.sum(), turned.sum()])[:, None, None] * np.eye(2)
    return origin / n, side / n


@lru_cache
def lattice(dim: int, n: int) -> Array:
    """A point in each of the k = n^dim parts, (k, dim): their middles, on a line out of step."""
    origin, side = parts(dim, n)
    if dim == 1:
        return origin + (0.25 + 0.5 * (GOLDEN * np.arange(n)[:, None] % 1)) / n
    return np.asarray(origin + side.sum(axis=1) / 3)


def monomials(x: Array, degree: int) -> Array:
    """Products of the coordinates up to a degree at points `x` (..., dim), (..., q)."""
    found = [np.ones(x.shape[:-1])]  # each by one product, in the order of degrees
    for d in range(1, degree + 1):
        first = [x[..., 0] * previous for previous in found[-d if x.shape[-1] == 2 else -1 :]]
        found += first + ([x[..., 1] * found[-1]] if x.shape[-1] == 2 else [])
    return np.stack(found, axis=-1)


def gauss_rule(dim: int, order: int) -> tuple[Array, Array]:
    """Points (m, dim) and weights (m,) of NGSolve's rule on the unit segment or triangle."""
    rule = ng.IntegrationRule(ng.SEGM if dim == 1 else ng.TRIG, order)
    return np.array([p[:dim] for p in rule.points]).reshape(-1, dim), np.array(rule.weights)


@lru_cache
def composite(n: int, order: int) -> ng.IntegrationRule:
    """Rule of an order on each of n^2 equal parts of a triangle."""
    points, weights = gauss_rule(2, order)
    origin, side = parts(2, n)
    x = (origin[:, None] + points @ side).reshape(-1, 2)
    return ng.IntegrationRule(
        [(a, b, 0.0) for a, b in x.tolist()], np.tile(weights / n**2, n**2).tolist()
    )


class Rule(NamedTuple):
    """A rule on the unit simplex with its corners as last points, of weight 0."""

    points: Array  # (m, dim)
    weights: Array  # (m,)
    # (dim + 1, m) from values to what a polynomial through the inner points misses at the corners:
    # steps beyond the last point are seen there.
    misses: Array


@lru_cache
def rule_with_corners(dim: int, order: int, degree: int) -> Rule:
    """NGSolve's rule of an order, with corners and polynomials of a degree."""
    inner, weights = gauss_rule(dim, order)
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    corners = corners + AT_CORNERS * (1 / (dim + 1) - corners)
    through = monomials(corners, degree) @ np.linalg.pinv(monomials(inner, degree))
    return Rule(
        np.vstack([inner, corners]),
        np.append(weights, np.zeros(dim + 1)),
        np.hstack([-through, np.eye(dim + 1)]),
    )


@dataclass(frozen=True, eq=False)
class Cells:
    """Parts of elements, k of them."""

    element: Index  # (k,), the element of each
    origin: Array  # (k, dim), reference coordinates of a corner
    side: Array  # (k, dim, dim), sides from there, as rows

    @staticmethod
    def whole(dim: int, elements: Index) -> Cells:
        """The `elements` (k,) themselves."""
        size = len(elements)
        return Cells(elements, np.zeros((size, dim)), np.tile(np.eye(dim), (size, 1, 1)))

    @staticmethod
    def joined(several: list[Cells]) -> Cells:
        """All of several."""
        parts = ([getattr(cells, name) for cells in several] for name in vars(several[0]))
        return Cells(*map(np.concatenate, parts))

    @property
    def dim(self) -> int:
        """Of the elements."""
        return self.origin.shape[1]

    def points(self, rule: Rule) -> Array:
        """Points of a rule, (k, m, dim), in reference coordinates of the elements."""
        return self.origin[:, None] + rule.points @ self.side

    def weights(self, rule: Rule) -> Array:
        """Weights of a rule, (k, m)."""
        return np.abs(np.linalg.det(self.side))[:, None] * rule.weights

    def __getitem__(self, at: Mask | Index) -> Cells:
        """Those selected by `at` (k,), a mask or numbers."""
        return Cells(self.element[at], self.origin[at], self.side[at])

    def divided(self, n: int) -> Cells:
        """Each in n^dim equal parts, one after the other."""
        origin, side = parts(self.dim, n)
        return Cells(
            np.repeat(self.element, len(origin)),
            (self.origin[:, None] + origin @ self.side).reshape(-1, *origin.shape[1:]),
            (side @ self.side[:, None]).reshape(-1, *side.shape[1:]),
        )

    def beside(self, some: Mask, corners: Array) -> Mask:
        """The cells `some` (k,) and those that may touch one, (k,); `corners` (n, 3, 2) of all."""
        of = corners[self.element]
        sides = self.side @ (of[:, :2] - of[:, 2:])
        origin = of[:, 2] + (self.origin[:, None] @ (of[:, :2] - of[:, 2:]))[:, 0]
        middle = origin + sides.sum(axis=1) / 3
        ends = np.concatenate([origin[:, None], origin[:, None] + sides], axis=1)
        radius = np.linalg.norm(ends - middle[:, None], axis=2).max(axis=1)
        apart, nearest = cKDTree(middle[some]).query(middle)
        return np.asarray(apart <= radius + radius[some][nearest])


@dataclass(frozen=True, eq=False)
class Refined:
    """Parts of elements, k of them, on which a rule integrates a function of c components."""

    cells: Cells
    rule: Rule  # of m points on each
    values: Array  # (k, m, c), the function at its points
    missed: Array  # (k,), error over a part that is halved no more although it is too large, else 0
    # (c,) of the whole integral: errors of smooth functions have one sign and add up, others any.
    # The sum of differences, which may vanish by chance, or the root of the sum of squares, or what
    # is allowed of a part if any was halved, as a jump may be missed in it.
    error: Array

    @property
    def integral(self) -> Array:
        """Over all parts, (c,)."""
        return np.einsum("km,kmc->c", self.cells.weights(self.rule), self.values)


def refined(
    integrand: Integrand,
    cells: Cells,
    rules: dict[int, tuple[int, int]],
    share: float,
    total: float | None = None,
    corners: Array | None = None,
) -> Refined:
    """Parts of `cells` on which a rule, of `MOMENTS` or `INTEGRALS`, integrates a function.

    Parts are halved until their integrals and those over their halves differ by no more than a
    share of the total, that of the function's size by the first parts when left out. What is beside
    one that is halved is halved, too, where the `corners` (n, 3, 2) of all triangles tell: it may
    hold the rest of what is there without any of the points.
    """
    dim = cells.dim
    rule = rule_with_corners(dim, *rules[dim])
    found, kept, missed, differences, errors = [], [], [], [], []

    def integrals(cells: Cells) -> tuple[Array, Array]:
        """Values (k, m, c), and integrals and what may lie beyond the points (k, 2, c)."""
        values, weights = integrand(cells.element, cells.points(rule)), cells.weights(rule)
        beyond = np.abs(rule.misses @ values).max(axis=1) * weights.sum(axis=1)[:, None]
        return values, np.stack([(weights[:, None] @ values)[:, 0], BEYOND * beyond], axis=1)

    values, coarse = integrals(cells)
    if total is None:
        total = float((cells.weights(rule) * np.abs(values).sum(axis=2)).sum())
    allowed = share * total
    for depth in range(DEEPEST[dim]):
        halves = cells.divided(2)
        values, fine = integrals(halves)
        differs = fine[:, 0].reshape(len(coarse), 2**dim, -1).sum(axis=1) - coarse[:, 0]
        sizes = np.maximum(np.abs(differs), coarse[:, 1])
        error = sizes.max(axis=1)
        last = depth == DEEPEST[dim] - 1 or np.count_nonzero(error > allowed) > MOST_CELLS
        some = (error > allowed) & (not last)
        if corners is not None and some.any():
            some = cells.beside(some, corners)
        again = np.repeat(some, 2**dim)
        found.append(halves[~again])
        kept.append(values[~again])
        over = np.where(error > allowed, error, 0.0) * last / 2**dim
        missed.append(np.repeat(over, 2**dim)[~again])
        differences.append(differs[~some])
        errors.append(sizes[~some])
        cells, coarse = halves[again], fine[again]
        if not len(coarse):
            break
    sums = np.abs(np.concatenate(differences).sum(axis=0))
    roots = np.array([root_of_squares(column) for column in np.concatenate(errors).T])
    return Refined(
        Cells.joined(found),
        rule,
        np.concatenate(kept),
        np.concatenate(missed),
        np.maximum(np.maximum(sums, roots), allowed if len(found) > 1 else 0.0),
    )
