"""How a run is refined: levels are planned on what the last one, or one of another load, estimates.

The first level for a load beside one that was solved is made from the first mesh.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from numbers import Real

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, across, joined, root_of_squares
from ..estimator import Estimated
from ..fem import ORDERS, check_element, unknowns
from ..mesh import copied, curve, unresolved
from ..problem import MeshArrays, Problem, bisect
from .marking import doerfler
from .refinement import RefinementTree, Refining
from .singularities import Singularities, at_ends, at_limit, below_resolution, ends_of_contact

# Barycentric coordinate: a point so far outside of an element still touches it.
TOUCHING_COORDINATE = 0.1
MAX_MARKINGS = 8  # most that one estimate is good for
# Estimate over its forecast from which it is planned half as far; measured .2 to 1.4.
WRONG_FORECAST = 2.0
# Order that is chosen at least: a first level of order 2 costs as much, and sees less.
LEAST_ORDER = 3
FIRST_GROWTH = 2.0  # of the unknowns up to which the next level is planned at first
# Of the unknowns that the tolerance requires: on the first level of another load.
FIRST_LEVEL_SHARE = 0.5


def best_order(error: float) -> int:
    """The order that reaches a relative error with the fewest unknowns.

    On one mesh orders p have errors c^p, c < 1, and numbers of unknowns ~ p^2; refined from there
    N ~ error^(-2/p). So p + 1 needs fewer than p where the error is less than
    (p / (p + 1))^(p (p + 1)): 0.09 for 3 instead of 2, 0.03 for 4 instead of 3.
    """
    return next((p for p in ORDERS[:-1] if error > (p / (p + 1)) ** (p * (p + 1))), ORDERS[-1])


def check_bool(name: str, value: object) -> None:
    """Raise a TypeError unless `value` is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name}={value!r}: give True or False")


@dataclass(frozen=True)
class Refinement:
    """Refinement of a sequence of levels, and its end: arguments of `adapt`, refused as there."""

    order: int
    element: str
    theta: float
    tolerance: float | None
    max_dofs: float
    guaranteed: bool = False
    # Size from which elements in which contact ends are refined: their segment's length over that
    # of its contact line, relative to the relative estimate.
    ending: float = 0.1
    # Of the unknowns up to which the next level is planned at first, and at most; with a tolerance,
    # at which planning stops anyway, at most its square. 1 marks once a level.
    growth: float = FIRST_GROWTH
    rising: bool = False  # whether levels have higher orders than the first where that is sooner

    def __post_init__(self) -> None:
        """Validate."""
        object.__setattr__(self, "order", check_element(self.order, self.element))
        for name in ("theta", "max_dofs", *(["tolerance"] if self.tolerance is not None else [])):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, Real):
                raise TypeError(f"{name}={value!r} is not a number")
        if not 0 < self.theta <= 1:
            raise ValueError(f"theta={self.theta} must lie in (0, 1]; 0.5 is usual")
        if self.tolerance is not None and not 0 < self.tolerance < 1:
            raise ValueError(
                f"tolerance={self.tolerance} is the error in the energy norm relative to that norm "
                "and must lie between 0 and 1, like 1e-3 (0.1 %); or None"
            )
        if not self.max_dofs > 0:
            raise ValueError(f"max_dofs={self.max_dofs} must be positive, like 100_000")
        check_bool("guaranteed", self.guaranteed)
        if self.guaranteed and self.tolerance is None:
            raise ValueError("guaranteed=True with tolerance=None: give a tolerance, like 1e-3")

    def choosing(self, start: int | None) -> Refinement:
        """The same with the best order: of a `start`, or for the tolerance; 3, then 4 without."""
        if self.element == "physical":
            return self
        if start is not None:
            return replace(self, order=start)
        if self.tolerance is None:
            return replace(self, order=LEAST_ORDER, rising=True)
        return replace(self, order=max(LEAST_ORDER, best_order(self.tolerance)))

    def next_order(self, order: int, error: float) -> int:
        """The order of the level after one of an `order` and relative `error`."""
        return max(order, best_order(error)) if self.rising else order


@dataclass(frozen=True)
class Plan:
    """A level before it is solved."""

    mesh: ng.Mesh  # curved
    order: int  # of the displacement
    corners: Singularities  # of the domain, the same on all levels
    error: float  # root of the sum of squared indicators that is forecast
    growth: float  # of the unknowns up to which it was planned
    tree: RefinementTree
    stuck: bool = False  # whether elements at the geometry kernel's limit are left alone
    ends: bool = False  # whether it cannot be


