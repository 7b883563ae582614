"""Loads, and prescribed displacements, that quadrature of the usual order misses."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, power_of_two, rows_of
from ..errors import warn
from ..problem import MeshArrays, Problem, numbers
from .cells import (
    MOMENTS,
    ElementParts,
    Refined,
    Rule,
    SampledElements,
    divisions,
    gauss_rule,
    inward,
    local_functions,
    missed_by_polynomials,
    monomials,
    refined,
)
from .features import LOADS, NO_JUMPS, features_in, features_of, towards, where_features_are

SHAPE = 0.05  # what polynomials miss of a load at a point, relative to its largest value ...
# ... or over an element, relative to its integral: it is rough there.
ROUGH_SHARES = {1: 1e-4, 2: 2e-3}
# Times what values vary at the points: no others are further apart in smooth functions.
VARIATION_FACTOR = 2
# Elements in the width of a feature, from which it is looked at as all else is.
ELEMENTS_PER_FEATURE = 4
CURVED = 4  # quadrature orders for the maps of curved elements
# Error of a part relative to that integral at which it is not halved.
PART_ERRORS = {1: 1e-6, 2: 3e-5}
ROUGH_LOADS = "_ngcontact_loads"  # attribute of a mesh: the estimate asks what assembly asked
LOST_SHARE = 1e-3  # of a load that quadrature may miss without a word

MIN_SEGMENT_POINTS = 8  # points on a segment at least, which show any interpolation error
ROUGH_MISS = 0.1  # what polynomials miss of values, relative to what the mesh does: they are rough
VALUE_ROUND_OFF = 1e-10  # ... and relative to the values
SQUARES_ERROR = 1e-3  # error of the squares on a part, relative to all of them


@dataclass(frozen=True, eq=False)
class RoughLoad:
    """A load where quadrature of the usual order misses a part of it, of n elements or segments."""

    rough: Mask  # (n,), where that is
    projection: ng.GridFunction  # there the polynomial, discontinuous, with the load's moments
    projection_error: Array  # (n,), L2 norm of what it misses of the load
    missed: Array  # (n,), error of the integral of the load, a force
    total: float  # integral of the load's size, a force
    cells: ElementParts  # parts of the rough elements on which a rule integrates the load


@dataclass(frozen=True, eq=False)
class Load:
    """A force on bodies, or a traction on boundaries."""

    kind: str  # "force" or "traction"
    name: str  # the pattern
    data: ng.CoefficientFunction  # as it is given, a pressure perhaps
    density: ng.CoefficientFunction  # the force (2,) per volume or area that this is
    region: ng.Region

    def where_rough(self, order: int) -> RoughLoad | None:
        """The load where it is rough for displacements of an order; None where it is nowhere.

        Known from its first time in a run on this mesh. Numbers are nowhere rough.
        """
        if numbers(self.data) or self.region.mesh.dim == 3:  # of solids not looked at
            return None
        mesh, degree = self.region.mesh, max(order, 2) + 1  # displacements' times a radius
        kept: dict[Any, tuple[ng.CoefficientFunction, RoughLoad | None]]
        kept = mesh.__dict__.setdefault(ROUGH_LOADS, {})
        key = self.kind, self.name, degree, mesh.GetNE(self.region.VB())
        data, found = kept.get(key, (None, None))
        if data != self.data:
            found = rough_load(self.density, self.region, degree, features_in(self.data))
            kept[key] = self.data, found
        return found


def sample_data(problem: Problem, mesh: ng.Mesh) -> None:
    """Look at all functions of a problem anew, as each run does: parameters may have changed."""
    features_of(problem, mesh, again=True)
    mesh.__dict__.pop(ROUGH_LOADS, None)


def loads_of(problem: Problem, mesh: ng.Mesh) -> list[Load]:
    """All loads of a problem, forces first."""
    forces = [Load("force", k, F, F, mesh.Materials(k)) for k, F in problem.force.items()]
    tractions = [
        Load("traction", k, p, problem.traction_vector(k), mesh.Boundaries(k))
        for k, p in problem.traction.items()
    ]
    return [*forces, *tractions]


def rough_load(
    load: ng.CoefficientFunction, region: ng.Region, degree: int, features: Array = NO_JUMPS
) -> RoughLoad | None:
    """A load on a region, bodies or boundaries, where it is rough; None where it is nowhere.

    Polynomials of a degree have the same moments; `features` (k, 3) are places and widths of narrow
    ones, lengths.
    """
    view = SampledElements(region.mesh, 2 if region.VB() == ng.VOL else 1)
    inside, sizes = view.inside(region), view.sizes
    miss, largest, total = np.zeros(len(sizes)), 0.0, 0.0
    least, most = np.zeros((2, len(sizes), load.dim))
    for here, values in view.samples(load, inside):
        miss[here] = missed_by_polynomials(values, view.dim)
        size = np.abs(values).max(axis=2)  # no squares: they may leave the range of numbers
        largest = max(largest, float(size.max(initial=0.0)))
        total += float(size.mean(axis=1) @ sizes[here] ** view.dim) / view.dim
        least[here], most[here] = values.min(axis=1), values.max(axis=1)
    here, beyond = _steps(load, view, inside, least[inside], most[inside])
    miss[here] = np.maximum(miss[here], beyond)
    share = miss * sizes**view.dim / view.dim
    rough = (miss > SHAPE * largest) | (share > ROUGH_SHARES[view.dim] * total)
    near, feature = where_features_are(features, view, inside)
    rough[near[sizes[near] > features[feature, 2] / ELEMENTS_PER_FEATURE]] = True
    if not rough.any():
        return None
    rough = view.with_neighbours(rough, inside)  # a part of a feature may have none of the points
    start = view.in_parts(np.flatnonzero(rough))

    def density(elements: Index, reference: Array) -> Array:
        values = view.sample(load, elements, reference)
        return np.asarray(values * view.evaluate(view.measure, elements, reference))

    if len(features):  # of which the points of the lattice may have seen nothing
        start, rule = towards(features, start, view), Rule.of(view.dim, *MOMENTS[view.dim])
        size = np.abs(density(start.element, start.points(rule))).max(axis=2)
        total = max(total, float((size * start.weights(rule)).sum()))
    found = refined(density, start, MOMENTS, PART_ERRORS[view.dim], total, view.corners)
    projection, rest = _projected(found, view, degree)
    missed = np.bincount(found.cells.element, found.missed, len(rough)).astype(float)
    return RoughLoad(rough, projection, rest, missed, total, found.cells)


def _steps(
    load: ng.CoefficientFunction, view: SampledElements, elements: Index, least: Array, most: Array
) -> tuple[Index, Array]:
    """Numbers (j,) of `elements` (k,) with steps beside the sampled points, and their sizes (j,).

    A step whose far side has none of the points leaves values of neighbours that do not meet: there
    it is looked for at the edges. `least` and `most` (k, c) are those at the points.
    """
    at, shape, varies = view.ends[elements], (view.mesh.nv, load.dim), most - least
    lowest, highest, most_varied = np.full(shape, np.inf), np.full(shape, -np.inf), np.zeros(shape)
    np.minimum.at(lowest, at, most[:, None])
    np.maximum.at(highest, at, least[:, None])
    np.maximum.at(most_varied, at, varies[:, None])
    apart = np.any(highest - lowest > VARIATION_FACTOR * most_varied, axis=1)
    some = np.flatnonzero(np.any(apart[at], axis=1))
    if not len(some):
        return elements[some], np.empty(0)
    values = view.sample(load, elements[some], beside_edges(view.dim))
    beyond = np.maximum(values - most[some, None], least[some, None] - values)
    beyond = np.maximum(beyond - VARIATION_FACTOR * varies[some, None], 0.0)
    return elements[some], np.asarray(beyond.max(axis=(1, 2), initial=0.0))


@lru_cache
def beside_edges(dim: int) -> Array:
    """Points (m, dim) inside the unit segment or triangle, 1e-4 of it from its ends or edges."""
    t = np.arange(8)[:, None] / 8
    corners = np.vstack([np.zeros(dim), np.eye(dim)])
    edges = [(1 - t) * a + t * b for a, b in zip(corners, np.roll(corners, 1, axis=0), strict=True)]
    return inward(corners if dim == 1 else np.vstack(edges))


def _projected(found: Refined, view: SampledElements, degree: int) -> tuple[ng.GridFunction, Array]:
    """Polynomials with the moments of a load times the measure, and what they miss of it (n,)."""
    order = np.argsort(found.cells.element, kind="stable")
    cells, values, rule = rows_of(found.cells, order), found.values[order], found.rule
    points, weights, dim = cells.points(rule), cells.weights(rule), view.dim
    elements, first = np.unique(cells.element, return_index=True)
    moments = np.swapaxes(weights[..., None] * monomials(2 * points - 1, degree), 1, 2) @ values
    moments = np.add.reduceat(moments, first, axis=0)
    # The q functions of an element, one by one, and matrices (j, q, q) to them from monomials.
    space, number = (ng.L2 if dim == 2 else ng.SurfaceL2), math.comb(degree + dim, dim)
    at = elements[:, None] * number + np.arange(number)
    shapes = local_functions(space(view.mesh, order=degree), at)
    nodes = [k for k in itertools.product(range(degree + 1), repeat=dim) if sum(k) <= degree]
    x = np.array(nodes) / degree
    change = np.linalg.solve(monomials(2 * x - 1, degree), view.evaluate(shapes, elements, x))
    moments = np.swapaxes(change, 1, 2) @ moments
    x, w = gauss_rule(dim, 2 * degree + CURVED)
    shape = view.evaluate(shapes, elements, x)
    weight = w[:, None] * view.evaluate(view.measure, elements, x)
    mass = np.swapaxes(shape * weight, 1, 2) @ shape
    coefficients = np.linalg.solve(mass, moments)
    count = moments.shape[2]
    projection = ng.GridFunction(space(view.mesh, order=degree, dim=count))
    projection.vec.FV().NumPy().reshape(-1, count)[at] = coefficients
    measure = view.evaluate(view.measure, cells.element, points)
    values = values / measure
    unit = power_of_two(values)
    squares = (weights * measure[..., 0] * ((values / unit) ** 2).sum(axis=2)).sum(axis=1)
    squares = np.add.reduceat(squares, first)
    squares -= (coefficients / unit * (moments / unit)).sum(axis=(1, 2))
    rest = np.zeros(len(view.sizes))
    rest[elements] = unit * np.sqrt(np.maximum(squares, 0.0))
    return projection, rest


def warn_of_data(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of loads that vanish wherever they are looked at or are finer than any quadrature."""
    for one in features_of(problem, mesh):
        if one.kind in LOADS and one.samples and not one.largest:
            warn(
                f'{one.kind} "{one.name}" is zero at all {one.samples} points at which it was '
                "looked at: if it acts on a smaller part, make that a boundary or a body of its own"
            )
    for load in loads_of(problem, mesh):
        found = load.where_rough(order)
        if found is not None and found.missed.sum() > LOST_SHARE * found.total:
            warn(
                f'{load.kind} "{load.name}" is finer than any quadrature: up to '
                f"{found.missed.sum() / found.total:.1%} of it may be missed; give a smoother load"
            )


