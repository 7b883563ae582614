"""Residuals inside a body: the divergence of the discrete stress and its jumps."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array
from ..fem import BoundaryTrace, Model
from ..problem import Problem, Triangulation, varies


def projected_stress(
    problem: Problem, boundary: BoundaryTrace, stress: ng.CoefficientFunction
) -> ng.GridFunction:
    """sigma_h as (xx, yy, xy), polynomials on each element, to be differentiated.

    Right for any modulus and curved elements; its jumps cost a fifth of those of the stress.
    """
    mesh, order = boundary.mesh, boundary.order
    any_varies = any(map(varies, problem.materials.values()))
    exact = mesh.GetCurveOrder() == 1 and not any_varies and boundary.model.polynomial
    projected = ng.GridFunction(ng.L2(mesh, order=order - 1 if exact else order, dim=3))
    # The points of NGSolve's rule of order 2 lie on edges, along which moduli may jump.
    bonus = 1 if order == 1 and any_varies else 0
    projected.Set(components(stress).Compile(), bonus_intorder=bonus)
    return projected


def components(stress: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """(xx, yy, xy) of a stress (2, 2)."""
    xx, xy, _, yy = stress
    return ng.CF((xx, yy, xy))


def divergence_and_jump(
    stress: ng.GridFunction,
) -> tuple[ng.CoefficientFunction, ng.CoefficientFunction]:
    """Div sigma and [sigma n] of a projected stress, two of two components."""
    slope = ng.Grad(stress)
    xx, yy, xy = stress - stress.Other()
    jump = ng.CF((xx, xy, xy, yy), dims=(2, 2)) * ng.specialcf.normal(2)
    return ng.CF((slope[0, 0] + slope[2, 1], slope[2, 0] + slope[1, 1])), jump


def element_integral(
    mesh: ng.Mesh, residual: ng.CoefficientFunction, order: int, model: Model
) -> Array:
    """Squares of a residual integrated over each element, (ne,)."""
    v = ng.L2(mesh, order=0).TestFunction()
    dx = ng.dx(bonus_intorder=order + 2 * model.bonus)
    squares = model.weighted(ng.InnerProduct(residual, residual)).Compile()  # in 2/3 of the time
    return _assembled(v, squares * v * dx)


def edge_integral(
    mesh: ng.Mesh, jump: ng.CoefficientFunction, order: int, mu: Array, model: Model
) -> Array:
    """Squares of a jump integrated over the inner edges of each element, (ne,).

    Where the other side is stiffer, times the ratio of both moduli `mu` (ne,): stiff bodies take
    up what soft ones cannot.
    """
    v = ng.L2(mesh, order=0).TestFunction()
    squares = model.weighted(ng.InnerProduct(jump, jump)).Compile()  # in half of the time
    squares = squares * (v + v.Other())
    dx = ng.dx(skeleton=True, bonus_intorder=order)
    if not _differs_at_a_vertex(mesh, mu):
        return _assembled(v, squares * dx)
    soft = ng.GridFunction(v.space)
    soft.vec.FV().NumPy()[:] = 1 / mu
    least = ng.IfPos(soft - soft.Other(), soft.Other(), soft)
    return mu * _assembled(v, least * squares * dx)


def _differs_at_a_vertex(mesh: ng.Mesh, mu: Array) -> bool:
    """Whether elements with a common vertex have different moduli."""
    low, high = np.full(mesh.nv, np.inf), np.zeros(mesh.nv)
    for corner in Triangulation(mesh).triangles.T:
        np.minimum.at(low, corner, mu)
        np.maximum.at(high, corner, mu)
    return bool((high > low).any())


def _assembled(v: ng.comp.ProxyFunction, form: ng.comp.SumOfIntegrals) -> Array:
    """Values (ne,) of a form linear in the function v, constant on each element."""
    f = ng.LinearForm(v.space)
    f += form
    f.Assemble()
    return np.array(f.vec.FV().NumPy())
