"""Time to accuracy: ngcontact's adaptive loop, from geometry to answer, beside the other codes."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np

from drivers.benchmark.engines import NotInstalledError, Run, kratos, ngsolve
from drivers.benchmark.scenes.meshes import KINDS
from drivers.benchmark.scenes.problems import COMMONS, Common
from drivers.benchmark.studies import Extent
from drivers.tables import table
from ngcontact import adapt

ENGINES = (ngsolve.PENALTY, ngsolve.ACTIVE_SET, kratos.MORTAR)
OURS = "ngcontact"
BUDGET = {2: 100_000, 3: 60_000, 4: 40_000}  # unknowns by order
SIZES = (1_000, 4_000, 16_000, 64_000)
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
QUANTITIES = ("force", "peak", "half_width", "energy")
TOGETHER = ("force", "peak", "half_width")


@dataclass(frozen=True)
class Point:
    """One run, or one level of an adaptive run, and its relative errors by quantity.

    `engine` has no settings, those that are tried are in the run's. `seconds` are what counts:
    meshing and all levels but for meshes graded by hand.
    """

    engine: str
    run: Run
    seconds: float
    errors: dict[str, float]

    @property
    def settings(self) -> tuple[str, int]:
        """Settings of the engine, and the order."""
        return self.run.engine, self.run.order

    @property
    def series(self) -> tuple[str, str]:
        """Engine and kind of mesh."""
        return self.engine, self.run.mesh_kind


def adaptive_run(common: Common, order: int, max_dofs: int) -> list[Run]:
    """One adaptive run; the seconds of each level include all before it, and the meshing."""
    result = []
    start = time.perf_counter()
    for solution in adapt(common.problem, order=order, max_dofs=min(BUDGET[order], max_dofs)):
        seconds = time.perf_counter() - start
        ends = solution.transitions()
        result.append(
            Run(
                engine=OURS,
                problem=common.name,
                mesh_kind="adaptive",
                order=order,
                unknowns=solution.displacement.space.ndof,
                seconds_mesh=0.0,
                seconds=seconds,
                steps=len(solution.steps),
                force=common.parts * abs(float(solution.contact_force()[1])),
                peak=float(solution.pressure[np.abs(solution.points[:, 0]).argmin()]),
                half_width=float(ends[:, 0].max()) if len(ends) else math.nan,
                energy=solution.energy_norm**2 / 2,
            )
        )
        start += time.perf_counter() - start - seconds  # reading off is not counted
    return result


def point(engine: str, common: Common, same: Sequence[Run]) -> Point:
    """The run of the first round with the medians of all rounds' seconds."""
    seconds, meshing = np.median([(r.seconds, r.seconds_mesh) for r in same], axis=0).tolist()
    run = replace(same[0], seconds=seconds, seconds_mesh=meshing)
    errors = {q: abs(getattr(run, q) / getattr(common.reference, q) - 1) for q in QUANTITIES}
    whole = seconds + (meshing if run.mesh_kind == "uniform" else 0.0)
    return Point(engine, run, whole, errors)


def points(common: Common, rounds: int, max_dofs: int) -> tuple[list[Point], list[str]]:
    """All engines on one problem, interleaved, and what could not be run."""
    missing: dict[str, str] = {}
    collected: dict[tuple[str, int], list[list[Run]]] = {}
    adaptive_run(common, min(BUDGET), max_dofs)  # warm-up
    for number in range(rounds):
        print(f"{common.name}: round {number + 1} of {rounds}", file=sys.stderr, flush=True)
        for order in BUDGET:
            runs = adaptive_run(common, order, max_dofs)
            collected.setdefault((OURS, order), []).append(runs)
        for engine in ENGINES:
            sizes = [size for size in SIZES if size <= min(engine.largest, max_dofs)]
            try:
                runs = list(engine.runs(common, KINDS, sizes))
            except NotInstalledError as error:
                missing[engine.name] = str(error)
                continue
            collected.setdefault((engine.name, 0), []).append(runs)
    found = [
        point(engine, common, same)
        for (engine, _), rounds_of_one in collected.items()
        for same in zip(*rounds_of_one, strict=True)
    ]
    return found, list(missing.values())


def seconds_to(series: Sequence[Point], names: Sequence[str], tolerance: float) -> float:
    """Seconds of the first run from which on all errors stay below; infinite if there is none.

    One run that is right by chance, with finer ones that are not, does not count.
    """
    best = math.inf
    for point in sorted(series, key=lambda p: -p.run.unknowns):
        if not np.max([point.errors[name] for name in names]) <= tolerance:  # NaN is a failure
            break
        best = point.seconds
    return best


def best_seconds(
    found: Sequence[Point], series: tuple[str, str], names: Sequence[str], tolerance: float
) -> float:
    """The same for the best order and settings of an engine on one kind of mesh."""
    mine = sorted((p for p in found if p.series == series), key=lambda p: p.settings)
    groups = (list(group) for _, group in groupby(mine, lambda p: p.settings))
    return min((seconds_to(group, names, tolerance) for group in groups), default=math.inf)


def accuracy(extent: Extent) -> tuple[list[Point], str]:
    """Time to accuracy."""
    found, missing = [], set()
    for name in extent.problems:
        here, lines = points(COMMONS[name](), extent.rounds, extent.max_dofs)
        found += here
        missing |= set(lines)
    return found, "\n\n".join([of_accuracy(found), *sorted(missing)])


def of_accuracy(found: Sequence[Point]) -> str:
    """Seconds of each engine's best order to relative errors."""
    rows = []
    for problem in dict.fromkeys(p.run.problem for p in found):
        mine = [p for p in found if p.run.problem == problem]
        for names in (*((name,) for name in QUANTITIES), TOGETHER):
            title = "the first three" if names == TOGETHER else names[0].replace("_", "-")
            for series in dict.fromkeys(p.series for p in mine):
                times = [best_seconds(mine, series, names, t) for t in TOLERANCES]
                label = f"**{OURS}**" if series[0] == OURS else series[0]
                cells = ("-" if math.isinf(t) else f"{t:.3g}" for t in times)
                rows.append((problem, title, label, series[1], *cells))
    return table(
        ("problem", "quantity", "engine", "meshes", *(f"{t:.0e}" for t in TOLERANCES)), rows
    )
