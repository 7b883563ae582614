"""Pictures of errors and of meshes."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drivers.adaptive_study.runs import Row, triangles
from ngcontact import Solution
from ngcontact.output import slope_triangle


def draw_errors(path: Path, name: str, runs: dict[tuple[str, int], list[Row]]) -> None:
    """Log-log picture of errors against unknowns and against seconds."""
    figure = Figure(figsize=(12, 5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for (strategy, order), rows in runs.items():
        style = {"color": f"C{order - 1}", "ls": "-" if strategy == "adaptive" else "--"}
        errors = [row.error for row in rows]
        left.loglog(
            [r.unknowns for r in rows],
            errors,
            "o",
            ms=3,
            label=f"{strategy}, order {order}",
            **style,
        )
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
        corners = triangles(solution)
        x, y = corners[..., 0].ravel(), corners[..., 1].ravel()
        for axes in rows[:, column]:
            axes.triplot(x, y, np.arange(len(x)).reshape(-1, 3), color="C0", lw=0.4)
            axes.set_aspect("equal")
        rows[0, column].set_title(f"{solution.displacement.space.ndof} unknowns")
        rows[1, column].set(
            xlim=(centre[0] - 2 * zone, centre[0] + 2 * zone),
            ylim=(centre[1] - 2 * zone, centre[1] + 2 * zone),
        )
        if len(solution.transitions()):
            rows[1, column].plot(*solution.transitions().T, "r.", ms=6)
    rows[1, 0].set_ylabel("close-up, transition red")
    FigureCanvasAgg(figure).print_png(path)
