"""Solve on one mesh, or solve, estimate, mark and refine: a sequence of refined meshes."""

from __future__ import annotations

import logging
import math
from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import NoReturn

import ngsolve as ng
import numpy as np

from .adaptivity import (
    Plan,
    Refinement,
    RefinementTree,
    check_bool,
    continued,
    corners,
    next_plan,
    settled,
    unresolvable,
    warn_of_limit,
)
from .arrays import root_of_squares
from .errors import ContactError, ConvergenceError, warn
from .estimator import refuse_bound
from .fem import boundary_trace, check_element, unknowns
from .mesh import curve, first_mesh, same_geometry
from .one_mesh import solve_on, warn_of_doubts, with_warnings
from .plausibility import EXACT, at_round_off, contradictions, warn_of_implausible
from .problem import MeshArrays, Problem
from .quadrature import evaluations, look, unresolved
from .results import with_progress
from .solution import Solution

# A cold start of more unknowns costs more than a coarse adaptive run that saves its Newton steps.
COARSE_RUN_FROM = 20_000
COARSE_ELEMENTS = 4  # of that run along the largest extent
COARSE_ORDER = 3
COARSE_DOFS = 1500  # its unknowns, which resolve the ends of a zone or two
COARSE_SHARE = 1 / 40  # ... or, where that is more, their share: waves in contact have many ends
BOUND_RATIO = 0.2  # bound over estimate that is hoped for at first; measured: 0.17 to 1

ONE_PER_LEVEL = (
    "adapt(...) {}: it yields one Solution per level; loop over it, or take the last one by "
    "*_, solution = adapt(...)"
)

log = logging.getLogger("ngcontact")


def solve(
    problem: Problem,
    mesh: ng.Mesh | None = None,
    *,
    maxh: float | None = None,
    order: int = 1,
    element: str = "isoparametric",
    start: Solution | None = None,
) -> Solution:
    """Solve a contact problem on one mesh, HH81 (P_1h) or (P_2h).

    Parameters
    ----------
    problem : Problem
        The continuous problem.
    mesh : ng.Mesh, optional
        The mesh; made from the geometry, with matched nodes on facing lines, when left out.
    maxh : float, optional
        Largest element size for making the mesh, a length; only without `mesh`.
    order : int
        Polynomial degree, 1 to 4.
    element : str
        "isoparametric": geometry of degree `order`. "superparametric": Zlamal's (2.8), geometry
        of degree `order` + 1. "physical": (2.4), linear in physical coordinates on curved
        elements, order 1 only.
    start : Solution, optional
        Of the same pairs on any mesh: its active set warms the start. On its own mesh with the
        same bodies, supports and pairs, assembly and factorisation are taken over: another load
        costs back-solves only.

    Returns
    -------
    Solution

    Raises
    ------
    ValueError, TypeError
        Bad input, before any assembly.
    ConvergenceError
        The active set did not settle, or a body can still move rigidly; carries the last iterate.
    NoEquilibriumError
        The load drives a rigid motion that supports and contact do not resist, or hardly.
    """
    order = check_element(order, element)
    if mesh is not None and maxh is not None:
        raise ValueError(f"maxh={maxh} has no effect on a given mesh; give one of mesh and maxh")
    if start is not None:
        _check_start(problem, start)
    mesh = first_mesh(problem, maxh) if mesh is None else mesh
    problem.check(mesh)
    before = evaluations()
    look(problem, mesh)
    coarse: list[Solution] = []
    if start is None:
        warn_of_implausible(problem, mesh, order)
        coarse = _coarse_run(problem, mesh, order, element)
    if coarse:  # with roles that can be solved
        problem, start = coarse[-1].problem, coarse[-1]
    solution = solve_on(Solution, problem, mesh, order, element, start)
    solution = replace(solution, coarse_levels=len(coarse))
    solution.work["evaluations"] = evaluations() - before
    log.info("%s", solution)
    warn_of_doubts(solution, set(), last=True)
    return solution


