"""Residuals on Gamma_tau, Gamma_0 and Gamma_u."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from ..arrays import Array, Index, Mask
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

    residual = _unbalanced(solution, segment, s)  # (3.7)
    factor = -boundary.normal(segment, s)  # of a pressure in the residual
    squares = []
    for axis, at, miss in _misses(solution, segment, s):  # (3.6)
        residual[at, axis] = factor[at, axis] = 0.0
        here = boundary.element[segment[at]]
        scale = 2 * solution.mu[here] / solution.diameter[here]
        values = scale * ds[at] * (miss / solution.strain) ** 2
        squares.append(Squares("displacement", here, values))
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


def _misses(
    solution: ScaledSolution, segment: Index, s: Array
) -> Iterator[tuple[int, Mask, Array]]:
    """Of each prescribed component: its axis, the points (k,) of its boundary, u_D - u_h there."""
    boundary = solution.boundary
    for pattern, components in solution.problem.displacement.items():
        at = boundary.lies_on(segment, pattern)
        u = boundary.evaluate(solution.displacement, segment[at], s[at])
        for axis, value in enumerate(components):
            if value is not None:
                yield axis, at, boundary.evaluate(value, segment[at], s[at])[:, 0] - u[:, axis]


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
