"""Nodes of curved triangles with values of a solution there; neighbours on curves."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import KDTree

from ..arrays import Array, Index, from_triplets
from ..problem import MeshArrays
from ..solved import Solved


@dataclass(frozen=True, eq=False)
class Nodes:
    """Lagrange nodes of a triangle mesh, shared inside a body and never between bodies."""

    cells: Index  # (ne, n) in VTK's order, n = (order + 1) (order + 2) / 2
    body: Index  # (ne,), position of the element's region in `names`
    names: tuple[str, ...]  # the material regions
    at: NDArray[Any]  # (k,), the same nodes as mesh points, element after element: k = ne n

    def values(self, function: ng.CoefficientFunction) -> Array:
        """Nodal values (k, dim) at all k nodes: the mean over the triangles that meet there."""
        numbers = self.cells.ravel()
        found = np.asarray(function(self.at), dtype=float).reshape(len(numbers), -1)
        count = np.bincount(numbers)
        return np.stack([np.bincount(numbers, column) / count for column in found.T], axis=1)


def lattice(order: int) -> Index:
    """Barycentric indices (n, 3) of the nodes of VTK's Lagrange triangle, row sums = `order`.

    Corners, then the insides of the edges 01, 12, 20, then the inside, which is again such a
    triangle of order - 3.
    """
    if order == 0:
        return np.zeros((1, 3), dtype=np.intp)
    unit, step = np.eye(3, dtype=np.intp), np.arange(1, order)[:, None]
    edges = [(order - step) * unit[a] + step * unit[b] for a, b in ((0, 1), (1, 2), (2, 0))]
    inside = [lattice(order - 3) + 1] if order > 2 else []
    return np.concatenate([order * unit, *edges, *inside])


def subdivision(order: int) -> tuple[list[list[int]], list[list[int]]]:
    """Small triangles (order^2, 3) and sides (3, order + 1) of a `lattice` triangle."""
    number = {(b, c): k for k, (_, b, c) in enumerate(lattice(order).tolist())}
    triangles = [
        [number[b + db, c + dc] for db, dc in corners]
        for b, c in number
        for corners in (((0, 0), (1, 0), (0, 1)), ((1, 0), (1, 1), (0, 1)))
        if all((b + db, c + dc) in number for db, dc in corners)
    ]
    steps = range(order + 1)
    bottom, left = [number[k, 0] for k in steps], [number[0, k] for k in steps]
    return triangles, [bottom, [number[order - k, k] for k in steps], left]


def nodes_of(mesh: ng.Mesh, order: int) -> Nodes:
    """Nodes of the Lagrange triangles of a mesh; ``ValueError`` if it has other elements."""
    weights = lattice(order)
    # NGSolve's reference triangle has its vertices at (1, 0), (0, 1), (0, 0).
    places = [(a / order, b / order, 0.0) for a, b, _ in weights]
    rule = ng.IntegrationRule(places, [0.0] * len(places))
    at = mesh.MapToAllElements({ng.TRIG: rule}, ng.VOL)
    view = MeshArrays(mesh)
    if others := view.without_simplices():
        raise ValueError(f"{others} elements of the mesh are no triangles; mesh without quads")
    names = tuple(dict.fromkeys(mesh.GetMaterials()))
    regions = np.array([names.index(name) for name in mesh.GetMaterials()], dtype=np.intp)
    body = regions[view.bodies]
    vertices = view.elements * len(names) + body[:, None]
    # A node is known by the vertices it leans on and its weights there, from any triangle.
    key = np.where(weights > 0, vertices[:, None, :] * (order + 1) + weights, 0)
    key = np.sort(key.reshape(-1, 3), axis=1)
    rank = np.lexsort(key.T)
    fresh = np.any(np.diff(key[rank], axis=0, prepend=-1), axis=1)
    cells = np.empty(len(key), dtype=np.intp)
    cells[rank] = np.cumsum(fresh) - 1
    return Nodes(cells.reshape(-1, len(weights)), body, names, at)


def full_stress(solution: Solved) -> ng.CoefficientFunction:
    """Stress components xx, yy, xy, zz, the one normal to the plane, (4,); of solids yz, xz."""
    stress = solution.stress
    plane = stress[0, 0], stress[1, 1], stress[0, 1]
    if solution.mesh.dim == 3:
        return ng.CF((*plane, stress[2, 2], stress[1, 2], stress[0, 2]))
    return ng.CF((*plane, solution.out_of_plane_stress))


def principal_stresses(stress: Array) -> Array:
    """Principal stresses (k, 3), the largest first, of xx, yy, xy, zz in `stress` (k, 4)."""
    xx, yy, xy, zz = stress.T
    mean, radius = (xx + yy) / 2, np.hypot((xx - yy) / 2, xy)
    return np.asarray(-np.sort(-np.stack([mean + radius, mean - radius, zz], axis=1), axis=1))


def neighbour_tree(points: Array) -> csr_array:
    """Neighbours (m, m) along the curves through `points` (m, 2): tree of least total distance."""
    near = list(range(1, min(len(points), 9) + 1))
    distance, neighbour = KDTree(points).query(points, k=near)
    start = np.broadcast_to(np.arange(len(points))[:, None], neighbour.shape)
    other = neighbour != start
    # The two rows of a corner are at distance 0, which a sparse graph reads as "no edge".
    weight = np.maximum(distance[other], np.finfo(float).tiny)
    graph = from_triplets(weight, start[other], neighbour[other], (len(points), len(points)))
    return minimum_spanning_tree(graph)