def _coarse_run(problem: Problem, mesh: ng.Mesh, order: int, element: str) -> list[Solution]:
    """A short adaptive run, to start a large mesh near its active set.

    Empty where it would not pay: on small meshes, and without a CAD geometry to mesh coarsely.
    """
    given = isinstance(problem.geometry, ng.Mesh)
    searched = any(not contact.bilateral for contact in problem.contact)
    size = unknowns(mesh, order, element)
    if given or not searched or size < COARSE_RUN_FROM:
        return []
    maxh = MeshArrays(mesh).extent / COARSE_ELEMENTS
    most = max(COARSE_DOFS, round(COARSE_SHARE * size))
    refinement = Refinement(COARSE_ORDER, "isoparametric", 0.5, None, most)
    try:
        return list(levels(problem, _first_level(problem, maxh, refinement, None), refinement))
    except (ContactError, ValueError) as error:  # it decides nothing but the start
        log.debug("no coarse run: %s", error)
        return []


def _check_start(problem: Problem, start: object) -> None:
    """Raise unless `start` is a solution of as many pairs as the problem has."""
    if not isinstance(start, Solution):
        raise TypeError(f"start is a {type(start).__name__}: give a Solution")
    if len(start.discrete.lines) != len(problem.contact):
        raise ValueError(
            f"start has {len(start.discrete.lines)} contact pairs, the problem "
            f"{len(problem.contact)}; a warm start needs the same pairs"
        )


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
    degree = 1 if order is None else order
    refinement = Refinement(degree, element, theta, tolerance, max_dofs, guaranteed)
    if order is None:
        refinement = refinement.choosing(start.order if isinstance(start, Solution) else None)
    check_bool("progress", progress)
    mesh = _first_level(problem, maxh, refinement, start)
    look(problem, mesh)
    if guaranteed and (found := contradictions(problem, mesh)):
        x, y = found[0].place
        raise ValueError(  # no refinement makes a bound there
            f"no guaranteed bound is known for supports that contradict each other: "
            f"{found[0].message} at ({x:.6g}, {y:.6g}), and no displacement of finite energy takes "
            "both values; make them equal there, or leave guaranteed out"
        )
    warn_of_implausible(problem, mesh, refinement.order)
    solutions = with_warnings(levels(problem, mesh, refinement, start))
    return Run(with_progress(solutions, tolerance, max_dofs) if progress else solutions)


