"""How a run is refined, and the next level, planned on what the last one estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask, root_of_squares
from ..estimator import Estimated
from ..fem import ORDERS, BoundaryTrace, check_element, unknowns
from ..mesh import curve, unresolved
from ..problem import MeshArrays, Problem
from ..quadrature import jumping_moduli
from .continuation import Descent, rebuilt
from .marking import doerfler, together
from .refinement import Aim, Forecast, planned
from .singularities import Singularities, at_ends, at_limit, ends_of_contact, settled

WRONG = 2.0  # estimate over its forecast from which it is planned half as far; measured .2 to 1.4
HALF = 0.5  # of the unknowns that the tolerance asks for: a first level that knows another load
FIRST = 3  # order that is chosen at least: a first level of order 2 costs as much, and sees less
GROWTH = 2.0  # of the unknowns up to which the next level is planned at first


def _number(name: str, value: object) -> float:
    """`value`, or a TypeError unless it is a real number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name}={value!r} is not a number")
    return float(value)


def best_order(error: float) -> int:
    """The order that reaches a relative error with the fewest unknowns.

    On one mesh orders p have errors c^p, c < 1, and numbers of unknowns ~ p^2; refined from there
    N ~ error^(-2/p). So p + 1 needs fewer than p where the error is less than
    (p / (p + 1))^(p (p + 1)): 0.09 for 3 instead of 2, 0.03 for 4 instead of 3.
    """
    return next((p for p in ORDERS[:-1] if error > (p / (p + 1)) ** (p * (p + 1))), ORDERS[-1])


