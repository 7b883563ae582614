"""Solution of a checked problem on one mesh."""

from __future__ import annotations

import logging

import ngsolve as ng
import numpy as np

from .contact import unmatched
from .discrete import (
    DiscreteProblem,
    carried_active_set,
    discretise,
    first_active_set,
    minimise_energy,
)
from .mesh import check_curves, curve
from .problem import Problem
from .qp import Iterate
from .solution import Solution

MANY = 0.2  # of the points in contact, that face no node, spoil the pressure

log = logging.getLogger("ngcontact")


def _unmatched_pairs(discrete: DiscreteProblem, minimiser: Iterate) -> list[int]:
    """Pairs of which many points in contact face no node."""
    stops = np.cumsum([len(line.node) for line in discrete.lines])[:-1]
    active = np.split(minimiser.active, stops) if discrete.lines else []
    shares = [
        unmatched(line)[at].mean() if at.any() else 0.0
        for line, at in zip(discrete.lines, active, strict=True)
    ]
    return [pair for pair, share in enumerate(shares) if share > MANY]


def _warn_of_unmatched(discrete: DiscreteProblem, minimiser: Iterate, told: list[int]) -> None:
    """Say once a run where pressures are not to be trusted."""
    for pair in _unmatched_pairs(discrete, minimiser):
        if pair not in told:
            contact = discrete.lines[pair].contact
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
        active = carried_active_set(discrete, start.discrete, start.minimiser)
    minimiser = minimise_energy(discrete, active)
    told = [] if start is None else _unmatched_pairs(start.discrete, start.minimiser)
    _warn_of_unmatched(discrete, minimiser, told)
    displacement = ng.GridFunction(discrete.space.V)
    displacement.vec.FV().NumPy()[:] = discrete.space.basis @ (discrete.basis.T @ minimiser.u)
    return Solution(
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
