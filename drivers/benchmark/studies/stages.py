"""Where the time of one warm adaptive level goes."""

from __future__ import annotations

import cProfile
import pstats
import time
from pathlib import Path

from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.studies import Extent
from drivers.benchmark.studies.linear import uniform_mesh
from drivers.tables import of_dicts
from ngcontact import solve
from ngcontact.adaptivity import doerfler, refined

SIZES = (1_000, 10_000, 100_000, 1_000_000)
ORDER = 2
STAGES = {  # cumulative seconds of these functions; none calls another
    "assembly": [("space", "assemble")],
    "rows": [
        ("dual", "contact_line"),
        ("constraints", "change_of_basis"),
        ("boundary", "boundary_trace"),
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
    for common, _, size in extent.cases((ORDER,), SIZES):
        if size == SIZES[0]:
            stages(common, size)  # warm-up
        unknowns, seconds = stages(common, size)
        total = sum(seconds.values())
        shares = {name: f"{100 * spent / total:.0f} %" for name, spent in seconds.items()}
        row = {"problem": common.name, "unknowns": unknowns, "level, s": f"{total:.3g}"}
        rows.append(row | shares)
    return rows, of_dicts(rows)
