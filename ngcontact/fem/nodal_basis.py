"""Values at Gauss-Lobatto points of the boundary in place of NGSolve's edge unknowns."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index
from ..lagrange import gauss_lobatto
from ..triplets import from_triplets
from .boundary import BoundaryTrace


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
