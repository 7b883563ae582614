"""The mesh for a load beside one that was solved: from the first mesh, guided by its indicators."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..problem import MeshArrays, Problem
from .marking import doerfler
from .refinement import Aim, Forecast, areas, depths, planned, touching
from .singularities import at_limit


@dataclass(frozen=True, eq=False)
class Descent:
    """The first mesh of a sequence, and where the elements of a later one come from.

    Attributes
    ----------
    mesh : ng.Mesh
        The first one.
    element : ndarray of int (ne,)
        Its element of which each of the later ones is a part.
    """

    mesh: ng.Mesh
    element: Index

    @staticmethod
    def first(mesh: ng.Mesh) -> Descent:
        """Of a mesh that begins a sequence."""
        return Descent(mesh, np.arange(mesh.ne))

    def of_parts(self, parent: Index) -> Descent:
        """Of a mesh whose elements are parts of the `parent` (k,) elements."""
        return Descent(self.mesh, self.element[parent])


@dataclass(frozen=True, eq=False)
class Recalled(Forecast):
    """Squared indicators on coarser elements, or others, from those of a mesh that was solved on.

    The indicators of known elements in one element make a mean of |D^(p+1) u|^2, or at a singular
    point its coefficient; both tell the element's indicator by the powers of `Forecast`.

    Attributes
    ----------
    known : Forecast
        Of the mesh that was solved on, n elements.
    inside : ndarray of int (n,)
        The element in which the centre of each of these lies.
    aim : float
        Error over the known one that is asked for.
    """

    known: Forecast
    inside: Index
    aim: float

    def after(self, corners: Array, parent: Index) -> Recalled:
        """On elements with `corners` (k, 3, 2), each of them a part of a `parent` (k,)."""
        inherited = super().after(corners, parent).squares
        inside = _inside(self.known.corners.mean(axis=1), self.inside, corners, parent)
        squares = recalled(self.known, inside, corners)
        squares = np.where(np.isnan(squares), inherited, squares)
        return replace(self, corners=corners, squares=squares, inside=inside)

    def marked(self, theta: float, share: float) -> Mask:
        """Elements (ne,) to refine: so many that the others have the error asked for.

        That tells the share instead of `theta`. Contact will end elsewhere: `share` is of no use.
        """
        rest = (self.aim / self.error) ** 2 if self.error > 0 else 1.0
        return doerfler(np.sqrt(self.squares), 1.0 - min(rest, 1.0))


def _inside(places: Array, inside: Index, corners: Array, parent: Index) -> Index:
    """The element (n,) with `corners` (k, 3, 2) in which, or nearest, each of the `places` lies.

    Of the parts, by `parent` (k,), of the element `inside` (n,) it lies in.
    """
    order, count = np.argsort(parent, kind="stable"), np.bincount(parent)
    first = np.cumsum(count) - count
    found, deepest = order[first[inside]], np.full(len(inside), -math.inf)
    for number in range(count.max()):
        several = np.flatnonzero((count[inside] > 1) & (number < count[inside]))
        part = order[first[inside[several]] + number]
        depth = depths(corners[part], places[several])
        better = depth > deepest[several]
        found[several[better]], deepest[several[better]] = part[better], depth[better]
    return found


def recalled(known: Forecast, inside: Index, corners: Array) -> Array:
    """Squared indicators (k,) of elements with `corners` (k, 3, 2); NaN where nothing is known.

    `known` are those of n other elements, `inside` (n,) the elements in which they lie.
    """
    whole = areas(known.corners).sum()
    area, old = areas(corners) / whole, areas(known.corners) / whole

    def sums(values: Array) -> Array:
        return np.bincount(inside, values, len(area)).astype(float)

    power = known.order + 1.0
    with np.errstate(invalid="ignore"):
        smooth = sums(known.squares * old**-known.order) / sums(old) * area**power
    at, was_at = (touching(c, known.singular.places) for c in (corners, known.corners))
    for number, power in enumerate(known.singular.powers):
        touched = np.where(was_at[:, number], old**-power * known.squares, 0.0)
        coefficient, seen = sums(touched), sums(was_at[:, number].astype(float)) > 0
        with_it = at[:, number] & seen
        smooth[with_it] = np.minimum(smooth[with_it], (coefficient * area**power)[with_it])
    return smooth


def rebuilt(
    problem: Problem, descent: Descent, known: Forecast, aim: Aim, element: str
) -> tuple[ng.Mesh, Descent]:
    """The mesh, straight-sided, of which a solution's `known` squares forecast the aim's error.

    Made from the first mesh of its `descent`: what was refined for another load is not, if this
    one does not need it.
    """
    mesh = descent.mesh
    corners = MeshArrays(mesh).corners
    squares = recalled(known, descent.element, corners)
    guess = Recalled(
        corners, squares, known.order, known.singular, known, descent.element, aim.error
    )
    marked = guess.marked(aim.theta, aim.ending) & ~at_limit(mesh, mesh.GetCurveOrder())
    if guess.error <= aim.error or not marked.any():
        return mesh, Descent.first(mesh)
    mesh, _, parent = planned(problem, mesh, marked, guess, aim, element)
    return mesh, Descent.first(descent.mesh).of_parts(parent)
