"""Solve on one mesh, or solve, estimate, mark and refine: a sequence of refined meshes."""

from __future__ import annotations

import logging
import math
from collections.abc import Generator, Iterator, Sequence
from dataclasses import replace
from typing import NoReturn

import ngsolve as ng
import numpy as np

from .adaptivity import (
    Plan,
    Refinement,
    RefinementTree,
    Singularities,
    below_resolution,
    check_bool,
    continued,
    corners,
    next_plan,
    warn_of_limit,
)
from .arrays import Array, joined, root_of_squares
from .contact import with_roles
from .discrete import (
    DiscreteProblem,
    carried_active_set,
    discretise,
    first_active_set,
    minimise_energy,
)
from .errors import ContactError, ConvergenceError, NoEquilibriumError, warn
from .estimator import earlier_figures, refuse_bound
from .fem import boundary_trace, check_element, model_of, unknowns
from .mesh import check_curves, curve, first_mesh, same_geometry
from .plausibility import (
    EXACT_ESTIMATE,
    Contradiction,
    at_round_off,
    contradictions,
    estimates_rise,
    pair_warnings,
    refinement_warning,
    warn_of_implausible,
)
from .problem import Contact, MeshArrays, Problem
from .quadrature import evaluations, sample_data, unresolved
from .results import with_progress
from .solution import Solution, solution_of

# A cold start of more unknowns costs more than a coarse adaptive run that saves its Newton steps.
COARSE_RUN_FROM = 20_000
COARSE_ELEMENTS = 4  # of that run along the largest extent
COARSE_ORDER = 3
COARSE_DOFS = 1500  # its unknowns, which resolve the ends of a zone or two
COARSE_SHARE = 1 / 40  # ... or this share, if that is more: a wavy surface touches in many zones
SAME_ENERGY = 0.1  # relative difference of energies up to which two coarse solutions are one
BOUND_RATIO = 0.2  # bound over estimate, assumed until a bound is known; measured: 0.17 to 1

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
    order: int | None = None,
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
    order : int, optional
        Polynomial degree, 1 to 4, of solids 1 to 3; when left out 1, of solids 2.
    element : str
        "isoparametric": geometry of degree `order`. "superparametric": Zlamal's (2.8), geometry
        of degree `order` + 1. "physical": (2.4), linear in physical coordinates on curved
        elements, order 1 only.
    start : Solution, optional
        Of the same pairs on any mesh: its active set is the first guess. On its own mesh with the
        same bodies, supports and pairs, assembly and factorisation are taken over: another load
        costs back-solves only. Its mesh and order are not taken over: give them.

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
    _check_problem(problem)
    usual = 1 if problem.dim == 2 else 2
    order = check_element(usual if order is None else order, element, problem.dim)
    if mesh is not None and maxh is not None:
        raise ValueError(f"maxh={maxh} has no effect on a given mesh; give one of mesh and maxh")
    if start is not None:
        _check_start(problem, start)
    mesh = first_mesh(problem, maxh) if mesh is None else mesh
    problem.check(mesh)
    before = evaluations()
    sample_data(problem, mesh)
    coarse: list[Solution] = []
    if start is None:
        warn_of_implausible(problem, mesh, order, contradictions(problem, mesh))
        coarse = _coarse_run(problem, mesh, order, element)
    if coarse:  # with roles that can be solved
        problem, start = coarse[-1].problem, coarse[-1]
    solution = solve_on(problem, mesh, order, element, start)
    solution = replace(solution, coarse_levels=len(coarse))
    solution.work["evaluations"] = evaluations() - before
    log.info("%s", solution)
    warn_of_pairs(solution, set(), last=True)
    return solution


def _coarse_run(problem: Problem, mesh: ng.Mesh, order: int, element: str) -> list[Solution]:
    """A short adaptive run, to start a large mesh near its active set; empty where none pays."""
    given = isinstance(problem.geometry, ng.Mesh)
    searched = any(not contact.bilateral for contact in problem.contact)
    size = unknowns(mesh, order, element)
    if given or not searched or size < COARSE_RUN_FROM or problem.dim == 3:
        return []
    maxh = MeshArrays(mesh).extent / COARSE_ELEMENTS
    most = max(COARSE_DOFS, round(COARSE_SHARE * size))
    refinement = Refinement(COARSE_ORDER, "isoparametric", 0.5, None, most)
    try:
        coarse = _first_level(problem, maxh, refinement, None)
        return list(levels(problem, coarse, refinement, contradictions(problem, coarse)))
    except (ContactError, ValueError) as error:  # only the first guess depends on it
        log.debug("no coarse run: %s", error)
        return []


