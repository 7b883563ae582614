"""NGSolve with a plain active set on nodal values, and with its own `ContactBoundary`.

The former is what a user of any finite element code writes, with one factorisation a step. The
latter is a penalty energy. The tutorial's gap along the normal of a curved body loses half a
percent of the force whatever the mesh and the penalty, so the gap is taken along the direction of
contact here. One search on the bodies as they were is then exact, for displacements are small.
"""

from __future__ import annotations

import time

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from drivers.benchmark.engines import Engine, Solved
from drivers.benchmark.scenes.meshes import OBSTACLE, Mesh
from drivers.benchmark.scenes.plane import (
    Facing,
    Numbering,
    Reading,
    contact_sides,
    facing,
    moduli,
    modulus,
    prescribed,
    read,
)
from drivers.benchmark.scenes.problems import Common
from ngcontact.arrays import from_triplets
from ngcontact.linalg import lower_half, shared
from ngcontact.problem import MeshArrays

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BUBBLE = -1 / 8  # value of NGSolve's edge function of order 2 at the middle of the edge
REACH = 0.02  # largest distance at which the other side is searched, a length
STEPS = 100
ROUND_OFF = 1e-9  # of forces relative to the largest
CONVERGED = 1e-9  # unbalanced force relative to that before the first step
SHORTEST = 2**-10  # of a Newton step
# In units of E / h, all run: the best one depends on order and size. A small one takes few steps
# and errs less than the mesh does only while that is coarse.
PENALTIES = (10.0, 100.0, 1000.0)


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


def load(common: Common, space: ng.FESpace) -> ng.BaseVector:
    """Pressures on the boundary."""
    v, form = space.TestFunction(), ng.LinearForm(space)
    for name in common.problem.traction:
        form += ng.InnerProduct(common.problem.traction_vector(name), v.Trace()) * ng.ds(name)
    return form.Assemble().vec


def numbering(mesh: ng.Mesh, order: int) -> Numbering:
    """Vertices, then edges; all first components before all second ones."""
    segments: dict[str, list[list[int]]] = {}
    for element in mesh.Elements(ng.BND):
        first, last = (vertex.nr for vertex in element.vertices)
        middle = [mesh.nv + element.edges[0].nr] if order == 2 else []
        segments.setdefault(element.mat, []).append([first, *middle, last])
    nodes = mesh.nv + (mesh.nedge if order == 2 else 0)
    arrays = {name: np.array(rows) for name, rows in segments.items()}
    return Numbering(MeshArrays(mesh).vertices, np.arange(2 * nodes).reshape(2, nodes), arrays)


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


def active_set(
    K: sp.csr_array, f: Array, line: Facing, fixed: Mask, value: Array
) -> tuple[Array, Array, int]:
    """Min v'Kv/2 - f'v over v (n,) with v[fixed] = value[fixed] and v[line.at] >= -line.gap (m,).

    Primal-dual active set from the bounds that are attained before loading, with a sparse Cholesky
    factorisation at each step. Returns v, the multipliers (m,) of the bounds, which are not
    negative, and the number of linear systems. Raises RuntimeError if the set still changes after a
    hundred steps.
    """
    matrix = lower_half(K)
    right, change = matrix.CreateColVector(), matrix.CreateRowVector()
    at, lower = line.at, -line.gap
    active = lower >= 0
    for step in range(1, STEPS + 1):
        free = ~fixed
        free[at[active]] = False
        v = np.where(fixed, value, 0.0)
        v[at[active]] = lower[active]
        right.FV().NumPy()[:] = f - K @ v
        change.data = matrix.Inverse(ng.BitArray(free), inverse="sparsecholesky") * right
        v += change.FV().NumPy()
        force = np.where(active, (K @ v - f)[at], 0.0)
        following = np.where(active, force > 0, v[at] < lower)
        if (following == active).all():
            return v, force, step
        active = following
    raise RuntimeError(f"the active set still changes after {STEPS} steps")


def bounded(number: Numbering, line: Facing, order: int) -> sp.csr_array | None:
    """Unknowns (n, n) from those of which one is bounded per contact node, if they differ.

    Values at nodes; where two bodies meet, that of a secondary node is its opening over the node
    opposite.
    """
    basis = nodal(number)[0] if order == 2 else None
    if line.opposite is not None:
        n = number.unknown.size
        ties = from_triplets(np.ones(len(line.at)), line.at, line.opposite, (n, n))
        opening = ties + sp.eye_array(n, format="csr")
        basis = opening if basis is None else basis @ opening
    return basis


