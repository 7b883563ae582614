"""Solution of a checked problem on one mesh."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace

import ngsolve as ng
import numpy as np

from .arrays import Mask
from .discrete import (
    DiscreteProblem,
    carried_active_set,
    discretise,
    first_active_set,
    minimise_energy,
)
from .errors import ContactError, ConvergenceError, warn
from .mesh import check_curves, curve, same_geometry
from .plausibility import doubt_of_refinement, doubts, estimates_rise
from .problem import Contact, Problem
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
    """Solution on one mesh, of which names and values are known to be right.

    Roles of pairs that fail are tried the other way round, once; `Solution.problem` has the pairs
    as they were solved.
    """
    before = evaluations()
    mesh, curved = curve(mesh, order, element)
    if curved and mesh.GetCurveOrder() > 1:  # straight sides have no middles to place
        check_curves(mesh)
    here = (mesh, order, element)
    same = start is not None and (start.mesh, start.order, start.element) == here
    discrete = discretise(problem, *here, start.discrete if start is not None and same else None)
    tried = [discrete]
    try:
        minimiser = minimise_energy(discrete, _first_active_set(discrete, start))
    except ConvergenceError as error:
        exchanged = _exchanged(discrete)
        if not exchanged:
            raise
        pairs = [exchanged.get(i, contact) for i, contact in enumerate(problem.contact)]
        problem = replace(problem, contact=pairs)
        try:
            discrete = discretise(problem, *here, discrete)
            minimiser = minimise_energy(discrete, _first_active_set(discrete, start))
        except (ContactError, ValueError):
            raise error from None
        tried.append(discrete)
        warn(_told(list(exchanged.values())))
    return Solution(
        problem=problem,
        mesh=mesh,
        order=order,
        element=element,
        displacement=discrete.displacement(minimiser.u),
        discrete=discrete,
        minimiser=minimiser,
        work={
            "assemblies": sum(one.assembled for one in tried),
            "factorizations": minimiser.factorizations,
            "back_solves": minimiser.back_solves,
            "gap_searches": sum(line.searches for one in tried for line in one.lines),
            "curved_elements": curved,
            "estimates": 0,
            "equilibrations": 0,
            "evaluations": evaluations() - before,
        },
    )


def _first_active_set(discrete: DiscreteProblem, start: Solution | None) -> Mask:
    """Cold (m,), or warm from a solution."""
    if start is None:
        return first_active_set(discrete)
    return carried_active_set(discrete.lines, start.pairs)


def _exchanged(discrete: DiscreteProblem) -> dict[int, Contact]:
    """Pairs by number, with roles exchanged, whose primary belongs to a body without support.

    Normals of a hole, at points of a pin that lies elsewhere in it, all but resist the turning of
    the pin; its own normals leave it free.
    """
    if discrete.rigid is None:
        return {}
    free = discrete.rigid.free
    moves = np.abs(free.combinations).sum(axis=1).reshape(-1, 3).sum(axis=1) > 0
    primaries = [moves[np.unique(free.bodies.of_segment[line.facing])] for line in discrete.lines]
    return {
        number: contact.swapped()
        for number, contact in enumerate(discrete.problem.contact)
        if primaries[number].any()
        and contact.roles == "given"
        and contact.gap is None
        and not contact.bilateral
    }


def _told(exchanged: list[Contact]) -> str:
    """What is said of pairs that were solved with roles `exchanged`."""
    names = ", ".join(f'Contact("{c.primary}", "{c.secondary}")' for c in exchanged)
    secondaries = ", ".join(f'"{c.secondary}"' for c in exchanged)
    return (
        f"no solution was found with the roles given in {names}, and was found with roles "
        f"exchanged: {secondaries} carries the contact points, and contact_force acts on its body. "
        'Exchange the names, or give roles="auto", which mostly chooses the body without support'
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