class Run(Iterator[Solution]):
    """The levels of `adapt`, made one by one by a generator of `solutions`.

    It tells who takes it for a `Solution` what it is.
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


def _first_level(
    problem: Problem, maxh: float | None, refinement: Refinement, start: Solution | None
) -> ng.Mesh:
    """The first mesh of `levels`, checked and curved; arguments and errors of `adapt`."""
    order, element, max_dofs = refinement.order, refinement.element, refinement.max_dofs
    if start is None:
        mesh = first_mesh(problem, maxh)
    elif maxh is not None:
        raise ValueError(f"maxh={maxh} has no effect on the mesh of start; give one of them")
    else:
        _check_continuation(problem, start, order, element)
        mesh = _tree(start).mesh
    problem.check(mesh)
    mesh, _ = curve(mesh, order, element)
    if unknowns(mesh, order, element) > max_dofs:
        raise ValueError(
            f"the first mesh has {unknowns(mesh, order, element)} unknowns, more than "
            f"max_dofs={max_dofs}; give a larger maxh or max_dofs"
        )
    return mesh


def _check_continuation(problem: Problem, start: Solution, order: int, element: str) -> None:
    """Raise unless meshes of `start` serve the problem, and its indicators such elements."""
    _check_start(problem, start)
    if (start.order, start.element) != (order, element):
        raise ValueError(
            f"start has order={start.order} and element={start.element!r}, not order={order} and "
            f"element={element!r}: give the same, its indicators tell nothing of others"
        )
    here, there = ([(c.secondary, c.primary) for c in p.contact] for p in (problem, start.problem))
    if [set(pair) for pair in here] != [set(pair) for pair in there]:  # roles may be exchanged
        raise ValueError(f"the contact pairs of start are {there}, not {here}: keep them")
    if not same_geometry(problem.geometry, start.problem.geometry):
        raise ValueError(
            "the geometry is not the one of start: bodies, edges and names must be the same; leave "
            "start out, or change loads, supports, materials or gaps alone"
        )


def _tree(start: Solution) -> RefinementTree:
    """Of the elements of `start`; its own mesh is the first one of a sequence that starts there."""
    return start.tree or RefinementTree.root(start.mesh)


def _first_plan(
    problem: Problem, mesh: ng.Mesh, refinement: Refinement, start: Solution | None
) -> Plan:
    """The first level, of which nothing is forecast but by `start`."""
    found = corners(problem, boundary_trace(mesh, 1))
    found = found.joined(unresolvable([one.place for one in contradictions(problem, mesh)]))
    tree = RefinementTree.root(mesh)
    plan = Plan(mesh, refinement.order, found, math.inf, refinement.growth, tree)
    if start is None or _is_exact(start):
        return plan
    goal = refinement.tolerance
    if refinement.guaranteed and goal is not None:
        goal /= _bound_ratio(start) if start.bounded else BOUND_RATIO
    return continued(problem, start, replace(plan, tree=_tree(start)), refinement, goal)


def _is_exact(solution: Solution) -> bool:
    """Whether its error is round-off."""
    space, u = solution.discrete.space, solution.displacement
    return at_round_off(solution.problem, space, u, solution.error_estimate)


def _bound_ratio(solution: Solution) -> float:
    """Bound over estimate."""
    estimate = solution.relative_error_estimate
    return solution.relative_error_bound / estimate if estimate > 0 else BOUND_RATIO


def levels(
    problem: Problem, mesh: ng.Mesh, refinement: Refinement, start: Solution | None = None
) -> Generator[Solution]:
    """Levels from a first mesh on, of which names and values are known to be right.

    The mesh is curved as the element asks, and the first of the sequence of `start`, a solution
    for another load.
    """
    element, goal, guaranteed = (
        refinement.element,
        refinement.tolerance or 0.0,
        refinement.guaranteed,
    )
    solution: Solution | None = None
    # Bound over estimate, by the last bound that was made.
    ratio, warned, plan = BOUND_RATIO, False, _first_plan(problem, mesh, refinement, start)
    while unknowns(plan.mesh, plan.order, element) <= refinement.max_dofs:
        if solution is not None:  # its factorisation is of no use to the next one
            solution.discrete.systems.forget()
        solution = solve_on(Solution, problem, plan.mesh, plan.order, element, solution or start)
        problem = solution.problem  # roles that fail are exchanged once
        solution = replace(solution, adaptive=True, tree=plan.tree)
        narrow = unresolved(problem, solution.mesh, in_bounds=guaranteed)
        error = math.inf
        if guaranteed:
            refuse_bound(problem, solution.discrete.space.trace, solution.pairs)
            if not narrow and (
                solution.bounded or ratio * solution.relative_error_estimate <= goal
            ):
                error = solution.relative_error_bound
                if solution.relative_error_estimate > 0:
                    ratio = _bound_ratio(solution)
        yield solution
        estimate = solution.relative_error_estimate
        if not np.isfinite(solution.error_estimate):  # it would mark nothing, for ever
            raise ConvergenceError(
                f"the error estimate is {solution.error_estimate}, so nothing can be refined; "
                "choose units in which the squares of loads and displacements are numbers",
                iterate=solution.minimiser,
            )
        log.info("%s", solution)
        small = settled(solution.mesh, plan.corners.unresolvable)
        if not guaranteed:
            error = estimate
            if small.any():  # no mesh makes the estimate less there
                error *= root_of_squares(solution.indicators[~small]) / solution.error_estimate
        if not narrow and (error <= max(goal, EXACT) or _is_exact(solution)):
            return
        now = ratio * estimate if guaranteed else error
        seen = np.any([one.elements for one in narrow], axis=0) if narrow else np.zeros_like(small)
        plan = next_plan(solution, refinement, plan, goal / now if now else 1.0, seen)
        if plan.ends or (plan.stuck and not warned):
            warned = True
            warn_of_limit(solution.discrete.space.trace, ends=plan.ends)
        if plan.ends:
            return
    if solution is not None and not narrow:  # of which there is a warning
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