def _check_problem(problem: object) -> None:
    if not isinstance(problem, Problem):
        raise TypeError(f"problem is a {type(problem).__name__}: give a Problem, one at a time")


def _check_start(problem: Problem, start: object) -> None:
    """Raise unless `start` is a solution of as many dimensions and pairs as the problem has."""
    if not isinstance(start, Solution):
        raise TypeError(f"start is a {type(start).__name__}: give a Solution")
    if start.problem.dim != problem.dim:
        raise ValueError(
            f"start is a solution of {start.problem.dim} dimensions, the problem is of "
            f"{problem.dim}: leave start out, or give a solution of this problem with other loads"
        )
    if len(start.discrete.lines) != len(problem.contact):
        raise ValueError(
            f"start has {len(start.discrete.lines)} contact pairs, the problem "
            f"{len(problem.contact)}; a warm start needs the same pairs"
        )


def solve_on(
    problem: Problem, mesh: ng.Mesh, order: int, element: str, start: Solution | None
) -> Solution:
    """Solution on one mesh; roles of pairs that fail are tried the other way round, once."""
    before = evaluations()
    mesh, curved = curve(mesh, order, element)
    if curved and mesh.GetCurveOrder() > 1:  # straight sides have no middles to place
        check_curves(mesh)
    here = (mesh, order, element)
    same = start is not None and (start.mesh, start.order, start.element) == here
    tried: list[DiscreteProblem] = []

    def attempt(
        problem: Problem, known: DiscreteProblem | None
    ) -> tuple[Solution, ContactError | None]:
        """The solution, and the error of a body that contact hardly holds."""
        discrete = discretise(problem, *here, known)
        tried.append(discrete)
        if start is None:
            active = first_active_set(discrete)
        else:
            active = carried_active_set(discrete.lines, start.expected)
        minimiser = minimise_energy(discrete, active)
        solution = solution_of(minimiser, tried, element, curved)
        solution.work["evaluations"] = evaluations() - before
        if discrete.rigid is None:
            return solution, None
        return solution, discrete.rigid.hardly_held(discrete.basis.T @ minimiser.u)

    first, doubt = None, None
    try:
        first, doubt = attempt(problem, start.discrete if start is not None and same else None)
        if doubt is None:
            return first
    except (ConvergenceError, NoEquilibriumError) as error:
        doubt = error
    doubted = _doubted(problem, mesh, order, doubt, tried)
    if first is not None and not doubted:
        return first
    exchanged = {i: pair.swapped() for i, pair in doubted.items() if pair.gap is None}
    if not exchanged:
        raise doubt
    pairs = [exchanged.get(i, contact) for i, contact in enumerate(problem.contact)]
    try:
        second, again = attempt(replace(problem, contact=pairs), tried[0] if tried else None)
    except (ContactError, ValueError):
        raise doubt from None
    if again is None:
        names = ", ".join(f'Contact("{c.primary}", "{c.secondary}")' for c in exchanged.values())
        secondaries = ", ".join(f'"{c.secondary}"' for c in exchanged.values())
        warn(
            f"no solution was found with the roles given in {names}, and was found with roles "
            f"exchanged: {secondaries} carries the contact points, and contact_force acts on its "
            'body. Exchange the names, or give roles="auto", which mostly chooses the body without '
            "support"
        )
        return second
    if first is None or abs(first.energy - second.energy) > SAME_ENERGY * abs(second.energy):
        raise doubt
    return first  # both roles give one energy: it is the bodies that are hardly held


def _doubted(
    problem: Problem, mesh: ng.Mesh, order: int, error: ContactError, tried: list[DiscreteProblem]
) -> dict[int, Contact]:
    """Pairs by number, with roles decided, whose primary is of a body that supports leave free.

    Normals of a hole, at points of a pin that is not in its middle, nearly prevent the pin from
    turning, by forces that do not exist; the normals of the pin leave it free.
    """
    if isinstance(error, NoEquilibriumError):
        bodies = error.motion.bodies
    else:
        bodies = [name for one in tried if one.rigid for name in one.rigid.free.names]
    trace, names = boundary_trace(mesh, order, model_of(problem)), mesh.GetMaterials()
    pairs = [with_roles(trace, contact) for contact in problem.contact]
    primaries = [trace.body[trace.segments(pair.primary)] for pair in pairs]
    return {
        number: pair
        for number, (pair, body) in enumerate(zip(pairs, primaries, strict=True))
        if pair.primary is not None and any(names[i] in bodies for i in np.unique(body))
    }


