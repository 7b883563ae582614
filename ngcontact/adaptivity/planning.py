"""How a run is refined, and the next level, planned on what the last one estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, across, joined, root_of_squares
from ..estimator import Estimated
from ..fem import ORDERS, check_element, unknowns
from ..mesh import copied, curve, unresolved
from ..problem import MeshArrays, bisect
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
    small = below_resolution(mesh, last.corners.unresolvable)
    indicators = np.where(small, 0.0, solution.indicators)
    if not indicators.any():
        indicators = solution.indicators
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
    forecast = Forecast(
        corners=MeshArrays(mesh).corners,
        squares=(scale * indicators / error) ** 2,
        order=order,
        singular=joined([last.corners, ends_of_contact(pairs)]),
    )
    aim = Aim(now * growth, refinement.max_dofs, share, theta, size)
    refining, share = planned(Refining(problem, mesh), marked, forecast, aim, refinement.element)
    mesh, _ = curve(refining.finished(), order, refinement.element)
    tree = replace(last.tree, element=last.tree.element[refining.origin])
    return Plan(mesh, order, last.corners, share * error, growth, tree, stuck, unresolved(mesh))


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
    """Least barycentric coordinates (...,) of `places` (..., 2), negative outside of triangles.

    Of triangles with `corners` (..., 3, 2).
    """
    inwards = across(np.roll(corners, -1, axis=-2) - corners)
    height = np.einsum("...d,...id->...i", places, inwards) - (corners * inwards).sum(axis=-1)
    return np.asarray(height.min(axis=-1) / (2 * areas(corners)))


def touching(corners: Array, places: Array) -> Mask:
    """Whether triangles with `corners` (n, 3, 2) touch points `places` (k, 2), (n, k)."""
    return depths(corners[:, None], places) >= -TOUCHING_COORDINATE


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
