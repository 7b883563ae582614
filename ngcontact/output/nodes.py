"""Nodes of curved triangles and tetrahedra, values of a solution there."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from ..arrays import Array, Index
from ..problem import MeshArrays

# Of VTK's tetrahedra, by the numbers of their vertices.
EDGES = (0, 1), (1, 2), (2, 0), (0, 3), (1, 3), (2, 3)
FACES = (0, 1, 3), (1, 2, 3), (2, 0, 3), (0, 2, 1)
# Triangles and tetrahedra: linear, quadratic, Lagrange's of every higher order.
VTK_CELLS = {2: (5, 22, 69), 3: (10, 24, 71)}
# Places of the components of `full_stress` in the tensor.
COMPONENTS = (0, 0), (1, 1), (0, 1), (2, 2), (1, 2), (0, 2)


@dataclass(frozen=True, eq=False)
class Nodes:
    """Lagrange nodes of a mesh, shared inside a body and never between bodies."""

    cells: Index  # (ne, n) in VTK's order, of triangles n = (order + 1) (order + 2) / 2
    body: Index  # (ne,), position of the element's region in `names`
    names: tuple[str, ...]  # the material regions
    at: NDArray[Any]  # (k,), the same nodes as mesh points, element after element: k = ne n

    def values(self, function: ng.CoefficientFunction) -> Array:
        """Nodal values (k, dim) at all k nodes: the mean over the elements that meet there."""
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


def tetrahedron(order: int) -> Index:
    """Barycentric indices (n, 4) of the nodes of VTK's Lagrange tetrahedron of order 1, 2 or 3.

    With respect to Netgen's vertices: VTK sees its tetrahedra turned inside out.
    """
    unit, step = np.eye(4, dtype=np.intp)[[1, 0, 2, 3]], np.arange(1, order)[:, None]
    edges = [(order - step) * unit[a] + step * unit[b] for a, b in EDGES]
    faces = [unit[list(face)].sum(axis=0)[None] for face in FACES] if order == 3 else []
    return np.concatenate([order * unit, *edges, *faces])


def subdivision(order: int) -> tuple[Index, Index]:
    """Small triangles (t, 3), t = order^2, and sides (3, order + 1) of a `lattice` triangle."""
    inner = np.arange(3, 3 * order).reshape(3, -1)
    sides = np.column_stack([[0, 1, 2], inner, [1, 2, 0]])
    return Delaunay(lattice(order)[:, 1:]).simplices, sides


def sized(cells: Index) -> Index:
    """Numbers (m,) of `cells` (k, n) as VTK reads them: n before the nodes of each."""
    return np.column_stack([np.full(len(cells), cells.shape[1]), cells]).ravel()


def nodes_of(mesh: ng.Mesh, order: int) -> Nodes:
    """Nodes of the Lagrange elements of a mesh of simplices; ``ValueError`` if it has others."""
    solid = mesh.dim == 3
    weights = tetrahedron(order) if solid else lattice(order)
    # NGSolve's reference triangle has its vertices at (1, 0), (0, 1), (0, 0), and so on in space.
    places = np.zeros((len(weights), 3))
    places[:, : mesh.dim] = weights[:, : mesh.dim] / order
    rule = ng.IntegrationRule([tuple(x) for x in places.tolist()], [0.0] * len(places))
    at = mesh.MapToAllElements({ng.TET if solid else ng.TRIG: rule}, ng.VOL)
    view = MeshArrays(mesh)
    if others := view.without_simplices():
        kind, right = ("tetrahedra", "hexahedra") if solid else ("triangles", "quads")
        raise ValueError(f"{others} elements of the mesh are no {kind}; mesh without {right}")
    names = tuple(dict.fromkeys(mesh.GetMaterials()))
    regions = np.array([names.index(name) for name in mesh.GetMaterials()], dtype=np.intp)
    body = regions[view.bodies]
    vertices = view.elements * len(names) + body[:, None]
    # A node is known by the vertices it leans on and its weights there, from any triangle.
    key = np.where(weights > 0, vertices[:, None, :] * (order + 1) + weights, 0)
    key = np.sort(key.reshape(-1, mesh.dim + 1), axis=1)
    rank = np.lexsort(key.T)
    fresh = np.any(np.diff(key[rank], axis=0, prepend=-1), axis=1)
    cells = np.empty(len(key), dtype=np.intp)
    cells[rank] = np.cumsum(fresh) - 1
    return Nodes(cells.reshape(-1, len(weights)), body, names, at)


def stress_tensors(stress: Array) -> Array:
    """Tensors (k, 3, 3) of `stress` (k, 4), or (k, 6), the components of `full_stress`."""
    tensors = np.zeros((len(stress), 3, 3))
    for (i, j), component in zip(COMPONENTS, stress.T, strict=False):
        tensors[:, i, j] = tensors[:, j, i] = component
    return tensors


def principal_stresses(stress: Array) -> Array:
    """Principal stresses (k, 3), the largest first, of `stress` (k, 4) or (k, 6)."""
    return np.asarray(np.linalg.eigvalsh(stress_tensors(stress))[:, ::-1])
