"""Many solves on all cores: a disc pressed on a block, 64 depths and stiffnesses, against Hertz.

Every problem travels to a process of its own choice, and one row of a table comes back. The same
study by one process first, so that numbers and times can be compared. Writes study.csv.

    python -m drivers.parameter_study
    python -m drivers.parameter_study --engine joblib --processes 4
"""

from __future__ import annotations

import math
import multiprocessing
import os
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any, Literal, TypeAlias

from drivers.command_line import Count, Order, Positive, run
from drivers.hertz import pressed
from drivers.reference.half_spaces import Hertz, plane_modulus, reduced
from drivers.tables import Columns, printed, write_csv
from ngcontact import Elastic, Problem, adapt

Row: TypeAlias = dict[str, float]
Task: TypeAlias = tuple[Problem, int, float]  # with order and tolerance
Engine: TypeAlias = Literal["processes", "joblib", "dask"]

BLOCK, NU = 70e9, 0.3  # of the block, Pa; of both
COLUMNS: Columns = {
    "depth/R": "{0[depth]:.5f}",
    "E/GPa": lambda row: f"{row['E'] / 1e9:.0f}",
    "unknowns": "{0[unknowns]}",
    "force kN/m": lambda row: f"{row['contact_0_force_y'] / 1e3:.1f}",
    "peak/MPa": lambda row: f"{row['contact_0_peak_pressure'] / 1e6:.1f}",
    "Hertz/MPa": lambda row: f"{row['hertz_peak'] / 1e6:.1f}",
}


def parameters(solves: int) -> list[tuple[float, float]]:
    """Depths, in radii, and Young's moduli of the disc (Pa): a grid, four moduli at most."""
    moduli = [70e9, 140e9, 210e9, 420e9][: min(4, solves)]
    depths = math.ceil(solves / len(moduli))
    grid = [(0.001 * 1.1**k, E) for k in range(depths) for E in moduli]
    return grid[:solves]


def solved(task: Task) -> Row:
    """The row of one problem: what a worker does."""
    problem, order, tolerance = task
    *_, last = adapt(problem, order=order, tolerance=tolerance)
    return last.record()


def one_thread() -> None:
    """Let the libraries of all workers to come use one thread: there is one for each core.

    NGSolve's, too: its Cholesky factorisation of large systems starts threads, which wait by
    spinning.
    """
    for library in ("OMP", "OPENBLAS", "MKL", "NGS"):
        os.environ[f"{library}_NUM_THREADS"] = "1"


def by_processes(tasks: Sequence[Task], processes: int) -> list[Row]:
    """Rows by the standard library; new interpreters, as Netgen does not survive a fork."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(processes, mp_context=spawn) as pool:
        return list(pool.map(solved, tasks))


def by_joblib(tasks: Sequence[Task], processes: int) -> list[Row]:
    """Rows by joblib, whose workers are new interpreters, too."""
    from joblib import Parallel, delayed, parallel_config

    with parallel_config("loky", n_jobs=processes, inner_max_num_threads=1):
        return list(Parallel()(delayed(solved)(task) for task in tasks))


def by_dask(tasks: Sequence[Task], processes: int) -> list[Row]:
    """Rows by Dask on this machine; with the address of a scheduler the same on a cluster."""
    from dask.distributed import Client

    with Client(n_workers=processes, threads_per_worker=1, dashboard_address=None) as client:
        return list(client.gather(client.map(solved, tasks, pure=False)))


ENGINES: dict[str, Callable[[Sequence[Task], int], list[Row]]] = {
    "processes": by_processes,
    "joblib": by_joblib,
    "dask": by_dask,
}


def difference(first: Sequence[Row], second: Sequence[Row]) -> float:
    """Largest relative difference of energies, forces and peaks; infinite if sizes differ."""
    worst = 0.0
    for one, other in zip(first, second, strict=True):
        if any(one[name] != other[name] for name in ("unknowns", "active", "points")):
            return math.inf
        for name in ("energy", "contact_0_force_y", "contact_0_peak_pressure"):
            worst = max(worst, abs(one[name] - other[name]) / abs(one[name]))
    return worst


def table(grid: Sequence[tuple[float, float]], rows: Sequence[Row]) -> list[dict[str, Any]]:
    """Parameters, Hertz's peak under the force of both halves, and the record, one dict a solve."""
    found = []
    for (depth, E), row in zip(grid, rows, strict=True):
        stiffness = reduced([plane_modulus(E, NU), plane_modulus(BLOCK, NU)])
        _, peak = Hertz(2 * row["contact_0_force_y"], 1.0, stiffness).cylinder()
        found.append({"depth": depth, "E": E, "hertz_peak": peak, **row})
    return found


def main(
    *,
    solves: Count = 64,
    processes: Count = 2,
    engine: Engine = "processes",
    order: Order = 3,
    tolerance: Positive = 0.01,
    out: Path | None = Path("out"),
) -> tuple[list[dict[str, Any]], float]:
    """Many solves, by one process and by several: same numbers, and the speed-up.

    Parameters
    ----------
    solves : int
        Number of problems.
    processes : int
        Number of workers of the second run.
    engine : str
        Who starts the workers: the standard library, joblib or Dask.
    order : int
        Degree of the displacement on each element, 1 to 4.
    tolerance : float
        Estimated error, relative in the energy norm, that ends the refinement.
    out : path, optional
        Folder of study.csv; without one nothing is written.

    Returns
    -------
    rows : list of dict
        Parameters (m, Pa), Hertz's peak pressure (Pa) and the record of each solve.
    difference : float
        Largest relative difference between both runs.
    """
    one_thread()
    grid = parameters(solves)
    tasks = [
        (pressed(1.0, depth, Elastic(E, NU), Elastic(BLOCK, NU)), order, tolerance)
        for depth, E in grid
    ]
    found, seconds = [], []
    for count in (1, processes):
        started = time.perf_counter()
        found.append(ENGINES[engine](tasks, count))
        seconds.append(time.perf_counter() - started)
        print(f"{solves} solves, {engine}, {count} at a time: {seconds[-1]:8.2f} s")
    worst = difference(*found)
    print(f"speed-up {seconds[0] / seconds[1]:.2f}, largest relative difference {worst:.1e}\n")
    rows = table(grid, found[1])
    printed(COLUMNS, rows[:: max(1, solves // 8)])
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        write_csv(out / "study.csv", rows)
        print(f"\nWritten: {out}/study.csv")
    return rows, worst


if __name__ == "__main__":
    run(main)
