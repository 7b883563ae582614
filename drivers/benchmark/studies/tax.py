"""Contact tax: time of a whole contact solve over that of the linear solve of the same mesh."""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.studies.linear import linear_solve, uniform_mesh
from ngcontact import solve

SIZES = (1_000, 10_000, 100_000, 300_000)
ORDERS = (1, 2)


@dataclass(frozen=True)
class Tax:
    """Medians of interleaved rounds.

    Attributes
    ----------
    problem : str
    order, unknowns : int
    linear : float
        Seconds of the linear solve.
    cold : float
        Of a contact solve that knows nothing, over the linear solve.
    warm : float
        Of one that starts from a solution on a coarser mesh, over the linear solve.
    systems : tuple of int
        Linear systems, cold and warm.
    factorizations : tuple of int
    """

    problem: str
    order: int
    unknowns: int
    linear: float
    cold: float
    warm: float
    systems: tuple[int, int]
    factorizations: tuple[int, int]


def tax(common: Common, order: int, size: int, rounds: int) -> Tax:
    """Measure one size."""
    problem = common.problem
    mesh = uniform_mesh(problem, order, size)
    coarse = solve(problem, uniform_mesh(problem, order, size // 4), order=order)
    seconds = []
    for _ in range(rounds):
        linear = linear_solve(problem, mesh, order)
        clock = [time.perf_counter()]
        cold = solve(problem, mesh, order=order)
        clock.append(time.perf_counter())
        warm = solve(problem, mesh, order=order, start=coarse)
        clock.append(time.perf_counter())
        seconds.append([linear.seconds, *np.diff(clock)])
    times = np.median(seconds, axis=0)
    return Tax(
        problem=common.name,
        order=order,
        unknowns=linear.unknowns,
        linear=float(times[0]),
        cold=float(times[1] / times[0]),
        warm=float(times[2] / times[0]),
        systems=(len(cold.steps), len(warm.steps)),
        factorizations=(cold.work["factorizations"], warm.work["factorizations"]),
    )


def taxes(commons: list[Common], rounds: int, max_dofs: int) -> Iterator[Tax]:
    """All problems, orders and sizes up to about `max_dofs` unknowns."""
    for common in commons:
        for order in ORDERS:
            for size in SIZES:
                if size <= max_dofs:
                    yield tax(common, order, size, rounds)
