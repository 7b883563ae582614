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

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TypeAlias, get_args

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drivers.adaptive_study.runs import (
    REFERENCE,
    SHARE,
    STUDIES,
    Name,
    Row,
    Strategy,
    energy_errors,
    rate,
    run_of,
    seconds_to,
)
from drivers.command_line import Count, Order, run
from drivers.tables import Columns, printed, table, write_csv
from ngcontact import Solution
from ngcontact.output import slope_triangle
from ngcontact.problem import MeshArrays

Runs: TypeAlias = dict[tuple[str, int, str], list[Row]]  # by case, order and strategy
COLUMNS: Columns = {
    "unknowns": "{0.unknowns}",
    "   error": "{0.error:.2e}",
    "estimate": "{0.estimate:.2e}",
    "effectivity": "{0.effectivity:.2f}",
    "near": "{0.near:4.2f}",
    "half-width": "{0.half_width:.1e}",
    "angle": "{0.angle:.1f}",
    "steps": "{0.steps}",
    "seconds": "{0.seconds:.2f}",
}


def compare(
    name: Name, orders: Sequence[int], max_dofs: int, reference: int, out: Path
) -> list[Row]:
    """Both strategies on one problem: tables on the screen, pictures in `out`."""
    study = STUDIES[name]()
    errors = energy_errors(study, reference)
    runs: Runs = {}
    stem = name.replace(" ", "_").replace("=", "").replace(".", "")
    for order in orders:
        most = 5 * max_dofs // 4 if order == 4 else max_dofs  # asymptotic from 10k on
        if study.exact is None:  # the reference has to be much finer
            most = min(most, int(SHARE * min(reference, study.finest)))
        for strategy in get_args(Strategy):
            results = list(run_of(name, study, strategy, order, errors, most))
            rows = runs[name, order, strategy] = [row for _, row in results]
            print(f"\n{name}, {strategy}, order {order}: rate N^{rate(rows):.2f}")
            printed(COLUMNS, rows)
            if (strategy, order) == ("adaptive", 2):
                draw_meshes(out / f"meshes_{stem}.png", [s for s, _ in results], study.zone)
    draw_errors(out / f"errors_{stem}.png", name, runs)
    return [row for rows in runs.values() for row in rows]


def tables(rows: Sequence[Row]) -> Iterator[str]:
    """The tables of docs/adaptivity.md: rates, seconds, effectivities, half-widths."""
    runs: Runs = {}
    for row in rows:
        runs.setdefault((row.case, row.order, row.strategy), []).append(row)
    adaptive = {key[:2]: found for key, found in runs.items() if key[2] == "adaptive"}
    rates, seconds, widths = [], [], []
    for (case, order), found in adaptive.items():
        uniform = rate(runs[case, order, "uniform"])
        rates.append((case, order, f"{uniform:.2f}", f"{rate(found):.2f}", f"{-order / 2:.1f}"))
        if order > 1:
            times = [seconds_to(found, 10.0**-k) for k in (2, 3, 4)]
            cells = ("-" if math.isnan(t) else f"{t:.2f}" for t in times)
            seconds.append((case, order, *cells))
        if case == "hertz a=0.3" and order > 1:  # some levels of each order
            known = [row for row in found if row.half_width == row.half_width]
            for row in known[len(known) // 2 :: 2]:
                widths.append((order, row.unknowns, f"{row.half_width:.1e}"))
    orders = sorted({order for _, order in adaptive})
    effectivities = []
    for case in dict.fromkeys(case for case, _ in adaptive):
        ranges = []
        for order in orders:  # after the third level
            values = [row.effectivity for row in adaptive[case, order][3:]]
            ranges.append(f"{min(values):.1f} - {max(values):.1f}" if values else "-")
        effectivities.append((case, *ranges))
    yield table(("case", "order", "uniform", "adaptive", "optimal"), rates)
    yield table(("case", "order", "1e-2", "1e-3", "1e-4"), seconds)
    yield table(("case", *(f"order {order}" for order in orders)), effectivities)
    yield table(("order", "N", "relative error"), widths)


def draw_errors(path: Path, name: str, runs: Runs) -> None:
    """Log-log picture of errors against unknowns and against seconds."""
    figure = Figure(figsize=(12, 5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for (_, order, strategy), rows in runs.items():
        style = {"color": f"C{order - 1}", "ls": "-" if strategy == "adaptive" else "--"}
        errors = [row.error for row in rows]
        label = f"{strategy}, order {order}"
        left.loglog([r.unknowns for r in rows], errors, "o", ms=3, label=label, **style)
        right.loglog([r.seconds for r in rows], errors, "o", ms=3, **style)
        if strategy == "adaptive":
            unknowns = np.array([row.unknowns for row in rows])
            slope_triangle(left, unknowns, np.array(errors), order / 2)
    left.set(title=name, xlabel="unknowns N", ylabel="relative error, energy norm")
    left.legend(fontsize=8, title="triangles: N^(-p/2)", title_fontsize=8)
    right.set(title="processor time from geometry to solution", xlabel="seconds, one thread")
    for axes in (left, right):
        axes.grid(which="major", alpha=0.3)
    FigureCanvasAgg(figure).print_png(path)


def draw_meshes(path: Path, solutions: Sequence[Solution], zone: float) -> None:
    """Meshes of three levels, with close-ups of the zone."""
    chosen = [solutions[int(k)] for k in np.linspace(0, len(solutions) - 1, 3)]
    figure = Figure(figsize=(12, 8), layout="constrained")
    rows = figure.subplots(2, 3)
    ends = chosen[-1].transitions()
    centre = ends[np.argmax(ends[:, 0])] if len(ends) else chosen[-1].points.mean(axis=0)
    for column, solution in enumerate(chosen):
        corners = MeshArrays(solution.mesh).corners
        x, y = corners[..., 0].ravel(), corners[..., 1].ravel()
        for axes in rows[:, column]:
            axes.triplot(x, y, np.arange(len(x)).reshape(-1, 3), color="C0", lw=0.4)
            axes.set_aspect("equal")
        rows[0, column].set_title(f"{solution.displacement.space.ndof} unknowns")
        (x, y), reach = centre, 2 * zone
        rows[1, column].set(xlim=(x - reach, x + reach), ylim=(y - reach, y + reach))
        if len(solution.transitions()):
            rows[1, column].plot(*solution.transitions().T, "r.", ms=6)
    rows[1, 0].set_ylabel("close-up, transition red")
    FigureCanvasAgg(figure).print_png(path)


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
    write_csv(out / "adaptive_study.csv", rows)
    (out / "adaptive_study.md").write_text("\n\n".join(tables(rows)) + "\n", encoding="utf-8")
    return rows


if __name__ == "__main__":
    run(main)
