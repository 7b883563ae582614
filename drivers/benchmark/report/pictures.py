"""Log-log pictures of the measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator, NullFormatter, StrMethodFormatter

from drivers.benchmark.studies.accuracy import OURS, QUANTITIES, Point, best_seconds, series
from drivers.benchmark.studies.growth import Growth

BOUNDS = np.logspace(-1, -7, 61)  # errors below the last are those of the references
LINES = {"uniform": "--", "graded": ":", "adaptive": "-"}


def draw_accuracy(path: Path, found: Sequence[Point]) -> None:
    """Seconds from which errors stay below a bound: problems in rows, quantities in columns.

    One line for an engine and kind of mesh, of its best order and settings, as in the table.
    """
    problems = list(dict.fromkeys(p.problem for p in found))
    figure = Figure(figsize=(4 * len(QUANTITIES), 3.6 * len(problems)), layout="constrained")
    panels = figure.subplots(
        len(problems), len(QUANTITIES), sharex=True, sharey=True, squeeze=False
    )
    engines = [e for e in dict.fromkeys(p.engine for p in found) if e != OURS]
    for row, problem in zip(panels, problems, strict=True):
        mine = [p for p in found if p.problem == problem]
        for panel, name in zip(row, QUANTITIES, strict=True):
            panel.set_title(f"{problem}: {name.replace('_', '-')}", fontsize=10)
            panel.grid(which="major", alpha=0.3)
            for engine, kind in series(found):
                ours = engine == OURS
                panel.loglog(
                    [best_seconds(mine, engine, kind, (name,), bound) for bound in BOUNDS],
                    BOUNDS,
                    LINES[kind],
                    color="black" if ours else f"C{engines.index(engine)}",
                    lw=2.2 if ours else 1.2,
                    label=f"{engine}, {kind}",
                )
    for panel in panels[-1]:
        panel.set_xlabel("seconds")
    for row in panels:
        row[0].set_ylabel("relative error")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=5, fontsize=8)
    FigureCanvasAgg(figure).print_png(path)


def draw_growth(path: Path, rows: Sequence[Growth]) -> None:
    """Seconds and memory against unknowns."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    panels = figure.subplots(1, 2)
    keys = list(dict.fromkeys((r.problem, r.order) for r in rows))
    for panel, value, title in (
        (panels[0], "seconds", "seconds"),
        (panels[1], "memory", "peak memory, GB"),
    ):
        for number, (problem, order) in enumerate(keys):
            for kind, line in (("linear", ":"), ("contact", "-")):
                mine = [r for r in rows if (r.problem, r.order, r.kind) == (problem, order, kind)]
                panel.loglog(
                    [r.unknowns for r in mine],
                    [getattr(r, value) for r in mine],
                    line + "o",
                    color=f"C{number}",
                    ms=3,
                    label=f"{problem}, order {order}, {kind}",
                )
        panel.set_title(title, fontsize=10)
        panel.set_xlabel("unknowns")
        panel.yaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
        panel.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        panel.yaxis.set_minor_formatter(NullFormatter())
        panel.grid(which="major", alpha=0.3)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8)
    FigureCanvasAgg(figure).print_png(path)
