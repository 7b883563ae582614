"""Solve, estimate, mark, refine: a sequence of adaptively refined meshes."""

from __future__ import annotations

import logging
import math
from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import NoReturn

import ngsolve as ng
import numpy as np

from .adaptivity import (
    Descent,
    Plan,
    Refinement,
    continued,
    corners,
    next_plan,
    settled,
    truth,
    unresolvable,
    warn_of_limit,
)
from .arrays import root_of_squares
from .errors import ConvergenceError, warn
from .estimator import refuse_bound
from .fem import boundary_trace, unknowns
from .mesh import curve, first_mesh
from .one_mesh import check_continuation, solve_on, with_warnings
from .plausibility import EXACT, at_round_off, contradictions, warn_of_implausible
from .problem import Problem
from .quadrature import look, unresolved
from .results import with_progress
from .solution import Solution

SHARPER = 0.2  # bound over estimate that is hoped for at first; measured: 0.17 to 1

ONE_PER_LEVEL = (
    "adapt(...) {}: it yields one Solution per level; loop over it, or take the last one by "
    "*_, solution = adapt(...)"
)

log = logging.getLogger("ngcontact")


def adapt(
    problem: Problem,
    *,
    maxh: float | None = None,
    order: int | None = 4,
    element: str = "isoparametric",
    theta: float = 0.5,
    tolerance: float | None = None,
    max_dofs: int = 100_000,
    guaranteed: bool = False,
    start: Solution | None = None,
    progress: bool = False,
) -> Iterator[Solution]:
    """Solve, estimate, mark, refine: one `Solution` per level.

    Parameters
    ----------
    problem : Problem
        The continuous problem.
    maxh : float, optional
        Largest element size of the first mesh; when left out an eighth of the geometry, half of
        that on bounded contact zones.
    order : int, optional
        Degree, 1 to 4. 4 is best for errors of 1e-3 and less; None chooses (docs/adaptivity.md).
    element : str
        As in `solve`.
    theta : float
        Doerfler's share of the squared indicators that is marked, in (0, 1].
    tolerance : float, optional
        Relative estimated error in the energy norm, less than 1, at which to stop. Elements within
        a thousandth of the extent of corners where supports contradict each other do not count.
    max_dofs : int
        Number of unknowns that no level exceeds.
    guaranteed : bool
        Stop at `Solution.relative_error_bound`, which is made where the estimate suggests that it
        meets the tolerance.
    start : Solution, optional
        Of another load on the same geometry, with the same pairs, order and element. The first
        level has a mesh that fits it, finer or coarser than its own, and starts from its contact.
    progress : bool
        Tell each level when it is done: a line in a terminal, a growing table in a notebook.

    Yields
    ------
    Solution
        Every one stays valid. Its estimate is made when it is printed, asked for, or refined.

    Raises
    ------
    ValueError, TypeError
        Bad input, before any assembly; also a first mesh of more than `max_dofs` unknowns; with
        `guaranteed`, at the first level, a problem for which no bound is known.
    ConvergenceError
        The active set of a level did not settle.
    """
    plain = Refinement(1, element, theta, tolerance, max_dofs, guaranteed)
    refinement = _with_order(plain, order, start)
    truth("progress", progress)
    mesh = first_level(problem, maxh, refinement, start)
    look(problem, mesh)
    if guaranteed:
        _refuse_infinite_energy(problem, mesh)
    warn_of_implausible(problem, mesh, refinement.order)
    solutions = with_warnings(levels(problem, mesh, refinement, start=start))
    return Run(with_progress(solutions, tolerance, max_dofs) if progress else solutions)


class Run(Iterator[Solution]):
    """The levels of `adapt`, made one by one; told from a `Solution`, which it is easily taken for.

    Parameters
    ----------
    solutions : iterator of Solution
        A generator.
    """

    def __init__(self, solutions: Generator[Solution]) -> None:
        self._solutions = solutions

    def __next__(self) -> Solution:
        """The next level."""
        return next(self._solutions)

    def close(self) -> None:
        """Make no more levels."""
        self._solutions.close()

    def __getattr__(self, name: str) -> NoReturn:
        """Say that a level has what is asked for."""
        raise AttributeError(ONE_PER_LEVEL.format(f"has no {name}"))

    def __getitem__(self, number: object) -> NoReturn:
        """Say how to get the last level."""
        raise TypeError(ONE_PER_LEVEL.format(f"has no [{number!r}]"))


def _refuse_infinite_energy(problem: Problem, mesh: ng.Mesh) -> None:
    """Raise where supports contradict each other: no refinement makes a bound there."""
    if found := contradictions(problem, mesh):
        x, y = found[0].place
        raise ValueError(
            f"no guaranteed bound is known for supports that contradict each other: "
            f"{found[0].message} at ({x:.6g}, {y:.6g}), and no displacement of finite energy takes "
            "both values; make them equal there, or leave guaranteed out"
        )


def _with_order(plain: Refinement, order: int | None, start: object) -> Refinement:
    """With the order that is given, or that of a `start`, or the best one."""
    if order is not None:
        return replace(plain, order=order)
    return plain.choosing(start.order if isinstance(start, Solution) else None)


def first_level(
    problem: Problem, maxh: float | None, refinement: Refinement, start: Solution | None = None
) -> ng.Mesh:
    """The first mesh of `levels`, checked and curved; arguments and errors of `adapt`."""
    order, element, max_dofs = refinement.order, refinement.element, refinement.max_dofs
    if start is None:
        mesh = first_mesh(problem, maxh)
    elif maxh is not None:
        raise ValueError(f"maxh={maxh} has no effect on the mesh of start; give one of them")
    else:
        check_continuation(problem, start, order, element)
        mesh = _descent(start).mesh
    problem.check(mesh)
    mesh, _ = curve(mesh, order, element)
    if unknowns(mesh, order, element) > max_dofs:
        raise ValueError(
            f"the first mesh has {unknowns(mesh, order, element)} unknowns, more than "
            f"max_dofs={max_dofs}; give a larger maxh or max_dofs"
        )
    return mesh


