"""Terms of the residual estimate: units, stresses inside bodies, residuals, squares."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple, TypeAlias

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..fem import BoundaryTrace, Model, law_measures, normal_stress_of, summing
from ..lagrange import gauss
from ..problem import Problem

VOIGT = {3: [[0, 2], [2, 1]], 6: [[0, 5, 4], [5, 1, 3], [4, 3, 2]]}  # numbers, by components
DATA_BONUS = 4  # quadrature order above that of the discrete terms, for the loads


@dataclass(frozen=True, eq=False)
class BoundaryPoints:
    """Points of quadrature on the boundary, in order along segments."""

    segment: Index  # (k,)
    s: Array  # (k,), parameters on them, on facets (k, 3)
    weight: Array  # (k,)
    position: Array  # (k, d), on the curves of the mesh
    slope: Array  # (k, 2), derivative of that with respect to s, on facets (k, 3, 2)
    normal: Array  # (k, d), outward unit vectors of the mesh

    @staticmethod
    def at(boundary: BoundaryTrace, segment: Index, s: Array, weight: Array) -> BoundaryPoints:
        """Those at `s` (k, ...) of segments `segment` (k,), each of a `weight` (k,)."""
        slope = boundary.derivative(segment, s)
        normal = boundary.outward(segment, slope)
        return BoundaryPoints(segment, s, weight, boundary.point(segment, s), slope, normal)

    def lengths(self, model: Model) -> Array:
        """Arc length, about an axis area, per s, (k,), of plane bodies."""
        return np.asarray(np.linalg.norm(self.slope, axis=1) * model.measure(self.position))


@dataclass(frozen=True, eq=False)
class Parts:
    """Parts of segments of the boundary."""

    segment: Index  # (r,)
    start: Array  # (r,), an interval of its parameter
    stop: Array  # (r,)

    def points(self, boundary: BoundaryTrace, order: int) -> tuple[Index, BoundaryPoints]:
        """Number of its part (k,) and place of each Gauss point exact to a degree, weights in s."""
        rule, weight = gauss(order)
        part = np.arange(len(self.segment)).repeat(len(rule))
        length = (self.stop - self.start)[:, None]
        s, weights = self.start[:, None] + length * rule, length * weight
        return part, BoundaryPoints.at(boundary, self.segment[part], s.ravel(), weights.ravel())


class PressureShare(NamedTuple):
    """Share of a pressure correction delta in residuals at points of the boundary."""

    at: Index  # (n,), numbers of the residuals
    segment: Index  # (n,)
    s: Array  # (n,)
    factor: Array  # (n, c) of delta, without a unit


class BoundaryResidual(NamedTuple):
    """Residuals of the stress at k points of the boundary, in a part `name` of the estimate."""

    name: str
    element: Index  # (k,), for which each point counts
    weight: Array  # (k,), of its square
    residual: Array  # (k, c), of sigma_h, over the unit of stress
    shares: list[PressureShare]


class Squares(NamedTuple):
    """Squared residuals of the displacement, which no pressure changes."""

    name: str
    element: Index  # (k,), for which each point counts
    values: Array  # (k,), with their weights


BoundaryTerms: TypeAlias = list[BoundaryResidual | Squares]


@dataclass(frozen=True, eq=False)
class ScaledSolution:
    """A solution with its stress relative to `unit` and its moduli relative to `modulus`.

    So squares neither overflow nor underflow; both units are powers of 2, by which nothing is
    rounded. Data and displacement are as they are.
    """

    problem: Problem
    boundary: BoundaryTrace
    displacement: ng.GridFunction
    stress: ng.CoefficientFunction  # sigma_h (2, 2) over `unit`
    # The same as (xx, yy, xy), polynomials on each element, which stand for it in all residuals:
    # of nearly incompressible bodies sigma_h has kappa times what div u_h misses on curved elements
    # between points of quadrature.
    projected: ng.GridFunction
    unit: float
    modulus: float
    mu: Array  # (ne,), the smallest stiffness, see `fem.Moduli`
    rigidity: Array  # (ne,), the largest one
    bulk: Array  # (ne,), kappa
    incompressibility: Array  # (ne,), kappa over mu, in the middle
    rough: Mask  # (ne,), elements in which the law varies by more than a part of itself
    diameter: Array  # (ne,), h, a length

    @property
    def mesh(self) -> ng.Mesh:
        """The mesh."""
        return self.boundary.mesh

    @property
    def model(self) -> Model:
        """The model."""
        return self.boundary.model

    @property
    def order(self) -> int:
        """Degree p of the displacement."""
        return self.boundary.order

    @property
    def strain(self) -> float:
        """The strain that belongs to both units; by it displacements are divided."""
        return self.unit / self.modulus

    def normal_stress(self) -> ng.CoefficientFunction:
        """The stress normal to the plane over `unit`."""
        return normal_stress_of(self.problem, self.displacement) * (1 / self.unit)

    @cached_property
    def edge_weight(self) -> Array:
        """Weight (h/p) / 2mu of squared tractions, (ne,)."""
        return self.diameter / (2 * self.mu * self.order)

    @property
    def element_weight(self) -> Array:
        """Weight (h/p)^2 / 2mu of squared forces, (ne,)."""
        return (self.diameter / self.order) ** 2 / (2 * self.mu)

    @cached_property
    def constant(self) -> ng.comp.ProxyFunction:
        """Test function that is constant on each element."""
        return ng.L2(self.mesh, order=0).TestFunction()

    def on_elements(self, values: Array | Mask) -> ng.GridFunction:
        """The function that has `values` (ne,) on the elements."""
        function = ng.GridFunction(self.constant.space)
        function.vec.FV().NumPy()[:] = values
        return function

    @cached_property
    def measure(self) -> Array:
        """Measure of the body over that of the mesh, in the middle of elements, (ne,)."""
        return self.model.measure(self.boundary.arrays.corners.mean(axis=1))

    def missed(self, element: Index, force: Array) -> Squares:
        """Squares of errors `force` (k,) of the loads' quadrature, each in an `element` (k,).

        A force f at one point costs f^2 / 2mu, times the logarithm of sizes.
        """
        energy = (force / self.unit) ** 2 / (2 * self.mu[element])
        return Squares("loads", element, energy * self.measure[element])

    def traction(self, segment: Index, s: Array, normal: Array) -> Array:
        """Traction (k, d) over `unit` at `s` (k, ...) of `segment` (k,) by the `normal` (k, d)."""
        voigt = self.boundary.evaluate(ng.BoundaryFromVolumeCF(self.projected), segment, s)
        return (voigt[:, VOIGT[voigt.shape[1]]] @ normal[:, :, None])[..., 0]


def components(stress: ng.CoefficientFunction) -> ng.CoefficientFunction:
    """(xx, yy, xy) of a stress (2, 2), of a solid's (3, 3) also those with z, in Voigt's order."""
    rows = {4: (0, 3, 1), 9: (0, 4, 8, 5, 2, 1)}[stress.dim]
    return summing(stress.dim, *((row,) for row in rows)) * stress.Reshape((stress.dim,))


def oscillation(solution: ScaledSolution) -> Array:
    """Squares (ne,) of |sigma_h - Pi sigma_h| in the norm of C^-1, where data in the body vary."""
    problem, mesh, projected = solution.problem, solution.mesh, solution.projected
    v, forms, miss = solution.constant, [], components(solution.stress) - projected
    for body, law in problem.varying.items():
        compliance = solution.model.compliance(law.voigt(problem.model) / solution.modulus)
        density = solution.model.weighted(ng.InnerProduct(compliance * miss, miss))
        measures = law_measures(mesh, body, 2 * projected.space.globalorder, solution.rough)
        forms += [density * v * dx for dx in measures]
    return _assembled(v, *forms)


def divergence_and_jump(
    stress: ng.GridFunction,
) -> tuple[ng.CoefficientFunction, ng.CoefficientFunction]:
    """Div sigma and [sigma n] of a projected stress, two of d components."""
    voigt, size = VOIGT[stress.dim], stress.dim
    d, rows = len(voigt), [tuple([len(row) * k + j for j, k in enumerate(row)]) for row in voigt]
    divergence = summing(size * d, *rows) * ng.Grad(stress).Reshape((size * d,))
    every = summing(size, *((k,) for row in voigt for k in row))
    jump = (every * (stress - stress.Other())).Reshape((d, d))
    return divergence, jump * ng.specialcf.normal(d)


def element_integral(
    solution: ScaledSolution, residual: ng.CoefficientFunction, order: int
) -> Array:
    """Squares of a residual integrated over each element, (ne,)."""
    squares = solution.model.weighted(ng.InnerProduct(residual, residual))
    order += 2 * solution.model.bonus
    return np.asarray(ng.Integrate(squares, solution.mesh, order=order, element_wise=True))


def edge_integral(solution: ScaledSolution, jump: ng.CoefficientFunction, order: int) -> Array:
    """Squares of a jump integrated over the inner edges of each element, (ne,).

    Where the other side is stiffer, times the ratio of both moduli mu: stiff bodies take up what
    soft ones cannot.
    """
    mu, v = solution.mu, solution.constant
    squares = solution.model.weighted(ng.InnerProduct(jump, jump)) * (v + v.Other())
    dx = ng.dx(skeleton=True, bonus_intorder=order)
    piece = solution.boundary.arrays.pieces[solution.boundary.arrays.elements[:, 0]]
    if all(np.ptp(mu[piece == k]) == 0 for k in range(piece.max() + 1)):
        return _assembled(v, squares * dx)
    soft = solution.on_elements(1 / mu)
    least = ng.IfPos(soft - soft.Other(), soft.Other(), soft)
    return mu * _assembled(v, least * squares * dx)


def _assembled(v: ng.comp.ProxyFunction, *forms: ng.comp.SumOfIntegrals) -> Array:
    """Values (ne,) of the sum of forms linear in the function v, constant on each element."""
    f = ng.LinearForm(v.space)
    for form in forms:
        f += form
    f.Assemble()
    return np.array(f.vec.FV().NumPy())
