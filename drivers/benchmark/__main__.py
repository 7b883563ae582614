"""Run time against error, measured beside other codes on one machine.

    python -m drivers.benchmark
    python -m drivers.benchmark tax levels --rounds 3 --max-dofs 1e5

The other codes need the optional group `bench` of dependencies.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

import ngsolve as ng
from cyclopts import Parameter
from cyclopts.validators import Number

from drivers.benchmark.scenes.problems import Name
from drivers.benchmark.studies import Extent, accuracy, overhead, processes
from drivers.command_line import Count, run

Size: TypeAlias = Annotated[Count, Parameter(validator=Number(gte=10_000))]
PACKAGES = ("ngsolve", "numpy", "scipy", "KratosMultiphysics")


def machine() -> str:
    """Date, processor, threads and versions."""
    versions = []
    for name in PACKAGES:
        try:
            versions.append(f"{name} {importlib.metadata.version(name)}")
        except importlib.metadata.PackageNotFoundError:
            versions.append(f"{name} not installed")
    return (
        f"{datetime.date.today()}, {platform.machine()}, {os.cpu_count()} cores, one thread in "
        f"NGSolve, Python {platform.python_version()}, {', '.join(versions)}"
    )


Part: TypeAlias = Literal["tax", "levels", "growth", "large", "accuracy", "stages"]
# Each returns rows and their table in Markdown; its docstring is the title.
PARTS: dict[Part, Callable[[Extent], tuple[list[Any], str]]] = {
    "tax": overhead.taxes,
    "levels": overhead.all_levels,
    "growth": processes.growth,
    "large": processes.large,
    "accuracy": accuracy.accuracy,
    "stages": overhead.all_stages,
}


def main(
    parts: Sequence[Part] = get_args(Part),
    *,
    problems: Sequence[Name] = get_args(Name),
    rounds: Count = 5,
    max_dofs: Size = 3_000_000,
    out: Path = Path("out"),
) -> dict[Part, list[Any]]:
    """Run time against error, measured beside other codes on one machine.

    Prints Markdown tables and writes them. Everything takes about 55 minutes, 20 of
    them for the accuracy. Codes of the optional group bench that are not installed are left out.

    Parameters
    ----------
    parts : sequence of str
        Tables.
    problems : sequence of str
        Common problems.
    rounds : int
        Number of times that each solve is measured; tables give medians. Growth, large and stages
        measure once.
    max_dofs : int
        Number of unknowns, at least 10 000; problems of about more are left out.
    out : path
        Folder of the files.

    Returns
    -------
    dict of list
        Rows of each table: seconds, GB, relative errors.
    """
    out.mkdir(parents=True, exist_ok=True)
    ng.SetNumThreads(1)
    print(machine(), flush=True)
    extent, found = Extent(problems, rounds, max_dofs), {}
    for name in parts:
        found[name], table = PARTS[name](extent)
        text = f"{machine()}\n\n## {PARTS[name].__doc__}\n\n{table}\n"
        (out / f"benchmark_{name}.md").write_text(text)  # other codes print what they like
        print(text, flush=True)
    return found


if __name__ == "__main__":
    run(main)
