"""Elements of HH81 (2.2), (2.4), (2.9): which there are, their spaces, their node values."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index
from ..lagrange import gauss_lobatto
from ..problem import Triangulation
from ..triplets import for_both_components, from_triplets
from .boundary import BoundaryTrace

ORDERS = (1, 2, 3, 4)
ELEMENTS = ("isoparametric", "superparametric", "physical")


def edge_bubbles(space: ng.FESpace, axis: int = 0) -> Array:
    """Values (order - 1, order - 1) of the edge functions of an H1 space at the interior nodes.

    Row i is the i-th interior Gauss-Lobatto point from the end with the lower vertex number,
    column j the j-th edge function. Which points, says `axis`: see `gauss_lobatto`.
    """
    mesh, order = space.mesh, space.globalorder
    element = ng.ElementId(ng.VOL, 0)
    vertices = [v.nr for v in mesh[element].vertices]
    edge = mesh[element].edges[0]
    low, high = sorted(v.nr for v in mesh[edge].vertices)
    reference = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    start, stop = reference[vertices.index(low)], reference[vertices.index(high)]
    numbers = list(space.GetDofNrs(element))
    columns = [numbers.index(d) for d in space.GetDofNrs(edge)]
    shape = space.GetFE(element)
    points = [start + s * (stop - start) for s in gauss_lobatto(order, axis)[1:-1]]
    values = np.array([shape.CalcShape(float(px), float(py), 0.0).NumPy() for px, py in points])
    return values[:, columns]


def nodal_basis(trace: BoundaryTrace, segments: Index) -> sp.csr_array:
    """Matrix (n, n) from node values on `segments` (k,) and other unknowns to those of NGSolve."""
    order, size = trace.order, trace.space.ndof
    if order == 1:
        return sp.eye_array(size, format="csr")
    nodes, axis = trace.nodes[segments], trace.axis[segments]
    falling = nodes[:, 0] > nodes[:, -1]
    nodes = np.where(falling[:, None], nodes[:, ::-1], nodes)
    axis = np.where(falling, -axis, axis)
    _, first = np.unique(nodes[:, 1], return_index=True)
    nodes, axis = nodes[first], axis[first]
    # Edge function coefficients: bubbles (values - linear part).
    values = np.zeros((len(nodes), order - 1, order + 1))
    for end in np.unique(axis):
        s = gauss_lobatto(order, int(end))[1:-1]
        bubbles = np.linalg.inv(edge_bubbles(trace.space, int(end)))
        values[axis == end] = bubbles @ np.column_stack([s - 1, np.eye(order - 1), -s])
    rows = np.repeat(nodes[:, 1:-1, None], order + 1, axis=2)
    cols = np.repeat(nodes[:, None, :], order - 1, axis=1)
    rest = np.ones(size, dtype=bool)
    rest[nodes[:, 1:-1]] = False
    same = np.flatnonzero(rest)
    return from_triplets(
        np.concatenate([np.ones(len(same)), values.ravel()]),
        np.concatenate([same, rows.ravel()]),
        np.concatenate([same, cols.ravel()]),
        (size, size),
    )


def unknowns(mesh: ng.Mesh, order: int, element: str) -> int:
    """Number of unknowns of the displacement on a mesh that is curved to the element's degree."""
    # Functions linear in physical coordinates are kept in a space with boundary edge functions.
    edges = mesh.GetNE(ng.BND) if element == "physical" and mesh.GetCurveOrder() > 1 else 0
    return unknowns_of(order, mesh.nv + edges, mesh.nedge, mesh.ne)


def unknowns_of(order: int, vertices: int, edges: int, elements: int) -> int:
    """Number of unknowns of a displacement of degree `order` on that many of each."""
    inner = (order - 1) * (order - 2) // 2
    return 2 * (vertices + (order - 1) * edges + inner * elements)


def check_element(order: int, element: str) -> int:
    """The order; raise unless the element is one of `ELEMENTS` with an order it is available in."""
    if element not in ELEMENTS:
        raise ValueError(f"element={element!r} is not available; choose one of {ELEMENTS}")
    orders = (1,) if element == "physical" else ORDERS
    if isinstance(order, bool) or not isinstance(order, int | np.integer):
        raise TypeError(f"order={order!r} is not an integer; element={element!r} has {orders}")
    if order not in orders:
        raise ValueError(f"order={order} is not available; element={element!r} has {orders}")
    return int(order)  # NGSolve knows no integers of NumPy


def _physical_basis(V: ng.FESpace, trace: BoundaryTrace) -> sp.csr_array:
    """P1 in physical coordinates (2.4) inside the quadratic isoparametric space, (N, nv).

    On a curved element a linear function of x has the edge function coefficients that its
    values at the edge's interior nodes ask for; those values come from all three vertices.
    """
    mesh = trace.mesh
    if V.ndof == 2 * mesh.nv:
        return sp.eye_array(mesh.nv, format="csr")
    view = Triangulation(mesh)
    xy, triangles = view.vertices, view.triangles[trace.element]
    if trace.geometry_order > 2:
        raise ValueError(
            f"the mesh is curved to degree {trace.geometry_order}; element='physical' lives on "
            "meshes curved to degree 2: call mesh.Curve(2)"
        )
    middle = trace.curve[:, 1] if trace.geometry_order == 2 else trace.curve.mean(axis=1)
    # Barycentric coordinates of the edge's node in the straight triangle, affinely extended.
    sides = xy[triangles[:, 1:]] - xy[triangles[:, :1]]
    bary = np.linalg.solve(sides.transpose(0, 2, 1), (middle - xy[triangles[:, 0]])[..., None])
    bary = np.column_stack([1 - bary.sum(axis=1), bary[..., 0]])
    # (2.4): the linear function of x at the edge's node, less the mean of its two ends.
    value = bary - np.where((triangles[:, :, None] == trace.nodes[:, None, :]).any(axis=2), 0.5, 0)
    numbers = np.array(
        [
            V.GetDofNrs(el.edges[0])[0] if V.GetDofNrs(el.edges[0]) else -1
            for el in mesh.Elements(ng.BND)
        ]
    )
    on = numbers >= 0
    bubble = 1 / edge_bubbles(ng.H1(mesh, order=2))[0, 0]
    rows = np.repeat(numbers[on], 3)
    edges = from_triplets(
        (bubble * value[on]).ravel(), rows, triangles[on].ravel(), (V.ndof // 2, mesh.nv)
    )
    return (sp.eye_array(V.ndof // 2, mesh.nv) + edges).tocsr()


def vector_space(mesh: ng.Mesh, order: int, element: str) -> ng.FESpace:
    """Displacements on a curved mesh, as unknowns of NGSolve."""
    if element != "physical" or mesh.GetCurveOrder() == 1:
        return ng.VectorH1(mesh, order=order)  # (2.2); on curved elements (2.9)
    full = ng.VectorH1(mesh, order=2)
    half = full.ndof // 2
    active = np.zeros(half, dtype=bool)
    active[: mesh.nv] = True
    boundary = [el.edges[0].nr for el in mesh.Elements(ng.BND)]
    active[mesh.nv + np.array(boundary)] = True  # (2.4): what linear functions of x need
    return ng.Compress(full, active_dofs=ng.BitArray(np.tile(active, 2)))


def node_basis(V: ng.FESpace, trace: BoundaryTrace, nodal: Index, element: str) -> sp.csr_array:
    """`Space.basis` (2N, 2n) for node values on the segments `nodal` (k,)."""
    scalar = _physical_basis(V, trace) if element == "physical" else nodal_basis(trace, nodal)
    return for_both_components(scalar)
