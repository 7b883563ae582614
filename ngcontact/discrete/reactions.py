"""Whether a solution is in balance: forces of the supports, conditions of optimality."""

from __future__ import annotations

import numpy as np

from ..arrays import Array
from ..fem import BoundaryTrace
from ..problem import Problem, boundary_mask


def resultants(problem: Problem, trace: BoundaryTrace, reaction: Array) -> dict[str, Array]:
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
        segments = trace.segments(pattern)
        named = names[trace.region[segments]]
        for name in dict.fromkeys(names[boundary_mask(mesh, pattern)]):
            nodes = np.unique(trace.nodes[segments[named == name]])
            nodes = nodes[~counted[nodes]]
            counted[nodes] = True
            result[str(name)] = reaction[nodes].sum(axis=0)
    return result
