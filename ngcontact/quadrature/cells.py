"""Parts of elements, halved where a function asks for it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import ngsolve as ng
import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask
from .lattice import monomials, parts

ORDER = {1: 7, 2: 4}  # of the rule on a part
DEEPEST = {1: 40, 2: 10}  # halvings of the sides of a part
MOST_CELLS = 20_000  # parts that are halved at a time: rougher functions are noise

CORNER = 1e-4  # distance of the points at corners from these, relative to a part
BEYOND = 0.05  # share of a part beyond the last point of the rule

Integrand = Callable[[Index, Array], Array]


def with_corners(inner: Array, weights: Array, degree: int) -> tuple[Array, Array, Array]:
    """A rule with points `inner` (m, dim) and `weights` (m,), and corners at its end.

    Points (n, dim); weights (n,), 0 at the corners; a matrix (dim + 1, n) to what a polynomial of
    a degree through the others misses at the corners. Steps beyond the last point are seen there.
    """
    dim = inner.shape[1]
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    corners = corners + CORNER * (1 / (dim + 1) - corners)
    through = monomials(corners, degree) @ np.linalg.pinv(monomials(inner, degree))
    return (
        np.vstack([inner, corners]),
        np.append(weights, np.zeros(dim + 1)),
        np.hstack([-through, np.eye(dim + 1)]),
    )


@lru_cache
def rule(dim: int) -> tuple[Array, Array, Array]:
    """Points (m, dim), weights (m,) on the unit simplex, a matrix (dim + 1, m): `with_corners`."""
    made = ng.IntegrationRule(ng.SEGM if dim == 1 else ng.TRIG, ORDER[dim])
    inner = np.array([p[:dim] for p in made.points]).reshape(-1, dim)
    return with_corners(inner, np.array(made.weights), {1: 3, 2: 2}[dim])


@dataclass(frozen=True, eq=False)
class Cells:
    """Parts of elements, k of them.

    Attributes
    ----------
    element : ndarray of int (k,)
        The element of each.
    origin : ndarray (k, dim)
        Reference coordinates of a corner.
    side : ndarray (k, dim, dim)
        Sides from there, as rows.
    """

    element: Index
    origin: Array
    side: Array

    @property
    def points(self) -> Array:
        """Points of the rule, (k, m, dim), in reference coordinates of the elements."""
        return self.origin[:, None] + rule(self.origin.shape[1])[0] @ self.side

    @property
    def weights(self) -> Array:
        """Weights of the rule, (k, m)."""
        return np.abs(np.linalg.det(self.side))[:, None] * rule(self.origin.shape[1])[1]

    def __getitem__(self, at: Mask | Index) -> Cells:
        """Those selected by `at` (k,), a mask or numbers."""
        return Cells(self.element[at], self.origin[at], self.side[at])

    def divided(self, n: int) -> Cells:
        """Each in n^dim equal parts, one after the other."""
        origin, side = parts(self.origin.shape[1], n)
        return Cells(
            np.repeat(self.element, len(origin)),
            (self.origin[:, None] + origin @ self.side).reshape(-1, *origin.shape[1:]),
            (side @ self.side[:, None]).reshape(-1, *side.shape[1:]),
        )


def whole(dim: int, elements: Index) -> Cells:
    """The `elements` (k,) themselves."""
    size = len(elements)
    return Cells(elements, np.zeros((size, dim)), np.tile(np.eye(dim), (size, 1, 1)))


def joined(several: list[Cells]) -> Cells:
    """All of several."""
    return Cells(*(np.concatenate(x) for x in zip(*map(_arrays, several), strict=True)))


def _arrays(cells: Cells) -> tuple[Index, Array, Array]:
    return cells.element, cells.origin, cells.side


def following(
    integrand: Integrand, cells: Cells, allowed: float, corners: Array | None = None
) -> tuple[Cells, Array, Array]:
    """Parts of `cells` on which the rule integrates a function.

    What is beside a part that is halved is halved, too, where `corners` tell: it may hold the rest
    of what is there without any of the points.

    Parameters
    ----------
    integrand : function
        Values (k, m, c) at points (k, m, dim) of elements (k,).
    cells : Cells
        To start from.
    allowed : float
        Difference of the integrals over a part and over its halves at which it is not halved again.
    corners : ndarray (n, 3, 2), optional
        Of all triangles, lengths.

    Returns
    -------
    Cells
        The parts.
    values : ndarray (k, m, c)
        The function there.
    missed : ndarray (k,)
        That difference where a part is halved no more although it is larger, else 0.
    """
    dim = cells.origin.shape[1]
    found, kept, missed = [], [], []

    def integrals(cells: Cells) -> tuple[Array, Array, Array]:
        values = integrand(cells.element, cells.points)
        beyond = np.abs(rule(dim)[2] @ values).max(axis=(1, 2))
        integral = (cells.weights[:, None] @ values)[:, 0]
        return values, integral, BEYOND * beyond * cells.weights.sum(axis=1)

    _, coarse, beyond = integrals(cells)
    for depth in range(DEEPEST[dim]):
        halves = cells.divided(2)
        values, fine, next_beyond = integrals(halves)
        error = np.abs(fine.reshape(len(coarse), 2**dim, -1).sum(axis=1) - coarse).max(axis=1)
        error = np.maximum(error, beyond)
        last = depth == DEEPEST[dim] - 1 or np.count_nonzero(error > allowed) > MOST_CELLS
        some = (error > allowed) & (not last)
        if corners is not None and some.any():
            some = with_those_beside(some, cells, corners)
        again = np.repeat(some, 2**dim)
        found.append(halves[~again])
        kept.append(values[~again])
        over = np.where(error > allowed, error, 0.0) * last / 2**dim
        missed.append(np.repeat(over, 2**dim)[~again])
        cells, coarse, beyond = halves[again], fine[again], next_beyond[again]
        if not len(coarse):
            break
    return joined(found), np.concatenate(kept), np.concatenate(missed)


def with_those_beside(some: Mask, cells: Cells, corners: Array) -> Mask:
    """The cells `some` (k,) and those that may touch one, (k,); `corners` (n, 3, 2) as above."""
    of = corners[cells.element]
    sides = cells.side @ (of[:, :2] - of[:, 2:])
    origin = of[:, 2] + (cells.origin[:, None] @ (of[:, :2] - of[:, 2:]))[:, 0]
    middle = origin + sides.sum(axis=1) / 3
    ends = np.concatenate([origin[:, None], origin[:, None] + sides], axis=1)
    radius = np.linalg.norm(ends - middle[:, None], axis=2).max(axis=1)
    apart, nearest = cKDTree(middle[some]).query(middle)
    return np.asarray(apart <= radius + radius[some][nearest])
