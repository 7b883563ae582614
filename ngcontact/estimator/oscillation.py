"""What polynomials miss of the stress where moduli vary inside elements."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..fem import Model, law_measures
from ..linalg import cholesky, lower_half, shared
from ..problem import Problem, varies
from .interior import components


def project_by_compliance(
    problem: Problem,
    projected: ng.GridFunction,
    stress: ng.CoefficientFunction,
    modulus: float,
    rough: Mask,
    model: Model,
) -> None:
    """Replace a projection by that in the norm of C^-1 on the elements `rough` (ne,).

    Where moduli jump inside an element its soft part tells what the stress is, not the mean.
    """
    mesh, order = projected.space.mesh, projected.space.globalorder
    space = ng.L2(mesh, order=order) ** 3
    s, t = ng.CF(space.TrialFunction()), ng.CF(space.TestFunction())
    a, f = ng.BilinearForm(space, symmetric=True), ng.LinearForm(space)
    for body, law in problem.materials.items():
        if varies(law):
            compliance = model.compliance(law.voigt(problem.model) / modulus)
            *_, dx = law_measures(mesh, body, 2 * order, rough)
            a += model.weighted(ng.InnerProduct(compliance * s, t)) * dx
            f += model.weighted(ng.InnerProduct(compliance * components(stress), t)) * dx
    a.Assemble()
    f.Assemble()
    free = np.repeat(rough, space.ndof // (3 * mesh.ne))
    values = cholesky(lower_half(shared(a.mat)))(np.tile(free, 3))(f.vec.FV().NumPy().copy())
    projected.vec.FV().NumPy().reshape(-1, 3)[free] = values.reshape(3, -1).T[free]


def oscillation(
    problem: Problem,
    projected: ng.GridFunction,
    stress: ng.CoefficientFunction,
    modulus: float,
    rough: Mask,
    model: Model,
) -> Array:
    """Squares (ne,) of |sigma_h - Pi sigma_h| in the norm of C^-1, where moduli vary.

    Stresses are over one unit, C over `modulus`; more points in the elements `rough` (ne,).
    """
    mesh, order = projected.space.mesh, projected.space.globalorder
    v = ng.L2(mesh, order=0).TestFunction()
    f = ng.LinearForm(v.space)
    for body, law in problem.materials.items():
        if varies(law):
            miss = components(stress) - projected
            compliance = model.compliance(law.voigt(problem.model) / modulus)
            density = model.weighted(ng.InnerProduct(compliance * miss, miss))
            for dx in law_measures(mesh, body, 2 * order, rough):
                f += density * v * dx
    f.Assemble()
    return np.array(f.vec.FV().NumPy())
