"""Uniform against adaptive refinement, orders 1 to 4: errors, estimates, rates, meshes, seconds.

Cases: one transition (S1), Hertz contact with a wide and a narrow zone (S3), a stiff flat punch,
a disc on a block, a disc on a rigid plane. Errors are in the energy norm, relative: of the exact
stress where it is known, else from the energy above that of a much finer solution. Writes
adaptive_study.csv, a picture of errors and one of three meshes for each case.

    python -m drivers.adaptive_study
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path

import ngsolve as ng

from drivers.adaptive_study.pictures import draw_errors, draw_meshes
from drivers.adaptive_study.runs import Row, rate, run, seconds_to
from drivers.adaptive_study.studies import STUDIES, error_measure


def print_rows(rows: Sequence[Row]) -> None:
    """Print one run."""
    first = rows[0]
    print(f"\n{first.case}, {first.strategy}, order {first.order}: rate N^{rate(rows):.2f}")
    print("unknowns  error     estimate  effectivity  near  half-width  angle  steps  seconds")
    for r in rows:
        print(
            f"{r.unknowns:8d}  {r.error:.2e}  {r.estimate:.2e}  {r.effectivity:11.2f}  "
            f"{r.near:4.2f}  {r.half_width:10.1e}  {r.angle:5.1f}  {r.steps:5d}  {r.seconds:7.2f}"
        )


def main(
    names: Sequence[str] = tuple(STUDIES),
    orders: Sequence[int] = (1, 2, 3, 4),
    folder: str | Path = "out",
) -> list[Row]:
    """Run the studies, print tables, write the CSV file and the pictures; return all rows."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    everything: list[Row] = []
    for name in names:
        study = STUDIES[name]()
        error = error_measure(study)
        runs: dict[tuple[str, int], list[Row]] = {}
        stem = name.replace(" ", "_").replace("=", "").replace(".", "")
        for order in orders:
            for strategy in ("uniform", "adaptive"):
                results = list(run(name, study, strategy, order, error))
                rows = runs[strategy, order] = [row for _, row in results]
                print_rows(rows)
                if (strategy, order) == ("adaptive", 2):
                    draw_meshes(folder / f"meshes_{stem}.png", [s for s, _ in results], study.zone)
        draw_errors(folder / f"errors_{stem}.png", name, runs)
        print(f"\n{name}: seconds to a relative error, adaptive\norder      1e-2     1e-3     1e-4")
        for order in orders:
            times = [seconds_to(runs["adaptive", order], 10.0**-k) for k in (2, 3, 4)]
            print(f"{order:5d}  " + "  ".join(f"{t:7.2f}" for t in times))
        everything += [row for rows in runs.values() for row in rows]
    with (folder / "adaptive_study.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(Row)])
        writer.writerows(astuple(row) for row in everything)
    return everything


if __name__ == "__main__":
    with ng.TaskManager():
        main()
