"""Residual error indicators in the energy norm, with contact terms.

For two bodies and one pressure pi_h, the discrete contact force over its weight (after Krause,
Veeser, Walloth 2015, Numer. Math. 130:151). Squared contributions of an element T of diameter h,
shear modulus mu, degree p:

* element: (h/p)^2 / 2mu |F + div sigma_h|^2 over T
* jump: half of (h/p) / 2mu |[sigma_h n]|^2 over the edges inside a body
* oscillation: |sigma_h - Pi sigma_h|^2 in the norm of C^-1 over T, where moduli vary; there
  Pi sigma_h, polynomials, stands for sigma_h in the parts before
* traction: (h/p) / 2mu |P - sigma_h n|^2 over Gamma_tau and all free boundary
* sliding: (h/p) / 2mu |sigma_t|^2 over Gamma_0
* tangential, pressure: (h/p) / 2mu times the squares of the parts of the traction across and
  along the direction of contact, the latter plus (pi_h)_+, on the parts of segments that face;
  where a segment is in contact with all its nodes and the mean of both bodies' tractions presses,
  half their difference, with the weight of the stiffer. Tractions are per arc length of the
  secondary, those of the primary times ds_p / ds_s
* complementarity: half of pi_h (gap)_+ over Gamma_K; where all nodes of a segment are in contact
  no more than closing the gap would cost, as a penetration
* penetration: mu / l |(-gap)_+|^2 over Gamma_K, of the softer body; l is h, or the length
  |gap| / |d_s gap| in which the gap changes where that is shorter. Gaps are measured along the
  normals of the contact rows, and gap data followed by the quadrature
* displacement: 2 mu |w| max(|w| / h, |dw/ds|) over each segment of Gamma_u, w = u_D - u_h; mu is
  here the stiffness of a strain without change of volume, the largest. What w costs is at most
  2 mu times its square in H^(1/2), which |w| |dw/ds| bounds. Over Gamma_0 2 mu / l |u_h.n|^2 with
  the normals by which its nodes are held
* loads: what no quadrature found of rough loads, as forces f at points: f^2 / 2mu
* incompressibility: what correcting the pressure costs, see `pressure_correction`; on nearly
  incompressible bodies sigma_h stands for the corrected stress in all other parts

On an enlarging zone forces are per unit eta along xi.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array
from ..fem import (
    NEARLY_INCOMPRESSIBLE,
    nearly_incompressible,
)
from ..problem import varies
from ..quadrature import known_rough_load, moment_degree
from ..solved import Solved
from .contact import on_contact, remaining
from .interior import divergence_and_jump, edge_integral, element_integral
from .oscillation import oscillation
from .pressure_correction import PressureCorrection, correcting_pressure
from .supports import on_supports_and_loads
from .terms import DATA_BONUS, BoundaryTerms, ScaledSolution, Squares, scaled


@dataclass(frozen=True, eq=False)
class Estimate:
    """Error indicators of the ne elements.

    Attributes
    ----------
    indicators : ndarray (ne,)
        eta_T, an energy norm: the root of an energy per unit thickness.
    parts : dict of ndarray (ne,)
        Squared contributions by name: energies, 0 or inf where these are out of a float's range.
    """

    indicators: Array
    parts: dict[str, Array]


def estimate(solved: Solved, corrected_from: float = NEARLY_INCOMPRESSIBLE) -> Estimate:
    """Residual error estimate of a displacement in the energy norm.

    Parameters
    ----------
    solved : Solved
    corrected_from : float
        kappa / mu from which the pressure of a body is corrected.
    """
    pairs, boundary = solved.pairs, solved.discrete.space.trace
    solution = scaled(solved.problem, boundary, solved.displacement, solved.stress)
    terms = [on_contact(solution, pair, pairs) for pair in pairs]
    rest = remaining(boundary.inner | boundary.on_axis, [term.covered for term in terms])
    terms.append(on_supports_and_loads(solution, rest))
    parts = _squares(solution, terms, corrected_from)
    total = np.sum(list(parts.values()), axis=0)
    unit = solution.unit / math.sqrt(solution.modulus)  # of the energy norm
    with np.errstate(over="ignore"):
        parts = {name: part * unit * unit for name, part in parts.items()}
    return Estimate(indicators=unit * np.sqrt(np.maximum(total, 0.0)), parts=parts)


def _squares(
    solution: ScaledSolution, terms: Sequence[BoundaryTerms], corrected_from: float
) -> dict[str, Array]:
    """Squared contributions (ne,) by name, after the pressure has been corrected where needed."""
    parts = {"element": np.zeros(solution.mesh.ne)}

    def of(name: str) -> Array:
        return parts.setdefault(name, np.zeros(solution.mesh.ne))

    if any(map(varies, solution.problem.materials.values())):
        of("oscillation")[:] = oscillation(
            *(solution.problem, solution.projected, solution.stress),
            *(solution.modulus, solution.rough),
            model=solution.boundary.model,
        )
    for squares in (x for term in terms for x in term.squares):
        np.add.at(of(squares.name), squares.element, squares.values)
    residuals = [x for term in terms for x in term.residuals]
    divergence, jump = divergence_and_jump(solution.projected)
    model = solution.boundary.model
    divergence = model.divergence(divergence, solution.stress, solution.normal_stress)
    force, rest = _body_forces(solution)
    for squares in rest:
        np.add.at(of(squares.name), squares.element, squares.values)
    if force is not None:
        divergence += force  # (3.5)
    names = nearly_incompressible(
        solution.problem, solution.mesh, corrected_from, solution.incompressibility
    )
    correction = None
    if names:
        correction = correcting_pressure(solution, list(names), (divergence, jump), residuals)
        of("incompressibility")[:] = correction.squares()
        of_pressure = correction.divergence_and_jump()
        divergence += of_pressure[0]
        jump += of_pressure[1]
    parts |= _inside(solution, divergence, jump, correction)
    for term in residuals:
        residual = term.residual.copy()
        if correction is not None:
            correction.add_to(residual, term.shares)
        np.add.at(of(term.name), term.element, term.weight * (residual**2).sum(axis=1))
    return parts


def _body_forces(
    solution: ScaledSolution,
) -> tuple[ng.CoefficientFunction | None, list[Squares]]:
    """F over the unit of stress, polynomials where it is rough, and squares of what they miss."""
    problem, mesh = solution.problem, solution.mesh
    if not problem.force:
        return None, []
    forces, squares, every = {}, [], np.arange(mesh.ne)
    for body, F in problem.force.items():
        region = mesh.Materials(body)
        found = known_rough_load(F, F, region, moment_degree(solution.order))
        forces[body] = ng.CF(F) * (1 / solution.unit)
        if found is not None:
            rough = ng.GridFunction(ng.L2(mesh, order=0))
            rough.vec.FV().NumPy()[:] = found.rough
            projection = found.projection * (1 / solution.unit)
            forces[body] = ng.IfPos(rough, projection, forces[body])
            rest = solution.element_weight * (found.rest / solution.unit) ** 2 * solution.measure
            squares += [Squares("element", every, rest), solution.missed(every, found.missed)]
    return mesh.MaterialCF(forces, default=ng.CF((0, 0))), squares


def _inside(
    solution: ScaledSolution,
    divergence: ng.CoefficientFunction,
    jump: ng.CoefficientFunction,
    correction: PressureCorrection | None,
) -> dict[str, Array]:
    """Squared residuals (ne,) in the elements and on the edges between them."""
    data = DATA_BONUS if solution.problem.force else 0
    degree = solution.order if correction else solution.projected.space.globalorder
    element, model = np.zeros(solution.mesh.ne), solution.boundary.model
    if degree or data:  # else there is no divergence
        squares = element_integral(solution.mesh, divergence, 2 * degree + data, model)
        element = solution.element_weight * squares
    edges = edge_integral(solution.mesh, jump, 2 * degree, solution.mu, model)
    return {"element": element, "jump": solution.edge_weight / 2 * edges}
