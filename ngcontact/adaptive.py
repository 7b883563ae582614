"""Solve on one mesh, or on a sequence of adaptively refined ones."""

from __future__ import annotations

import logging
import math
from collections.abc import Iterator
from dataclasses import replace
from numbers import Real

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from .adaptivity import doerfler, refined
from .arrays import power_of_two
from .contact import ending_segments
from .errors import ConvergenceError
from .fem import bulk_moduli, check_element, shear_moduli, unknowns, warn_of_locking
from .mesh import curve, first_mesh
from .one_mesh import solve_on
from .problem import Problem
from .solution import Solution

ROUND_OFF = 1e-12  # relative estimate at which refinement stops: the solution is exact
SMALL = 1e-4  # ... above which no round-off reaches
NOISE = 100 * np.finfo(float).eps  # of a stress, relative to its terms; measured 0.5 to 50 eps
END = 0.1  # size of elements in which contact ends, of its line, over the relative estimate

log = logging.getLogger("ngcontact")


def adapt(
    problem: Problem,
    *,
    maxh: float | None = None,
    order: int = 4,
    element: str = "isoparametric",
    theta: float = 0.5,
    tolerance: float | None = None,
    max_dofs: int = 100_000,
) -> Iterator[Solution]:
    """Solve, estimate, mark, refine: one `Solution` per level.

    Parameters
    ----------
    problem : Problem
        The continuous problem.
    maxh : float, optional
        Largest element size of the first mesh; when left out an eighth of the geometry, half of
        that on bounded contact zones.
    order, element
        As in `solve`. Order 4 reaches errors of 1e-3 to 1e-5 soonest (docs/adaptivity.md), order 3
        errors of a percent.
    theta : float
        Doerfler's share of the squared indicators that is marked, in (0, 1].
    tolerance : float, optional
        Relative estimated error in the energy norm at which to stop.
    max_dofs : int
        Number of unknowns that no level exceeds.

    Yields
    ------
    Solution
        Every one stays valid. Its estimate is made when it is asked for, printing it included, or
        when the next level is.

    Raises
    ------
    ValueError, TypeError
        Bad input, before any assembly; also a first mesh of more than `max_dofs` unknowns, or a
        mesh with segments of curved edges below 1e-6 units.
    ConvergenceError
        The active set of a level did not settle.
    """
    check_element(order, element)
    if not 0 < _number("theta", theta) <= 1:
        raise ValueError(f"theta={theta} must lie in (0, 1]; 0.5 is usual")
    if tolerance is not None and not _number("tolerance", tolerance) > 0:
        raise ValueError(f"tolerance={tolerance} must be positive, like 1e-3, or None")
    if not _number("max_dofs", max_dofs) > 0:
        raise ValueError(f"max_dofs={max_dofs} must be positive, like 100_000")
    mesh = first_mesh(problem, maxh)
    problem.check(mesh)
    mesh, _ = curve(mesh, order, element)
    if unknowns(mesh, order, element) > max_dofs:
        raise ValueError(
            f"the first mesh has {unknowns(mesh, order, element)} unknowns, more than "
            f"max_dofs={max_dofs}; give a larger maxh or max_dofs"
        )
    warn_of_locking(problem, mesh, order)
    return _levels(problem, mesh, order, element, theta, tolerance, max_dofs)


def _number(name: str, value: object) -> float:
    """`value`, or a TypeError unless it is a real number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name}={value!r} is not a number")
    return float(value)


def _marked(solution: Solution, theta: float) -> NDArray[np.bool_]:
    """Elements (ne,) to refine: Doerfler's, and those in which contact ends.

    The end of contact is known to the square of these elements' size, the energy to the square of
    the relative error: both stay of one size.
    """
    marked = doerfler(solution.indicators, theta)
    trace = solution.discrete.space.trace
    for pair in solution.pairs:
        line = pair.line
        segments = line.segments[ending_segments(line, pair.transitions)]
        sides = trace.curve[segments]
        length = np.linalg.norm(sides[:, -1] - sides[:, 0], axis=1)
        extent = np.linalg.norm(np.ptp(line.position, axis=0)) if line.node.size else 0.0
        coarse = length > END * solution.relative_error_estimate * extent
        marked[trace.element[segments[coarse]]] = True
    return marked


def _at_round_off(solution: Solution) -> bool:
    """Whether the estimate is round-off of terms that cancel, as where bodies move rigidly.

    Where div u cancels the terms of the stress are of size kappa |grad u|. The estimate divides
    them by the root of mu, their energy by the root of kappa only.
    """
    u = solution.displacement.vec.FV().NumPy()
    size = power_of_two(u)  # squares must stay in range
    terms = size * float(np.sqrt(solution.discrete.space.diagonal @ (u / size) ** 2))
    if solution.error_estimate > SMALL * terms:  # as nearly always
        return False
    problem, mesh = solution.problem, solution.mesh
    ratio = float((bulk_moduli(problem, mesh) / shear_moduli(problem, mesh)).max())
    return solution.error_estimate <= max(ROUND_OFF, NOISE * math.sqrt(ratio)) * terms


def _levels(
    problem: Problem,
    mesh: ng.Mesh,
    order: int,
    element: str,
    theta: float,
    tolerance: float | None,
    max_dofs: int,
) -> Iterator[Solution]:
    """Levels of `adapt` on checked input."""
    solution: Solution | None = None
    while unknowns(mesh, order, element) <= max_dofs:
        solution = replace(solve_on(problem, mesh, order, element, solution), adaptive=True)
        solution.discrete.systems.forget()  # a level's factorisation is of no use to the next one
        yield solution
        error = solution.relative_error_estimate
        if not np.isfinite(solution.error_estimate):  # it would mark nothing, for ever
            raise ConvergenceError(
                f"the error estimate is {solution.error_estimate}, so nothing can be refined; "
                "choose units in which the squares of loads and displacements are numbers",
                iterate=solution.minimiser,
            )
        log.info("%s", solution)
        if error <= max(tolerance or 0.0, ROUND_OFF) or _at_round_off(solution):
            return
        mesh = refined(problem, solution.mesh, _marked(solution, theta))
        mesh, _ = curve(mesh, order, element)
    if tolerance is not None:
        log.warning(
            "the estimate is %.2e, more than tolerance=%g: the next level would exceed max_dofs=%g",
            *(error, tolerance, max_dofs),
        )
