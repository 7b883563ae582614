"""The plain active set that a user of any finite element code writes, one factorisation a step."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from drivers.benchmark.scenes.plane import Bounded

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Solver = Callable[[Mask, Array], Array]

STEPS = 100


def active_set(problem: Bounded, solve: Solver) -> tuple[Array, Array, int]:
    """Primal-dual active set (m,) from the bounds that are attained before loading.

    `solve(free, b)` factorises K and returns x with K x = b in the free unknowns, zero elsewhere.

    Returns
    -------
    v : Array
        Minimiser (n,).
    force : Array
        Multipliers (m,) of the bounds, not negative.
    steps : int
        Linear systems solved.

    Raises
    ------
    RuntimeError
        The set still changes after a hundred steps.
    """
    at, lower = problem.at, problem.lower
    active = lower >= 0
    for step in range(1, STEPS + 1):
        free = ~problem.fixed
        free[at[active]] = False
        v = np.where(problem.fixed, problem.value, 0.0)
        v[at[active]] = lower[active]
        v += solve(free, problem.f - problem.K @ v)
        force = np.where(active, (problem.K @ v - problem.f)[at], 0.0)
        following = np.where(active, force > 0, v[at] < lower)
        if (following == active).all():
            return v, force, step
        active = following
    raise RuntimeError(f"the active set still changes after {STEPS} steps")
