"""Loads that quadrature misses, as polynomials with the same moments."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, power_of_two
from .cells import Cells, beside_edges, following, monomials
from .features import features_in, touched, towards
from .view import View, looked_at, numbers

SHAPE = 0.05  # what they miss of a load at a point, relative to its largest value ...
SHARE = {
    1: 1e-4,
    2: 2e-3,
}  # ... or over an element, relative to its integral, at which it is rough there
STEP = 2  # times what values vary at the points: no others are further apart in smooth functions
KEPT = "_ngcontact_loads"  # attribute of a mesh
COARSE = 4  # elements in the width of a feature, from which it is looked at as all else is
CURVED = 4  # quadrature orders for the maps of curved elements
FINE = {1: 1e-6, 2: 3e-5}  # error of a part relative to that integral at which it is not halved


NO_FEATURES = np.empty((0, 3))


@dataclass(frozen=True, eq=False)
class RoughLoad:
    """A load on elements in which quadrature of the usual order misses a part of it.

    Attributes
    ----------
    rough : ndarray of bool (n,)
        Those of all n elements, or segments of the boundary.
    projection : ng.GridFunction
        There the polynomial, discontinuous, with the load's moments.
    rest : ndarray (n,)
        Root of the integral of the square of what it misses of the load.
    missed : ndarray (n,)
        Error of the integral of the load, a force.
    total : float
        Integral of the load's size, a force.
    seen : int
        Tells the values from which it was found rough.
    cells : Cells
        Parts of the rough elements on which a rule integrates the load.
    """

    rough: Mask
    projection: ng.GridFunction
    rest: Array
    missed: Array
    total: float
    seen: int
    cells: Cells


def moment_degree(order: int) -> int:
    """Degree to which moments of a rough load are kept: displacements' times a radius."""
    return max(order, 2) + 1


def rough_load(
    load: ng.CoefficientFunction,
    region: ng.Region,
    degree: int,
    known: RoughLoad | None = None,
    features: Array = NO_FEATURES,
) -> RoughLoad | None:
    """A load on a region, bodies or boundaries, where it is rough; None where it is nowhere.

    Parameters
    ----------
    load : ng.CoefficientFunction
        A force per volume or area, of any dimension.
    region : ng.Region
        Where it acts.
    degree : int
        Of the polynomials with the same moments.
    known : RoughLoad, optional
        What was found of it before, returned where nothing has changed.
    features : ndarray (k, 3)
        Places and widths of narrow features, lengths.
    """
    view = View(region.mesh, 2 if region.VB() == ng.VOL else 1)
    inside = view.inside(region)
    rough, total, seen = _rough(load, view, inside)
    near, feature = touched(features, view, inside)
    rough[near[view.sizes[near] > features[feature, 2] / COARSE]] = True
    seen = hash((seen, features.tobytes()))
    if not rough.any() or (known is not None and known.seen == seen):
        return known if rough.any() else None
    rough = view.with_neighbours(rough, inside)  # a part of a feature may have none of the points
    start = view.in_parts(np.flatnonzero(rough))

    def density(elements: Index, reference: Array) -> Array:
        values = view.look(load, elements, reference)
        return np.asarray(values * view.evaluate(view.measure, elements, reference))

    if len(features):  # of which the points of the lattice may have seen nothing
        start = towards(features, start, view)
        size = np.abs(density(start.element, start.points)).max(axis=2)
        total = max(total, float((size * start.weights).sum()))
    corners = view.arrays.corners if view.dim == 2 else None
    cells, values, over = following(density, start, FINE[view.dim] * total, corners)
    missed = np.bincount(cells.element, over, len(rough)).astype(float)
    order = np.argsort(cells.element, kind="stable")
    projection, rest = _projected(values[order], view, cells[order], degree)
    return RoughLoad(rough, projection, rest, missed, total, seen, cells)


def known_rough_load(
    data: ng.CoefficientFunction, load: ng.CoefficientFunction, region: ng.Region, degree: int
) -> RoughLoad | None:
    """What `rough_load` found last of the `data` a load is made of, on the same mesh.

    A mesh keeps it as long as it lives: loads are assembled, then the estimate asks again.
    """
    if numbers(data):
        return None
    key = (id(data), str(region.VB()), bytes(np.array(region.Mask())), degree)
    kept = getattr(region.mesh, KEPT, {})
    count = region.mesh.GetNE(region.VB())
    if key not in kept or kept[key][:2] != (data, count):
        return keep_rough_load(data, load, region, degree)
    found: RoughLoad | None = kept[key][2]
    return found


