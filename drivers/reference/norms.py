"""Errors in the full norm of H^1, HH81 (2.1)."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import ngsolve as ng

from drivers.reference.manufactured import gradient
from drivers.reference.straight import Exact
from drivers.reference.westergaard import CF

if TYPE_CHECKING:
    from ngcontact.solution import Solution


def relative_h1_error(solution: Solution, exact: Exact) -> float:
    """Relative error of the displacement in the norm of H^1 over all bodies.

    Where a translation stays free (HH81 Remark 3.7) the exact displacement is the one for which
    p(u), the integral of u along it over the boundary of the body, vanishes, as it does for the
    discrete one. Integrals as in `relative_energy_error`. Raises ValueError where a rotation, or
    bodies together, stay free.
    """
    mesh, order = solution.mesh, 2 * solution.order + 8
    error = norm = 0.0
    for body, displacement in exact.displacement.items():
        u = displacement - _free_part(solution, body, displacement, order)
        v = (solution.displacement - u, ng.Grad(solution.displacement) - gradient(displacement))
        w = (u, gradient(displacement))
        squares = [sum(ng.InnerProduct(f, f) for f in fields) for fields in (v, w)]
        both = ng.CF(tuple(squares)).Compile()
        integrals = ng.Integrate(both, mesh.Materials(body), order=order)
        error, norm = error + integrals[0], norm + integrals[1]
    return math.sqrt(error / norm)


def _free_part(solution: Solution, body: str, u: CF, order: int) -> CF:
    """Translations (2,) to take off the exact displacement of a body, so that p(u) = 0."""
    total = ng.CF((0.0, 0.0))
    boundary = solution.mesh.Materials(body).Boundaries()
    for motion in solution.free_motions:
        if motion.rotation.any() or len(motion.bodies) > 1:
            raise ValueError(f"free motion {motion}: only translations of one body are taken off")
        if motion.bodies == (body,):
            along = motion.translation[0] / math.hypot(*motion.translation[0])
            z = ng.CF(tuple(along.tolist()))
            parts = ng.CF((ng.InnerProduct(u, z), 1.0))
            integral, length = ng.Integrate(parts, boundary, order=order)
            total = total + integral / length * z
    return total
