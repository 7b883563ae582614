"""A bar of the contact force that is proved: which dual problems, and what they cost."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...fem import has_rough_loads, load_vector, stress_of
from ...problem import varies
from ..bound import FINE, Guaranteed, force_bar

INTEGRATED = 5  # degree of NGSolve's quadrature with dx, without a bonus
STRAIGHT = 1e-12  # difference of directions that are one: round-off
ROUND_OFF = 64 * np.finfo(float).eps  # of a force, relative to the terms that it is the sum of


def proved_force_errors(solution: Guaranteed, pair: int, e: Array) -> tuple[float, float]:
    """How far a pair's contact force is from the true one at most, along `e` (2,) and across it.

    Raises
    ------
    ValueError, ContactError
        No bar is proved, or one beyond the force itself.
    """
    if not solution.problem.model.startswith("plane"):
        raise ValueError(f'no bar of the force is proved for "{solution.problem.model}"')
    if len(solution.pairs[pair].line.node) == 0:
        raise ValueError("the points of this pair belong to other pairs, which have its force")
    if has_rough_loads(solution.problem, solution.discrete.space.V):
        raise ValueError("loads that are rougher than the mesh count as they are integrated")
    d, across = solution.pairs[pair].line.direction, np.array([-e[1], e[0]])
    if np.ptp(d, axis=0).max() <= STRAIGHT:  # the force is one number times d
        one = _component(solution, pair, d[0])
        along, other = (one * abs(float(d[0] @ x)) for x in (e, across))
        other = other if other > STRAIGHT * along else 0.0
    else:
        along, other = (_component(solution, pair, x) for x in (e, across))
    size = float(np.linalg.norm(solution.contact_force(pair)))
    if max(along, other) > size > 0:
        raise ValueError(f"what is proved, {max(along, other):.2g}, is more than the force itself")
    return along, other


def _component(solution: Guaranteed, pair: int, e: Array) -> float:
    """How far the force's component along `e` (2,) is from the true one, at most."""
    states, space, u = solution.pairs, solution.discrete.space, solution.displacement
    directions = [e if number == pair else 0 * e for number in range(len(states))]
    jumps = [s.line.direction @ d for s, d in zip(states, directions, strict=True)]
    jump = np.where(solution.active, np.concatenate(jumps), 0.0)
    found = solution.discrete.influence(solution.active, jump)
    G = solution.discrete.displacement(found.u)
    solution.work["factorizations"] += found.factorizations
    solution.work["back_solves"] += found.back_solves
    solution.work["equilibrations"] += 1
    error = force_bar(solution.equilibrated.proof, u, G, directions)
    a, b = (x.vec.FV().NumPy() for x in (u, G))
    noise = ROUND_OFF * float(np.sqrt((space.diagonal @ a**2) * (space.diagonal @ b**2)))
    return error + noise + _integrated(solution, G)


def _integrated(solution: Guaranteed, G: ng.GridFunction) -> float:
    """Size of what quadrature of stiffness and loads misses of A(u_h, G) - l(G)."""
    space, problem, u = solution.discrete.space, solution.problem, solution.displacement
    a, b = (x.vec.FV().NumPy() for x in (u, G))
    missed = 0.0
    if problem.force or problem.traction:
        missed -= float((load_vector(problem, space.V, FINE) - space.f) @ b)
    inexact = space.trace.curved_elements | any(map(varies, problem.materials.values()))
    if inexact.any():
        p, geometry = space.trace.order, space.trace.geometry_order
        work = ng.InnerProduct(stress_of(problem, u), ng.Sym(ng.Grad(G)))
        fine, mesh = 2 * p * geometry + 2 * geometry + 8, space.trace.mesh
        for some, order in ((inexact, fine), (~inexact, 2 * p)):
            dx = ng.dx(bonus_intorder=order - INTEGRATED, definedonelements=ng.BitArray(some))
            missed += float(ng.Integrate(work * dx, mesh))
        missed -= float(a @ (space.A @ b))
    return abs(missed)