def by_active_set(_: object, common: Common, made: Mesh, order: int) -> Solved:
    """Refactorised at each step, on a mesh curved to the order of the elements."""
    mesh = made.copy()
    started = time.perf_counter()
    mesh.Curve(order)
    space = ng.VectorH1(mesh, order=order)
    K, f = matrix(common, space), load(common, space).FV().NumPy().copy()
    number = numbering(mesh, order)
    line = facing(common, number)
    basis = bounded(number, line, order)
    if basis is not None:
        K, f = (basis.T @ K @ basis).tocsr(), basis.T @ f
    v, force, steps = active_set(K, f, line, *prescribed(common, number))
    seconds = time.perf_counter() - started
    reading = read(common, line.x, force, v[line.at] + line.gap, order)
    return Solved(seconds, steps, float(v @ (K @ v)) / 2, reading)


def contact(
    common: Common, mesh: ng.Mesh, u: ng.CoefficientFunction, penalty: float
) -> ng.ContactBoundary:
    """Penalty energy of the gap between the two sides."""
    boundary = ng.ContactBoundary(*(mesh.Boundaries(name) for name in contact_sides(common)))
    gap = ng.y + u[1] - (ng.y.Other() + u.Other()[1])
    stiffness = penalty * modulus(common).E / ng.specialcf.mesh_size
    boundary.AddEnergy(ng.IfPos(gap, 0, stiffness / 2 * gap**2))
    return boundary


def minimised(form: ng.BilinearForm, f: ng.BaseVector, fixed: Mask, gf: ng.GridFunction) -> int:
    """Newton's method with step lengths halved until the energy falls; the number of steps."""
    free = ng.BitArray(~fixed)
    residual, step, before = (gf.vec.CreateVector() for _ in range(3))

    def energy() -> float:
        return float(form.Energy(gf.vec) - ng.InnerProduct(f, gf.vec))

    def unbalanced() -> float:
        form.Apply(gf.vec, residual)
        residual.data -= f
        return float(np.linalg.norm(residual.FV().NumPy()[~fixed]))

    start = size = unbalanced()
    value = energy()
    for count in range(STEPS):
        if size <= CONVERGED * start:
            return count
        form.AssembleLinearization(gf.vec)
        step.data = form.mat.Inverse(free, inverse="sparsecholesky") * residual
        before.data, length, last = gf.vec, 1.0, value
        while True:
            gf.vec.data = before - length * step
            value = energy()
            # Round-off decides between energies that agree.
            if value <= last + 1e-10 * abs(last) or length <= SHORTEST:
                break
            length /= 2
        size = unbalanced()
    raise RuntimeError(f"unbalanced force {size / start:.1e} after {STEPS} Newton steps")


def by_penalty(_: object, common: Common, made: Mesh, order: int, penalty: float) -> Solved:
    """On a mesh curved to the order of the elements."""
    mesh = made.copy()
    started = time.perf_counter()
    mesh.Curve(order)
    space = ng.VectorH1(mesh, order=order)
    form = stiffness(common, space)
    pair = contact(common, mesh, space.TrialFunction(), penalty)
    gf = ng.GridFunction(space)
    pair.Update(gf, bf=form, intorder=2 * order, maxdist=REACH)
    f, number = load(common, space), numbering(mesh, order)
    fixed, value = prescribed(common, number)
    fixed |= np.array(list(space.GetDofs(mesh.Materials(OBSTACLE))))
    gf.vec.FV().NumPy()[:] = nodal(number)[0] @ value
    steps = minimised(form, f, fixed, gf)
    seconds = time.perf_counter() - started
    v = gf.vec.FV().NumPy()
    pushed = matrix(common, space) @ v
    residual = np.where(fixed, 0.0, pushed - f.FV().NumPy())
    reading = read_off(common, number, v, residual, order)
    return Solved(seconds, steps, float(v @ pushed) / 2, reading)


def read_off(
    common: Common,
    number: Numbering,
    v: Array,
    residual: Array,
    order: int,
    round_off: float = ROUND_OFF,
) -> Reading:
    """Reading of unknowns and their unbalanced forces (n,) without those of contact."""
    forward, backward = nodal(number)
    line, nodes = facing(common, number), backward @ v
    force = (forward.T @ residual)[line.at]
    force[np.abs(force) < round_off * force.max()] = 0.0  # open nodes
    there = 0.0 if line.opposite is None else nodes[line.opposite]
    return read(common, line.x, force, nodes[line.at] - there + line.gap, order)


ACTIVE_SET = Engine("NGSolve active set", by_active_set)
PENALTY = Engine(
    "NGSolve penalty", by_penalty, penalties=PENALTIES, meshed_obstacle=True, largest=16_000
)
