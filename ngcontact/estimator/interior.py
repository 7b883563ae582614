"""Residuals inside a body: the divergence of the discrete stress and its jumps."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array
from ..fem import BoundaryTrace
from ..problem import Problem, varies


def projected_stress(
    problem: Problem, boundary: BoundaryTrace, stress: ng.CoefficientFunction
) -> ng.GridFunction:
    """sigma_h as (xx, yy, xy), polynomials on each element, to be differentiated.

    Right for any modulus and curved elements; its jumps cost a fifth of those of the stress.
    """
    mesh, order = boundary.mesh, boundary.order
    laws = problem.materials.values()
    exact = mesh.GetCurveOrder() == 1 and not any(varies(law) for law in laws)
    projected = ng.GridFunction(ng.L2(mesh, order=order - 1 if exact else order, dim=3))
    xx, xy, _, yy = stress
    projected.Set(ng.CF((xx, yy, xy)).Compile())
    return projected


def divergence_and_jump(
    stress: ng.GridFunction,
) -> tuple[ng.CoefficientFunction, ng.CoefficientFunction]:
    """Div sigma and [sigma n] of a projected stress, two of two components."""
    slope = ng.Grad(stress)
    xx, yy, xy = stress - stress.Other()
    jump = ng.CF((xx, xy, xy, yy), dims=(2, 2)) * ng.specialcf.normal(2)
    return ng.CF((slope[0, 0] + slope[2, 1], slope[2, 0] + slope[1, 1])), jump


def integral(
    mesh: ng.Mesh, residual: ng.CoefficientFunction, order: int, *, edges: bool = False
) -> Array:
    """Squares of a residual integrated over each element, or over its inner edges, (ne,)."""
    v = ng.L2(mesh, order=0).TestFunction()
    test = v + v.Other() if edges else v
    form = ng.LinearForm(v.space)
    form += ng.InnerProduct(residual, residual) * test * ng.dx(skeleton=edges, bonus_intorder=order)
    form.Assemble()
    return np.array(form.vec.FV().NumPy())