def adapt(
    problem: Problem,
    *,
    maxh: float | None = None,
    order: int | str | None = None,
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
    order : int or "auto", optional
        Degree, 1 to 4; 4 when left out, which is best for errors of 1e-3 and less. "auto" chooses
        (docs/adaptivity.md). Of solids 1 to 3, 2 when left out.
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
        Write a line to standard error when a level is done.

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
    _check_problem(problem)
    if guaranteed or start is not None or order == "auto":
        problem.refuse_solids('adapt with guaranteed=True, start or order="auto"')
    usual = 4 if problem.dim == 2 else 2
    degree = 1 if order == "auto" else usual if order is None else order
    degree = check_element(degree, element, problem.dim)
    refinement = Refinement(degree, element, theta, tolerance, max_dofs, guaranteed)
    if order == "auto":
        refinement = refinement.choosing(start.order if isinstance(start, Solution) else None)
    check_bool("progress", progress)
    mesh = _first_level(problem, maxh, refinement, start)
    sample_data(problem, mesh)
    found = contradictions(problem, mesh)
    if guaranteed and found:
        x, y = found[0].place
        raise ValueError(  # no refinement makes a bound there
            f"no guaranteed bound is known for supports that contradict each other: "
            f"{found[0].message} at ({x:.6g}, {y:.6g}), and no displacement of finite energy takes "
            "both values; make them equal there, or leave guaranteed out"
        )
    warn_of_implausible(problem, mesh, refinement.order, found)
    solutions = with_warnings(levels(problem, mesh, refinement, found, start))
    return Run(with_progress(solutions) if progress else solutions)


class Run(Iterator[Solution]):
    """The levels of `adapt`; whoever uses it as a `Solution` gets an error that explains."""

    def __init__(self, solutions: Generator[Solution]) -> None:
        self._solutions = solutions

    def __next__(self) -> Solution:
        """The next level."""
        return next(self._solutions)

    def __repr__(self) -> str:
        """Summary, and the way to the levels."""
        return "<" + ONE_PER_LEVEL.format("has not run to its end") + ">"

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
        mesh = start.tree.mesh
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
            f"element={element!r}: give the same, its indicators say nothing of others"
        )
    here, there = ([(c.secondary, c.primary) for c in p.contact] for p in (problem, start.problem))
    if [set(pair) for pair in here] != [set(pair) for pair in there]:  # roles may be exchanged
        raise ValueError(f"the contact pairs of start are {there}, not {here}: keep them")
    if not same_geometry(problem.geometry, start.problem.geometry):
        raise ValueError(
            "the geometry is not the one of start: bodies, edges and names must be the same; leave "
            "start out, or change loads, supports, materials or gaps alone"
        )


def _first_plan(
    problem: Problem,
    mesh: ng.Mesh,
    refinement: Refinement,
    contradictory: Sequence[Contradiction],
    start: Solution | None,
) -> Plan:
    """The first level, of which nothing is forecast but by `start`."""
    tree, plane = RefinementTree(mesh, np.arange(mesh.ne)), problem.dim == 2
    found = Singularities.at([one.place for one in contradictory if plane], 0.0)
    if plane:
        found = joined([corners(problem, boundary_trace(mesh, 1)), found])
    plan = Plan(mesh, refinement.order, found, math.inf, refinement.growth, tree)
    if start is None or at_round_off(start, start.error_estimate):
        return plan
    goal = refinement.tolerance
    if refinement.guaranteed and goal is not None:
        goal /= _bound_ratio(start) if start.bounded else BOUND_RATIO
    return continued(problem, start, replace(plan, tree=start.tree), refinement, goal)


def _bound_ratio(solution: Solution) -> float:
    """Bound over estimate."""
    estimate = solution.relative_error_estimate
    return solution.relative_error_bound / estimate if estimate > 0 else BOUND_RATIO


