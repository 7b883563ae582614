"""Nodes of curved triangles and tetrahedra, values of a solution there."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import Delaunay

from ..arrays import Array, Index
from ..problem import MeshArrays

if TYPE_CHECKING:
    import pyvista

# Triangles and tetrahedra: linear, quadratic, Lagrange's of every higher order.
VTK_CELLS = {2: (5, 22, 69), 3: (10, 24, 71)}
# Places of the components of `full_stress` in the tensor.
COMPONENTS = (0, 0), (1, 1), (0, 1), (2, 2), (1, 2), (0, 2)


@dataclass(frozen=True, eq=False)
class Nodes:
    """Lagrange nodes of a mesh, shared inside a body and never between bodies."""

    order: int
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

    def grid(self, points: Array) -> pyvista.UnstructuredGrid:
        """The elements with their nodes at `points` (n, d)."""
        import pyvista

        kind = VTK_CELLS[points.shape[1]][min(self.order, 3) - 1]
        return pyvista.UnstructuredGrid({kind: self.cells}, in_space(points))

    def divided(self) -> Nodes:
        """The linear triangles, order^2 to each, into which the nodes divide curved ones."""
        parts = subdivision(self.order)[0][:, ::-1]  # what VTK turns about z has positive volume
        cells, body = self.cells[:, parts].reshape(-1, 3), np.repeat(self.body, len(parts))
        return replace(self, order=1, cells=cells, body=body)


def lattice(order: int, dim: int) -> Index:
    """Barycentric indices (n, dim + 1) of the nodes of VTK's Lagrange simplex, row sums = `order`.

    With respect to Netgen's vertices: VTK sees its tetrahedra turned inside out.
    """
    from vtkmodules.vtkCommonDataModel import vtkHigherOrderTetra, vtkHigherOrderTriangle

    kind: Any = vtkHigherOrderTriangle if dim == 2 else vtkHigherOrderTetra
    turned = [2, 0, 1] if dim == 2 else [0, 3, 1, 2]
    nodes, node = [], [0] * (dim + 1)
    for number in range(math.comb(order + dim, dim)):
        kind.BarycentricIndex(number, node, order)  # the first vertex has the last index
        nodes.append([node[k] for k in turned])
    return np.array(nodes, dtype=np.intp)


def subdivision(order: int) -> tuple[Index, Index]:
    """Small triangles (t, 3), t = order^2, and sides (3, order + 1) of a `lattice` triangle."""
    inner = np.arange(3, 3 * order).reshape(3, -1)
    sides = np.column_stack([[0, 1, 2], inner, [1, 2, 0]])
    return Delaunay(lattice(order, 2)[:, 1:]).simplices, sides


def sized(cells: Index) -> Index:
    """Numbers (m,) of `cells` (k, n) as VTK reads them: n before the nodes of each."""
    return np.column_stack([np.full(len(cells), cells.shape[1]), cells]).ravel()


def in_space(vectors: Array) -> Array:
    """The `vectors` (k, d) as (k, 3), with third components 0 in the plane."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def through(step: Any, data: Any) -> Any:
    """What a filter of VTK makes of `data`."""
    import pyvista

    step.SetInputData(data)
    step.Update()
    return pyvista.wrap(step.GetOutput())


def order_of(mesh: ng.Mesh, order: int) -> int:
    """Degree of the geometry or of a displacement of `order`, whichever is higher."""
    return max(int(mesh.GetCurveOrder()), order)


def nodes_of(mesh: ng.Mesh, order: int) -> Nodes:
    """Nodes of the Lagrange elements of a mesh of simplices; ``ValueError`` if it has others."""
    solid = mesh.dim == 3
    weights = lattice(order, mesh.dim)
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
    key = np.sort(key.reshape(-1, mesh.dim + 1), axis=1)[:, ::-1]
    cells = np.unique(key, axis=0, return_inverse=True)[1]
    return Nodes(order, cells.reshape(-1, len(weights)), body, names, at)


def stress_tensors(stress: Array) -> Array:
    """Tensors (k, 3, 3) of `stress` (k, 4), or (k, 6), the components of `full_stress`."""
    tensors = np.zeros((len(stress), 3, 3))
    for (i, j), component in zip(COMPONENTS, stress.T, strict=False):
        tensors[:, i, j] = tensors[:, j, i] = component
    return tensors


def principal_stresses(stress: Array) -> Array:
    """Principal stresses (k, 3), the largest first, of `stress` (k, 4) or (k, 6)."""
    return np.asarray(np.linalg.eigvalsh(stress_tensors(stress))[:, ::-1])
