"""The common problems in NGSolve's forms and numbering."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from drivers.benchmark.scenes.plane import Numbering, moduli
from drivers.benchmark.scenes.problems import Common
from ngcontact.arrays import from_triplets
from ngcontact.linalg import shared
from ngcontact.problem import Triangulation

BUBBLE = -1 / 8  # value of NGSolve's edge function of order 2 at the middle of the edge


def stiffness(common: Common, space: ng.FESpace) -> ng.BilinearForm:
    """Plane strain elasticity, not yet assembled."""
    u, v = space.TnT()
    lam, mu = moduli(common)
    strain, test = ng.Sym(ng.Grad(u)), ng.Sym(ng.Grad(v))
    energy = 2 * mu * ng.InnerProduct(strain, test) + lam * ng.div(u) * ng.div(v)
    return ng.BilinearForm(energy * ng.dx, symmetric=True)


def matrix(common: Common, space: ng.FESpace) -> sp.csr_array:
    """Stiffness matrix (n, n); a copy, as NGSolve's is gone with its form."""
    form = stiffness(common, space).Assemble()
    return shared(form.mat).copy()


def load(common: Common, space: ng.FESpace) -> ng.LinearForm:
    """Pressures on the boundary, not yet assembled."""
    v = space.TestFunction()
    form = ng.LinearForm(space)
    for name in common.problem.traction:
        form += ng.InnerProduct(common.problem.traction_vector(name), v.Trace()) * ng.ds(name)
    return form


def numbering(mesh: ng.Mesh, order: int) -> Numbering:
    """Vertices, then edges; all first components before all second ones."""
    nodes = mesh.nv + (mesh.nedge if order == 2 else 0)
    segments: dict[str, list[list[int]]] = {}
    for element in mesh.Elements(ng.BND):
        first, last = (vertex.nr for vertex in element.vertices)
        middle = [mesh.nv + element.edges[0].nr] if order == 2 else []
        segments.setdefault(element.mat, []).append([first, *middle, last])
    return Numbering(
        points=Triangulation(mesh).vertices,
        unknown=np.arange(2 * nodes).reshape(2, nodes),
        segments={name: np.array(rows) for name, rows in segments.items()},
    )


def nodal(numbering: Numbering) -> tuple[sp.csr_array, sp.csr_array]:
    """Unknowns (n, n) from values at the nodes of the boundary, else from themselves; inverse.

    They differ at the middles of edges: NGSolve's unknown there counts from the mean of the ends.
    """
    n = numbering.unknown.size
    rows = np.concatenate(list(numbering.segments.values()))
    if rows.shape[1] == 2:
        return sp.eye_array(n, format="csr"), sp.eye_array(n, format="csr")
    first, middle, last = numbering.unknown[:, rows].transpose(2, 0, 1).reshape(3, -1)
    i, j = np.tile(middle, 2), np.concatenate([first, last])
    means = from_triplets(np.full(len(i), 0.5), i, j, (n, n))
    scale = np.ones(n)
    scale[middle] = BUBBLE
    forward = (sp.diags_array(1 / scale) @ (sp.eye_array(n) - means)).tocsr()
    return forward, (sp.diags_array(scale) + means).tocsr()
