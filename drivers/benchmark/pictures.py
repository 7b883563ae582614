"""Log-log pictures of the measurements."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drivers.benchmark.accuracy import OURS, QUANTITIES, Point
from drivers.benchmark.growth import Growth

FLOOR = 1e-9  # errors below it are those of the references
LINES = {"uniform": "--", "graded": ":", "adaptive": "-"}
MARKERS = "osD^v"


def draw_accuracy(path: Path, found: Sequence[Point]) -> None:
    """Errors against seconds: a row for each problem, a column for each quantity."""
    problems = list(dict.fromkeys(p.problem for p in found))
    figure = Figure(figsize=(4 * len(QUANTITIES), 3.6 * len(problems)), layout="constrained")
    panels = figure.subplots(len(problems), len(QUANTITIES), sharex=True, squeeze=False)
    lines: dict[tuple[str, str, int, str], list[Point]] = {}
    for p in found:
        lines.setdefault((p.engine, p.mesh_kind, p.order, p.variant), []).append(p)
    engines = [e for e in dict.fromkeys(p.engine for p in found) if e != OURS]
    for row, problem in zip(panels, problems, strict=True):
        for panel, name in zip(row, QUANTITIES, strict=True):
            panel.set_title(f"{problem}: {name.replace('_', '-')}", fontsize=10)
            panel.grid(which="major", alpha=0.3)
            for (engine, kind, order, variant), line in lines.items():
                mine = [p for p in line if p.problem == problem]
                ours = engine == OURS
                panel.loglog(
                    [p.seconds for p in mine],
                    [max(p.errors[name], FLOOR) for p in mine],
                    LINES[kind] + MARKERS[order - 1],
                    color="black" if ours else f"C{engines.index(engine)}",
                    lw=1.6 if ours else 1.0,
                    ms=4 if ours else 3,
                    label=f"{variant}, {kind}, order {order}",
                )
            panel.set_ylim(FLOOR / 2, 1)
    for panel in panels[-1]:
        panel.set_xlabel("seconds")
    for row in panels:
        row[0].set_ylabel("relative error")
    handles, labels = panels[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, fontsize=8)
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
        panel.grid(which="major", alpha=0.3)
    handles, labels = panels[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside right center", fontsize=8)
    FigureCanvasAgg(figure).print_png(path)
