"""Large problems: whole contact solves by Cholesky factor and by multigrid, each in a process.

python -m drivers.benchmark.studies.large block 2 1000000 iterative
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator
from dataclasses import asdict, dataclass

import ngsolve as ng

from drivers.benchmark.studies.growth import COMMONS, Process, apart, peak_memory
from drivers.benchmark.studies.linear import uniform_mesh
from ngcontact import solve
from ngcontact.discrete import linear_systems

SIZES = (100_000, 300_000, 1_000_000, 3_000_000)
ORDERS = (1, 2)
PATHS = {"direct": sys.maxsize, "iterative": 0}  # with the size from which the path is iterative


@dataclass(frozen=True)
class Large(Process):
    """One process that takes one of the `PATHS`.

    Attributes
    ----------
    path : str
    systems, cycles : int
        Linear systems, and V-cycles or back-solves for all of them.
    """

    path: str
    systems: int
    cycles: int


def measure(name: str, order: int, size: int, path: str) -> Large:
    """Run here; `memory` is that of this process so far."""
    problem = COMMONS[name]().problem
    mesh = uniform_mesh(problem, order, size)
    linear_systems.LARGE = {order: PATHS[path]}
    start = time.perf_counter()
    solution = solve(problem, mesh, order=order)
    seconds = time.perf_counter() - start
    if (path == "direct") != (solution.work["factorizations"] > 0):
        raise RuntimeError(f"{name}, order {order}, {size} unknowns did not stay {path}")
    return Large(
        *(name, order, solution.displacement.space.ndof, seconds, peak_memory(), path),
        systems=len(solution.steps),
        cycles=solution.work["back_solves"],
    )


def larges() -> Iterator[Large]:
    """All sizes, both paths interleaved."""
    for name in COMMONS:
        for order in ORDERS:
            for size in SIZES:
                for path in PATHS:
                    yield Large(**apart("drivers.benchmark.studies.large", name, order, size, path))


if __name__ == "__main__":
    ng.SetNumThreads(1)
    name, order, size, path = sys.argv[1:]
    print(json.dumps(asdict(measure(name, int(order), int(size), path))))
