"""Solution of a checked problem on one mesh."""

from __future__ import annotations

from collections.abc import Generator, Iterator
from dataclasses import replace
from typing import TypeVar

import ngsolve as ng
import numpy as np

from .contact import with_roles
from .discrete import (
    DiscreteProblem,
    carried_active_set,
    discretise,
    first_active_set,
    hardly_held,
    minimise_energy,
)
from .errors import ContactError, ConvergenceError, NoEquilibriumError, warn
from .estimator import Estimated
from .fem import boundary_trace, model_of
from .mesh import check_curves, curve
from .plausibility import doubt_of_refinement, doubts, estimates_rise
from .problem import Contact, Problem
from .quadrature import evaluations, unresolved, warn_of_unresolved
from .solved import Solved

S = TypeVar("S", bound=Solved)
E = TypeVar("E", bound=Estimated)

ALIKE = 0.1  # relative difference of energies up to which two coarse solutions are one


def solve_on(
    kind: type[S], problem: Problem, mesh: ng.Mesh, order: int, element: str, start: Solved | None
) -> S:
    """Solution, of a `kind`, on one mesh, of which names and values are known to be right.

    Roles of pairs that fail, or that leave a body all but free, are tried the other way round,
    once; `Solved.problem` has the pairs as they were solved.
    """
    before = evaluations()
    mesh, curved = curve(mesh, order, element)
    if curved and mesh.GetCurveOrder() > 1:  # straight sides have no middles to place
        check_curves(mesh)
    here = (mesh, order, element)
    same = start is not None and (start.mesh, start.order, start.element) == here
    tried: list[DiscreteProblem] = []

    def attempt(problem: Problem, known: DiscreteProblem | None) -> S:
        discrete = discretise(problem, *here, known)
        tried.append(discrete)
        if start is None:
            active = first_active_set(discrete)
        else:
            active = carried_active_set(discrete.lines, start.pairs)
        minimiser = minimise_energy(discrete, active)
        return kind(
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

    first = None
    try:
        first = attempt(problem, start.discrete if start is not None and same else None)
        doubt: ContactError | None = hardly_held(first.discrete, first.minimiser)
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
        second = attempt(replace(problem, contact=pairs), tried[0] if tried else None)
    except (ContactError, ValueError):
        raise doubt from None
    if hardly_held(second.discrete, second.minimiser) is None:
        warn(_told(list(exchanged.values())))
        return second
    if first is None or abs(first.energy - second.energy) > ALIKE * abs(second.energy):
        raise doubt
    return first  # so are the bodies made, not the rows


def _doubted(
    problem: Problem, mesh: ng.Mesh, order: int, error: ContactError, tried: list[DiscreteProblem]
) -> dict[int, Contact]:
    """Pairs by number, with roles decided, whose primary is of a body that supports leave free.

    Normals of a hole, at points of a pin that lies elsewhere in it, all but resist the turning of
    the pin, with forces that are not there; its own normals leave it free.
    """
    if isinstance(error, NoEquilibriumError):
        bodies = error.motion.bodies
    else:
        bodies = [name for one in tried if one.rigid for name in one.rigid.free.names]
    trace, names = boundary_trace(mesh, order, model_of(problem)), mesh.GetMaterials()
    decided = [with_roles(trace, contact) for contact in problem.contact]
    primaries = [trace.body[trace.segments(pair.primary)] for pair in decided]
    return {
        number: pair
        for number, (pair, body) in enumerate(zip(decided, primaries, strict=True))
        if pair.primary is not None and any(names[i] in bodies for i in np.unique(body))
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


def warn_of_doubts(solution: Solved, told: set[object], *, last: bool) -> None:
    """Warn of what may be wrong but was not `told` before, and add it there.

    What a finer mesh mends is left out unless none follows: the mesh is the `last`.
    """
    found = doubts(solution, last=last)
    for doubt, message in found.items():
        if doubt not in told:
            warn(message)
    told.update(found)
    if last:
        warn_of_unresolved(solution.problem, solution.mesh)


def with_warnings(solutions: Iterator[E]) -> Generator[E]:
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
