"""Seconds and peak memory against unknowns, each solve in a process of its own.

"linear" is the problem without contact, "contact" the solve as users have it, "direct" and
"iterative" the same by Cholesky factor and by multigrid, whatever the size says.

python -m drivers.benchmark.studies.processes block 2 100000 contact
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal, TypeAlias, cast

import ngsolve as ng
import numpy as np

from drivers.benchmark.scenes.problems import COMMONS, Name
from drivers.benchmark.studies import Extent
from drivers.benchmark.studies.linear import linear_solve, uniform_mesh
from drivers.tables import markdown, table
from ngcontact import solve
from ngcontact.discrete import MULTIGRID

ORDERS = (1, 2)
GROWTH = (10_000, 30_000, 100_000, 300_000, 1_000_000)
LARGE = (100_000, 300_000, 1_000_000, 3_000_000)
Kind: TypeAlias = Literal["linear", "contact", "direct", "iterative"]
PATHS: dict[Kind, int] = {"direct": sys.maxsize, "iterative": 0}  # size from which it is iterative


@dataclass(frozen=True)
class Process:
    """What one process measures."""

    problem: str
    order: int
    unknowns: int
    kind: str
    seconds: float  # of the solve alone; of one that knows nothing, with its coarse run
    memory: float  # peak of the process, GB, its libraries and the mesh included
    systems: int  # linear ones
    cycles: int  # V-cycles or back-solves for all of them


def measure(name: Name, order: int, size: int, kind: Kind) -> Process:
    """One solve, in this process, whose memory so far counts.

    Raises RuntimeError if it took another path than the one asked for.
    """
    problem = COMMONS[name]().problem
    mesh = uniform_mesh(problem, order, size)
    known = MULTIGRID.large
    if kind in PATHS:
        MULTIGRID.large = {order: PATHS[kind]}
    start = time.perf_counter()
    if kind == "linear":
        count = linear_solve(problem, mesh, order).unknowns
        return Process(name, order, count, kind, time.perf_counter() - start, peak_memory(), 1, 1)
    try:
        solution = solve(problem, mesh, order=order)
        seconds = time.perf_counter() - start
    finally:
        MULTIGRID.large = known
    if kind in PATHS and (kind == "direct") != (solution.work["factorizations"] > 0):
        raise RuntimeError(
            f"{name}, order {order}, {size} unknowns did not stay {kind}: multigrid serves from "
            f"{MULTIGRID.coarsest} unknowns on meshes that refinement made, where it converges"
        )
    count, work = solution.displacement.space.ndof, solution.work["back_solves"]
    spent = seconds, peak_memory(), len(solution.steps), work
    return Process(name, order, count, kind, *spent)


def peak_memory() -> float:
    """Largest memory of this process so far, GB."""
    status = Path("/proc/self/status")
    if status.exists():  # what getrusage says there includes the process that started this one
        [line] = [x for x in status.read_text().splitlines() if x.startswith("VmHWM:")]
        return float(line.split()[1]) / 1e6
    unit = 1e9 if sys.platform == "darwin" else 1e6  # bytes there, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def apart(extent: Extent, sizes: Sequence[int], kinds: Sequence[Kind]) -> list[Process]:
    """All sizes, each in a process of its own, the kinds interleaved."""
    found = []
    for common, order, size in extent.cases(ORDERS, sizes):
        for kind in kinds:
            words = [common.name, str(order), str(size), kind]
            command = [sys.executable, "-m", "drivers.benchmark.studies.processes", *words]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            found.append(Process(**json.loads(done.stdout.splitlines()[-1])))
    return found


def growth(extent: Extent) -> tuple[list[Process], str]:
    """Growth of time and memory."""
    rows = apart(extent, GROWTH, ("linear", "contact"))
    return rows, of_growth(rows)


def of_growth(rows: Sequence[Process]) -> str:
    """Exponents of time and ratios of memory."""
    lines: list[Sequence[object]] = []
    for key in dict.fromkeys((r.problem, r.order) for r in rows):
        linear, contact = (
            [r for r in rows if (r.problem, r.order, r.kind) == (*key, kind)]
            for kind in ("linear", "contact")
        )
        for one, other in zip(linear, contact, strict=True):
            seconds = (f"{r.seconds:.3g}" for r in (one, other))
            ratios = (other.seconds / one.seconds, other.memory / one.memory)
            rest = (f"{x:.2f}" for x in (one.memory, other.memory, *ratios))
            lines.append((*key, one.unknowns, *seconds, *rest))
        if len(linear) > 1:
            logs = (np.log([[r.unknowns, r.seconds] for r in x]).T for x in (linear, contact))
            exponents = (f"{np.polyfit(n, s, 1)[0]:.2f}" for n, s in logs)
            lines.append((*key, "exponent", *exponents, "", "", "", ""))
    titles = ("problem", "order", "unknowns", "linear, s", "contact, s", "linear, GB")
    return table((*titles, "contact, GB", "time", "memory"), lines)


def large(extent: Extent) -> tuple[list[Process], str]:
    """Large problems, direct and iterative."""
    rows = apart(extent, LARGE, tuple(PATHS))
    return rows, of_large(rows)


def of_large(rows: Sequence[Process]) -> str:
    """Direct and iterative beside each other."""
    columns = {
        "problem": "{0[0].problem}",
        "order": "{0[0].order}",
        "unknowns": "{0[0].unknowns}",
        "direct, s": "{0[0].seconds:.3g}",
        "iterative, s": "{0[1].seconds:.3g}",
        "direct, GB": "{0[0].memory:.2f}",
        "iterative, GB": "{0[1].memory:.2f}",
        "systems": "{0[1].systems}",
        "V-cycles": "{0[1].cycles}",
    }
    both = ([r for r in rows if r.kind == path] for path in PATHS)
    return markdown(columns, zip(*both, strict=True))


if __name__ == "__main__":
    ng.SetNumThreads(1)
    name, order, size, kind = sys.argv[1:]
    print(json.dumps(asdict(measure(cast(Name, name), int(order), int(size), cast(Kind, kind)))))
