"""Elements looked at closely: lattices of points in them, and rules on parts of them."""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index
from ..problem import Triangulation

# A disc of a hundredth of the bodies contains a point: none is further from one than .58 / FINEST.
FINEST = 116
LARGEST = 32  # divisions of the side of an element


def extent(mesh: ng.Mesh) -> float:
    """Largest extent of the mesh along x or y, a length."""
    return float(np.ptp(Triangulation(mesh).vertices, axis=0).max())


@lru_cache
def parts(n: int) -> tuple[Array, Array]:
    """The k = n^2 equal parts of the unit triangle: origins (k, 2), sides (k, 2, 2) as rows."""
    i, j = (k.ravel() for k in np.meshgrid(np.arange(n), np.arange(n), indexing="ij"))
    upright, turned = i + j < n, i + j < n - 1
    origin = np.concatenate(
        [np.column_stack([i, j])[upright], np.column_stack([i + 1, j + 1])[turned]]
    )
    side = np.repeat([1.0, -1.0], [upright.sum(), turned.sum()])[:, None, None] * np.eye(2)
    return origin / n, side / n


@lru_cache
def composite(n: int, order: int) -> ng.IntegrationRule:
    """Rule of an order on each of n^2 equal parts of a triangle."""
    rule = ng.IntegrationRule(ng.TRIG, order)
    points, weights = np.array([p[:2] for p in rule.points]), np.array(rule.weights)
    origin, side = parts(n)
    x = (origin[:, None] + points @ side).reshape(-1, 2)
    return ng.IntegrationRule(
        [(a, b, 0.0) for a, b in x.tolist()], np.tile(weights / n**2, n**2).tolist()
    )


def on_lattice(mesh: ng.Mesh, elements: Index, diameter: Array) -> Iterator[tuple[Index, NDArray]]:
    """Elements (j,) of about one size, and mesh points (j, n) in them, until all have come.

    No disc of a hundredth of the mesh's extent falls between the points.

    Parameters
    ----------
    mesh : ng.Mesh
        The mesh.
    elements : ndarray of int (k,)
        Numbers of elements.
    diameter : ndarray (ne,)
        Of all elements, lengths.
    """
    wanted = np.ceil(diameter[elements] * FINEST / extent(mesh))
    divisions = np.clip(2 ** np.ceil(np.log2(np.maximum(wanted, 2))), 2, LARGEST).astype(int)
    for n in np.unique(divisions).tolist():
        here = elements[divisions == n]
        origin, side = parts(n)
        yield here, mesh_points(mesh, here, origin + side.sum(axis=1) / 3)


def mesh_points(mesh: ng.Mesh, elements: Index, reference: Array) -> NDArray:
    """NGSolve's points (j, n) of `elements` (j,) at `reference` (n, 2)."""
    template = mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)
    points = np.repeat(template[elements][:, None], len(reference), axis=1)
    points["x"], points["y"] = reference.T
    return points