def _descent(start: Solution) -> Descent:
    """Of the elements of `start`; its own mesh is the first one of a sequence that starts there."""
    return start.descent or Descent.first(start.mesh)


def _first_plan(
    problem: Problem, mesh: ng.Mesh, refinement: Refinement, start: Solution | None
) -> Plan:
    """The first level, of which nothing is forecast but by `start`."""
    trace = boundary_trace(mesh, 1)
    found = corners(problem, trace)
    found = found.joined(unresolvable([one.place for one in contradictions(problem, mesh)]))
    plan = Plan(mesh, refinement.order, found, math.inf, refinement.growth, Descent.first(mesh))
    if start is None or at_round_off(
        start.problem, start.discrete.space, start.displacement, start.error_estimate
    ):
        return plan
    goal, plan = refinement.tolerance, replace(plan, descent=_descent(start))
    if refinement.guaranteed and goal is not None:
        goal /= _ratio(start) if start.bounded else SHARPER
    return continued(problem, start, plan, refinement, goal)


def _ratio(solution: Solution) -> float:
    """Bound over estimate."""
    estimate = solution.relative_error_estimate
    return solution.relative_error_bound / estimate if estimate > 0 else SHARPER


def _bounded(solution: Solution, refinement: Refinement, ratio: float) -> tuple[float, float]:
    """The relative bound where it may meet the tolerance, else inf; and the bound per estimate.

    `ratio` is that of the last bound that was made.
    """
    estimate = solution.relative_error_estimate
    if not solution.bounded and not ratio * estimate <= (refinement.tolerance or 0.0):
        return math.inf, ratio
    return solution.relative_error_bound, _ratio(solution) if estimate > 0 else ratio


def levels(
    problem: Problem,
    mesh: ng.Mesh,
    refinement: Refinement,
    start: Solution | None = None,
) -> Generator[Solution]:
    """Levels from a first mesh on, of which names and values are known to be right.

    Parameters
    ----------
    problem, mesh, refinement
        The continuous problem; the first mesh, curved as the element asks; what is refined, and
        when to stop.
    start
        A solution for another load, of whose sequence `mesh` is the first.
    """
    element = refinement.element
    solution: Solution | None = None
    ratio, told, plan = SHARPER, False, _first_plan(problem, mesh, refinement, start)
    while unknowns(plan.mesh, plan.order, element) <= refinement.max_dofs:
        if solution is not None:  # its factorisation is of no use to the next one
            solution.discrete.systems.forget()
        solution = solve_on(problem, plan.mesh, plan.order, element, solution or start)
        problem = solution.problem  # roles that fail are exchanged once
        solution = replace(solution, adaptive=True, descent=plan.descent)
        narrow = unresolved(problem, solution.mesh, in_bounds=refinement.guaranteed)
        if refinement.guaranteed:
            refuse_bound(problem, solution.discrete.space.trace, solution.pairs)
            error, ratio = (math.inf, ratio) if narrow else _bounded(solution, refinement, ratio)
        yield solution
        if not refinement.guaranteed:
            error = solution.relative_error_estimate
        if not np.isfinite(solution.error_estimate):  # it would mark nothing, for ever
            raise ConvergenceError(
                f"the error estimate is {solution.error_estimate}, so nothing can be refined; "
                "choose units in which the squares of loads and displacements are numbers",
                iterate=solution.minimiser,
            )
        log.info("%s", solution)
        small = settled(solution.mesh, plan.corners.unresolvable)
        if small.any() and not refinement.guaranteed:  # no mesh makes the estimate less there
            error *= root_of_squares(solution.indicators[~small]) / solution.error_estimate
        if not narrow and (
            error <= max(refinement.tolerance or 0.0, EXACT)
            or at_round_off(
                problem, solution.discrete.space, solution.displacement, solution.error_estimate
            )
        ):
            return
        now = ratio * solution.relative_error_estimate if refinement.guaranteed else error
        rest = np.where(small, 0.0, solution.indicators)
        share = (refinement.tolerance or 0.0) / now if now else 1.0
        seen = np.any([one.elements for one in narrow], axis=0) if narrow else np.zeros_like(small)
        plan = next_plan(
            solution, solution.discrete.space.trace, refinement, plan, rest, share, seen
        )
        if plan.ends or (plan.stuck and not told):
            told = True
            warn_of_limit(solution.discrete.space.trace, ends=plan.ends)
        if plan.ends:
            return
    if solution is not None:
        if not narrow:  # of which there is a warning
            _warn_of_missed(solution, refinement, error, outside=bool(small.any()))


def _warn_of_missed(
    solution: Solution, refinement: Refinement, error: float, *, outside: bool
) -> None:
    """Warn where `max_dofs` keeps the last solution out of the tolerance.

    By its `error` estimate, `outside` of the corners of contradictory supports, or by its bound.
    """
    if refinement.guaranteed:
        error = solution.relative_error_bound
    if refinement.tolerance is not None and error > refinement.tolerance:
        what = "bound" if refinement.guaranteed else "estimate"
        what += " outside of the corners of contradictory supports" if outside else ""
        warn(
            f"the {what} is {error:.2e}, more than tolerance={refinement.tolerance:g}: the next "
            f"level would exceed max_dofs={refinement.max_dofs:g}; give a larger max_dofs or "
            "tolerance"
        )