def next_plan(
    solution: Estimated, refinement: Refinement, last: Plan, share: float, narrow: Mask
) -> Plan:
    """The level after `solution`, planned until a `share` of its error is left.

    By its indicators, but for those that no mesh makes less. Marked are Doerfler's elements and
    those in which contact ends, known to the square of their size as the energy is to that of the
    relative error. In elements `narrow` (ne,) data are narrower than these. Of solids Doerfler's
    elements are marked, once, and nothing is forecast.
    """
    if solution.problem.dim == 3:
        mesh = copied(solution.mesh)
        bisect(mesh, doerfler(solution.indicators, refinement.theta))
        mesh, _ = curve(mesh, last.order, refinement.element)
        return replace(last, mesh=mesh, tree=RefinementTree(mesh, np.arange(mesh.ne)))
    problem, mesh, theta = solution.problem, solution.mesh, refinement.theta
    indicators = _of_resolvable(solution, last.corners)
    order = refinement.next_order(last.order, solution.relative_error_estimate)
    size, pairs = refinement.ending * solution.relative_error_estimate, solution.expected
    limit, marked = at_limit(mesh, mesh.GetCurveOrder()), doerfler(indicators, theta)
    if (marked & limit).any():  # for ever: the others are refined instead
        marked |= doerfler(np.where(limit, 0.0, indicators), theta)
    marked |= at_ends(solution.discrete.space.trace, pairs, size) | narrow
    stuck, marked = bool((marked & limit).any()), marked & ~limit
    if not marked.any():
        return replace(last, ends=True)

    error = root_of_squares(indicators) or 1.0
    most = refinement.growth if refinement.tolerance is None else refinement.growth**2
    wrong = error > WRONG_FORECAST * last.error
    growth = max(last.growth / 2, 1.0) if wrong else min(2 * last.growth, most)
    now = unknowns(mesh, order, refinement.element)
    relative = min(solution.relative_error_estimate, 1.0)
    scale = relative ** (order / last.order - 1)  # errors of orders p on one mesh are c^p
    forecast = Forecast.of(solution, last.corners, (scale * indicators / error) ** 2, order)
    aim = Aim(now * growth, refinement.max_dofs, share, theta, size)
    refining, share = planned(Refining(problem, mesh), marked, forecast, aim, refinement.element)
    mesh, _ = curve(refining.finished(), order, refinement.element)
    tree = replace(last.tree, element=last.tree.element[refining.origin])
    return Plan(mesh, order, last.corners, share * error, growth, tree, stuck, unresolved(mesh))


def _of_resolvable(solution: Estimated, corners: Singularities) -> Array:
    """Indicators (ne,), 0 at `corners` where no mesh makes them less, unless all would be."""
    small = below_resolution(solution.mesh, corners.unresolvable)
    rest = np.where(small, 0.0, solution.indicators)
    return rest if rest.any() else solution.indicators


@dataclass(frozen=True)
class Aim:
    """Aim of a planned level: so many `unknowns`, or `markings`, or so small an `error`."""

    unknowns: float
    max_unknowns: float
    error: float  # over the one that was estimated
    theta: float  # Doerfler's share
    ending: float  # size of elements at ends of contact over their line, per error
    markings: float = MAX_MARKINGS


def planned(
    refining: Refining, marked: Mask, forecast: Forecast, aim: Aim, element: str
) -> tuple[Refining, float]:
    """The next level's mesh, refined but not finished, and the error that is forecast on it.

    The elements `marked` (ne,) are refined, then again and again those that the forecast marks.
    Elements at unresolvable corners count no more once they are small, as in `below_resolution`.
    """
    problem, given, marks, forecasts = refining.problem, refining.given, [marked], [forecast]
    while True:
        parent = refining.bisect(marks[-1])
        forecast = forecasts[-1].after(MeshArrays(refining.mesh).corners, parent)
        small = below_resolution(refining.mesh, forecast.singular.unresolvable)
        forecasts.append(replace(forecast, squares=np.where(small, 0.0, forecast.squares)))
        unknowns, error = refining.unknowns(forecast.order, element), forecasts[-1].error
        if unknowns > aim.max_unknowns and len(marks) > 1:  # one too many: again without it
            refining = Refining(problem, given)
            for again in marks[:-1]:
                refining.bisect(again)
            return refining, forecasts[-2].error
        if unknowns >= aim.unknowns or error <= aim.error or len(marks) >= aim.markings:
            return refining, error
        limit = at_limit(refining.mesh, given.GetCurveOrder())
        marks.append(forecasts[-1].marked(aim.theta, aim.ending * error) & ~limit)
        if not marks[-1].any():
            return refining, error


