"""Solve on one mesh."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np

from .adaptive import first_level, levels, log
from .adaptivity import Refinement
from .errors import ContactError
from .fem import check_element, unknowns
from .mesh import first_mesh
from .one_mesh import check_start, solve_on, warn_of_doubts
from .plausibility import warn_of_implausible
from .problem import MeshArrays, Problem
from .quadrature import evaluations, look
from .solution import Solution

# A cold start of more unknowns costs more than a coarse adaptive run that saves its Newton steps.
COARSE_RUN_FROM = 20_000
COARSE_ELEMENTS = 4  # of that run along the largest extent
COARSE_ORDER = 3
COARSE_DOFS = 1500  # its unknowns, which resolve the ends of a zone or two
COARSE_SHARE = 1 / 40  # ... or, where that is more, their share: waves in contact have many ends


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
        check_start(problem, start)
    mesh = first_mesh(problem, maxh) if mesh is None else mesh
    problem.check(mesh)
    before = evaluations()
    look(problem, mesh)
    if start is None:
        warn_of_implausible(problem, mesh, order)
    coarse = coarse_run(problem, mesh, order, element) if start is None else []
    if coarse:  # with roles that can be solved
        problem, start = coarse[-1].problem, coarse[-1]
    solution = solve_on(problem, mesh, order, element, start)
    solution = replace(solution, coarse_levels=len(coarse))
    solution.work["evaluations"] = evaluations() - before
    log.info("%s", solution)
    warn_of_doubts(solution, set(), last=True)
    return solution


def coarse_run(problem: Problem, mesh: ng.Mesh, order: int, element: str) -> list[Solution]:
    """A short adaptive run, to start a large mesh near its active set.

    Empty where it would not pay: on small meshes, and without a CAD geometry to mesh coarsely.
    """
    given = isinstance(problem.geometry, ng.Mesh)
    searched = any(not contact.bilateral for contact in problem.contact)
    size = unknowns(mesh, order, element)
    if given or not searched or size < COARSE_RUN_FROM:
        return []
    maxh = float(np.ptp(MeshArrays(mesh).vertices, axis=0).max()) / COARSE_ELEMENTS
    most = max(COARSE_DOFS, round(COARSE_SHARE * size))
    refinement = Refinement(COARSE_ORDER, "isoparametric", 0.5, None, most)
    try:
        return list(levels(problem, first_level(problem, maxh, refinement), refinement))
    except (ContactError, ValueError) as error:  # it decides nothing but the start
        log.debug("no coarse run: %s", error)
        return []
