"""What is looked at before the first solve of a run."""

from __future__ import annotations

import ngsolve as ng

from ..fem import warn_of_locking
from ..problem import Problem
from ..quadrature import warn_of_data, warn_of_jumps
from .corners import warn_of_contradictions


def warn_of_implausible(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of elements that lock, loads that are nowhere, supports that contradict, laws that jump.

    Once, of the first mesh.
    """
    warn_of_locking(problem, mesh, order)
    warn_of_data(problem, mesh, order)
    warn_of_contradictions(problem, mesh)
    warn_of_jumps(problem, mesh)
