"""Time to accuracy: ngcontact's adaptive loop, from geometry to answer, beside the other codes."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from itertools import groupby

import numpy as np

from drivers.benchmark.engines import NotInstalledError, Run
from drivers.benchmark.scenes.problems import Common, Reference
from ngcontact import adapt

PACKAGE = "drivers.benchmark.engines"
ENGINES = (
    "ngsolve_penalty",
    "ngsolve_active_set",
    "scikit",
    "felupe_active_set",
    "kratos",
    "akantu_penalty",
)
OURS = "ngcontact"
ORDERS = (2, 3, 4)
BUDGET = {2: 100_000, 3: 60_000, 4: 40_000}
SIZES = {
    "uniform": (1_000, 4_000, 16_000, 64_000),
    "graded": (1_000, 4_000, 16_000, 64_000),
}
# More would take minutes a run, and up to 18 s with Akantu.
LARGEST = {"kratos": 16_000, "ngsolve_penalty": 16_000, "akantu_penalty": 4_000}
TOLERANCES = (1e-2, 1e-3, 1e-4, 1e-5)
QUANTITIES = ("force", "peak", "half_width", "energy")
TOGETHER = ("force", "peak", "half_width")


@dataclass(frozen=True)
class Point:
    """Seconds and relative errors of one run, or of one level of an adaptive run.

    Attributes
    ----------
    engine, problem, mesh_kind : str
    variant : str
        The engine with its settings, where several are tried.
    order, unknowns : int
    seconds : float
        What counts: meshing and all levels but for meshes graded by hand.
    errors : dict
        Relative errors by quantity.
    """

    engine: str
    problem: str
    mesh_kind: str
    variant: str
    order: int
    unknowns: int
    seconds: float
    errors: dict[str, float]


def errors(found: Run, reference: Reference) -> dict[str, float]:
    """Relative errors of the four quantities."""
    return {name: abs(getattr(found, name) / getattr(reference, name) - 1) for name in QUANTITIES}


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


def median_runs(rounds: Sequence[Sequence[Run]]) -> list[Run]:
    """The runs of the first round with the medians of all rounds' seconds."""
    return [
        replace(
            same[0],
            seconds=float(np.median([run.seconds for run in same])),
            seconds_mesh=float(np.median([run.seconds_mesh for run in same])),
        )
        for same in zip(*rounds, strict=True)
    ]


def engine_runs(name: str, common: Common, max_dofs: int) -> list[Run]:
    """All runs of one other code."""
    engine = import_module(f"{PACKAGE}.{name}")
    most = min(LARGEST.get(name, max_dofs), max_dofs)
    return [
        run
        for kind, sizes in SIZES.items()
        for run in engine.runs(common, (kind,), [size for size in sizes if size <= most])
    ]


def points(common: Common, rounds: int, max_dofs: int) -> tuple[list[Point], list[str]]:
    """All engines on one problem, interleaved, and what could not be run."""
    missing: dict[str, str] = {}
    collected: dict[str, list[list[Run]]] = {}
    adaptive_run(common, ORDERS[0], max_dofs)  # warm-up
    for number in range(rounds):
        print(f"{common.name}: round {number + 1} of {rounds}", file=sys.stderr, flush=True)
        for order in ORDERS:
            collected.setdefault(f"{OURS} {order}", []).append(
                adaptive_run(common, order, max_dofs)
            )
        for name in ENGINES:
            if name in missing:
                continue
            try:
                collected.setdefault(name, []).append(engine_runs(name, common, max_dofs))
            except NotInstalledError as error:
                missing[name] = str(error)
                collected.pop(name)
    found = [
        Point(
            engine=OURS if name.startswith(OURS) else import_module(f"{PACKAGE}.{name}").ENGINE,
            problem=run.problem,
            mesh_kind=run.mesh_kind,
            variant=run.engine,
            order=run.order,
            unknowns=run.unknowns,
            seconds=run.seconds + (run.seconds_mesh if run.mesh_kind == "uniform" else 0.0),
            errors=errors(run, common.reference),
        )
        for name, rounds_of_one in collected.items()
        for run in median_runs(rounds_of_one)
    ]
    return found, list(missing.values())


def seconds_to(series: Sequence[Point], names: Sequence[str], tolerance: float) -> float:
    """Seconds of the first run from which on all errors stay below; infinite if there is none.

    One run that is right by chance, with finer ones that are not, does not count.
    """
    best = math.inf
    for point in sorted(series, key=lambda p: -p.unknowns):
        if not np.max([point.errors[name] for name in names]) <= tolerance:  # NaN is a failure
            break
        best = point.seconds
    return best


def best_seconds(
    found: Sequence[Point], engine: str, kind: str, names: Sequence[str], tolerance: float
) -> float:
    """The same for the best order and settings of an engine."""

    def settings(point: Point) -> tuple[str, int]:
        return point.variant, point.order

    mine = sorted((p for p in found if (p.engine, p.mesh_kind) == (engine, kind)), key=settings)
    return min(
        (seconds_to(list(group), names, tolerance) for _, group in groupby(mine, settings)),
        default=math.inf,
    )


def series(found: Sequence[Point]) -> Iterator[tuple[str, str]]:
    """Every engine with every kind of mesh, ngcontact first."""
    yield from dict.fromkeys((p.engine, p.mesh_kind) for p in found)