def levels(
    problem: Problem,
    mesh: ng.Mesh,
    refinement: Refinement,
    contradictory: Sequence[Contradiction],
    start: Solution | None = None,
) -> Generator[Solution]:
    """Levels from a first, curved mesh on, perhaps after a `start` for another load."""
    goal, guaranteed = refinement.tolerance or 0.0, refinement.guaranteed
    element, solution = refinement.element, None
    # Bound over estimate, by the last bound that was made.
    ratio, warned = BOUND_RATIO, False
    plan = _first_plan(problem, mesh, refinement, contradictory, start)
    while unknowns(plan.mesh, plan.order, element) <= refinement.max_dofs:
        earlier: tuple[Array, ...] = ()
        if solution is not None:  # its factorisation is of no use to the next one
            solution.discrete.systems.forget()
            earlier = earlier_figures(solution)
        solution = solve_on(problem, plan.mesh, plan.order, element, solution or start)
        problem = solution.problem  # roles that fail are exchanged once
        solution = replace(solution, adaptive=True, tree=plan.tree, earlier=earlier)
        unresolved_data = unresolved(problem, solution.mesh, in_bounds=guaranteed)
        error = math.inf
        if guaranteed:
            refuse_bound(problem, solution.discrete.space.trace, solution.pairs)
            predicted = ratio * solution.relative_error_estimate
            if not unresolved_data and (solution.bounded or predicted <= goal):
                error, ratio = solution.relative_error_bound, _bound_ratio(solution)
        yield solution
        estimate = solution.relative_error_estimate
        if not np.isfinite(solution.error_estimate):  # nothing would be marked, in an endless loop
            raise ConvergenceError(
                f"the error estimate is {solution.error_estimate}, so nothing can be refined; "
                "choose units in which the squares of loads and displacements are numbers",
                iterate=solution.minimiser,
            )
        log.info("%s", solution)
        excluded = below_resolution(solution.mesh, plan.corners.unresolvable)
        if not guaranteed:
            error = estimate
            if excluded.any():  # no mesh makes the estimate less there
                error *= root_of_squares(solution.indicators[~excluded]) / solution.error_estimate
        enough = error <= max(goal, EXACT_ESTIMATE)
        if not unresolved_data and (enough or at_round_off(solution, solution.error_estimate)):
            return
        expected = ratio * estimate if guaranteed else error
        of_data = np.any([np.zeros_like(excluded), *unresolved_data.values()], axis=0)
        plan = next_plan(solution, refinement, plan, goal / expected if expected else 1.0, of_data)
        if plan.ends or (plan.stuck and not warned):
            warned = True
            warn_of_limit(solution.discrete.space.trace, ends=plan.ends)
        if plan.ends:
            return
    if solution is None or unresolved_data or goal == 0.0:  # of narrow data there is a warning
        return
    error = solution.relative_error_bound if guaranteed else error
    if error > goal:
        what = "bound" if guaranteed else "estimate"
        what += " outside of the corners of contradictory supports" if excluded.any() else ""
        warn(
            f"the {what} is {error:.2e}, more than tolerance={goal:g}: the next level would exceed "
            f"max_dofs={refinement.max_dofs:g}; give a larger max_dofs or tolerance"
        )


def warn_of_pairs(solution: Solution, issued: set[object], *, last: bool) -> None:
    """Warn of what is not `issued`, and add it there; what refinement mends on the `last` mesh."""
    found = pair_warnings(solution, last=last)
    for doubt, message in found.items():
        if doubt not in issued:
            warn(message)
    issued.update(found)
    if last:
        for one in unresolved(solution.problem, solution.mesh):
            warn(f"{one}: the solution hardly knows of it; refine the mesh there, or take `adapt`")


def with_warnings(solutions: Iterator[Solution]) -> Generator[Solution]:
    """The levels of a run; what no mesh mends is said at once, what refinement mends at the end."""
    issued: set[object] = set()
    estimates: list[float] = []
    solution = None
    for solution in solutions:
        warn_of_pairs(solution, issued, last=False)
        yield solution
        if unresolved(solution.problem, solution.mesh):  # estimates rise when data are seen
            estimates.clear()
        estimates.append(solution.relative_error_estimate)
        if "estimates" not in issued and estimates_rise(estimates):
            issued.add("estimates")
            warn(refinement_warning(solution.mesh, solution.indicators, estimates))
    if solution is not None:
        warn_of_pairs(solution, issued, last=True)