def keep_rough_load(
    data: ng.CoefficientFunction, load: ng.CoefficientFunction, region: ng.Region, degree: int
) -> RoughLoad | None:
    """`rough_load`, kept for `known_rough_load`; numbers are nowhere rough."""
    if numbers(data):
        return None
    key = (id(data), str(region.VB()), bytes(np.array(region.Mask())), degree)
    kept, count = getattr(region.mesh, KEPT, {}), region.mesh.GetNE(region.VB())
    before = kept[key][2] if key in kept and kept[key][:2] == (data, count) else None
    found = rough_load(load, region, degree, before, features_in(data))
    kept[key] = (data, count, found)
    setattr(region.mesh, KEPT, kept)
    return found


def _rough(load: ng.CoefficientFunction, view: View, elements: Index) -> tuple[Mask, float, int]:
    """Those (n,) of `elements` (k,) where a load is rough, the integral of its size, what is seen.

    The last is a number that other values, or other elements, change.
    """
    sizes = view.sizes
    miss, largest, total, seen = np.zeros(len(sizes)), 0.0, 0.0, 0
    least, most = np.zeros((2, len(sizes), load.dim))
    for here, values, left in looked_at(load, view, elements):
        miss[here] = left
        seen = hash((seen, here.tobytes(), sizes[here].tobytes(), values.tobytes()))
        size = np.abs(values).max(axis=2)  # no squares: they may leave the range of numbers
        largest = max(largest, float(size.max(initial=0.0)))
        total += float(size.mean(axis=1) @ sizes[here] ** view.dim) / view.dim
        least[here], most[here] = values.min(axis=1), values.max(axis=1)
    here, beyond = _steps(load, view, elements, least[elements], most[elements])
    miss[here] = np.maximum(miss[here], beyond)
    share = miss * sizes**view.dim / view.dim
    return (miss > SHAPE * largest) | (share > SHARE[view.dim] * total), total, seen


def _steps(
    load: ng.CoefficientFunction, view: View, elements: Index, least: Array, most: Array
) -> tuple[Index, Array]:
    """Those (j,) of `elements` (k,) with steps beside the points looked at, and how large (j,).

    A step whose far side has none of the points leaves values of neighbours that do not meet: there
    it is looked for at the edges. `least` and `most` (k, c) are those at the points.
    """
    ends = view.arrays.elements if view.dim == 2 else view.arrays.facets
    at, shape, varies = ends[elements], (view.mesh.nv, load.dim), most - least
    lowest, highest, most_varied = np.full(shape, np.inf), np.full(shape, -np.inf), np.zeros(shape)
    np.minimum.at(lowest, at, most[:, None])
    np.maximum.at(highest, at, least[:, None])
    np.maximum.at(most_varied, at, varies[:, None])
    apart = np.any(highest - lowest > STEP * most_varied, axis=1)
    some = np.flatnonzero(np.any(apart[at], axis=1))
    if not len(some):
        return elements[some], np.empty(0)
    values = view.look(load, elements[some], beside_edges(view.dim))
    beyond = np.maximum(values - most[some, None], least[some, None] - values)
    beyond = np.maximum(beyond - STEP * varies[some, None], 0.0)
    return elements[some], np.asarray(beyond.max(axis=(1, 2), initial=0.0))


def _projected(
    values: Array, view: View, cells: Cells, degree: int
) -> tuple[ng.GridFunction, Array]:
    """Polynomials with the moments of a load on `cells`, sorted by element; squares (n,) left.

    `values` (k, m, c) are the load times the measure at the points of the k cells.
    """
    space, shapes = view.shapes(degree)
    elements, first = np.unique(cells.element, return_index=True)
    measure = view.evaluate(view.measure, cells.element, cells.points)
    shape = monomials(2 * cells.points - 1, degree)
    moments = np.swapaxes(cells.weights[..., None] * shape, 1, 2) @ values
    moments = np.add.reduceat(moments, first, axis=0)
    moments = np.swapaxes(view.as_monomials(shapes, elements, degree), 1, 2) @ moments
    density, values = cells.weights * measure[..., 0], values / measure
    unit = power_of_two(values)
    squares = np.add.reduceat((density * ((values / unit) ** 2).sum(axis=2)).sum(axis=1), first)
    coefficients = np.linalg.solve(view.mass(shapes, elements, 2 * degree + CURVED), moments)
    _, number, count = moments.shape
    projection = ng.GridFunction(type(space)(view.mesh, order=degree, dim=count))
    at = (elements[:, None] * number + np.arange(number)).ravel()
    projection.vec.FV().NumPy().reshape(-1, count)[at] = coefficients.reshape(-1, count)
    rest = np.zeros(len(view.sizes))
    squares -= (coefficients / unit * (moments / unit)).sum(axis=(1, 2))
    rest[elements] = unit * np.sqrt(np.maximum(squares, 0.0))
    return projection, rest
