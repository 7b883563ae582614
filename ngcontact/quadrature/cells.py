"""Elements in equal parts, and parts that are halved where a function asks for it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask
from ..problem import MeshArrays

ORDER = {1: 7, 2: 4}  # of the rule on a part
DEEPEST = {1: 40, 2: 10}  # halvings of the sides of a part
MOST_CELLS = 20_000  # parts that are halved at a time: rougher functions are noise

CORNER = 1e-4  # distance of the points at corners from these, relative to a part
BEYOND = 0.05  # share of a part beyond the last point of the rule
# Parts of the bodies' extent: a disc, or a length, of a hundredth of it contains a point.
FINEST = {1: 256, 2: 116}
# Of the side of an element: the polynomials of `View` miss a step at any of the points by 7 %.
PARTS = {1: (16, 32, 128), 2: (2, 4, 8, 12, 16, 24, 32)}
GOLDEN = (1 + 5**0.5) / 2  # takes points on a line out of step with waves


def extent(mesh: ng.Mesh) -> float:
    """Largest extent of the mesh along x or y, a length."""
    return float(np.ptp(MeshArrays(mesh).vertices, axis=0).max())


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


@lru_cache
def beside_edges(dim: int) -> Array:
    """Points (m, dim) inside the unit segment or triangle, 1e-4 of it from its ends or edges."""
    t = np.arange(8)[:, None] / 8
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    edges = [(1 - t) * a + t * b for a, b in zip(corners, np.roll(corners, 1, axis=0), strict=True)]
    x = corners if dim == 1 else np.vstack(edges)
    return np.asarray(x + 1e-4 * (1 / (dim + 1) - x))


def monomials(x: Array, degree: int) -> Array:
    """Products of the coordinates up to a degree at points `x` (..., dim), (..., q)."""
    found = [np.ones(x.shape[:-1])]  # each by one product, in the order of degrees
    for d in range(1, degree + 1):
        first = [x[..., 0] * previous for previous in found[-d if x.shape[-1] == 2 else -1 :]]
        found += first + ([x[..., 1] * found[-1]] if x.shape[-1] == 2 else [])
    return np.stack(found, axis=-1)


@lru_cache
def composite(n: int, order: int) -> ng.IntegrationRule:
    """Rule of an order on each of n^2 equal parts of a triangle."""
    rule = ng.IntegrationRule(ng.TRIG, order)
    points, weights = np.array([p[:2] for p in rule.points]), np.array(rule.weights)
    origin, side = parts(2, n)
    x = (origin[:, None] + points @ side).reshape(-1, 2)
    return ng.IntegrationRule(
        [(a, b, 0.0) for a, b in x.tolist()], np.tile(weights / n**2, n**2).tolist()
    )


def divisions(dim: int, sizes: Array, whole: float) -> Index:
    """How many of `PARTS` the side of elements of `sizes` (k,) is divided into, (k,)."""
    at = np.searchsorted(PARTS[dim], sizes * (FINEST[dim] / whole))
    return np.array(PARTS[dim])[np.minimum(at, len(PARTS[dim]) - 1)]


def on_lattice(mesh: ng.Mesh, elements: Index, sizes: Array) -> Iterator[tuple[Index, NDArray]]:
    """Triangles (j,) of about one size, and mesh points (j, n) in them, until all have come.

    No disc of a hundredth of the mesh's extent falls between the points.

    Parameters
    ----------
    mesh : ng.Mesh
        The mesh.
    elements : ndarray of int (k,)
        Numbers of triangles.
    sizes : ndarray (ne,)
        Diameters of all triangles, lengths.
    """
    count = divisions(2, sizes[elements], extent(mesh))
    for n in np.unique(count).tolist():
        here, reference = elements[count == n], lattice(2, n)
        points = np.broadcast_to(reference, (len(here), *reference.shape))
        yield here, mesh_points(mesh, here, points)


def mesh_points(mesh: ng.Mesh, elements: Index, reference: Array) -> NDArray:
    """NGSolve's points (j, n) of `elements` (j,) at `reference` (j, n, dim)."""
    dim = reference.shape[-1]
    middle = ng.IntegrationRule([(1 / 3, 1 / 3 if dim == 2 else 0.0, 0.0)], [1])
    template = mesh.MapToAllElements(middle, ng.VOL if dim == 2 else ng.BND)
    points = template[np.repeat(elements, reference.shape[1])].reshape(reference.shape[:2])
    for axis, name in zip(range(dim), "xy", strict=False):
        points[name] = reference[..., axis]
    return points


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
