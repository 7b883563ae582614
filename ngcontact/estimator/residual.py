"""Residual error indicators in the energy norm, with contact terms.

For two bodies and one pressure pi_h, the discrete contact force over its weight (after Krause,
Veeser, Walloth 2015, Numer. Math. 130:151). Squared contributions of an element T of diameter h,
shear modulus mu, degree p:

* element: (h/p)^2 / 2mu |F + div sigma_h|^2 over T
* jump: half of (h/p) / 2mu |[sigma_h n]|^2 over the edges inside a body
* traction: (h/p) / 2mu |P - sigma_h n|^2 over Gamma_tau and all free boundary
* sliding: (h/p) / 2mu |sigma_t|^2 over Gamma_0
* tangential, pressure: (h/p) / 2mu times the squares of the parts of the traction across and
  along the direction of contact, the latter plus pi_h; where a segment is in contact with all its
  nodes, half the difference of both bodies' tractions, with the weight of the stiffer
* complementarity: half of pi_h (gap)_+ over Gamma_K; where all nodes of a segment are in contact
  no more than closing the gap would cost, as a penetration
* penetration: mu / h |(-gap)_+|^2 over Gamma_K, of the softer body
* displacement: 2 mu / h |u_D - u_h|^2 over Gamma_u, the interpolation error of its data
* incompressibility: what correcting the pressure costs, see `incompressible`; on nearly
  incompressible bodies sigma_h stands for the corrected stress in all other parts

On an enlarging zone forces are per unit eta along xi.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index, power_of_two
from ..contact import ContactLine, at_quadrature, partners, prescribed_gap
from ..fem import (
    NEARLY_INCOMPRESSIBLE,
    BoundaryTrace,
    bulk_moduli,
    nearly_incompressible,
    shear_moduli,
)
from ..lagrange import gauss, lagrange
from ..mesh import diameters
from ..problem import boundary_mask
from .contact import Side, met_from_behind, pressure_at_nodes, traction
from .interior import divergence_and_jump, integral, projected_stress
from .pressure_correction import PressureCorrection
from .terms import BoundaryResidual, PressureShare

if TYPE_CHECKING:
    from ..solution import Solution


DATA_BONUS = 4  # quadrature order above that of the discrete terms, for the loads
ROUND_OFF = 4e-15  # of a gap, relative to the displacement and, where it is measured, to positions


@dataclass(frozen=True, eq=False)
class Estimate:
    """Error indicators.

    Attributes
    ----------
    indicators : ndarray (ne,)
        eta_T, an energy norm.
    parts : dict of ndarray (ne,)
        Squared contributions by name: energies, 0 or inf where these are out of a float's range.
    """

    indicators: Array
    parts: dict[str, Array]


class _Residuals:
    """Collects squared residuals on the elements of one solution.

    Stresses are relative to a stress of the solution and moduli to a modulus, so that squares
    neither overflow nor underflow; both units are powers of 2, by which nothing is rounded.
    """

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.mesh = solution.mesh
        self.trace: BoundaryTrace = solution.discrete.space.trace
        self.order = solution.order
        self.diameter = diameters(self.mesh)
        mu = shear_moduli(solution.problem, self.mesh)
        self.modulus = power_of_two(mu)
        self.mu = mu / self.modulus
        self.projected = projected_stress(solution)
        coefficients = self.projected.vec.FV().NumPy()
        self.unit = power_of_two(coefficients)
        coefficients /= self.unit
        self.strain = self.unit / self.modulus
        self.stress = solution.stress * (1 / self.unit)
        self.edge_weight = self.diameter / (2 * self.mu * self.order)
        self.in_contact = self.trace.inner.copy()
        self.terms: list[BoundaryResidual] = []
        self.parts: dict[str, Array] = {"element": np.zeros(self.mesh.ne)}

    def add(self, name: str, element: Index, squares: Array) -> None:
        """Add squared terms at elements, repeated ones summed."""
        part = self.parts.setdefault(name, np.zeros(self.mesh.ne))
        np.add.at(part, element, squares)

    def finish(self) -> None:
        """Correct the pressure where that is needed, then square all residuals of the stress."""
        solution, p = self.solution, self.order
        divergence, jump = divergence_and_jump(self.projected)
        if solution.problem.force:
            force = self.mesh.MaterialCF(solution.problem.force, default=ng.CF((0, 0)))
            divergence += force * (1 / self.unit)
        weights = ((self.diameter / p) ** 2 / (2 * self.mu), self.edge_weight)
        names = nearly_incompressible(solution.problem, self.mesh, NEARLY_INCOMPRESSIBLE)
        correction = None
        if names:
            kappa = bulk_moduli(solution.problem, self.mesh) / self.modulus
            correction = PressureCorrection(solution.problem, self.trace, list(names))
            correction.minimise(weights, (self.mu, kappa), (divergence, jump), self.terms)
            self.parts["incompressibility"] = correction.squares()
            delta = correction.pressure
            divergence += ng.Grad(delta)
            jump += (delta - delta.Other()) * ng.specialcf.normal(2)
        data = DATA_BONUS if solution.problem.force else 0
        degree = self.projected.space.globalorder if correction is None else p
        if degree or data:  # else there is no divergence
            squares = integral(self.mesh, divergence, 2 * degree + data)
            self.parts["element"] = weights[0] * squares
        self.parts["jump"] = weights[1] / 2 * integral(self.mesh, jump, 2 * degree, edges=True)
        for term in self.terms:
            residual = term.residual.copy()
            if correction is not None:
                correction.add_to(residual, term.shares)
            self.add(term.name, term.element, term.weight * (residual**2).sum(axis=1))

    def on_supports_and_loads(self) -> None:
        """Gamma_tau, Gamma_0, Gamma_u: every outer segment `on_contact` has not seen."""
        problem, trace, mesh = self.solution.problem, self.trace, self.mesh
        rule, rule_weight = gauss(2 * self.order + DATA_BONUS)
        segments = np.flatnonzero(~self.in_contact)
        segment, s = np.repeat(segments, len(rule)), np.tile(rule, len(segments))
        ds = np.linalg.norm(trace.derivative(segment, s), axis=1) * np.tile(
            rule_weight, len(segments)
        )
        residual = -traction(trace, self.stress, segment, s)
        factor = -trace.normal(segment, s)  # of a pressure in the residual
        for pattern in problem.traction:
            at = boundary_mask(mesh, pattern)[trace.region[segment]]
            load = problem.traction_vector(pattern)
            residual[at] += trace.evaluate(load, segment[at], s[at]) / self.unit
        element = trace.element[segment]
        for pattern, components in problem.displacement.items():
            at = boundary_mask(mesh, pattern)[trace.region[segment]]
            u = trace.evaluate(self.solution.displacement, segment[at], s[at])
            for axis, value in enumerate(components):
                if value is not None:
                    residual[at, axis] = factor[at, axis] = 0.0
                    miss = trace.evaluate(value, segment[at], s[at])[:, 0] - u[:, axis]
                    here = element[at]
                    scale = 2 * self.mu[here] / self.diameter[here]
                    self.add("displacement", here, scale * ds[at] * (miss / self.strain) ** 2)
        guided = np.zeros(len(segment), dtype=bool)
        if problem.sliding is not None:
            guided = boundary_mask(mesh, str(problem.sliding))[trace.region[segment]]
            normal = trace.normal(segment[guided], s[guided])
            for vector in (residual, factor):
                along = (vector[guided] * normal).sum(axis=1)
                vector[guided] -= along[:, None] * normal
        weight = self.edge_weight[element] * ds
        for name, at in (("traction", ~guided), ("sliding", guided)):
            share = PressureShare(np.arange(at.sum()), segment[at], s[at], factor[at])
            self.terms.append(
                BoundaryResidual(name, element[at], weight[at], residual[at], [share])
            )

    def on_contact(self, line: ContactLine, pressure: Array, active: NDArray[np.bool_]) -> None:
        """Gamma_K: tractions of both sides, complementarity, penetration."""
        trace, contact, solution = self.trace, line.contact, self.solution
        local, segment, s, dc = at_quadrature(line, trace, 2 * self.order + DATA_BONUS)
        if len(local) == 0:
            return
        pi = (lagrange(self.order, s) * pressure_at_nodes(line, pressure, self.order)[local]).sum(1)
        pi /= self.unit
        full = np.asarray(np.append(active, True)[line.rows].all(axis=1))[local]
        self.in_contact[segment] = True
        normal = trace.normal(segment, s)
        direction = contact.direction
        d = normal if direction is None else np.tile(direction, (len(s), 1))
        x = trace.point(segment, s)
        met = np.ones(len(s), dtype=bool)
        if contact.primary is None:
            facing, distance = np.full(len(s), -1), np.zeros(len(s))
        else:
            facing, facing_s, distance, _ = partners(trace, line.facing, segment, x, d)
            self.in_contact[met_from_behind(trace, line)] = True
            met = facing >= 0
        if contact.gap is not None:
            distance = prescribed_gap(contact, trace, segment, s, x)
        u = trace.evaluate(solution.displacement, segment, s)
        noise = np.full(len(s), ROUND_OFF * np.abs(u).max())
        if contact.gap is None:
            noise[distance != 0] += ROUND_OFF * np.abs(x).max()
        sides = [Side(trace, self.stress, direction, np.arange(len(s)), segment, s, d, pi)]
        if contact.primary is not None:
            at = np.flatnonzero(met)
            sides.append(
                Side(trace, self.stress, direction, at, facing[at], facing_s[at], d[at], -pi[at])
            )
            u[at] -= trace.evaluate(solution.displacement, facing[at], facing_s[at])
        # Where both bodies meet the stiffer takes up a jump, the softer gives way to a depth.
        least = np.full((2, len(s)), np.inf)
        for side in sides:
            side.weight = self.edge_weight[side.element] * dc[side.at] / side.stretch
            stiffness = self.mu[side.element] / self.diameter[side.element]
            least[:, side.at] = np.minimum(least[:, side.at], [side.weight, stiffness])
        for side, other in zip(sides, sides[::-1], strict=True):
            self.terms.append(side.tangential())
            self.terms.append(side.pressure(other, full, least[0]))
        gap = np.where(met, distance - (u * d).sum(axis=1), 0.0)
        gap[np.abs(gap) <= noise] = 0.0  # its root counts: 1e-16 would be an estimate of 1e-8
        gap /= self.strain
        depth = least[1] * gap**2 * ((gap < 0) | contact.bilateral)  # apart is as wrong then
        closed = np.maximum(pi, 0) * np.maximum(gap, 0) * (not contact.bilateral)
        closed = np.where(full, np.minimum(closed, least[1] * gap**2), closed)
        for side in sides:
            share = dc[side.at] / len(sides)
            self.add("complementarity", side.element, share * closed[side.at])
            self.add("penetration", side.element, share * depth[side.at])


def estimate(solution: Solution) -> Estimate:
    """Residual error estimate of a solution."""
    residuals = _Residuals(solution)
    for number, line in enumerate(solution.discrete.lines):
        at = solution.pair == number
        residuals.on_contact(line, solution.pressure[at], solution.active[at])
    residuals.on_supports_and_loads()
    residuals.finish()
    total = np.sum(list(residuals.parts.values()), axis=0)
    unit = residuals.unit / math.sqrt(residuals.modulus)  # of the energy norm
    with np.errstate(over="ignore"):
        parts = {name: part * unit * unit for name, part in residuals.parts.items()}
    return Estimate(indicators=unit * np.sqrt(np.maximum(total, 0.0)), parts=parts)
