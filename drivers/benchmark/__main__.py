"""Run time against error, measured beside other codes on one machine.

python -m drivers.benchmark [tax] [levels] [growth] [large] [accuracy] [skip] [stages]

Everything when no part is named, about 55 minutes, 20 of them for the accuracy; prints Markdown
tables and writes them, with pictures, to out/. The other codes need the optional group `bench` of
dependencies; those that are not installed are left out.
"""

from __future__ import annotations

import datetime
import importlib.metadata
import os
import platform
import sys
from pathlib import Path

import ngsolve as ng

from drivers.benchmark.report import pictures, tables
from drivers.benchmark.scenes.problems import block, disc
from drivers.benchmark.studies import accuracy, growth, large, levels, skip, stages, tax

FOLDER = Path("out")
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


def contact_tax() -> str:
    """Contact tax."""
    return tables.of_tax(tax.taxes([disc(), block()]))


def adaptive_levels() -> str:
    """Whole levels and imports."""
    table = tables.of_levels(levels.all_levels([disc(), block()]))
    plain, ours = levels.import_seconds()
    return f"{table}\n\nimport: ngsolve {plain:.3f} s, ngcontact {ours:.3f} s"


def growth_of_time() -> str:
    """Growth of time and memory."""
    rows = list(growth.growths())
    pictures.draw_growth(FOLDER / "benchmark_growth.png", rows)
    return tables.of_growth(rows)


def large_problems() -> str:
    """Large problems, direct and iterative."""
    return tables.of_large(list(large.larges()))


def time_to_accuracy() -> str:
    """Time to accuracy."""
    found, missing = [], set()
    for common in (disc(), block()):
        points, lines = accuracy.points(common)
        found += points
        missing |= set(lines)
    pictures.draw_accuracy(FOLDER / "benchmark_accuracy.png", found)
    return "\n\n".join([tables.of_accuracy(found), *sorted(missing)])


def skipped() -> str:
    """What scenes skip."""
    return tables.of_scenes(skip.scenes())


def time_by_stage() -> str:
    """Where the time of a level goes."""
    return tables.of_stages(stages.all_stages([disc(), block()]))


PARTS = {
    "tax": contact_tax,
    "levels": adaptive_levels,
    "growth": growth_of_time,
    "large": large_problems,
    "accuracy": time_to_accuracy,
    "skip": skipped,
    "stages": time_by_stage,
}


def main(names: list[str]) -> None:
    """Run the parts named, or all."""
    if "--help" in names:
        print(__doc__)
        return
    unknown = sorted(set(names) - set(PARTS))
    if unknown:
        raise SystemExit(f"no part is called {', '.join(unknown)}; choose from {', '.join(PARTS)}")
    FOLDER.mkdir(exist_ok=True)
    ng.SetNumThreads(1)
    print(machine(), flush=True)
    for name in names or PARTS:
        text = f"{machine()}\n\n## {PARTS[name].__doc__}\n\n{PARTS[name]()}\n"
        (FOLDER / f"benchmark_{name}.md").write_text(text)  # other codes print what they like
        print(text, flush=True)


if __name__ == "__main__":
    main(sys.argv[1:])
