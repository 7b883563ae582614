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
  nodes, half the difference of both bodies' tractions stands for the latter
* complementarity: half of pi_h (gap)_+ over Gamma_K
* penetration: mu / h |(-gap)_+|^2 over Gamma_K
* displacement: 2 mu / h |u_D - u_h|^2 over Gamma_u, the interpolation error of its data

On an enlarging zone forces are per unit eta along xi.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from .gap import ContactLine, at_quadrature, partners, prescribed_gap
from .lagrange import gauss, gauss_lobatto, lagrange
from .problem import boundary_mask
from .trace import Trace

if TYPE_CHECKING:
    from .solution import Solution

Array = NDArray[np.float64]
Index = NDArray[np.intp]

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
        Squared contributions by name.
    """

    indicators: Array
    parts: dict[str, Array]


class _Residuals:
    """Collects squared residuals on the elements of one solution."""

    def __init__(self, solution: Solution) -> None:
        self.solution = solution
        self.mesh = solution.mesh
        self.trace: Trace = solution.discrete.space.trace
        self.order = solution.order
        self.diameter = _diameters(self.mesh)
        self.mu = self._shear_moduli()
        self.boundary_stress = ng.BoundaryFromVolumeCF(solution.stress)
        self.edge_weight = self.diameter / (2 * self.mu * self.order)
        self.in_contact = self.trace.inner.copy()
        self.parts: dict[str, Array] = {}

    def _shear_moduli(self) -> Array:
        """Mean shear modulus (ne,) of each element."""
        p = self.solution.problem
        mu = self.mesh.MaterialCF(
            {body: law.shear_modulus(p.model) for body, law in p.materials.items()}
        )
        middle = self.mesh.MapToAllElements(ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1]), ng.VOL)
        return np.asarray(mu(middle)).ravel()

    def add(self, name: str, element: Index, squares: Array) -> None:
        """Add squared terms at elements, repeated ones summed."""
        part = self.parts.setdefault(name, np.zeros(self.mesh.ne))
        np.add.at(part, element, squares)

    def traction(self, segment: Index, s: Array) -> Array:
        """sigma_h n (k, 2) at boundary points."""
        stress = self.trace.evaluate(self.boundary_stress, segment, s).reshape(-1, 2, 2)
        return np.einsum("kij,kj->ki", stress, self.trace.normal(segment, s))

    def inside(self) -> None:
        """Element and jump terms."""
        solution, mesh, p = self.solution, self.mesh, self.order
        v = ng.L2(mesh, order=0).TestFunction()
        stress = solution.stress
        # Differentiate the stress through a projection: right for any modulus, curved elements.
        projected = ng.GridFunction(ng.L2(mesh, order=p, dim=3))
        projected.Set(ng.CF((stress[0, 0], stress[1, 1], stress[0, 1])))
        slope = ng.Grad(projected)
        divergence = ng.CF((slope[0, 0] + slope[2, 1], slope[2, 0] + slope[1, 1]))
        if solution.problem.force:
            divergence += mesh.MaterialCF(solution.problem.force, default=ng.CF((0, 0)))
        jump = (stress - stress.Other()) * ng.specialcf.normal(2)
        for name, form, weight in (
            (
                "element",
                ng.InnerProduct(divergence, divergence)
                * v
                * ng.dx(bonus_intorder=2 * p + DATA_BONUS),
                (self.diameter / p) ** 2 / (2 * self.mu),
            ),
            (
                "jump",
                ng.InnerProduct(jump, jump)
                * (v + v.Other())
                * ng.dx(skeleton=True, bonus_intorder=2 * p),
                self.edge_weight / 2,
            ),
        ):
            integral = ng.LinearForm(v.space)
            integral += form
            integral.Assemble()
            self.parts[name] = weight * integral.vec.FV().NumPy()

    def on_supports_and_loads(self) -> None:
        """Gamma_tau, Gamma_0, Gamma_u: every outer segment `on_contact` has not seen."""
        problem, trace, mesh = self.solution.problem, self.trace, self.mesh
        rule, rule_weight = gauss(2 * self.order + DATA_BONUS)
        q = len(rule)
        segments = np.flatnonzero(~self.in_contact)
        segment, s = np.repeat(segments, q), np.tile(rule, len(segments))
        ds = np.linalg.norm(trace.derivative(segment, s), axis=1) * np.tile(
            rule_weight, len(segments)
        )
        residual = -self.traction(segment, s)
        for pattern in problem.traction:
            at = boundary_mask(mesh, pattern)[trace.region[segment]]
            load = problem.traction_vector(pattern)
            residual[at] += trace.evaluate(load, segment[at], s[at])
        element = trace.element[segment]
        for pattern, components in problem.displacement.items():
            at = boundary_mask(mesh, pattern)[trace.region[segment]]
            u = trace.evaluate(self.solution.displacement, segment[at], s[at])
            for axis, value in enumerate(components):
                if value is not None:
                    residual[at, axis] = 0.0
                    miss = trace.evaluate(value, segment[at], s[at])[:, 0] - u[:, axis]
                    here = element[at]
                    scale = 2 * self.mu[here] / self.diameter[here]
                    self.add("displacement", here, scale * ds[at] * miss**2)
        guided = np.zeros(len(segment), dtype=bool)
        if problem.sliding is not None:
            guided = boundary_mask(mesh, str(problem.sliding))[trace.region[segment]]
            normal = trace.normal(segment[guided], s[guided])
            along = (residual[guided] * normal).sum(axis=1)
            residual[guided] -= along[:, None] * normal
        squares = self.edge_weight[element] * ds * (residual**2).sum(axis=1)
        self.add("traction", element[~guided], squares[~guided])
        self.add("sliding", element[guided], squares[guided])

    def on_contact(self, line: ContactLine, pressure: Array, active: NDArray[np.bool_]) -> None:
        """Gamma_K: tractions of both sides, complementarity, penetration."""
        trace, contact, solution = self.trace, line.contact, self.solution
        local, segment, s, dc = at_quadrature(line, trace, 2 * self.order + DATA_BONUS)
        if len(local) == 0:
            return
        pi = (lagrange(self.order, s) * _nodal_pressure(line, pressure, self.order)[local]).sum(1)
        full = np.asarray(np.append(active, True)[line.rows].all(axis=1))[local]
        self.in_contact[segment] = True
        normal = trace.normal(segment, s)
        d = normal if contact.direction is None else np.tile(contact.direction, (len(s), 1))
        x = trace.point(segment, s)
        met = np.ones(len(s), dtype=bool)
        if contact.primary is None:
            facing, distance = np.full(len(s), -1), np.zeros(len(s))
        else:
            facing, facing_s, distance, _ = partners(trace, line.facing, segment, x, d)
            self.in_contact[_met_from_behind(trace, line)] = True
            met = facing >= 0
        if contact.gap is not None:
            distance = prescribed_gap(contact, trace, segment, s, x)

        # Tractions per unit of s (P1) or eta (P2); `stretch` is ds per that unit.
        def side(segment: Index, s: Array, d: Array, pi: Array) -> tuple[Array, Array, Array]:
            stretch = np.ones(len(s))
            if contact.direction is not None:
                stretch = 1 / np.abs((trace.normal(segment, s) * d).sum(axis=1))
            t = self.traction(segment, s) * stretch[:, None]
            along = (t * d).sum(axis=1)
            return stretch, along + pi, t - along[:, None] * d

        stretch, along, across = side(segment, s, d, pi)
        element = trace.element[segment]
        u = trace.evaluate(solution.displacement, segment, s)
        noise = ROUND_OFF * np.abs(u).max()
        if contact.gap is None:
            noise += ROUND_OFF * np.abs(x).max()
        sides = [(np.arange(len(s)), element, stretch, along, across)]
        if contact.primary is not None:
            at = np.flatnonzero(met)
            there, there_s = facing[at], facing_s[at]
            other = side(there, there_s, d[at], -pi[at])
            u[at] -= trace.evaluate(solution.displacement, there, there_s)
            sides.append((at, trace.element[there], *other))
            jump = (along[at] + other[1]) / 2
            along[at] = np.where(full[at], jump, along[at])
            sides[1][3][:] = np.where(full[at], jump, other[1])
        for at, element, stretch, along, across in sides:
            weight = self.edge_weight[element] * dc[at] / stretch
            self.add("tangential", element, weight * (across**2).sum(axis=1))
            self.add("pressure", element, weight * along**2)
        gap = np.where(met, distance - (u * d).sum(axis=1), 0.0)
        gap[np.abs(gap) <= noise] = 0.0  # its root counts: 1e-16 would be an estimate of 1e-8
        share = 1 / len(sides)
        for at, element, *_ in sides:
            closed = np.maximum(pi[at], 0) * np.maximum(gap[at], 0)
            depth = np.maximum(-gap[at], 0)
            if contact.bilateral:  # apart is as wrong as into each other
                closed, depth = np.zeros(len(at)), np.abs(gap[at])
            self.add("complementarity", element, share * dc[at] * closed)
            scale = share * self.mu[element] / self.diameter[element]
            self.add("penetration", element, scale * dc[at] * depth**2)


def _diameters(mesh: ng.Mesh) -> Array:
    """Longest side of each triangle, (ne,)."""
    triangles = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(np.intp) - 1
    corners = np.array(mesh.ngmesh.Coordinates())[:, :2][triangles]
    return np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def _met_from_behind(trace: Trace, line: ContactLine) -> Index:
    """Segments of the primary whose middle faces the secondary, (q,)."""
    middle = np.full(len(line.facing), 0.5)
    x = trace.point(line.facing, middle)
    if line.contact.direction is None:
        d = trace.normal(line.facing, middle)
    else:
        d = np.tile(-np.array(line.contact.direction), (len(x), 1))
    back, *_ = partners(trace, line.segments, line.facing, x, d)
    return line.facing[back >= 0]


def _nodal_pressure(line: ContactLine, pressure: Array, order: int) -> Array:
    """Pressure (k, order + 1) at the nodes of each segment.

    At a node without a row, an end of Gamma_K on Gamma_u, the polynomial through the others.
    """
    values = np.append(pressure, 0.0)[line.rows]
    for k in np.flatnonzero((line.rows < 0).any(axis=1) & line.faces):
        nodes = gauss_lobatto(order)
        known = line.rows[k] >= 0
        if known.any():
            fit = np.polynomial.Polynomial.fit(nodes[known], values[k, known], known.sum() - 1)
            values[k, ~known] = fit(nodes[~known])
    return values


def estimate(solution: Solution) -> Estimate:
    """Residual error estimate of a solution."""
    residuals = _Residuals(solution)
    residuals.inside()
    for number, line in enumerate(solution.discrete.lines):
        at = solution.pair == number
        residuals.on_contact(line, solution.pressure[at], solution.active[at])
    residuals.on_supports_and_loads()
    total = np.sum(list(residuals.parts.values()), axis=0)
    return Estimate(indicators=np.sqrt(np.maximum(total, 0.0)), parts=residuals.parts)
