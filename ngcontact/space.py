"""The finite element spaces V_h of HH81 (2.2), (2.4), (2.9): space, stiffness A, load f."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from .arrays import Array, Index
from .linalg.sparse import shared
from .nodal import edge_bubbles, nodal_basis
from .problem.material import varies
from .problem.problem import Problem
from .problem.regions import boundary_mask
from .trace import Trace
from .triplets import from_triplets

ORDERS = (1, 2, 3, 4)
ELEMENTS = ("isoparametric", "superparametric", "physical")
# Loads and variable moduli may be as rough as r^(-1/2): quadrature orders above the default.
LOAD_BONUS = 6
MODULUS_BONUS = 4


def check_element(order: int, element: str) -> None:
    """Raise unless the element is one of `ELEMENTS` with an order it is available in."""
    if element not in ELEMENTS:
        raise ValueError(f"element={element!r} is not available; choose one of {ELEMENTS}")
    orders = (1,) if element == "physical" else ORDERS
    if isinstance(order, bool) or not isinstance(order, int | np.integer):
        raise TypeError(f"order={order!r} is not an integer; element={element!r} has {orders}")
    if order not in orders:
        raise ValueError(f"order={order} is not available; element={element!r} has {orders}")


@dataclass(frozen=True, eq=False)
class Space:
    """V_h with the assembled forms (3.1), (3.2).

    Attributes
    ----------
    V : ng.FESpace
        Vector space of N unknowns for each component.
    trace : Trace
        Its boundary nodes.
    nodal : ndarray of int (k,)
        Segments of the trace on which conditions are posed at nodes.
    basis : sparse (2N, 2n)
        From n node values there (and unknowns elsewhere) for each component to the unknowns of V.
    A : sparse (2N, 2N)
        Stiffness.
    matrix : ng.BaseMatrix
        The same for NGSolve, in the same memory.
    f : ndarray (2N,)
        Load.
    """

    V: ng.FESpace
    trace: Trace
    nodal: Index
    basis: sp.csr_array
    A: sp.csr_array
    matrix: ng.BaseMatrix
    f: Array

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal of A, (2N,)."""
        return np.asarray(self.A.diagonal())

    def stiffness(self) -> Array:
        """Force per displacement of the nodes, (n,), by its order of magnitude."""
        diagonal = self.basis.power(2).T @ self.diagonal
        return diagonal.reshape(2, -1).max(axis=0)


def strain(u: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """Voigt strain (e_xx, e_yy, 2 e_xy) of a displacement or trial function."""
    grad = ng.Grad(u)
    return ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))


def _physical_basis(V: ng.FESpace, trace: Trace) -> sp.csr_array:
    """P1 in physical coordinates (2.4) inside the quadratic isoparametric space, (N, nv).

    On a curved element a linear function of x has the edge function coefficients that its
    values at the edge's interior nodes ask for; those values come from all three vertices.
    """
    mesh = trace.mesh
    if V.ndof == 2 * mesh.nv:
        return sp.eye_array(mesh.nv, format="csr")
    xy = np.array(mesh.ngmesh.Coordinates())[:, :2]
    corners = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(np.intp) - 1
    triangles = corners[trace.element]
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


def _vector_space(mesh: ng.Mesh, order: int, element: str) -> ng.FESpace:
    if element != "physical" or mesh.GetCurveOrder() == 1:
        return ng.VectorH1(mesh, order=order)
    full = ng.VectorH1(mesh, order=2)
    half = full.ndof // 2
    active = np.zeros(half, dtype=bool)
    active[: mesh.nv] = True
    boundary = [el.edges[0].nr for el in mesh.Elements(ng.BND)]
    active[mesh.nv + np.array(boundary)] = True
    return ng.Compress(full, active_dofs=ng.BitArray(np.tile(active, 2)))


def _check_normals(trace: Trace, boundary: str) -> None:
    """Raise unless NGSolve's normals, the direction of pressures, point outwards."""
    segments = trace.select(boundary_mask(trace.mesh, boundary))
    s = np.full(len(segments), 0.5)
    normal = trace.evaluate(ng.specialcf.normal(2), segments, s)
    if ((normal * trace.normal(segments, s)).sum(axis=1) < 0).any():
        raise ValueError(
            f'the normals of the boundary "{boundary}" point into the body; its segments must run '
            "with the body on their left"
        )


def load_vector(problem: Problem, V: ng.FESpace, bonus: int) -> Array:
    """f(v) of (3.2), (2N,), with quadrature `bonus` orders above the default."""
    v = V.TestFunction()
    f = ng.LinearForm(V)
    for body, F in problem.force.items():
        f += F * v * ng.dx(definedon=V.mesh.Materials(body), bonus_intorder=bonus)
    for boundary in problem.traction:
        P = problem.traction_vector(boundary)
        region = V.mesh.Boundaries(boundary)
        f += P * v.Trace() * ng.ds(definedon=region, bonus_intorder=bonus)
    f.Assemble()
    return f.vec.FV().NumPy().copy()


def node_basis(V: ng.FESpace, trace: Trace, nodal: Index, element: str) -> sp.csr_array:
    """`Space.basis` for node values on the segments `nodal`."""
    scalar = _physical_basis(V, trace) if element == "physical" else nodal_basis(trace, nodal)
    return sp.block_diag([scalar, scalar], format="csr")


def assemble(problem: Problem, trace: Trace, element: str, nodal: Index | None = None) -> Space:
    """Space, stiffness and load of a problem on the mesh of `trace`, curved as `element` asks.

    Node values replace NGSolve's unknowns on the segments `nodal`, all when left out.
    """
    mesh = trace.mesh
    V = _vector_space(mesh, trace.order, element)
    nodal = np.arange(len(trace.region)) if nodal is None else nodal
    u, v = V.TnT()
    a = ng.BilinearForm(V, symmetric=True)
    for body, law in problem.materials.items():
        C = law.voigt(problem.model)
        bonus = MODULUS_BONUS if varies(law) else 0
        region = mesh.Materials(body)
        a += ng.InnerProduct(C * strain(u), strain(v)) * ng.dx(
            definedon=region, bonus_intorder=bonus
        )
    for boundary in problem.traction:
        _check_normals(trace, boundary)
    a.Assemble()
    return Space(
        V=V,
        trace=trace,
        nodal=nodal,
        basis=node_basis(V, trace, nodal, element),
        A=shared(a.mat),
        matrix=a.mat,
        f=load_vector(problem, V, LOAD_BONUS),
    )
