"""The next level, planned on what the last one estimates."""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask, root_of_squares
from ..estimator import Estimated
from ..fem import BoundaryTrace, unknowns
from ..mesh import curve, diameters, unresolved
from ..problem import Problem, Triangulation
from ..quadrature import jumping_moduli
from .continuation import Descent, rebuilt
from .exceptions import at_ends, at_limit, settled
from .forecast import Aim, Forecast, planned
from .marking import doerfler, together
from .settings import Refinement
from .singularities import Singularities, ends_of_contact

WRONG = 2.0  # estimate over its forecast from which it is planned half as far; measured .2 to 1.4
HALF = 0.5  # of the unknowns that the tolerance asks for: a first level that knows another load


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
    marked = together(marked, jumping, diameters(mesh))
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
        corners=Triangulation(mesh).corners,
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
        corners=Triangulation(start.mesh).corners,
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
