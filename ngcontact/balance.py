"""Whether a solution is in balance: forces of the supports, conditions of optimality."""

from __future__ import annotations

import numpy as np

from .arrays import Array
from .matrix import terms
from .newton import Minimiser
from .problem.problem import Problem
from .problem.regions import boundary_mask
from .program import Program
from .trace import Trace


def resultants(problem: Problem, trace: Trace, reaction: Array) -> dict[str, Array]:
    """Sums (2,) of the forces `reaction` (n, 2) on nodes, by boundary of Gamma_u and Gamma_0."""
    mesh = trace.mesh
    names = np.array(mesh.GetBoundaries())
    patterns = [
        *reversed(list(problem.displacement)),  # at a common node the last one is in force
        *([] if problem.sliding is None else [str(problem.sliding)]),
    ]
    counted = np.zeros(len(reaction), dtype=bool)
    result: dict[str, Array] = {}
    for pattern in patterns:
        mask = boundary_mask(mesh, pattern)
        for name in dict.fromkeys(names[mask]):
            nodes = np.unique(trace.nodes[trace.select(mask & (names == name))])
            nodes = nodes[~counted[nodes]]
            counted[nodes] = True
            result[str(name)] = reaction[nodes].sum(axis=0)
    return result


def optimality(program: Program, minimiser: Minimiser) -> dict[str, float]:
    """Dimensionless residuals of the Karush-Kuhn-Tucker conditions, see `Solution.residuals`."""
    p, y, force, active = program, minimiser.u, minimiser.force, minimiser.active
    gap = p.g - y[p.unknown]
    residual = p.b - p.K @ y - p.R.T @ force
    sizes = (p.b, terms(p.K, y), force)
    load = max(np.abs(x).max(initial=0.0) for x in sizes)
    length = max(np.abs(y).max(initial=0.0), np.abs(p.g[active]).max(initial=0.0))
    largest = np.abs(force).max(initial=0.0)
    one_sided = force[~p.equality]

    def over(value: float, scale: float) -> float:
        return float(value / scale) if value > 0 else 0.0

    return {
        "equilibrium": over(np.abs(residual[~p.fixed]).max(initial=0.0), load),
        "penetration": over(-gap.min(initial=0.0), length),
        "tension": over(-one_sided.min(initial=0.0), largest),
        "complementarity": float(np.abs(force / (largest or 1.0) * (gap / (length or 1.0))).sum()),
    }
