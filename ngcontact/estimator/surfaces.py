"""Residuals of a solution on the boundary of solids: supports, loads, contact.

As `estimator.residual` and `estimator.contact` have them of plane bodies, by quadrature on facets
and on the parts of facets that face each other. Loads and prescribed displacements are not looked
at between the points of quadrature.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..arrays import Array, Index, rows_of
from ..contact import (
    ContactState,
    facing_pieces,
    interpolated_rays,
    jacobian,
    opposite,
    prescribed_gap,
)
from ..fem import BoundaryTrace
from ..reference import triangle
from .terms import BoundaryPoints, BoundaryResidual, BoundaryTerms, ScaledSolution, Squares

DATA_DEGREE = 4  # of quadrature above the discrete terms, for the data


def _points(trace: BoundaryTrace, facets: Index, degree: int) -> BoundaryPoints:
    """Points on whole `facets` (j,), exact for polynomials of a degree on straight ones."""
    s, w = triangle.gauss(degree)
    every, places = trace.at_places(facets, s)
    weight = trace.surface_element(every, places) * np.tile(w, len(facets))
    return BoundaryPoints(every, places, weight)


def surface_terms(solution: ScaledSolution, pairs: Sequence[ContactState]) -> BoundaryTerms:
    """Terms of the whole boundary: of each pair, and of what no pair covers."""
    terms, uncovered = BoundaryTerms(), ~solution.boundary.inner
    for pair in pairs:
        on_pair, covered = on_zone(solution, pair)
        terms += on_pair
        uncovered[covered] = False
    return terms + on_supports_and_loads(solution, np.flatnonzero(uncovered))


def on_supports_and_loads(solution: ScaledSolution, facets: Index) -> BoundaryTerms:
    """Residuals of (3.6), (3.7), (3.8) on `facets` (j,) of no pair; the rest is free."""
    problem, trace = solution.problem, solution.boundary
    points = _points(trace, facets, 2 * solution.order + DATA_DEGREE)
    t, element = solution.traction(points.segment, points.s), trace.element[points.segment]
    held = np.zeros(t.shape, dtype=bool)
    miss = np.zeros(t.shape)
    for pattern, components in problem.displacement.items():
        at = np.flatnonzero(trace.lies_on(points.segment, pattern))
        u = trace.evaluate(solution.displacement, points.segment[at], points.s[at])
        for axis, value in enumerate(components):
            if value is not None:
                given = trace.evaluate(value, points.segment[at], points.s[at])[:, 0]
                miss[at, axis], held[at, axis] = u[:, axis] - given, True
    for pattern in problem.traction:
        at = np.flatnonzero(trace.lies_on(points.segment, pattern))
        load = problem.traction_vector(pattern)
        t[at] -= trace.evaluate(load, points.segment[at], points.s[at]) / solution.unit  # (3.7)
    t[held] = 0.0
    if problem.guide is not None:  # (3.8): no shear
        at = np.flatnonzero(trace.lies_on(points.segment, problem.guide))
        n = trace.normal(points.segment[at], points.s[at])
        t[at] -= (t[at] * n).sum(axis=1)[:, None] * n
    weight = solution.edge_weight[element] * points.weight
    squares = 2 * solution.mu[element] / solution.diameter[element] * points.weight
    squares = squares * ((miss / solution.strain) ** 2).sum(axis=1)  # (3.6)
    return [
        BoundaryResidual("boundary", element, weight, t, []),
        Squares("displacement", element, squares),
    ]


def discrete_pressure(trace: BoundaryTrace, pair: ContactState, local: Index, s: Array) -> Array:
    """The pressure (k,) that the forces stand for, at `s` (k, 3) of facets `local` (k,) of a zone.

    At order 2 linear through the middles of edges, with Bernstein's polynomials where vertices have
    rows, too.
    """
    value = pair.line.on_segments(pair.force / pair.line.weight, 0.0)
    if trace.order != 2:
        return np.asarray((triangle.lagrange(trace.order, s) * value[local]).sum(axis=1))
    edges = value[:, 3:]
    beside = 3 - triangle.EDGES.sum(axis=1)  # the vertex that an edge has not
    # At a vertex the sum of its two edges less the third.
    linear = (1.0 - 2.0 * np.eye(3)[:, beside]) @ edges.T
    has = pair.line.rows[:, :3] >= 0
    value[:, :3] = np.where(has, value[:, :3], linear.T)
    shapes = triangle.lagrange(2, s)
    by_edges = (1 - 2 * s[:, beside]) * edges[local]
    quadratic = np.einsum("ki,ij,kj->k", shapes, triangle.bernstein(2), value[local])
    return np.where(has[local].any(axis=1), quadratic, by_edges.sum(axis=1))


def on_zone(solution: ScaledSolution, pair: ContactState) -> tuple[BoundaryTerms, Index]:
    """Terms of one pair, and the facets (j,) of both bodies that face each other.

    Where all rows of a facet are active both bodies have one pressure, and half the jump of their
    tractions counts; elsewhere the difference from the discrete forces. Gaps count where they are
    negative, and where they are open under pressure.
    """
    trace, zone = solution.boundary, pair.line
    parts, _ = facing_pieces(trace, zone, np.asarray((zone.rows >= 0).any(axis=1)))
    places, w = triangle.gauss(2 * solution.order)
    each = rows_of(parts, np.arange(len(parts.local)).repeat(len(places)))
    local, facing = each.local, each.facing
    facet, s = zone.segments[local], parts.places(places)
    size, seen = trace.surface_element(facet, s), jacobian(trace, zone.contact, facet, s)
    weight = seen * (parts.share[:, None] * w).ravel()  # across a fixed direction
    d = interpolated_rays(trace, zone.contact, zone.segments, local, s)
    pi = discrete_pressure(trace, pair, local, s) / solution.unit
    active, has = zone.on_segments(pair.active, False), zone.rows >= 0
    full = np.asarray((active | ~has).all(axis=1) & has.any(axis=1))[local]
    u = trace.evaluate(solution.displacement, facet, s)
    sides = [(trace.element[facet], solution.traction(facet, s) * (size / seen)[:, None], 1.0)]
    x, distance, shared = trace.point(facet, s), np.zeros(len(pi)), np.zeros_like(full)
    if zone.contact.primary is not None:
        there, distance = opposite(trace, x, d, facing, each.opposite)
        met = np.isfinite(distance)
        weight, distance = weight * met, np.where(met, distance, 0.0)
        across = np.abs((trace.normal(facing, there) * d).sum(axis=1))
        u = u - trace.evaluate(solution.displacement, facing, there)
        other = solution.traction(facing, there) / across[:, None]
        sides.append((trace.element[facing], other, -1.0))
        shared = full
    if zone.contact.gap is not None:
        distance = prescribed_gap(zone.contact, trace, facet, s, x)
    gap = (distance - (u * d).sum(axis=1)) / solution.strain
    half_jump = sum((t * d).sum(axis=1) for _, t, _ in sides) / 2
    least = np.min([solution.edge_weight[e] for e, _, _ in sides], axis=0)
    stiff = np.min([solution.mu[e] / solution.diameter[e] for e, _, _ in sides], axis=0)
    closing, product = stiff * gap**2, np.maximum(pi, 0.0) * np.maximum(gap, 0.0) / 2
    product, depth = np.where(full, np.minimum(product, closing), product), closing * (gap < 0)
    if zone.contact.bilateral:
        depth, product = closing, np.zeros(len(gap))
    terms, share = BoundaryTerms(), weight / len(sides)
    for e, t, sign in sides:
        own_weight, along = solution.edge_weight[e], (t * d).sum(axis=1)
        values = np.where(shared, half_jump, sign * along + pi)[:, None]
        factor = np.where(shared, least, own_weight) * weight
        shear = t - along[:, None] * d
        terms += [
            BoundaryResidual("pressure", e, factor, values, []),
            BoundaryResidual("tangential", e, own_weight * weight, shear, []),
            Squares("penetration", e, depth * share),
            Squares("complementarity", e, product * share),
        ]
    covered = np.concatenate([zone.segments[parts.local], parts.facing[parts.facing >= 0]])
    return terms, covered
