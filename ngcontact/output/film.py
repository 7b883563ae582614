"""Films: pictures of several solutions one after the other, with one scale for all."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..solved import Solved
from .files import check_path, replacing
from .pictures.fields import check_field
from .pictures.panels import close_ups, colour_range, cut_pressure, shown_part
from .pictures.picture import draw_scene
from .pictures.scene import Scene, Style, contact_lines, names_of, picture

if TYPE_CHECKING:
    from PIL.Image import Image

DPI = 80
HEADROOM = 1.05  # of the largest pressure


def write_film(
    path: str | os.PathLike[str],
    solutions: Sequence[Solved],
    *,
    seconds: float = 0.6,
    titles: Sequence[str] | None = None,
    **options: Any,
) -> Path:
    """Write a film (``.gif``) of a load sequence or of the levels of an adaptive run.

    Colours, windows and the scales of displacement and pressure are those of all frames together.

    Parameters
    ----------
    path : path
        File (.gif).
    solutions : sequence of Solution
        One for each frame, of one problem or of several with the same names.
    seconds : float
        Time that each frame is seen; the last one is three times as long.
    titles : sequence of str, optional
        Of the frames. Default: their numbers and unknowns.
    options
        As of `Solution.plot`: scale, field, limits, units, profile, mesh, mirror.

    Returns
    -------
    Path
        The file.

    Raises
    ------
    ValueError, TypeError, OSError
        No solutions, titles of another number, an option that is none, a path that cannot be
        written: before any work.
    """
    frames, style = list(solutions), Style(**options)
    _check(frames, seconds, titles)
    target = check_path(path, ".gif")
    check_field(style.field, *names_of(frames[0]))
    scenes = [picture(solution, style) for solution in frames]
    scale = min(scene.scale for scene in scenes)  # one for all, the most careful one
    for k, scene in enumerate(scenes):
        if scene.scale != scale:
            scenes[k] = picture(frames[k], replace(style, scale=scale))
    names = titles or [
        f"{k + 1} of {len(frames)}: {s.displacement.space.ndof} unknowns"
        for k, s in enumerate(frames)
    ]
    images = _images(frames, scenes, style, names)
    times = [round(1000 * seconds)] * (len(images) - 1) + [round(3000 * seconds)]
    with replacing(target) as (draft,):
        images[0].save(
            draft, format="GIF", save_all=True, append_images=images[1:], duration=times, loop=0
        )
    return target


def _check(frames: Sequence[Solved], seconds: float, titles: Sequence[str] | None) -> None:
    """Raise ``ValueError`` where nothing can be shown."""
    if not frames:
        raise ValueError("solutions: give one at least")
    if titles is not None and len(titles) != len(frames):
        raise ValueError(f"titles: {len(titles)} for {len(frames)} solutions")
    if not (np.isfinite(seconds) and seconds > 0):
        raise ValueError(f"seconds = {seconds}: give a positive time")


def _images(
    frames: Sequence[Solved],
    scenes: Sequence[Scene],
    style: Style,
    names: Sequence[str],
) -> list[Image]:
    """The frames, drawn with one scale for all."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    windows = close_ups(scenes)
    ranges = [style.limits or colour_range(scene, windows) for scene in scenes]
    limits = min(low for low, _ in ranges), max(high for _, high in ranges)
    if style.limits is None and limits[0] < 0:
        limits = -max(-limits[0], limits[1]), max(-limits[0], limits[1])
    unit = style.unit("stress")[1]
    tops = [cut_pressure(s) or HEADROOM * float(s.pressure.max(initial=0.0)) for s in frames]
    top = max(tops) / unit
    low = np.min([scene.moved.min(axis=0) for scene in scenes], axis=0) / style.unit("length")[1]
    high = np.max([scene.moved.max(axis=0) for scene in scenes], axis=0) / style.unit("length")[1]
    margin = 0.03 * (high - low).max()
    parts = [shown_part(frame, contact_lines(frame)) for frame in frames]
    ends = np.array([part for part in parts if part is not None])
    along = [np.array([ends.min(), ends.max()])] if len(ends) else [np.zeros(2)]
    images = []
    for solution, scene, name in zip(frames, scenes, names, strict=True):
        figure = Figure(layout="constrained")
        [profile] = draw_scene(figure, solution, scene, style, windows, limits, along)
        figure.axes[0].set(
            xlim=(low[0] - margin, high[0] + margin), ylim=(low[1] - margin, high[1] + margin)
        )
        if top > 0:
            profile.set_ylim(min(profile.get_ylim()[0], -0.02 * top), top)
        figure.suptitle(name)
        canvas = FigureCanvasAgg(figure)
        figure.set_dpi(DPI)
        canvas.draw()
        images.append(Image.fromarray(np.asarray(canvas.buffer_rgba())).convert("RGB"))
    size = images[0].size
    images = [image if image.size == size else image.resize(size) for image in images]
    # One palette for all: of its own each frame would show one stress in another colour.
    strip = Image.fromarray(np.vstack([np.asarray(image) for image in images]))
    colours = np.array(strip.quantize(256).getpalette() or [255] * 3).reshape(-1, 3)
    colours[(colours >= 240).all(axis=1)] = 255  # Pillow would take a neighbour of white
    palette = Image.new("P", (1, 1))
    palette.putpalette(colours.ravel().tolist())
    return [image.quantize(palette=palette, dither=Image.Dither.NONE) for image in images]