def areas(corners: Array) -> Array:
    """Areas (...,) of triangles with the `corners` (..., 3, 2)."""
    first, second = corners[..., 1, :] - corners[..., 0, :], corners[..., 2, :] - corners[..., 0, :]
    return np.asarray(np.abs((across(first) * second).sum(axis=-1)) / 2)


def depths(corners: Array, places: Array) -> Array:
    """Least barycentric coordinates (n, k) of `places` (k, 2), or (n, k, 2), negative outside.

    Of each of the triangles with `corners` (n, 3, 2).
    """
    inwards = across(np.roll(corners, -1, axis=1) - corners)
    height = inwards @ np.swapaxes(places, -1, -2) - (corners * inwards).sum(axis=2)[..., None]
    return np.asarray(height.min(axis=1) / (2 * areas(corners))[:, None])


def touching(corners: Array, places: Array) -> Mask:
    """Whether triangles with `corners` (n, 3, 2) touch points `places` (k, 2), (n, k)."""
    return depths(corners, places) >= -TOUCHING_COORDINATE


@dataclass(frozen=True, eq=False)
class Forecast:
    """Squared indicators of a mesh that has not been solved on.

    On an element of area a on which the solution is smooth, eta_T^2 ~ a^(p+1): the square of
    |D^(p+1) u| times h^(2p) times the area. On one that touches a singular point it falls by that
    point's power of the area. Parts of an element share its square by that.
    """

    corners: Array  # (ne, 3, 2), of the elements, lengths
    squares: Array  # (ne,), in shares of the sum of those that were estimated
    order: int  # p, of the displacement
    singular: Singularities  # where the solution is not smooth

    @classmethod
    def of(
        cls, solution: Estimated, corners: Singularities, squares: Array, order: int
    ) -> Forecast:
        """The `squares` (ne,) of the mesh of a solution, singular at `corners` and its ends."""
        singular = joined([corners, ends_of_contact(solution.expected)])
        return cls(MeshArrays(solution.mesh).corners, squares, order, singular)

    @property
    def error(self) -> float:
        """The error, over the one that was estimated."""
        return float(np.sqrt(self.squares.sum()))

    def after(self, corners: Array, parent: Index) -> Forecast:
        """Forecast on elements with `corners` (k, 3, 2), each of them a part of a `parent` (k,)."""
        area = areas(corners)
        share = np.minimum(area / areas(self.corners)[parent], 1.0)
        power = np.full(len(parent), self.order + 1.0)
        new = np.flatnonzero(share < 1)
        at = touching(corners[new], self.singular.places)
        powers = np.where(at, self.singular.powers, np.inf).min(axis=1, initial=np.inf)
        power[new] = np.minimum(powers, self.order + 1)
        squares = self.squares[parent] * share**power
        return replace(self, corners=corners, squares=squares)

    def marked(self, theta: float, share: float) -> Mask:
        """Elements (ne,) to refine: Doerfler's, and large ones in which contact ends."""
        marked = doerfler(np.sqrt(self.squares), theta)
        ends = np.isfinite(self.singular.extents)
        sizes = np.sqrt(2 * areas(self.corners))  # the legs, if two are equal at a right angle
        large = np.flatnonzero(sizes > share * self.singular.extents[ends].min(initial=np.inf))
        at = touching(self.corners[large], self.singular.places[ends])
        limits = share * self.singular.extents[ends]
        marked[large] |= (at & (sizes[large, None] > limits)).any(axis=1)
        return marked


def continued(
    problem: Problem, start: Estimated, first: Plan, refinement: Refinement, goal: float | None
) -> Plan:
    """The first level of a `problem` that is near the one of `start`.

    It has half the unknowns that the `goal`, a relative estimate, requires, or that of `start`: it
    shows where contact ends now, and the level after it can be the last one. `first` is the plan of
    the first mesh, with the tree of the elements of `start`.
    """
    rest = _of_resolvable(start, first.corners)
    order, element, error = refinement.order, refinement.element, root_of_squares(rest)
    known = Forecast.of(start, first.corners, (rest / error) ** 2, order)
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
        depth = depths(corners[part], places[several, None])[:, 0]
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
