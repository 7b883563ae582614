"""Residual error indicators in the energy norm, with contact terms.

For two bodies and one pressure pi_h, the discrete contact force over its weight (after Krause,
Veeser, Walloth 2015, Numer. Math. 130:151). Polynomials Pi sigma_h on the elements stand for
sigma_h. Squared contributions of an element T of diameter h, shear modulus mu, degree p:

* element: (h/p)^2 / 2mu |F + div sigma_h|^2 over T
* jump: half of (h/p) / 2mu |[sigma_h n]|^2 over the edges inside a body
* oscillation: |sigma_h - Pi sigma_h|^2 in the norm of C^-1 over T, where moduli or initial strains
  vary
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
  normals of the contact rows
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
from dataclasses import dataclass, replace
from functools import cached_property

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, power_of_two, root_of_squares, rows_of
from ..fem import NEARLY_INCOMPRESSIBLE, law_measures, nearly_incompressible, rough_moduli
from ..lagrange import gauss, gauss_derivative
from ..linalg import cholesky, lower_half, shared
from ..quadrature import features_of, loads_of, pieces, rough_segments
from ..solved import Solved
from .contact import between_nodes, closing_energy, on_contact, on_surfaces, remaining
from .pressure_correction import pressure_correction
from .terms import (
    DATA_BONUS,
    BoundaryPoints,
    BoundaryResidual,
    BoundaryTerms,
    PressureShare,
    ScaledSolution,
    Squares,
    components,
    divergence_and_jump,
    edge_integral,
    element_integral,
    oscillation,
)

GUIDE_NOISE = 4e-15  # of displacements along the normal of a guide, relative to the largest


def scaled(solved: Solved) -> ScaledSolution:
    """A solution in units of its own."""
    problem, stress, boundary = solved.problem, solved.stress, solved.discrete.space.trace
    mesh = boundary.mesh
    stiffness = solved.moduli
    modulus = power_of_two(stiffness.shear)
    # sigma_h as polynomials, to be differentiated: right for any modulus and curved elements; its
    # jumps cost a fifth of those of the stress.
    any_varies = bool(problem.varying)
    exact = mesh.GetCurveOrder() == 1 and not any_varies and boundary.model.polynomial
    degree = boundary.order - 1 if exact else boundary.order
    of_stress = components(stress)
    projected = ng.GridFunction(ng.L2(mesh, order=degree, dim=of_stress.dim))
    # The points of NGSolve's rule of order 2 lie on edges, along which moduli may jump.
    bonus = 1 if boundary.order == 1 and any_varies else 0
    projected.Set(of_stress, bonus_intorder=bonus)
    coefficients = projected.vec.FV().NumPy()
    rough = rough_moduli(problem, mesh)
    if rough.any():
        _project_by_compliance(solved, projected, modulus, rough)
    unit = power_of_two(coefficients)
    # Displacements that nodes hardly know of, as narrow ones, may be the largest by far.
    seen = [x.largest for x in features_of(problem, mesh) if x.kind == "displacement"]
    if seen:
        strain = power_of_two(np.array(seen)) / power_of_two(np.ptp(boundary.curve, axis=(0, 1)))
        unit = max(unit, modulus * strain)
    coefficients /= unit
    return ScaledSolution(
        problem=problem,
        boundary=boundary,
        displacement=solved.displacement,
        stress=stress * (1 / unit),
        projected=projected,
        unit=unit,
        modulus=modulus,
        mu=stiffness.shear / modulus,
        rigidity=stiffness.rigidity / modulus,
        bulk=stiffness.bulk / modulus,
        incompressibility=stiffness.ratio,
        rough=rough,
        diameter=boundary.arrays.diameters,
    )


def _project_by_compliance(
    solved: Solved, projected: ng.GridFunction, modulus: float, rough: Mask
) -> None:
    """Replace a projection by that in the norm of C^-1 on the elements `rough` (ne,).

    Where moduli jump inside an element its soft part determines the stress, not the mean.
    """
    problem, model = solved.problem, solved.discrete.space.trace.model
    mesh, order = projected.space.mesh, projected.space.globalorder
    space = ng.L2(mesh, order=order) ** 3
    s, t = ng.CF(space.TrialFunction()), ng.CF(space.TestFunction())
    a, f = ng.BilinearForm(space, symmetric=True), ng.LinearForm(space)
    for body, law in problem.varying.items():
        compliance = model.compliance(law.voigt(problem.model) / modulus)
        *_, dx = law_measures(mesh, body, 2 * order, rough)
        a += model.weighted(ng.InnerProduct(compliance * s, t)) * dx
        stress = components(solved.stress)
        f += model.weighted(ng.InnerProduct(compliance * stress, t)) * dx
    a.Assemble()
    f.Assemble()
    free = np.repeat(rough, space.ndof // (3 * mesh.ne))
    values = cholesky(lower_half(shared(a.mat)))(np.tile(free, 3))(f.vec.FV().NumPy().copy())
    projected.vec.FV().NumPy().reshape(-1, 3)[free] = values.reshape(3, -1).T[free]


def on_supports_and_loads(solution: ScaledSolution, points: BoundaryPoints) -> BoundaryTerms:
    """Residuals at `points` of the boundary that no body faces.

    Of solids data are not looked at between them.
    """
    boundary, problem, segment, s = solution.boundary, solution.problem, points.segment, points.s
    plane = problem.dim == 2
    residual = -solution.traction(segment, s, points.normal)  # (3.7)
    for pattern in problem.traction:
        at, load = boundary.lies_on(segment, pattern), problem.traction_vector(pattern)
        residual[at] += boundary.evaluate(load, segment[at], s[at]) / solution.unit
    factor = -points.normal  # of a pressure in the residual
    squares = _rough_tractions(solution, segment, s, residual)
    for pattern, data in problem.displacement.items():  # (3.6)
        at = boundary.lies_on(segment, pattern)
        given = {axis: value for axis, value in enumerate(data) if value is not None}
        for axis in given:
            residual[at, axis] = factor[at, axis] = 0.0
        if plane:
            squares.append(_displacement(solution, boundary.segments(pattern), given))
        else:
            squares.append(_displacement_at(solution, rows_of(points, at), given))
    guided = np.zeros(len(segment), dtype=bool)
    if problem.guide is not None:  # (3.8): any force along the normal, none across it
        guided = boundary.lies_on(segment, problem.guide)
        if plane:
            normal, off_guide = _off_guide(solution, rows_of(points, guided), problem.guide)
            squares.append(off_guide)
        else:
            normal = points.normal[guided]
        for vector in (residual, factor):
            along = (vector[guided] * normal).sum(axis=1)
            vector[guided] -= along[:, None] * normal

    element = boundary.element[segment]
    weight = solution.edge_weight[element] * points.weight
    terms = BoundaryTerms(squares)
    for name, at in (("traction", ~guided), ("sliding", guided)):
        share = PressureShare(np.arange(at.sum()), segment[at], s[at], factor[at])
        terms.append(BoundaryResidual(name, element[at], weight[at], residual[at], [share]))
    return terms


def _rough_tractions(
    solution: ScaledSolution, segment: Index, s: Array, residual: Array
) -> list[Squares]:
    """Squares of what polynomials miss of rough tractions; `residual` (k, 2) takes polynomials."""
    boundary, problem, squares = solution.boundary, solution.problem, []
    for load in loads_of(problem, boundary.mesh):
        if load.kind != "traction" or not (found := load.where_rough(solution.order)):
            continue
        at = found.rough[segment]
        change = found.projection - load.density
        residual[at] += boundary.evaluate(change, segment[at], s[at]) / solution.unit
        element = boundary.element
        rest = solution.edge_weight[element] * (found.projection_error / solution.unit) ** 2
        squares.append(Squares("traction", element, rest * solution.measure[element]))
        squares.append(solution.missed(element, found.missed))
    return squares


def _displacement(
    solution: ScaledSolution, segments: Index, data: dict[int, ng.CoefficientFunction]
) -> Squares:
    """2 mu |w| max(|w| / h, |w'|) on `segments` (k,), with w = u_D - u_h, `data` by component.

    |w| |w'| bounds the square of w in H^(1/2), and 2 mu times that the energy that w costs.
    """
    boundary, order = solution.boundary, 2 * solution.order + DATA_BONUS
    points, weights = gauss(order)
    u, mesh, count = solution.displacement, solution.mesh, len(segments)
    missed = [value - u[axis] for axis, value in data.items()]

    def miss(number: Index, s: Array) -> Array:
        """Values (k, m, c) at `s` (k, m) of segments of those numbers (k,), without a unit."""
        at = np.repeat(segments[number], s.shape[1]), s.ravel()
        w = np.hstack([boundary.evaluate(component, *at) for component in missed])
        return np.asarray(w.reshape(*s.shape, len(data)) / solution.strain)

    number, start, length = np.arange(count), np.zeros(count), np.ones(count)
    w = miss(number, points[None].repeat(count, axis=0))
    rough = rough_segments([*data.values()], mesh, segments, solution.strain * np.abs(w).max())
    if rough.any():
        found = pieces(miss, mesh, boundary.lengths(segments), np.flatnonzero(rough))
        number = np.concatenate([number[~rough], found.element])
        start = np.concatenate([start[~rough], found.origin[:, 0]])
        length = np.concatenate([length[~rough], found.side[:, 0, 0]])
        w = miss(number, start[:, None] + length[:, None] * points)
    s = start[:, None] + length[:, None] * points
    every = np.repeat(segments[number], len(points))
    stretch = np.linalg.norm(boundary.derivative(every, s.ravel()), axis=1).reshape(s.shape)
    slope = (gauss_derivative(order) @ w) / (length[:, None] * stretch)[..., None]
    measure = boundary.measure(every, s.ravel()).reshape(s.shape)
    ds = (length[:, None] * weights * stretch * measure)[..., None]
    square, sloping = (np.bincount(number, (ds * x**2).sum(axis=(1, 2)), count) for x in (w, slope))
    element = boundary.element[segments]
    root = np.sqrt(square)
    worst = root * np.maximum(root / solution.diameter[element], np.sqrt(sloping))
    return Squares("displacement", element, 2 * solution.rigidity[element] * worst)


def _displacement_at(
    solution: ScaledSolution, points: BoundaryPoints, data: dict[int, ng.CoefficientFunction]
) -> Squares:
    """2 mu |u_D - u_h|^2 / h at `points`, with u_D, `data` by component."""
    boundary, segment, s = solution.boundary, points.segment, points.s
    u, element = boundary.evaluate(solution.displacement, segment, s), boundary.element[segment]
    missed = [u[:, k] - boundary.evaluate(f, segment, s)[:, 0] for k, f in data.items()]
    square = ((np.array(missed) / solution.strain) ** 2).sum(axis=0)
    weight = 2 * solution.mu[element] / solution.diameter[element]
    return Squares("displacement", element, weight * points.weight * square)


def _off_guide(
    solution: ScaledSolution, points: BoundaryPoints, guide: str
) -> tuple[Array, Squares]:
    """Unit vectors (k, 2) by which Gamma_0 is held at points of it, squares of u_h along them."""
    boundary = solution.boundary
    segments, (number, normal) = boundary.segments(guide), boundary.guide(guide)
    nodal = normal[number].reshape(len(segments), -1, 2)
    normal, _ = between_nodes(nodal[np.searchsorted(segments, points.segment)], points.s)
    element = boundary.element[points.segment]
    u = boundary.evaluate(solution.displacement, points.segment, points.s)
    miss = (u * normal).sum(axis=1)
    miss[np.abs(miss) <= GUIDE_NOISE * np.abs(u).max(initial=0.0)] = 0.0
    stiffness = 2 * solution.rigidity[element] / solution.diameter[element]
    cost = closing_energy(solution, points, stiffness, miss / solution.strain)
    return normal, Squares("displacement", element, points.weight * cost)


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
    """Residual estimate; pressures of bodies are corrected from that kappa / mu on."""
    pairs, boundary = solved.pairs, solved.discrete.space.trace
    solution = scaled(solved)
    order = 2 * solution.order + DATA_BONUS
    if solved.problem.dim == 3:
        terms, corrected_from = BoundaryTerms(), math.inf
        outer = ~boundary.inner
        for pair in pairs:
            on_pair, covered = on_surfaces(solution, pair)
            terms += on_pair
            outer[covered] = False
        places, rule = boundary.rule(order)
        segment, s = boundary.at_places(np.flatnonzero(outer), places)
        points = BoundaryPoints.at(boundary, segment, s, np.tile(rule, len(segment) // len(rule)))
        size = boundary.surface_element(segment, s)
    else:
        terms, of_pairs = on_contact(solution, pairs)
        _, points = remaining(boundary.inner | boundary.on_axis, of_pairs).points(boundary, order)
        size = points.lengths(solution.model)
    terms += on_supports_and_loads(solution, replace(points, weight=points.weight * size))
    parts = _squares(solution, terms, corrected_from)
    total = np.sum(list(parts.values()), axis=0)
    unit = solution.unit / math.sqrt(solution.modulus)  # of the energy norm
    with np.errstate(over="ignore"):
        parts = {name: part * unit * unit for name, part in parts.items()}
    return Estimate(indicators=unit * np.sqrt(np.maximum(total, 0.0)), parts=parts)


def _squares(
    solution: ScaledSolution, terms: BoundaryTerms, corrected_from: float
) -> dict[str, Array]:
    """Squared contributions (ne,) by name, after the pressure has been corrected where needed."""
    problem, mesh, order = solution.problem, solution.mesh, solution.order
    parts = {"element": np.zeros(mesh.ne)}

    def add(name: str, element: Index, values: Array) -> None:
        np.add.at(parts.setdefault(name, np.zeros(mesh.ne)), element, values)

    if problem.varying:
        parts["oscillation"] = oscillation(solution)
    force, of_loads = _body_forces(solution)
    for squares in [x for x in terms if isinstance(x, Squares)] + of_loads:
        add(*squares)
    residuals = [x for x in terms if isinstance(x, BoundaryResidual)]
    divergence, jump = divergence_and_jump(solution.projected)
    divergence = solution.model.divergence(divergence, solution.stress, solution.normal_stress)
    if force is not None:
        divergence += force  # (3.5)
    degree, corrected = solution.projected.space.globalorder, [x.residual for x in residuals]
    names = nearly_incompressible(mesh, corrected_from, solution.incompressibility)
    if names:
        found = pressure_correction(solution, names, divergence, jump, residuals)
        parts["incompressibility"] = found.squares
        divergence, jump, degree = divergence + found.divergence, jump + found.jump, order
        corrected = [x + delta for x, delta in zip(corrected, found.on_boundary, strict=True)]
    data = DATA_BONUS if problem.force else 0
    if degree or data:  # else there is no divergence
        followed = 2 * (max(order, 2) + 1) if of_loads else 0  # of polynomials for rough forces
        inside = element_integral(solution, divergence, max(2 * degree + data, followed))
        parts["element"] += solution.element_weight * inside
    parts["jump"] = solution.edge_weight / 2 * edge_integral(solution, jump, 2 * degree)
    for term, residual in zip(residuals, corrected, strict=True):
        add(term.name, term.element, term.weight * (residual**2).sum(axis=1))
    return parts


def _body_forces(
    solution: ScaledSolution,
) -> tuple[ng.CoefficientFunction | None, list[Squares]]:
    """F over the unit of stress, polynomials where it is rough, and squares of what they miss."""
    problem, mesh = solution.problem, solution.mesh
    if not problem.force:
        return None, []
    forces, squares, every = {}, [], np.arange(mesh.ne)
    for load in loads_of(problem, mesh):
        if load.kind != "force":
            continue
        body, F = load.name, load.data
        forces[body] = ng.CF(F) * (1 / solution.unit)
        if found := load.where_rough(solution.order):
            projection = found.projection * (1 / solution.unit)
            forces[body] = ng.IfPos(solution.on_elements(found.rough), projection, forces[body])
            weight = solution.element_weight * solution.measure
            missed = weight * (found.projection_error / solution.unit) ** 2
            squares += [Squares("element", every, missed), solution.missed(every, found.missed)]
    return mesh.MaterialCF(forces, default=ng.CF((0,) * problem.dim)), squares


@dataclass(frozen=True, eq=False)
class Estimated(Solved):
    """Members of `Solution` that estimate its error, made when the first of them is asked for."""

    adaptive: bool = False  # whether it is a level of `adapt`, whose estimate is needed anyway
    earlier: tuple[Array, ...] = ()  # figures (c, 8) of c pairs of solids, of levels before

    @cached_property
    def _estimate(self) -> Estimate:
        self.work["estimates"] += 1
        return estimate(self)

    @property
    def estimated(self) -> bool:
        """Whether the error estimate has been computed already."""
        return "_estimate" in self.__dict__

    @property
    def indicators(self) -> Array:
        """Local error indicators eta_T, (ne,), root of an energy per unit thickness."""
        return self._estimate.indicators

    @property
    def estimate_parts(self) -> dict[str, Array]:
        """Squared contributions (ne,) to the indicators by origin, energy per thickness."""
        return self._estimate.parts

    @property
    def error_estimate(self) -> float:
        """Estimated A(u - u_h, u - u_h)^(1/2), root of an energy per unit thickness."""
        return root_of_squares(self.indicators)

    @property
    def relative_error_estimate(self) -> float:
        """Estimated error over the energy norm of u_h, dimensionless; 0 where both vanish.

        With initial strains over the norm of the stress, of e(u_h) - e0.
        """
        return self._relative(self.error_estimate)

    def _relative(self, error: float) -> float:
        """An `error` over the norm of the solution."""
        if error == 0 or (self.problem.strain and self.stress_free):
            return 0.0
        return error / self.energy_norm if self.energy_norm > 0 else math.inf
