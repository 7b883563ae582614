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
    opposite,
    prescribed_gap,
)
from ..fem import BoundaryTrace, FacetTrace
from ..reference import triangle
from .terms import BoundaryPoints, BoundaryResidual, BoundaryTerms, Parts, ScaledSolution, Squares

DATA_DEGREE = 4  # of quadrature above the discrete terms, for the data
NO_PARTS = Parts(np.zeros(0, dtype=np.intp), np.zeros(0), np.zeros(0))  # of lines


def _points(trace: BoundaryTrace, facets: Index, degree: int) -> BoundaryPoints:
    """Points on whole `facets` (j,), exact for polynomials of a degree on straight ones."""
    s, w = triangle.gauss(degree)
    every, places = trace.at_places(facets, s)
    weight = trace.surface_element(every, places) * np.tile(w, len(facets))
    return BoundaryPoints(every, places, weight)


def surface_terms(solution: ScaledSolution, pairs: Sequence[ContactState]) -> list[BoundaryTerms]:
    """Terms of the whole boundary: of each pair, and of what no pair covers."""
    zones, uncovered = [on_zone(solution, pair) for pair in pairs], ~solution.boundary.inner
    for _, covered in zones:
        uncovered[covered] = False
    rest = on_supports_and_loads(solution, np.flatnonzero(uncovered))
    return [*(term for term, _ in zones), rest]


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
    return BoundaryTerms(
        residuals=[BoundaryResidual("boundary", element, weight, t, [])],
        squares=[Squares("displacement", element, squares)],
        covered=NO_PARTS,
    )


def discrete_pressure(trace: FacetTrace, pair: ContactState, local: Index, s: Array) -> Array:
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
    """Terms of one pair, and the facets (j,) that it covers.

    Where all rows of a facet are active both bodies have one pressure, and half the jump of their
    tractions counts; elsewhere the difference from the discrete forces. Gaps count where they are
    negative, and where they are open under pressure.
    """
    trace, zone = solution.boundary, pair.line
    if not isinstance(trace, FacetTrace):
        raise TypeError("a pair of solids is asked for")
    degree = 2 * solution.order
    parts, _ = facing_pieces(trace, zone, np.asarray((zone.rows >= 0).any(axis=1)))
    covered = parts.covered(len(zone.segments))
    alone = np.flatnonzero(covered == 0)
    met = np.isin(zone.facing, parts.facing)
    residuals: list[BoundaryResidual] = []
    squares: list[Squares] = []
    s, w = triangle.gauss(degree)
    each = rows_of(parts, np.arange(len(parts.local)).repeat(len(s)))
    local, facing = each.local, each.facing
    facet, places = zone.segments[local], parts.places(s)
    weight = trace.surface_element(facet, places) * (parts.share[:, None] * w).ravel()
    own = BoundaryPoints(facet, places, weight)
    d = interpolated_rays(trace, zone.contact, zone.segments, local, own.s)
    n = trace.normal(own.segment, own.s)
    cosine = (n * d).sum(axis=1)
    weight = own.weight * np.abs(cosine)  # across the direction
    pi = discrete_pressure(trace, pair, local, own.s) / solution.unit
    if zone.contact.direction is None:
        weight, cosine = own.weight, np.ones(len(cosine))
    active, has = zone.on_segments(pair.active, False), zone.rows >= 0
    full = np.asarray((active | ~has).all(axis=1) & has.any(axis=1))[local]
    element = trace.element[own.segment]
    u = trace.evaluate(solution.displacement, own.segment, own.s)
    t = solution.traction(own.segment, own.s) / np.abs(cosine)[:, None]
    sides = [(element, t, 1.0)]
    distance = np.zeros(len(pi))
    if zone.contact.primary is not None:
        x = trace.point(own.segment, own.s)
        there, distance = opposite(trace, x, d, facing, each.opposite)
        weight = weight * np.isfinite(distance)
        distance = np.where(np.isfinite(distance), distance, 0.0)
        across = np.abs((trace.normal(facing, there) * d).sum(axis=1))
        u = u - trace.evaluate(solution.displacement, facing, there)
        other = solution.traction(facing, there) / across[:, None]
        sides.append((trace.element[facing], other, -1.0))
    if zone.contact.gap is not None:
        distance = prescribed_gap(
            zone.contact, trace, own.segment, own.s, trace.point(own.segment, own.s)
        )
    gap = (distance - (u * d).sum(axis=1)) / solution.strain
    along = [sign * (t * d).sum(axis=1) + pi for _, t, sign in sides]
    half_jump = sum((t * d).sum(axis=1) for _, t, _ in sides) / 2
    least = np.min([solution.edge_weight[e] for e, _, _ in sides], axis=0)
    stiff = np.min([solution.mu[e] / solution.diameter[e] for e, _, _ in sides], axis=0)
    both = np.where(full & (len(sides) == 2), np.abs(half_jump), np.inf)
    for (e, t, _), miss in zip(sides, along, strict=True):
        own_weight = solution.edge_weight[e]
        shared = np.isfinite(both)
        values = np.where(shared, both, miss)[:, None]
        factor = np.where(shared, least, own_weight) * weight
        residuals.append(BoundaryResidual("pressure", e, factor, values, []))
        shear = t - (t * d).sum(axis=1)[:, None] * d
        residuals.append(BoundaryResidual("tangential", e, own_weight * weight, shear, []))
        depth = stiff * np.minimum(gap, 0.0) ** 2
        product = np.maximum(pi, 0.0) * np.maximum(gap, 0.0) / 2
        product = np.where(full, np.minimum(product, stiff * gap**2), product)
        if zone.contact.bilateral:
            depth, product = stiff * gap**2, np.zeros(len(gap))
        share = weight / len(sides)
        squares.append(Squares("penetration", e, depth * share))
        squares.append(Squares("complementarity", e, product * share))
    rest = np.concatenate([zone.segments[alone], zone.facing[~met]])
    points = _points(trace, rest, degree)
    free, element = solution.traction(points.segment, points.s), trace.element[points.segment]
    weight = solution.edge_weight[element] * points.weight
    residuals.append(BoundaryResidual("boundary", element, weight, free, []))
    both_sides = np.concatenate([zone.segments, zone.facing])
    return BoundaryTerms(residuals, squares, NO_PARTS), both_sides
