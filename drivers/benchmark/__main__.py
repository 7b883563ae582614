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
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, TypeAlias, get_args

import ngsolve as ng
from cyclopts import Parameter
from cyclopts.validators import Number

from drivers.benchmark.report import pictures, tables
from drivers.benchmark.scenes.problems import COMMONS, Common, Name
from drivers.benchmark.studies import accuracy, growth, large, levels, skip, stages, tax
from drivers.command_line import Count, run

Size: TypeAlias = Annotated[Count, Parameter(validator=Number(gte=10_000))]
PACKAGES = ("ngsolve", "numpy", "scipy", "scikit-fem", "felupe", "KratosMultiphysics", "akantu")


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


@dataclass(frozen=True)
class Extent:
    """How much is measured, and where pictures go; see `main`."""

    problems: Sequence[Name]
    rounds: int
    max_dofs: int
    out: Path

    @property
    def commons(self) -> list[Common]:
        """The problems themselves."""
        return [COMMONS[name]() for name in self.problems]


Measured: TypeAlias = tuple[list[Any], str]  # rows, and their table in Markdown


def contact_tax(extent: Extent) -> Measured:
    """Contact tax."""
    rows = list(tax.taxes(extent.commons, extent.rounds, extent.max_dofs))
    return rows, tables.of_tax(rows)


def adaptive_levels(extent: Extent) -> Measured:
    """Whole levels and imports."""
    rows = list(levels.all_levels(extent.commons, extent.rounds, extent.max_dofs))
    plain, ours = levels.import_seconds()
    imports = f"import: ngsolve {plain:.3f} s, ngcontact {ours:.3f} s"
    return rows, f"{tables.of_levels(rows)}\n\n{imports}"


def growth_of_time(extent: Extent) -> Measured:
    """Growth of time and memory."""
    rows = list(growth.growths(extent.problems, extent.max_dofs))
    pictures.draw_growth(extent.out / "benchmark_growth.png", rows)
    return rows, tables.of_growth(rows)


def large_problems(extent: Extent) -> Measured:
    """Large problems, direct and iterative."""
    rows = list(large.larges(extent.problems, extent.max_dofs))
    return rows, tables.of_large(rows)


def time_to_accuracy(extent: Extent) -> Measured:
    """Time to accuracy."""
    found, missing = [], set()
    for common in extent.commons:
        points, lines = accuracy.points(common, extent.rounds, extent.max_dofs)
        found += points
        missing |= set(lines)
    pictures.draw_accuracy(extent.out / "benchmark_accuracy.png", found)
    return found, "\n\n".join([tables.of_accuracy(found), *sorted(missing)])


def skipped(extent: Extent) -> Measured:
    """What scenes skip."""
    rows = list(skip.scenes(extent.rounds, extent.max_dofs))
    return rows, tables.of_scenes(rows)


def time_by_stage(extent: Extent) -> Measured:
    """Where the time of a level goes."""
    rows = list(stages.all_stages(extent.commons, extent.max_dofs))
    return rows, tables.of_stages(rows)


Part: TypeAlias = Literal["tax", "levels", "growth", "large", "accuracy", "skip", "stages"]
PARTS: dict[Part, Callable[[Extent], Measured]] = {
    "tax": contact_tax,
    "levels": adaptive_levels,
    "growth": growth_of_time,
    "large": large_problems,
    "accuracy": time_to_accuracy,
    "skip": skipped,
    "stages": time_by_stage,
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

    Prints Markdown tables and writes them, with pictures. Everything takes about 55 minutes, 20 of
    them for the accuracy. Codes of the optional group bench that are not installed are left out.

    Parameters
    ----------
    parts : sequence of str
        Tables.
    problems : sequence of str
        Common problems; what scenes skip is shown on others.
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
    extent, found = Extent(problems, rounds, max_dofs, out), {}
    for name in parts:
        found[name], table = PARTS[name](extent)
        text = f"{machine()}\n\n## {PARTS[name].__doc__}\n\n{table}\n"
        (out / f"benchmark_{name}.md").write_text(text)  # other codes print what they like
        print(text, flush=True)
    return found


if __name__ == "__main__":
    run(main)
