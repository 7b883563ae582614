"""Picture of a solution: deformed bodies with a field, close-ups, contact pressure."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Array
from ...solved import Solved
from ..files import check_path, replacing
from .fields import check_field
from .panels import (
    Window,
    close_ups,
    colour_range,
    draw_bodies,
    draw_pressures,
    draw_windows,
    powers,
    shown_parts,
)
from .scene import Scene, Style, names_of, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

HEIGHT = 5.0  # of a picture, inches


def plot_solution(
    solution: Solved,
    path: str | os.PathLike[str] | None = None,
    scale: float | None = None,
    **options: Any,
) -> Figure:
    """Picture of the deformed bodies with a field, and of the contact pressure.

    Close-ups of small zones in contact stand between the two. The pressure is drawn over eta (P2)
    or the arc position (P1). Lengths and stresses in the consistent units of the data. With a
    `path` (``.png``) the picture is written there without any window, otherwise it is shown on the
    screen. `scale` multiplies the displacement; None chooses a factor that lets the deformation be
    seen, but not so large that bodies seem to run into each other. `options` are those of `Style`.

    Raises ``ValueError`` or ``TypeError`` where an option is none, and as `check_path` does, before
    any work.
    """
    style = Style(scale, **options)
    if path is None:
        check_field(style.field, *names_of(solution))
        from matplotlib import pyplot

        figure = pyplot.figure(layout="constrained")
        draw(figure, solution, style)
        pyplot.show()
        return figure
    target = check_path(path, ".png")
    check_field(style.field, *names_of(solution))
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(layout="constrained")
    draw(figure, solution, style)
    with replacing(target) as (draft,):
        FigureCanvasAgg(figure).print_figure(
            draft, format="png", dpi=150, bbox_inches="tight", pad_inches=0.05
        )
    return figure


def draw(figure: Figure, solution: Solved, style: Style) -> None:
    """Bodies on the left, close-ups of the contact if needed, the pressure on the right."""
    scene = picture(solution, style)
    windows = close_ups([scene])
    limits = style.limits or colour_range(scene, windows)
    draw_scene(figure, solution, scene, style, windows, limits)
    if (engine := figure.get_layout_engine()) is not None:
        for _ in range(2):  # labels move with the ticks that a first layout leaves
            engine.execute(figure)


def _width(scene: Scene) -> float:
    """Of the bodies, over their height."""
    width, height = np.ptp(scene.moved, axis=0)
    return float(width / height)


def _panels(
    figure: Figure, scene: Scene, close: int, parts: int
) -> tuple[Axes, list[Axes], list[Axes]]:
    """Axes for the bodies, for `close` close-ups, two above each other, and of the pressures."""
    tall = 1 if close < 2 else 2
    columns = -(-close // tall)
    ratios = [float(np.clip(_width(scene), 0.6, 2)), *[1.0 / tall] * columns]
    ratios.append(1.2 if parts == 1 else 0.8 * parts)
    figure.set_size_inches(2 + HEIGHT * 0.9 * sum(ratios), HEIGHT)
    grid = figure.add_gridspec(tall, columns + 2, width_ratios=ratios)
    bodies = figure.add_subplot(grid[:, 0])
    places = [grid[k % tall, 1 + k // tall] for k in range(close)]
    pressures = grid[:, -1].subgridspec(1, parts, wspace=0.05)
    return (
        bodies,
        [figure.add_subplot(place) for place in places],
        [figure.add_subplot(pressures[k]) for k in range(parts)],
    )


def draw_scene(
    figure: Figure,
    solution: Solved,
    scene: Scene,
    style: Style,
    windows: Sequence[Window],
    limits: tuple[float, float],
    parts: Sequence[Array] | None = None,
) -> list[Axes]:
    """Draw a scene with its close-ups, its colours and the pressure; returns the axes of that.

    Pressures are shown on `parts` (2,) of the contact lines, which are chosen when left out.
    """
    parts = parts or shown_parts(solution)
    bodies, close, pressures = _panels(figure, scene, len(windows), len(parts))
    shading, *_ = [draw_bodies(axes, scene, style, limits) for axes in (bodies, *close)]
    space = " " if _width(scene) > 0.9 else "\n"
    bodies.set_title(f"deformed bodies,{space}displacement × {scene.scale:g}")
    draw_windows(bodies, close, windows, style.unit("length")[1])
    _colour_bar(figure, shading, [bodies, *close], scene, style, limits)
    draw_pressures(pressures, solution, style, parts)
    return pressures


def _colour_bar(
    figure: Figure,
    shading: Any,
    axes: list[Axes],
    scene: Scene,
    style: Style,
    limits: tuple[float, float],
) -> None:
    """Scale of colours; an arrow and a number say what lies beyond its ends."""
    values, (_, unit) = scene.shown.values, style.unit(scene.shown.kind)
    least, most = float(values.min()), float(values.max())
    below, above = least < limits[0], most > limits[1]
    extend = {(True, True): "both", (True, False): "min", (False, True): "max"}
    bar = figure.colorbar(
        shading,
        ax=axes,
        label=style.title(scene.shown.label, scene.shown.kind),
        extend=extend.get((below, above), "neither"),
        format=powers(),
    )
    bar.formatter.set_locs(bar.get_ticks().tolist())
    power = 16 if bar.formatter.get_offset() else 0  # which stands above the bar
    for beyond, value, y, offset in ((above, most, 1.0, 14 + power), (below, least, 0.0, -14)):
        if beyond:
            bar.ax.annotate(
                f"{'largest' if offset > 0 else 'least'} {value / unit:.3g}",
                (0.5, y),
                xycoords="axes fraction",
                xytext=(0, offset),
                textcoords="offset points",
                ha="center",
                va="bottom" if offset > 0 else "top",
                fontsize=8,
            )
