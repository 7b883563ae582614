"""Large problems: whole contact solves by Cholesky factor and by multigrid, each in a process.

python -m drivers.benchmark.studies.large block 2 1000000 iterative
"""

from __future__ import annotations

import json
import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from typing import Literal, TypeAlias

import ngsolve as ng

from drivers.benchmark.scenes.problems import COMMONS, Name
from drivers.benchmark.studies.growth import Process, apart, peak_memory
from drivers.benchmark.studies.linear import uniform_mesh
from drivers.command_line import Count, Order, run
from ngcontact import solve
from ngcontact.discrete import MULTIGRID

SIZES = (100_000, 300_000, 1_000_000, 3_000_000)
ORDERS = (1, 2)
Solver: TypeAlias = Literal["direct", "iterative"]
# With the size from which the path is iterative.
PATHS: dict[Solver, int] = {"direct": sys.maxsize, "iterative": 0}


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


def measure(name: Name, order: Order, size: Count, path: Solver) -> Large:
    """One contact solve, in this process, whose memory so far counts.

    Parameters
    ----------
    name : str
        Common problem.
    order : int
        Degree of the displacement on each element, 1 to 4.
    size : int
        Number of unknowns, about.
    path : str
        How linear systems are solved: by Cholesky factor or by multigrid.

    Returns
    -------
    Large
        Seconds, memory in GB and the exact number of unknowns.

    Raises
    ------
    RuntimeError
        The solve took the other path.
    """
    problem = COMMONS[name]().problem
    mesh = uniform_mesh(problem, order, size)
    known, MULTIGRID.large = MULTIGRID.large, {order: PATHS[path]}
    try:
        start = time.perf_counter()
        solution = solve(problem, mesh, order=order)
        seconds = time.perf_counter() - start
    finally:
        MULTIGRID.large = known
    if (path == "direct") != (solution.work["factorizations"] > 0):
        raise RuntimeError(
            f"{name}, order {order}, {size} unknowns did not stay {path}: multigrid serves from "
            f"{MULTIGRID.coarsest} unknowns on meshes that refinement made, where it converges"
        )
    return Large(
        *(name, order, solution.displacement.space.ndof, seconds, peak_memory(), path),
        systems=len(solution.steps),
        cycles=solution.work["back_solves"],
    )


def larges(problems: Sequence[Name], max_dofs: int) -> Iterator[Large]:
    """All sizes up to about `max_dofs` unknowns, both paths interleaved."""
    for name in problems:
        for order in ORDERS:
            for size in SIZES:
                for path in PATHS if size <= max_dofs else ():
                    yield Large(**apart("drivers.benchmark.studies.large", name, order, size, path))


if __name__ == "__main__":
    ng.SetNumThreads(1)
    print(json.dumps(asdict(run(measure))))
