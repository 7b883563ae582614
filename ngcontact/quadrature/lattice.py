"""Elements looked at closely: equal parts of them, points in these, and rules on them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index
from ..problem import Triangulation

# Parts of the bodies' extent: a disc, or a length, of a hundredth of it contains a point.
FINEST = {1: 256, 2: 116}
# Of the side of an element: the polynomials of `View` miss a step at any of the points by 7 %.
PARTS = {1: (16, 32, 128), 2: (2, 4, 8, 12, 16, 24, 32)}
GOLDEN = (1 + 5**0.5) / 2  # takes points on a line out of step with waves


def extent(mesh: ng.Mesh) -> float:
    """Largest extent of the mesh along x or y, a length."""
    return float(np.ptp(Triangulation(mesh).vertices, axis=0).max())


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