def rough_segments(
    values: Sequence[ng.CoefficientFunction], mesh: ng.Mesh, segments: Index, missed: float
) -> Mask:
    """Mask (k,) of `segments` (k,) with values, scalars, that are not seen at a few points.

    `missed` is how far a displacement is from them there. Numbers are nowhere rough.
    """
    if all(map(numbers, values)):
        return np.zeros(len(segments), dtype=bool)
    left, largest = np.zeros(mesh.GetNE(ng.BND)), 0.0
    view = SampledElements(mesh, 1)
    for here, found in view.samples(ng.CF(tuple(values)), segments, MIN_SEGMENT_POINTS):
        left[here] = missed_by_polynomials(found, 1)
        largest = max(largest, float(np.abs(found).max()))
    return np.asarray(left[segments] > max(ROUGH_MISS * missed, VALUE_ROUND_OFF * largest))


def pieces(
    miss: Callable[[Index, Array], Array], mesh: ng.Mesh, sizes: Array, at: Index
) -> ElementParts:
    """Pieces of segments `at` (k,) on which Gauss points integrate the squares of what is missed.

    `miss` has values (k, m, c) at parameters (k, m) of segments (k,) of lengths `sizes` (q,).
    """

    def squares(segment: Index, s: Array) -> Array:
        return np.asarray(sizes[segment, None, None] * miss(segment, s[..., 0]) ** 2)

    n = max(MIN_SEGMENT_POINTS, int(divisions(1, sizes[at], MeshArrays(mesh).extent).max()))
    cells = ElementParts.whole(1, at).divided(n)
    return refined(squares, cells, MOMENTS, SQUARES_ERROR).cells
