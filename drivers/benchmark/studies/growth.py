"""Growth: seconds and peak memory against unknowns, each run in a process of its own.

python -m drivers.benchmark.studies.growth block 2 100000 contact
"""

from __future__ import annotations

import json
import resource
import subprocess
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import ngsolve as ng

from drivers.benchmark.scenes.problems import COMMONS, Name
from drivers.benchmark.studies.linear import linear_solve, uniform_mesh
from drivers.command_line import Count, Order, run
from ngcontact import solve

SIZES = (10_000, 30_000, 100_000, 300_000, 1_000_000)
ORDERS = (1, 2)
Kind: TypeAlias = Literal["linear", "contact"]


@dataclass(frozen=True)
class Process:
    """What one process measures.

    Attributes
    ----------
    problem : str
    order, unknowns : int
    seconds : float
        Of the solve alone; of a contact solve that knows nothing, with its coarse run.
    memory : float
        Peak of the process, GB, its libraries and the mesh included.
    """

    problem: str
    order: int
    unknowns: int
    seconds: float
    memory: float


@dataclass(frozen=True)
class Growth(Process):
    """One process of a `kind`, "linear" or "contact"."""

    kind: str


def measure(name: Name, order: Order, size: Count, kind: Kind) -> Growth:
    """One solve, in this process, whose memory so far counts.

    Parameters
    ----------
    name : str
        Common problem.
    order : int
        Degree of the displacement on each element, 1 to 4.
    size : int
        Number of unknowns, about.
    kind : str
        What is solved: contact, or the linear problem without it.

    Returns
    -------
    Growth
        Seconds, memory in GB and the exact number of unknowns.
    """
    problem = COMMONS[name]().problem
    mesh = uniform_mesh(problem, order, size)
    start = time.perf_counter()
    if kind == "linear":
        count = linear_solve(problem, mesh, order).unknowns
    else:
        count = solve(problem, mesh, order=order).displacement.space.ndof
    seconds = time.perf_counter() - start
    return Growth(name, order, count, seconds, peak_memory(), kind)


def peak_memory() -> float:
    """Largest memory of this process so far, GB."""
    status = Path("/proc/self/status")
    if status.exists():  # what getrusage says there includes the process that started this one
        [line] = [x for x in status.read_text().splitlines() if x.startswith("VmHWM:")]
        return float(line.split()[1]) / 1e6
    unit = 1e9 if sys.platform == "darwin" else 1e6  # bytes there, kilobytes elsewhere
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def apart(module: str, *words: object) -> dict[str, Any]:
    """What a module prints last, as JSON, when it runs in a process of its own."""
    command = [sys.executable, "-m", module, *map(str, words)]
    done = subprocess.run(command, check=True, capture_output=True, text=True)
    found: dict[str, Any] = json.loads(done.stdout.splitlines()[-1])
    return found


def growths(problems: Sequence[Name], max_dofs: int) -> Iterator[Growth]:
    """All sizes up to about `max_dofs` unknowns, the kinds interleaved."""
    for name in problems:
        for order in ORDERS:
            for size in SIZES:
                for kind in get_args(Kind) if size <= max_dofs else ():
                    words = name, order, size, kind
                    yield Growth(**apart("drivers.benchmark.studies.growth", *words))


if __name__ == "__main__":
    ng.SetNumThreads(1)
    print(json.dumps(asdict(run(measure))))
