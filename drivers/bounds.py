"""Guaranteed bounds beside estimates, level by level: effectivities, seconds, a picture.

Errors are those of stresses, as in `drivers.adaptive_study`. Seconds are those of one thread's
processor. Writes bounds.csv, and bounds.png, the picture of docs/bounds.md.

    python -m drivers.bounds
    python -m drivers.bounds "hertz a=0.3" --orders 2 --max-dofs 30_000
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from drivers.adaptive_study.runs import STUDIES, Name, energy_errors
from drivers.command_line import Count, Order, run
from drivers.tables import Columns, printed, write_csv
from ngcontact import adapt

SHOWN: tuple[Name, ...] = ("one transition", "hertz a=0.3", "flat punch", "disc on rigid plane")
ROUND = (1.0, 1.5, 2.0, 3.0, 5.0, 7.0)  # effectivities with a tick


COLUMNS: Columns = {
    "case" + 16 * " ": "{0.case:20s}",
    " p": "{0.order}",
    "unknowns": "{0.unknowns}",
    "   error": "{0.error:.2e}",
    "estimate": "{0.estimate:.2f}",
    "bound": "{0.bound:.2f}",
    "width": "{0.width:.2f}",
    "run s": "{0.run:.2f}",
    "bound s": "{0.bounding:.2f}",
    "bars s": "{0.quantities:.2f}",
}


@dataclass(frozen=True)
class Row:
    """One level: relative error, effectivities, seconds of the run so far and of what is proved."""

    case: str
    order: int
    unknowns: int
    error: float
    estimate: float
    bound: float
    width: float
    run: float
    bounding: float
    quantities: float


def rows_of(name: Name, order: int, max_dofs: int, reference: int) -> Iterator[Row]:
    """The levels of an adaptive run."""
    study = STUDIES[name]()
    measure = energy_errors(study, reference)
    spent, started = 0.0, time.process_time()
    for level in adapt(study.problem, order=order, max_dofs=max_dofs):
        estimate = level.error_estimate
        clock = [time.process_time()]
        spent += clock[0] - started
        bound, (low, high) = level.error_bound, level.energy_bounds
        clock.append(time.process_time())
        level.quantities()
        clock.append(time.process_time())
        error, norm = measure(level)
        ratios = error / norm, estimate / error, bound / error, (high - low) / bound**2
        unknowns, seconds = level.displacement.space.ndof, np.diff(clock).tolist()
        yield Row(name, order, unknowns, *ratios, spent, *seconds)
        started = time.process_time()


def draw(path: Path, rows: Sequence[Row]) -> None:
    """Effectivities against unknowns: bounds solid, estimates dashed."""
    names = list(dict.fromkeys(row.case for row in rows))
    orders = sorted({row.order for row in rows})
    deep = math.ceil(len(names) / 2)
    figure = Figure(figsize=(10, 4 * deep), layout="constrained")
    every = figure.subplots(deep, 2, sharey=True, squeeze=False).ravel()
    for axes in every[len(names) :]:
        axes.set_visible(False)
    for axes, name in zip(every, names, strict=False):
        for order in orders:
            mine = [row for row in rows if (row.case, row.order) == (name, order)]
            n = [row.unknowns for row in mine]
            axes.loglog(n, [row.bound for row in mine], "o-", ms=3, color=f"C{order - 1}")
            axes.loglog(n, [row.estimate for row in mine], "s--", ms=3, color=f"C{order - 1}")
        axes.axhline(1, color="k", lw=0.8, zorder=0)
        axes.set(title=name, xlabel="unknowns")
        axes.set_yticks(ROUND, [f"{tick:g}" for tick in ROUND])
        axes.minorticks_off()
        axes.grid(axis="y", alpha=0.3)
    for axes in every[::2]:
        axes.set_ylabel("over the error")
    lines = [Line2D([], [], color=f"C{order - 1}", label=f"order {order}") for order in orders]
    styles = (("-", "guaranteed bound"), ("--", "residual estimate"))
    lines += [Line2D([], [], color="0.3", ls=ls, label=label) for ls, label in styles]
    figure.legend(handles=lines, loc="outside lower center", ncols=len(lines))
    FigureCanvasAgg(figure).print_png(path)


def main(
    studies: Sequence[Name] = SHOWN,
    *,
    orders: Sequence[Order] = (2, 4),
    max_dofs: Count = 15_000,
    reference: Count = 40_000,
    out: Path = Path("out"),
) -> list[Row]:
    """Guaranteed bounds beside estimates, level by level: effectivities, seconds, a picture.

    Parameters
    ----------
    studies : sequence of str
        Problems of the adaptive study, by name.
    orders : sequence of int
        Degrees of the displacement on each element, 1 to 4.
    max_dofs : int
        Unknowns that no level exceeds.
    reference : int
        Unknowns of the solution that stands for an unknown exact one.
    out : path
        Folder of the files.

    Returns
    -------
    list of Row
        All levels.
    """
    out.mkdir(parents=True, exist_ok=True)
    rows = (rows_of(name, order, max_dofs, reference) for name in studies for order in orders)
    found = printed(COLUMNS, chain.from_iterable(rows))
    write_csv(out / "bounds.csv", found)
    draw(out / "bounds.png", found)
    return found


if __name__ == "__main__":
    run(main)
