"""Overhead of contact, of adaptivity and of the import, and where the time of a level goes."""

from __future__ import annotations

import cProfile
import pstats
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.studies import Extent
from drivers.benchmark.studies.linear import linear_solve, uniform_mesh
from drivers.tables import of_dicts
from ngcontact import adapt, solve
from ngcontact.adaptivity import doerfler, refined

Row: TypeAlias = dict[str, Any]  # by title
SIZES = (1_000, 10_000, 100_000, 300_000)
TARGETS = (1_000, 10_000, 30_000)  # unknowns; the first level of at least as many is shown


def tax(common: Common, order: int, size: int, rounds: int) -> Row:
    """One size: seconds of the linear solve, and contact solves over it; medians of rounds.

    The cold one knows nothing, the warm one starts from a solution on a coarser mesh.
    """
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
    factors = [solution.work["factorizations"] for solution in (cold, warm)]
    return {
        "problem": common.name,
        "order": order,
        "unknowns": linear.unknowns,
        "linear, s": f"{base:.3g}",
        "cold": f"{others[0] / base:.2f}",
        "warm": f"{others[1] / base:.2f}",
        "systems": f"{len(cold.steps)}, {len(warm.steps)}",
        "factors": f"{factors[0]}, {factors[1]}",
    }


def taxes(extent: Extent) -> tuple[list[Row], str]:
    """Contact tax."""
    rows = [tax(*case, extent.rounds) for case in extent.cases((1, 2), SIZES)]
    return rows, of_dicts(rows)


def levels(common: Common, order: int, targets: list[int], rounds: int) -> Iterator[Row]:
    """Levels of a run: marking, refinement, curving, solution, estimate.

    Medians over several equal runs, each after a warm-up, linear solves on the same meshes
    interleaved.
    """
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
        yield {
            "problem": common.name,
            "order": order,
            "unknowns": count[i],
            "level, s": f"{level[i]:.3g}",
            "over linear": f"{level[i] / base[i]:.2f}",
        }


def all_levels(extent: Extent) -> tuple[list[Row], str]:
    """Whole levels and imports."""
    targets = [target for target in TARGETS if target <= extent.max_dofs]
    rows = [
        row
        for common, order, _ in extent.cases((1, 2, 3, 4), targets[:1])
        for row in levels(common, order, targets, extent.rounds)
    ]
    plain, ours = import_seconds()
    imports = f"import: ngsolve {plain:.3f} s, ngcontact {ours:.3f} s"
    return rows, f"{of_dicts(rows)}\n\n{imports}"


def import_seconds(rounds: int = 7) -> tuple[float, float]:
    """Medians of ``import ngsolve`` and ``import ngcontact`` in fresh processes, interleaved."""
    script = "import time; t = time.perf_counter(); import {}; print(time.perf_counter() - t)"
    commands = [[sys.executable, "-c", script.format(x)] for x in ("ngsolve", "ngcontact")]
    times = [[float(subprocess.check_output(x)) for x in commands] for _ in range(rounds)]
    plain, ours = np.median(times, axis=0).tolist()
    return plain, ours


STAGED = (1_000, 10_000, 100_000, 1_000_000)
ORDER = 2
STAGES = {  # cumulative seconds of these functions; none calls another
    "assembly": [("space", "assemble")],
    "rows": [
        ("dual", "contact_line"),
        ("constraints", "change_of_basis"),
        ("boundary", "of"),
    ],
    "rigid motions": [("equilibrium", "equilibrium")],
    "matrix": [("sparse", "congruent")],
    "factorisation": [("sparse", "factor")],
    "back-solves": [("sparse", "solve")],
    "multigrid": [("discrete_problem", "prepare"), ("multigrid", "solve")],
    "estimate": [("residual", "estimate")],
    "refinement": [("refinement", "refined")],
}


def stages(common: Common, size: int) -> tuple[int, dict[str, float]]:
    """Unknowns, and seconds by stage; "rest" is what no stage contains.

    Of one profiled level: a solution started from a coarser one, its estimate, a refinement.
    """
    problem = common.problem
    mesh = uniform_mesh(problem, ORDER, size)
    start = solve(problem, uniform_mesh(problem, ORDER, max(size // 4, 500)), order=ORDER)
    profile = cProfile.Profile()
    clock = time.perf_counter()
    profile.enable()
    solution = solve(problem, mesh, order=ORDER, start=start)
    refined(problem, mesh, doerfler(solution.indicators, 0.5))
    profile.disable()
    clock = time.perf_counter() - clock
    stats = pstats.Stats(profile)
    spent = dict.fromkeys(STAGES, 0.0)
    for (path, _, name), (*_, cumulative, callers) in stats.stats.items():  # type: ignore[attr-defined]
        for stage, functions in STAGES.items():
            if (Path(path).stem, name) in functions:
                outside = [c for c in callers if Path(c[0]).stem != "refinement"]
                share = sum(callers[c][3] for c in outside) if stage == "rows" else cumulative
                spent[stage] += share
    if not spent["assembly"] > 0:  # seen on Python 3.13.0, whose profiler misses outer calls
        raise RuntimeError(
            "Python's profiler has missed the assembly; use another Python, like 3.11"
        )
    spent["rest"] = clock - sum(spent.values())
    return solution.displacement.space.ndof, spent


def all_stages(extent: Extent) -> tuple[list[dict[str, object]], str]:
    """Where the time of a level goes."""
    rows: list[dict[str, object]] = []
    for common, _, size in extent.cases((ORDER,), STAGED):
        if size == STAGED[0]:
            stages(common, size)  # warm-up
        unknowns, seconds = stages(common, size)
        total = sum(seconds.values())
        shares = {name: f"{100 * spent / total:.0f} %" for name, spent in seconds.items()}
        row = {"problem": common.name, "unknowns": unknowns, "level, s": f"{total:.3g}"}
        rows.append(row | shares)
    return rows, of_dicts(rows)
