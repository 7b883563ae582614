"""Picture of a solution: deformed bodies with von Mises stress, contact pressure."""

from __future__ import annotations

import os
from typing import TYPE_CHECKING, Any

import numpy as np

from ..files import check_path, replacing
from ..solution_data import SolutionData
from .scene import Scene, close_up, contact_lines, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def plot_solution(
    solution: SolutionData, path: str | os.PathLike[str] | None = None, scale: float | None = None
) -> Figure:
    """Picture of the deformed bodies with von Mises stress, and of the contact pressure.

    A close-up stands between the two if the zone in contact is small. The pressure is drawn over
    eta (P2) or the arc position (P1). Lengths and stresses in the consistent units of the data.
    With a `path` (``.png``) the picture is written there without any window, otherwise it is
    shown on the screen. `scale` multiplies the displacement; None chooses a factor that lets the
    deformation be seen, but not so large that bodies seem to run into each other.

    Raises ``ValueError`` if `scale` is not a finite number, and ``ValueError`` or ``OSError`` as
    `check_path` does, before any work.
    """
    if scale is not None and not np.isfinite(scale):
        raise ValueError(f"scale = {scale}: give a finite factor, or None to have one chosen")
    if path is None:
        from matplotlib import pyplot

        figure = pyplot.figure(layout="constrained")
        _draw(figure, solution, scale)
        pyplot.show()
        return figure
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    target = check_path(path, ".png")
    figure = Figure(layout="constrained")
    _draw(figure, solution, scale)
    with replacing(target) as (draft,):
        FigureCanvasAgg(figure).print_figure(draft, format="png", dpi=150)
    return figure


def _draw(figure: Figure, solution: SolutionData, scale: float | None) -> None:
    """Bodies on the left, a close-up of the contact if needed, the pressure on the right."""
    from matplotlib.patches import Rectangle

    scene = picture(solution, scale)
    frame = close_up(scene)
    top = scene.stress.max()
    if frame is not None:  # peaks at supports and corners shall not take the colours away
        seen = np.all((scene.moved >= frame[0]) & (scene.moved <= frame[1]), axis=1)
        top = max(scene.stress[seen].max(initial=0), np.quantile(scene.stress, 0.995))
    width, height = np.ptp(scene.moved, axis=0)
    ratios = [np.clip(width / height, 0.6, 2), *([] if frame is None else [1]), 1.2]
    figure.set_size_inches(2 + 4.5 * sum(ratios), 5)
    bodies, *close, profile = figure.subplots(1, len(ratios), width_ratios=ratios)
    shading, *_ = [_draw_bodies(axes, scene, top) for axes in (bodies, *close)]
    bodies.set_title(f"deformed bodies, displacement × {scene.scale:g}")
    if frame is not None:
        low, high = frame
        box = Rectangle((low[0], low[1]), *(high - low), fill=False, color="crimson", lw=1.2)
        bodies.add_patch(box)
        close[0].set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), title="zone in contact")
        close[0].spines[:].set_color("crimson")
    extend = "max" if top < scene.stress.max() else "neither"
    figure.colorbar(shading, ax=[bodies, *close], label="von Mises stress", extend=extend)
    _draw_pressure(profile, solution)


def _draw_bodies(axes: Axes, scene: Scene, top: float) -> Any:
    """Von Mises stress on the deformed bodies, thin element edges, body outlines."""
    from matplotlib.collections import LineCollection
    from matplotlib.tri import Triangulation

    mesh = Triangulation(scene.moved[:, 0], scene.moved[:, 1], scene.triangles)
    shading = axes.tripcolor(mesh, scene.stress, shading="gouraud", vmin=0, vmax=top)
    inner, outer = (list(scene.moved[scene.edges[at]]) for at in (~scene.outline, scene.outline))
    axes.add_collection(LineCollection(inner, colors="w", lw=0.25, alpha=0.5))
    axes.add_collection(LineCollection(outer, colors="k", lw=0.8))
    axes.set(aspect="equal", xlabel=scene.axes[0], ylabel=scene.axes[1])
    axes.locator_params(nbins=5)
    axes.ticklabel_format(scilimits=(-2, 4))
    return shading


def _draw_pressure(axes: Axes, solution: SolutionData) -> None:
    """Pressure along the contact lines, points in contact full and the others hollow."""
    lines, contact = contact_lines(solution), solution.problem.contact
    touching = []
    for pair, rows, s in lines:
        colour, active, p = f"C{pair % 10}", solution.active[rows], solution.pressure[rows]
        title = f"pair {pair}: {contact[pair].secondary}" if len(contact) > 1 else None
        axes.plot(s, p, color=colour, lw=1, label=title)
        for state, fill, name in ((active, colour, "in contact"), (~active, "w", "open")):
            label = name if state.any() and pair == lines[0][0] else None
            axes.plot(s[state], p[state], "o", ms=4, mec=colour, mfc=fill, label=label)
        touching.append(s[active])
    if len(contact) > 1 or not solution.active.all():
        axes.legend()
    if (
        solution.active.any() and len(solution.points) > 1
    ):  # keep the zone in contact in sight on a long boundary
        places, every = np.concatenate(touching), np.concatenate([s for *_, s in lines])
        low, high = places.min(), places.max()
        margin = max(0.75 * (high - low), 0.02 * np.ptp(every))
        low, high = max(low - margin, every.min()), min(high + margin, every.max())
        axes.set_xlim(low - 0.03 * margin, high + 0.03 * margin)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    names = {
        "arc position" if pair.direction is None else "η, along the contact line"
        for pair in contact
    }
    axes.set(xlabel=" or ".join(sorted(names)), ylabel="contact pressure", title="contact pressure")
    axes.grid(alpha=0.3)
