"""Solution of a checked problem on one mesh."""

from __future__ import annotations

import logging

import ngsolve as ng

from .contact import ContactState, unmatched
from .discrete import carried_active_set, discretise, first_active_set, minimise_energy
from .mesh import check_curves, curve
from .problem import Problem
from .solution import Solution

SPOILING = 0.2  # share of the points in contact facing no node from which pressures oscillate

log = logging.getLogger("ngcontact")


def _unmatched_pairs(pairs: list[ContactState]) -> set[int]:
    """Numbers of the pairs of which many points in contact face no node."""
    shares = [
        unmatched(pair.line)[pair.active].mean() if pair.active.any() else 0.0 for pair in pairs
    ]
    return {number for number, share in enumerate(shares) if share > SPOILING}


def _warn_of_unmatched(solution: Solution, start: Solution | None) -> None:
    """Say once a run where pressures are not to be trusted."""
    told = set() if start is None else _unmatched_pairs(start.pairs)
    for pair in sorted(_unmatched_pairs(solution.pairs) - told):
        contact = solution.pairs[pair].line.contact
        log.warning(
            'the nodes of "%s" and "%s" do not match where they touch: forces and ends of '
            "contact hold, pressures oscillate; leave the mesh to ngcontact, give a pair with "
            "a gap a direction, and parts of an edge that face different boundaries edges of "
            "their own",
            contact.secondary,
            contact.primary,
        )


def solve_on(
    problem: Problem, mesh: ng.Mesh, order: int, element: str, start: Solution | None
) -> Solution:
    """Solution on one mesh, of which names and values are known to be right."""
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
    displacement = ng.GridFunction(discrete.space.V)
    displacement.vec.FV().NumPy()[:] = discrete.space.basis @ (discrete.basis.T @ minimiser.u)
    solution = Solution(
        problem=problem,
        mesh=mesh,
        order=order,
        element=element,
        displacement=displacement,
        discrete=discrete,
        minimiser=minimiser,
        work={
            "assemblies": int(discrete.assembled),
            "factorizations": minimiser.factorizations,
            "back_solves": minimiser.back_solves,
            "gap_searches": sum(line.searches for line in discrete.lines),
            "curved_elements": curved,
            "estimates": 0,
        },
    )
    _warn_of_unmatched(solution, start)
    return solution
