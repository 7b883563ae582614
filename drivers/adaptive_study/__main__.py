"""Uniform against adaptive refinement, orders 1 to 4: errors, estimates, rates, meshes, seconds.

Cases: one transition (S1), Hertz contact with a wide and a narrow zone (S3), a stiff flat punch,
a disc on a block, a disc on a rigid plane. Errors are those of stresses in the energy norm,
relative, against the exact stress where it is known, else against that of a much finer solution.
Seconds are those of one thread's processor, which other work on the machine does not change. Writes
adaptive_study.csv, a picture of errors and one of three meshes for each case, and the tables of
docs/adaptivity.md as adaptive_study.md.

    python -m drivers.adaptive_study
    python -m drivers.adaptive_study "hertz a=0.3" "flat punch" --orders 1 2
"""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import astuple, fields
from pathlib import Path
from typing import get_args

from drivers.adaptive_study.pictures import draw_errors, draw_meshes
from drivers.adaptive_study.report import tables
from drivers.adaptive_study.runs import Row, rate, run_of, seconds_to
from drivers.adaptive_study.studies import REFERENCE, SHARE, STUDIES, Name, error_measure
from drivers.command_line import Count, Order, run


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


def print_seconds(name: str, runs: dict[tuple[str, int], list[Row]]) -> None:
    """Print when adaptive runs reach relative errors of 1e-2, 1e-3 and 1e-4."""
    print(f"\n{name}: seconds to a relative error, adaptive\norder      1e-2     1e-3     1e-4")
    for (strategy, order), rows in runs.items():
        if strategy == "adaptive":
            times = [seconds_to(rows, 10.0**-k) for k in (2, 3, 4)]
            print(f"{order:5d}  " + "  ".join(f"{t:7.2f}" for t in times))


def compare(
    name: Name, orders: Sequence[int], max_dofs: int, reference: int, out: Path
) -> list[Row]:
    """Both strategies on one problem: tables on the screen, pictures in `out`."""
    study = STUDIES[name]()
    error = error_measure(study, reference)
    runs: dict[tuple[str, int], list[Row]] = {}
    stem = name.replace(" ", "_").replace("=", "").replace(".", "")
    for order in orders:
        most = 5 * max_dofs // 4 if order == 4 else max_dofs  # asymptotic from 10k on
        if study.exact is None:  # the reference has to be much finer
            most = min(most, int(SHARE * study.reference(reference)))
        for strategy in ("uniform", "adaptive"):
            results = list(run_of(name, study, strategy, order, error, most))
            rows = runs[strategy, order] = [row for _, row in results]
            print_rows(rows)
            if (strategy, order) == ("adaptive", 2):
                draw_meshes(out / f"meshes_{stem}.png", [s for s, _ in results], study.zone)
    draw_errors(out / f"errors_{stem}.png", name, runs)
    print_seconds(name, runs)
    return [row for rows in runs.values() for row in rows]


def main(
    studies: Sequence[Name] = get_args(Name),
    *,
    orders: Sequence[Order] = (1, 2, 3, 4),
    max_dofs: Count = 40_000,
    reference: Count = REFERENCE,
    out: Path = Path("out"),
) -> list[Row]:
    """Uniform against adaptive refinement: errors, estimates, rates, meshes, seconds.

    Errors are those of stresses, relative, in the energy norm. Writes adaptive_study.csv, the
    tables of docs/adaptivity.md as adaptive_study.md, and of every problem a picture of errors and,
    of order 2, one of three meshes. All of it takes minutes.

    Parameters
    ----------
    studies : sequence of str
        Problems, by name.
    orders : sequence of int
        Degrees of the displacement on each element, 1 to 4.
    max_dofs : int
        Number of unknowns that no level exceeds; a quarter more at order 4.
    reference : int
        Number of unknowns that the solution of order 4 does not exceed which stands for an
        unknown exact one; levels have at most a quarter of it there.
    out : path
        Folder of the files.

    Returns
    -------
    list of Row
        All levels of all runs.
    """
    out.mkdir(parents=True, exist_ok=True)
    rows = [row for name in studies for row in compare(name, orders, max_dofs, reference, out)]
    with (out / "adaptive_study.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(Row)])
        writer.writerows(astuple(row) for row in rows)
    (out / "adaptive_study.md").write_text("\n\n".join(tables(rows)) + "\n", encoding="utf-8")
    return rows


if __name__ == "__main__":
    run(main)
