"""Residuals on Gamma_tau, Gamma_0 and Gamma_u."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index
from ..lagrange import gauss, gauss_derivative
from ..quadrature import known_rough_load, moment_degree, pieces, rough_segments
from .contact import between_nodes, closing_energy
from .terms import (
    DATA_BONUS,
    BoundaryResidual,
    BoundaryTerms,
    Parts,
    PressureShare,
    ScaledSolution,
    Squares,
)

NOISE = 4e-15  # of displacements along the normal of a guide, relative to the largest


def on_supports_and_loads(solution: ScaledSolution, parts: Parts) -> BoundaryTerms:
    """Residuals on all of the boundary that contact has not covered.

    Parameters
    ----------
    solution : ScaledSolution
        In units of its own.
    parts : Parts
        What no body faces.
    """
    boundary, problem = solution.boundary, solution.problem
    _, segment, s, weight = parts.points(2 * solution.order + DATA_BONUS)
    ds = np.linalg.norm(boundary.derivative(segment, s), axis=1) * weight
    ds *= boundary.measure(segment, s)

    residual = _unbalanced(solution, segment, s)  # (3.7)
    factor = -boundary.normal(segment, s)  # of a pressure in the residual
    squares = _rough_loads(solution, segment, s, residual)
    for pattern, components in problem.displacement.items():  # (3.6)
        at = boundary.lies_on(segment, pattern)
        given = {axis: value for axis, value in enumerate(components) if value is not None}
        for axis in given:
            residual[at, axis] = factor[at, axis] = 0.0
        squares.append(_displacement(solution, boundary.segments(pattern), given))
    guided = np.zeros(len(segment), dtype=bool)
    if problem.sliding is not None:  # (3.8): any force along the normal, none across it
        guided = boundary.lies_on(segment, str(problem.sliding))
        normal = _guiding(solution, segment[guided], s[guided])
        squares.append(_off_guide(solution, segment[guided], s[guided], ds[guided], normal))
        for vector in (residual, factor):
            along = (vector[guided] * normal).sum(axis=1)
            vector[guided] -= along[:, None] * normal

    element = boundary.element[segment]
    weight = solution.edge_weight[element] * ds
    residuals = []
    for name, at in (("traction", ~guided), ("sliding", guided)):
        share = PressureShare(np.arange(at.sum()), segment[at], s[at], factor[at])
        residuals.append(BoundaryResidual(name, element[at], weight[at], residual[at], [share]))
    return BoundaryTerms(residuals, squares, parts)


def _unbalanced(solution: ScaledSolution, segment: Index, s: Array) -> Array:
    """P - sigma_h n (k, 2) at points of the boundary, with P = 0 where no traction is given."""
    boundary, problem = solution.boundary, solution.problem
    residual = -solution.traction(segment, s)
    for pattern in problem.traction:
        at = boundary.lies_on(segment, pattern)
        load = problem.traction_vector(pattern)
        residual[at] += boundary.evaluate(load, segment[at], s[at]) / solution.unit
    return residual


def _rough_loads(
    solution: ScaledSolution, segment: Index, s: Array, residual: Array
) -> list[Squares]:
    """Squares of what polynomials miss of tractions where these are rough.

    There `residual` (k, 2) at `s` (k,) of segments (k,) is made that of the polynomials.
    """
    boundary, problem, squares = solution.boundary, solution.problem, []
    for pattern in problem.traction:
        load = problem.traction_vector(pattern)
        found = known_rough_load(
            *(problem.traction[pattern], load, boundary.mesh.Boundaries(pattern)),
            moment_degree(solution.order),
        )
        if found is None:
            continue
        at = found.rough[segment]
        change = found.projection - load
        residual[at] += boundary.evaluate(change, segment[at], s[at]) / solution.unit
        element = boundary.element
        rest = solution.edge_weight[element] * (found.rest / solution.unit) ** 2
        rest *= solution.measure[element]
        squares.append(Squares("traction", element, rest))
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
    size = boundary.lengths(segments)
    u = solution.displacement
    missed = ng.CF(tuple(value - u[axis] for axis, value in data.items()))

    def miss(segment: Index, s: Array) -> Array:
        """Values (k, m, c) at `s` (k, m) of segments (k,), without a unit."""
        w = boundary.evaluate(missed, np.repeat(segment, s.shape[1]), s.ravel())
        return np.asarray(w.reshape(*s.shape, len(data)) / solution.strain)

    count, mesh = len(segments), boundary.mesh
    number, start, length = np.arange(count), np.zeros(count), np.ones(count)
    w = miss(segments, np.tile(points, (count, 1)))
    rough = rough_segments([*data.values()], mesh, segments, solution.strain * np.abs(w).max())
    if rough.any():
        found = pieces(
            lambda k, s: miss(segments[k], s), boundary.mesh, size, np.flatnonzero(rough)
        )
        number, start, length = (
            np.concatenate([x[~rough], y])
            for x, y in zip((number, start, length), found, strict=True)
        )
        w = miss(segments[number], start[:, None] + length[:, None] * points)
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


def _guiding(solution: ScaledSolution, segment: Index, s: Array) -> Array:
    """Unit vectors (k, 2) by which Gamma_0 is held at `s` (k,) of segments (k,)."""
    boundary = solution.boundary
    segments = boundary.segments(str(solution.problem.sliding))
    at, at_node = boundary.at_nodes(segments)
    node = boundary.nodes[segments].ravel()
    number, normal = boundary.number_points(at, node, boundary.exact_normal(at, at_node))
    nodal = normal[number].reshape(len(segments), -1, 2)
    return between_nodes(nodal[np.searchsorted(segments, segment)], s)[0]


def _off_guide(
    solution: ScaledSolution, segment: Index, s: Array, ds: Array, normal: Array
) -> Squares:
    """What u_h.n between the nodes of Gamma_0 costs, at points (k,) with weights `ds` (k,)."""
    boundary, element = solution.boundary, solution.boundary.element[segment]
    u = boundary.evaluate(solution.displacement, segment, s)
    miss = (u * normal).sum(axis=1)
    miss[np.abs(miss) <= NOISE * np.abs(u).max(initial=0.0)] = 0.0
    stiffness = 2 * solution.rigidity[element] / solution.diameter[element]
    where = segment, ds, boundary.point(segment, s)
    cost = closing_energy(solution, where, stiffness, miss / solution.strain)
    return Squares("displacement", element, ds * cost)