def truth(name: str, value: object) -> None:
    """Raise a TypeError unless `value` is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name}={value!r}: give True or False")


@dataclass(frozen=True)
class Refinement:
    """How a sequence of levels is refined, and when it ends.

    Raises `ValueError` or `TypeError` with the offending value and what would be right.

    Parameters
    ----------
    order, element, theta, tolerance, max_dofs, guaranteed
        As in `adapt`.
    ending : float
        Size from which elements in which contact ends are refined: their segment's length over
        that of its contact line, relative to the relative estimate.
    growth : float
        Of the unknowns up to which the next level is planned at first, and at most; with a
        tolerance, at which planning stops anyway, at most its square. 1 marks once a level.
    rising : bool
        Whether levels have higher orders than the first where that is sooner.
    """

    order: int
    element: str
    theta: float
    tolerance: float | None
    max_dofs: float
    guaranteed: bool = False
    ending: float = 0.1
    growth: float = GROWTH
    rising: bool = False

    def __post_init__(self) -> None:
        """Validate."""
        object.__setattr__(self, "order", check_element(self.order, self.element))
        if not 0 < _number("theta", self.theta) <= 1:
            raise ValueError(f"theta={self.theta} must lie in (0, 1]; 0.5 is usual")
        if self.tolerance is not None and not 0 < _number("tolerance", self.tolerance) < 1:
            raise ValueError(
                f"tolerance={self.tolerance} is the error in the energy norm relative to that norm "
                "and must lie between 0 and 1, like 1e-3 (0.1 %); or None"
            )
        if not _number("max_dofs", self.max_dofs) > 0:
            raise ValueError(f"max_dofs={self.max_dofs} must be positive, like 100_000")
        truth("guaranteed", self.guaranteed)
        if self.guaranteed and self.tolerance is None:
            raise ValueError("guaranteed=True with tolerance=None: give a tolerance, like 1e-3")

    def choosing(self, start: int | None) -> Refinement:
        """The same with the order that is best: that of a `start`, or for the tolerance.

        Without both the first levels have order 3, and later ones 4. `element` "physical" has 1.
        """
        if self.element == "physical":
            return self
        if start is not None:
            return replace(self, order=start)
        if self.tolerance is None:
            return replace(self, order=FIRST, rising=True)
        return replace(self, order=max(FIRST, best_order(self.tolerance)))

    def next_order(self, order: int, error: float) -> int:
        """The order of the level after one of an `order` and relative `error`."""
        return max(order, best_order(error)) if self.rising else order


@dataclass(frozen=True)
class Plan:
    """A level before it is solved.

    Attributes
    ----------
    mesh : ng.Mesh
        Curved.
    order : int
        Degree of the displacement.
    corners : Singularities
        Of the domain, the same on all levels.
    error : float
        Root of the sum of squared indicators that is forecast.
    growth : float
        Of the unknowns up to which it was planned.
    descent : Descent
        Where the elements come from.
    stuck, ends : bool
        Whether elements at the geometry kernel's limit are left alone, and whether it cannot be.
    """

    mesh: ng.Mesh
    order: int
    corners: Singularities
    error: float
    growth: float
    descent: Descent
    stuck: bool = False
    ends: bool = False


def next_plan(
    solution: Estimated,
    trace: BoundaryTrace,
    refinement: Refinement,
    last: Plan,
    indicators: Array,
    share: float,
    narrow: Mask,
) -> Plan:
    """The level after `solution`, planned until a `share` of its error is left.

    By its `indicators` (ne,), but for those that no mesh makes less. Marked are Doerfler's
    elements and those in which contact ends, known to the square of their size as the energy is to
    that of the relative error. Elements in which moduli jump are refined together, and nothing is
    forecast. `trace` is that of the mesh; in elements `narrow` (ne,) data are narrower than these.
    """
    if not indicators.any():
        indicators = solution.indicators
    problem, mesh, theta = solution.problem, solution.mesh, refinement.theta
    order = refinement.next_order(last.order, solution.relative_error_estimate)
    size = refinement.ending * solution.relative_error_estimate
    jumping, limit = jumping_moduli(problem, mesh), at_limit(mesh, mesh.GetCurveOrder())
    marked = doerfler(indicators, theta)
    if (marked & limit).any():  # for ever: the others are refined instead
        marked |= doerfler(np.where(limit, 0.0, indicators), theta)
    marked = together(marked, jumping, MeshArrays(mesh).diameters)
    marked |= at_ends(trace, solution.pairs, size) | narrow
    stuck, marked = bool((marked & limit).any()), marked & ~limit
    if not marked.any():
        return replace(last, ends=True)

    error = root_of_squares(indicators) or 1.0
    most = refinement.growth if refinement.tolerance is None else refinement.growth**2
    growth = max(last.growth / 2, 1.0) if error > WRONG * last.error else min(2 * last.growth, most)
    now = unknowns(mesh, order, refinement.element)
    relative = min(solution.relative_error_estimate, 1.0)
    scale = relative ** (order / last.order - 1)  # errors of orders p on one mesh are c^p
    forecast = Forecast(
        corners=MeshArrays(mesh).corners,
        squares=(scale * indicators / error) ** 2,
        order=order,
        singular=last.corners.joined(ends_of_contact(solution.pairs)),
    )
    growth = 1.0 if jumping.any() else growth
    aim = Aim(now * growth, refinement.max_dofs, share, theta, size)
    mesh, share, parent = planned(problem, mesh, marked, forecast, aim, refinement.element)
    mesh, _ = curve(mesh, order, refinement.element)
    descent = last.descent.of_parts(parent)
    return Plan(mesh, order, last.corners, share * error, growth, descent, stuck, unresolved(mesh))


def continued(
    problem: Problem, start: Estimated, first: Plan, refinement: Refinement, goal: float | None
) -> Plan:
    """The first level of a `problem` that is near the one of `start`.

    It has half the unknowns that the `goal` asks for, a relative estimate, or that of `start`,
    which is not round-off: it will tell where contact ends now, and the level after it can be the
    last one. `first` is the plan of the first mesh, with the descent of the elements of `start`.
    """
    small = settled(start.mesh, first.corners.unresolvable)
    rest = start.indicators if small.all() else np.where(small, 0.0, start.indicators)
    order, element, error = refinement.order, refinement.element, root_of_squares(rest)
    known = Forecast(
        corners=MeshArrays(start.mesh).corners,
        squares=(rest / error) ** 2,
        order=order,
        singular=first.corners.joined(ends_of_contact(start.pairs)),
    )
    now = start.relative_error_estimate * error / root_of_squares(start.indicators)
    share = (goal or now) / now * HALF ** (-order / 2)  # unknowns ~ error^(-2/p)
    most = refinement.growth**2 * unknowns(start.mesh, order, element)
    aim = Aim(most, refinement.max_dofs, share, refinement.theta, refinement.ending, np.inf)
    mesh, descent = rebuilt(problem, first.descent, known, aim, element)
    mesh, _ = curve(mesh, order, element)
    if unknowns(mesh, order, element) > refinement.max_dofs:
        mesh, descent = first.mesh, Descent.first(first.mesh)
    return replace(first, mesh=mesh, descent=descent)
