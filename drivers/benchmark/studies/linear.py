"""What a mesh costs without contact: NGSolve's own assembly, factorisation and back-solve."""

from __future__ import annotations

import time
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ngcontact import Problem
from ngcontact.adaptivity import refined
from ngcontact.fem import model_of, unknowns_of
from ngcontact.mesh import curve, first_mesh
from ngcontact.problem import MeshArrays

START = 300  # unknowns of a first mesh, about; refinement is much quicker than meshing at size


@dataclass(frozen=True)
class Linear:
    """Seconds of one linear solve: assembly, factorisation and back-solve."""

    seconds: float
    unknowns: int


def linear_solve(problem: Problem, mesh: ng.Mesh, order: int) -> Linear:
    """Time the linear problem in which the contact boundaries are held in place of contact."""
    started = time.perf_counter()
    held = problem.displacement.items()
    x = [name for name, (ux, _) in held if ux is not None]
    y = [name for name, (_, uy) in held if uy is not None]
    x += [str(problem.sliding)] if problem.sliding else []
    y += [contact.secondary for contact in problem.contact]
    V = ng.VectorH1(mesh, order=order, dirichletx="|".join(x), dirichlety="|".join(y))
    u, v = V.TnT()
    model = model_of(problem)
    a, f = ng.BilinearForm(V, symmetric=True), ng.LinearForm(V)
    for body, law in problem.materials.items():
        stress = model.stress(law.voigt(problem.model), model.strain(u))
        work = model.weighted(ng.InnerProduct(stress, model.strain(v)))
        a += work * ng.dx(definedon=mesh.Materials(body))
    for name in problem.traction:
        load = problem.traction_vector(name)
        f += load * v.Trace() * ng.ds(definedon=mesh.Boundaries(name))
    a.Assemble()
    f.Assemble()
    solution = f.vec.CreateVector()
    solution.data = a.mat.Inverse(V.FreeDofs(), inverse="sparsecholesky") * f.vec
    return Linear(time.perf_counter() - started, V.ndof)


def uniform_mesh(problem: Problem, order: int, size: int) -> ng.Mesh:
    """Uniformly refined mesh of about `size` unknowns, curved to the order."""
    rounds = max(0, round(np.log(size / START) / np.log(4)))
    extent = np.ptp(MeshArrays(first_mesh(problem)).vertices, axis=0).max()
    trials = [first_mesh(problem, float(extent) / count) for count in np.linspace(2, 16, 29)]

    def miss(mesh: ng.Mesh) -> float:
        return abs(float(np.log(_refined_size(mesh, order, rounds) / size)))

    mesh = min(trials, key=miss)
    for _ in range(rounds):
        mesh = refined(problem, mesh)
    return curve(mesh, order, "isoparametric")[0]


def _refined_size(mesh: ng.Mesh, order: int, rounds: int) -> int:
    """Unknowns after that many uniform refinements, each of which quarters all triangles."""
    vertices, edges, elements = mesh.nv, mesh.nedge, mesh.ne
    for _ in range(rounds):
        vertices, edges, elements = vertices + edges, 2 * edges + 3 * elements, 4 * elements
    return unknowns_of(order, vertices, edges, elements)
