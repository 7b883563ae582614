"""Overhead of contact and of adaptivity over the linear solve of the same mesh, and the import."""

from __future__ import annotations

import subprocess
import sys
import time
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.studies import Extent
from drivers.benchmark.studies.linear import linear_solve, uniform_mesh
from drivers.tables import markdown
from ngcontact import adapt, solve

SIZES = (1_000, 10_000, 100_000, 300_000)
TARGETS = (1_000, 10_000, 30_000)  # unknowns; the first level of at least as many is shown


@dataclass(frozen=True)
class Tax:
    """Medians of interleaved rounds; pairs are cold and warm."""

    problem: str
    order: int
    unknowns: int
    linear: float  # seconds of the linear solve
    cold: float  # a contact solve that knows nothing, over the linear solve
    warm: float  # one that starts from a solution on a coarser mesh
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
    base, *others = np.median(seconds, axis=0).tolist()
    factors = cold.work["factorizations"], warm.work["factorizations"]
    steps = len(cold.steps), len(warm.steps)
    over = [value / base for value in others]
    return Tax(common.name, order, linear.unknowns, base, over[0], over[1], steps, factors)


def taxes(extent: Extent) -> tuple[list[Tax], str]:
    """Contact tax."""
    rows = [tax(*case, extent.rounds) for case in extent.cases((1, 2), SIZES)]
    columns = {
        "problem": "{0.problem}",
        "order": "{0.order}",
        "unknowns": "{0.unknowns}",
        "linear, s": "{0.linear:.3g}",
        "cold": "{0.cold:.2f}",
        "warm": "{0.warm:.2f}",
        "systems": "{0.systems[0]}, {0.systems[1]}",
        "factors": "{0.factorizations[0]}, {0.factorizations[1]}",
    }
    return rows, markdown(columns, rows)


@dataclass(frozen=True)
class Level:
    """One level of an adaptive run: marking, refinement, curving, solution, estimate."""

    problem: str
    order: int
    unknowns: int
    seconds: float
    ratio: float  # over the linear solve on its mesh


def levels(common: Common, order: int, targets: list[int], rounds: int) -> Iterator[Level]:
    """Medians over several equal runs, each after a warm-up, linear solves interleaved."""
    problem, seconds, linear = common.problem, [], []
    for number in range(rounds + 1):
        clock, meshes = [time.perf_counter()], []
        for solution in adapt(problem, order=order, max_dofs=2 * targets[-1]):
            str(solution)  # asks for the estimate: part of this level, not of the next
            clock.append(time.perf_counter())
            meshes.append((solution.mesh, solution.displacement.space.ndof))
        if number:
            seconds.append(np.diff(clock))
            linear.append([linear_solve(problem, mesh, order).seconds for mesh, _ in meshes])
    level, base = np.median(seconds, axis=0).tolist(), np.median(linear, axis=0).tolist()
    count = [n for _, n in meshes]
    for i in sorted({int(np.searchsorted(count, target)) for target in targets} - {0}):
        # The first level meshes the geometry.
        yield Level(common.name, order, count[i], level[i], level[i] / base[i])


def all_levels(extent: Extent) -> tuple[list[Level], str]:
    """Whole levels and imports."""
    targets = [target for target in TARGETS if target <= extent.max_dofs]
    rows = [
        row
        for common, order, _ in extent.cases((1, 2, 3, 4), targets[:1])
        for row in levels(common, order, targets, extent.rounds)
    ]
    columns = {
        "problem": "{0.problem}",
        "order": "{0.order}",
        "unknowns": "{0.unknowns}",
        "level, s": "{0.seconds:.3g}",
        "over linear": "{0.ratio:.2f}",
    }
    plain, ours = import_seconds()
    imports = f"import: ngsolve {plain:.3f} s, ngcontact {ours:.3f} s"
    return rows, f"{markdown(columns, rows)}\n\n{imports}"


def import_seconds(rounds: int = 7) -> tuple[float, float]:
    """Medians of ``import ngsolve`` and ``import ngcontact`` in fresh processes, interleaved."""
    script = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
    commands = [[sys.executable, "-c", script.format(x)] for x in ("ngsolve", "ngcontact")]
    times = [[float(subprocess.check_output(x)) for x in commands] for _ in range(rounds)]
    plain, ours = np.median(times, axis=0).tolist()
    return plain, ours
