"""Overhead: one whole adaptive level over the linear solve of its mesh, and the import."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.studies.linear import linear_solve
from ngcontact import adapt

TARGETS = (1_000, 10_000, 30_000)  # unknowns; the first level of at least as many is shown
ORDERS = (1, 2, 3, 4)


@dataclass(frozen=True)
class Level:
    """One level of an adaptive run: marking, refinement, curving, solution, estimate.

    Attributes
    ----------
    problem : str
    order, unknowns : int
    seconds : float
    ratio : float
        Over the linear solve on its mesh.
    """

    problem: str
    order: int
    unknowns: int
    seconds: float
    ratio: float


def levels(common: Common, order: int, targets: Sequence[int], rounds: int) -> list[Level]:
    """Medians over several equal runs, each after a warm-up, linear solves interleaved."""
    problem, budget = common.problem, 2 * targets[-1]
    seconds, linear = [], []
    for number in range(rounds + 1):
        clock, meshes = [time.perf_counter()], []
        for solution in adapt(problem, order=order, max_dofs=budget):
            str(solution)  # asks for the estimate: part of this level, not of the next
            clock.append(time.perf_counter())
            meshes.append((solution.mesh, solution.displacement.space.ndof))
        if number:
            seconds.append(np.diff(clock))
            linear.append([linear_solve(problem, mesh, order).seconds for mesh, _ in meshes])
    level, base = np.median(seconds, axis=0), np.median(linear, axis=0)
    count = np.array([n for _, n in meshes])
    chosen = sorted({int(np.searchsorted(count, target)) for target in targets})
    return [
        Level(common.name, order, int(count[i]), float(level[i]), float(level[i] / base[i]))
        for i in chosen
        if i > 0  # the first level meshes the geometry
    ]


def all_levels(commons: list[Common], rounds: int, max_dofs: int) -> Iterator[Level]:
    """All problems and orders; levels of `TARGETS` up to `max_dofs` unknowns."""
    targets = [target for target in TARGETS if target <= max_dofs]
    for common in commons:
        for order in ORDERS:
            yield from levels(common, order, targets, rounds)


def import_seconds(rounds: int = 7) -> tuple[float, float]:
    """Medians of ``import ngsolve`` and ``import ngcontact`` in fresh processes, interleaved."""
    script = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
    times = [
        [
            float(subprocess.check_output([sys.executable, "-c", script.format(name)]))
            for name in ("ngsolve", "ngcontact")
        ]
        for _ in range(rounds)
    ]
    plain, ours = np.median(times, axis=0)
    return float(plain), float(ours)
