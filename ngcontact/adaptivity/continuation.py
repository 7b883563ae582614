"""The mesh for a load beside one that was solved: from the first mesh, guided by its indicators."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from ..arrays import Array, Index, Mask, joined, root_of_squares
from ..estimator import Estimated
from ..fem import unknowns
from ..mesh import curve
from ..problem import MeshArrays, Problem
from .marking import doerfler
from .planning import Aim, Forecast, Plan, Refinement, areas, depths, planned, touching
from .refinement import RefinementTree, Refining
from .singularities import at_limit, below_resolution, ends_of_contact

# Of the unknowns that the tolerance requires: on the first level of another load.
FIRST_LEVEL_SHARE = 0.5


def continued(
    problem: Problem, start: Estimated, first: Plan, refinement: Refinement, goal: float | None
) -> Plan:
    """The first level of a `problem` that is near the one of `start`.

    It has half the unknowns that the `goal`, a relative estimate, requires, or that of `start`: it
    shows where contact ends now, and the level after it can be the last one. `first` is the plan of
    the first mesh, with the tree of the elements of `start`.
    """
    small = below_resolution(start.mesh, first.corners.unresolvable)
    rest = start.indicators if small.all() else np.where(small, 0.0, start.indicators)
    order, element, error = refinement.order, refinement.element, root_of_squares(rest)
    known = Forecast(
        corners=MeshArrays(start.mesh).corners,
        squares=(rest / error) ** 2,
        order=order,
        singular=joined([first.corners, ends_of_contact(start.expected)]),
    )
    now = start.relative_error_estimate * error / root_of_squares(start.indicators)
    share = (goal or now) / now * FIRST_LEVEL_SHARE ** (-order / 2)  # unknowns ~ error^(-2/p)
    most = refinement.growth**2 * unknowns(start.mesh, order, element)
    aim = Aim(most, refinement.max_dofs, share, refinement.theta, refinement.ending, np.inf)
    refining = rebuilt(problem, first.tree, known, aim, element)
    finer = refining.mesh.ne > refining.given.ne
    mesh, _ = curve(refining.finished() if finer else refining.given, order, element)
    tree = RefinementTree(refining.given, refining.origin)
    if unknowns(mesh, order, element) > refinement.max_dofs:
        mesh, tree = first.mesh, RefinementTree(first.mesh, np.arange(first.mesh.ne))
    return replace(first, mesh=mesh, tree=tree)


def rebuilt(
    problem: Problem, tree: RefinementTree, known: Forecast, aim: Aim, element: str
) -> Refining:
    """The mesh, refined from the first one, of which `known` squares forecast the aim's error."""
    refining, corners = Refining(problem, tree.mesh), MeshArrays(tree.mesh).corners
    squares = transferred(known, tree.element, corners)
    guess = TransferredForecast(
        corners, squares, known.order, known.singular, known, tree.element, aim.error
    )
    limit = at_limit(tree.mesh, tree.mesh.GetCurveOrder())
    marked = guess.marked(aim.theta, aim.ending) & ~limit
    if guess.error > aim.error and marked.any():
        refining, _ = planned(refining, marked, guess, aim, element)
    return refining


@dataclass(frozen=True, eq=False)
class TransferredForecast(Forecast):
    """Squared indicators on coarser elements, or others, from those of a mesh that was solved on.

    The indicators of known elements in one element make a mean of |D^(p+1) u|^2, or at a singular
    point its coefficient; both give the element's indicator by the powers of `Forecast`.
    """

    known: Forecast  # of the mesh that was solved on, n elements
    inside: Index  # (n,), the element in which the centre of each of these lies
    aim: float  # the error to reach, over the known one

    def after(self, corners: Array, parent: Index) -> TransferredForecast:
        """Forecast on elements with `corners` (k, 3, 2), each of them a part of a `parent` (k,)."""
        inherited = super().after(corners, parent).squares
        inside = _inside(self.known.corners.mean(axis=1), self.inside, corners, parent)
        squares = transferred(self.known, inside, corners)
        squares = np.where(np.isnan(squares), inherited, squares)
        return replace(self, corners=corners, squares=squares, inside=inside)

    def marked(self, theta: float, share: float) -> Mask:
        """Elements (ne,) to refine: so many that the others have the error `aim`; ends move."""
        rest = (self.aim / self.error) ** 2 if self.error > 0 else 1.0
        return doerfler(np.sqrt(self.squares), 1.0 - min(rest, 1.0))


def _inside(places: Array, inside: Index, corners: Array, parent: Index) -> Index:
    """The parts (n,) of elements `inside` (n,) in which, or nearest to which, places (n, 2) lie."""
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


def transferred(known: Forecast, inside: Index, corners: Array) -> Array:
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
