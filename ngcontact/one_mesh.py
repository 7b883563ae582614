"""Solution of a checked problem on one mesh."""

from __future__ import annotations

from collections.abc import Generator, Iterator

import ngsolve as ng

from .discrete import carried_active_set, discretise, first_active_set, minimise_energy
from .errors import warn
from .mesh import check_curves, curve, same_geometry
from .plausibility import doubt_of_refinement, doubts, estimates_rise
from .problem import Problem
from .quadrature import evaluations, unresolved, warn_of_unresolved
from .solution import Solution


def check_start(problem: Problem, start: object) -> None:
    """Raise unless `start` is a solution of as many pairs as the problem has."""
    if not isinstance(start, Solution):
        raise TypeError(f"start is a {type(start).__name__}: give a Solution")
    if len(start.discrete.lines) != len(problem.contact):
        raise ValueError(
            f"start has {len(start.discrete.lines)} contact pairs, the problem "
            f"{len(problem.contact)}; a warm start needs the same pairs"
        )


def check_continuation(problem: Problem, start: Solution, order: int, element: str) -> None:
    """Raise unless meshes of `start` serve the problem, and its indicators such elements."""
    check_start(problem, start)
    if (start.order, start.element) != (order, element):
        raise ValueError(
            f"start has order={start.order} and element={start.element!r}, not order={order} and "
            f"element={element!r}: give the same, its indicators tell nothing of others"
        )
    here, there = ([(c.secondary, c.primary) for c in p.contact] for p in (problem, start.problem))
    if here != there:
        raise ValueError(f"the contact pairs of start are {there}, not {here}: keep them")
    if not same_geometry(problem.geometry, start.problem.geometry):
        raise ValueError(
            "the geometry is not the one of start: bodies, edges and names must be the same; leave "
            "start out, or change loads, supports, materials or gaps alone"
        )


def solve_on(
    problem: Problem, mesh: ng.Mesh, order: int, element: str, start: Solution | None
) -> Solution:
    """Solution on one mesh, of which names and values are known to be right."""
    before = evaluations()
    mesh, curved = curve(mesh, order, element)
    if curved and mesh.GetCurveOrder() > 1:  # straight sides have no middles to place
        check_curves(mesh)
    here = (mesh, order, element)
    same = start is not None and (start.mesh, start.order, start.element) == here
    discrete = discretise(problem, *here, start.discrete if start is not None and same else None)
    if start is None:
        active = first_active_set(discrete)
    else:
        active = carried_active_set(discrete.lines, start.pairs)
    minimiser = minimise_energy(discrete, active)
    return Solution(
        problem=problem,
        mesh=mesh,
        order=order,
        element=element,
        displacement=discrete.displacement(minimiser.u),
        discrete=discrete,
        minimiser=minimiser,
        work={
            "assemblies": int(discrete.assembled),
            "factorizations": minimiser.factorizations,
            "back_solves": minimiser.back_solves,
            "gap_searches": sum(line.searches for line in discrete.lines),
            "curved_elements": curved,
            "estimates": 0,
            "equilibrations": 0,
            "evaluations": evaluations() - before,
        },
    )


def warn_of_doubts(solution: Solution, told: set[object], *, last: bool) -> None:
    """Warn of what may be wrong but was not `told` before, and add it there.

    What a finer mesh mends is left out unless none follows: the mesh is the `last`.
    """
    space, displacement = solution.discrete.space, solution.displacement
    found = doubts(solution.problem, space, displacement, solution.pairs, last=last)
    for doubt, message in found.items():
        if doubt not in told:
            warn(message)
    told.update(found)
    if last:
        warn_of_unresolved(solution.problem, solution.mesh)


def with_warnings(solutions: Iterator[Solution]) -> Generator[Solution]:
    """The levels of a run, with a warning of whatever may be wrong, once.

    What no mesh mends is said at the first level that shows it, what refinement mends at the last.
    """
    told: set[object] = set()
    estimates: list[float] = []
    solution = None
    for solution in solutions:
        warn_of_doubts(solution, told, last=False)
        yield solution
        if unresolved(solution.problem, solution.mesh):  # estimates rise when data are seen
            estimates.clear()
        estimates.append(solution.relative_error_estimate)
        if "estimates" not in told and estimates_rise(estimates):
            told.add("estimates")
            warn(doubt_of_refinement(solution.mesh, solution.indicators, estimates))
    if solution is not None:
        warn_of_doubts(solution, told, last=True)
