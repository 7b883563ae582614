"""Pictures and films of solutions: deformed bodies, contact pressure; pictures of convergence."""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from ..arrays import Array, Index
from ..solved import Solved
from .files import check_path, replacing, several
from .scene import Scene, Style, coordinates, picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours of Okabe and Ito, distinct for any colour vision, and marks for those who print grey.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKS = ("o", "s", "^", "D", "v", "P", "X")
SEQUENTIAL, DIVERGING = "viridis", "RdBu_r"  # colour maps, distinct for any colour vision
PANEL_PAD = 0.12  # inches between panels, so that their labels do not touch
HEIGHT = 5.0  # of a picture, inches
# Below and above these powers of ten an axis has one common power of ten.
POWERS: dict[str, Any] = {"scilimits": (-3, 4), "useMathText": True}
PROFILE_SAMPLES = 400  # points at which a given profile is drawn
NO_PRESSURE = 1e-6  # of the largest: pairs with less are named, and not drawn
STROKES = ("--", ":", "-.", "-")

MAX_CLOSE_UPS = 4
# Half-size of a close-up over the size of the picture: larger zones need none.
LARGEST_HALF_SIZE = 0.2
ZONE_HALF_SIZE = 0.9  # half-size of a close-up over the size of its zone
# Least half-size of a close-up over the size of the picture: of one or two points, of other zones.
LEAST_HALF_SIZES = 0.02, 0.002
# Share of the area whose values may lie beyond the colours, if the largest value is more than
# `PEAK_RATIO` times the largest of the rest.
PEAK_AREA, PEAK_RATIO = 0.005, 1.25

# Margin beside a zone in a plot of the pressure: of the length of the zone, and of all lines.
ZONE_MARGINS = 0.75, 0.02
# Zones have panels of their own if they fill less than this share, and are at most so many.
PANEL_SHARE, MAX_PANELS = 0.4, 4
# Pressures on this share of a zone are cut off if they exceed the rest by more than the factor.
CUT_SHARE, CUT_RATIO = 0.1, 4.0

FILM_DPI = 80
FILM_HEADROOM = 1.05  # end of the scale of a film over its largest pressure
FILM_LAST = 3  # times as long as others the last frame is seen

TRIANGLE_SPAN = 2.5  # of a triangle's side along the unknowns
TRIANGLE_DEPTH = 0.6  # of the curve, where a triangle lies

Window = tuple[Array, Array]  # lower left and upper right corner, each (2,)
Run = Sequence[Any] | tuple[Any, Any]  # solutions, or unknowns and errors


@dataclass(frozen=True, eq=False)
class View:
    """What scenes, the frames of a film, have in common."""

    corners: Window  # of all bodies
    windows: list[Window]  # of close-ups
    limits: tuple[float, float]  # ends of the colour scale
    parts: list[Array]  # intervals (2,) of the contact lines, a panel for each
    top: float | None  # end of the scale of pressures; None: what they need


def view_of(scenes: Sequence[Scene]) -> View:
    """The view that shows all scenes on the same scales."""
    windows = close_ups(scenes)
    low, high = np.transpose(
        [colour_limits(scene.values, scene.triangles, scene.moved, windows) for scene in scenes]
    )
    limits = float(high.max() * np.sign(low.min())), float(high.max())
    cuts = [cut_pressure(scene) for scene in scenes]
    peaks = [float(scene.solution.pressure.max(initial=0.0)) for scene in scenes]
    if len(scenes) > 1:
        cuts = [cut or FILM_HEADROOM * peak for cut, peak in zip(cuts, peaks, strict=True)]
    top = max((cut for cut in cuts if cut), default=None)
    return View(
        corners(scenes), windows, scenes[0].style.limits or limits, shown_parts(scenes), top
    )


def plot_solution(
    solution: Solved,
    path: str | os.PathLike[str] | None = None,
    scale: float | None = None,
    **options: Any,
) -> Figure:
    """Picture of the deformed bodies and the contact pressure; see `Solution.plot`."""
    style = Style(scale, **options)
    target = None if path is None else check_path(path, ".png")
    scene = picture(solution, style)
    figure = new_figure(target)
    draw_scene(figure, scene, view_of([scene]))
    show(figure, target)
    return figure


def new_figure(target: Path | None, **options: Any) -> Figure:
    """A figure for a file, or for the screen."""
    if target is None:
        from matplotlib import pyplot

        return pyplot.figure(layout="constrained", **options)
    from matplotlib.figure import Figure

    return Figure(layout="constrained", **options)


def show(figure: Figure, target: Path | None) -> None:
    """Write a figure to its file, or show it on the screen."""
    if target is None:
        from matplotlib import pyplot

        pyplot.show()
        return
    with replacing(target) as (draft,):
        figure.savefig(draft, format="png", dpi=150, bbox_inches="tight", pad_inches=0.05)


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
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure
    from PIL import Image

    frames, style = list(several(solutions)), Style(**options)
    if not frames:
        raise ValueError("solutions: give one at least")
    if titles is not None and len(titles) != len(frames):
        raise ValueError(f"titles: {len(titles)} for {len(frames)} solutions")
    if not (np.isfinite(seconds) and seconds > 0):
        raise ValueError(f"seconds = {seconds}: give a positive time")
    if any(solution.mesh.dim == 3 for solution in frames):
        raise ValueError("a film shows plane bodies: write pictures of solids by plot()")
    target = check_path(path, ".gif")
    scale = min(picture(solution, style).scale for solution in frames)
    scenes = [picture(solution, replace(style, scale=scale)) for solution in frames]
    view = view_of(scenes)
    titles = titles or [
        f"{k + 1} of {len(frames)}: {s.displacement.space.ndof} unknowns"
        for k, s in enumerate(frames)
    ]
    images = []
    for scene, heading in zip(scenes, titles, strict=True):
        figure = Figure(layout="constrained", dpi=FILM_DPI)
        canvas = FigureCanvasAgg(figure)
        draw_scene(figure, scene, view, heading)
        canvas.draw()
        images.append(np.asarray(canvas.buffer_rgba())[..., :3])
    # A common palette: one stress has one colour in all frames.
    every, plain = Image.fromarray(np.vstack(images)), Image.Dither.NONE
    palette = every.quantize(256, method=Image.Quantize.MAXCOVERAGE)
    first, *others = (Image.fromarray(x).quantize(palette=palette, dither=plain) for x in images)
    times = [round(1000 * seconds)] * len(others) + [round(1000 * FILM_LAST * seconds)]
    shown: dict[str, Any] = {"append_images": others, "duration": times, "loop": 0}
    with replacing(target) as (draft,):
        first.save(draft, format="GIF", save_all=True, **shown)
    return target


def corners(scenes: Sequence[Scene]) -> Window:
    """Lower left and upper right corner of all scenes."""
    low = np.min([scene.moved.min(axis=0) for scene in scenes], axis=0)
    return low, np.max([scene.moved.max(axis=0) for scene in scenes], axis=0)


def _window(zone: Array, low: Array, high: Array) -> Window:
    """Square about the points (c, 2) of a zone, moved into the picture from `low` to `high`."""
    size = (high - low).max()
    first, last = zone.min(axis=0), zone.max(axis=0)
    extent = (last - first).max()
    half = max(ZONE_HALF_SIZE * extent, LEAST_HALF_SIZES[0 if len(zone) < 3 else 1] * size)
    middle = (first + last) / 2
    # A zone at the rim, as on a symmetry plane, has a window that reaches inwards only.
    inner, outer = low + 0.95 * half, high - 0.95 * half
    middle = np.where(inner < outer, np.clip(middle, inner, outer), middle)
    return middle - half, middle + half


def close_ups(scenes: Sequence[Scene]) -> list[Window]:
    """Windows on the small contact zones of scenes, one where they overlap, large forces first."""
    low, high = corners(scenes)
    groups: list[Array] = []

    def overlap(zone: Array, other: Array) -> bool:
        (a, b), (c, d) = _window(zone, low, high), _window(other, low, high)
        return bool((a < d).all() and (c < b).all())

    def small(window: Window) -> bool:
        return bool((window[1] - window[0]).max() < 2 * LARGEST_HALF_SIZE * (high - low).max())

    zones = [zone for scene in scenes[::-1] for zone in scene.zones]
    for zone in [zone for zone in zones if small(_window(zone, low, high))]:
        joined = zone
        while met := [k for k, group in enumerate(groups) if overlap(group, joined)]:
            joined = np.concatenate([*(groups[k] for k in met), joined])
            groups = [group for k, group in enumerate(groups) if k not in met]
        groups.append(joined)
    windows = [_window(group, low, high) for group in groups]
    return [window for window in windows if small(window)][:MAX_CLOSE_UPS]


def _quantile(share: float, values: Array, weights: Array) -> float:
    """The value exceeded on a `share` of the `weights` (t,), areas or lengths."""
    order = np.argsort(values, kind="stable")
    sums = np.cumsum(weights[order])
    last = np.searchsorted(sums, (1 - share) * sums[-1])
    return float(values[order][min(last, len(order) - 1)])


def colour_limits(
    values: Array, triangles: Index, seen: Array, windows: Sequence[Window]
) -> tuple[float, float]:
    """Ends of the scale of `values` (k,) at nodes of `triangles` (t, 3), without peaks.

    Of the bodies and of each window: nodes are at `seen` (k, 2) in the picture. Peaks fill less
    than `PEAK_AREA` and exceed the rest by more than `PEAK_RATIO`: stresses at corners and at ends
    of supports, which grow with refinement. Where both signs occur colours are symmetric about 0.
    """
    corners = seen[triangles]
    areas = np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1]))
    middle, mean = corners.mean(axis=1), np.abs(values)[triangles].mean(axis=1)
    parts = [np.ones(len(areas), dtype=bool)]
    parts += [np.all((middle >= low) & (middle <= high), axis=1) for low, high in windows]
    top = max(_quantile(PEAK_AREA, mean[part], areas[part]) for part in parts if part.any())
    largest = float(np.abs(values).max(initial=0.0))
    top = largest if largest <= PEAK_RATIO * top else top
    top = top or 1.0
    return (-top, top) if values.min(initial=0.0) < 0 else (0.0, top)


def draw_scene(figure: Figure, scene: Scene, view: View, heading: str = "") -> None:
    """Draw a scene with close-ups, colour scale and pressure.

    Bodies are on the left, close-ups in the middle, two in a column, and pressures on the right, a
    panel for each part of the contact lines; none without contact points.
    """
    style, windows = scene.style, view.windows
    parts = view.parts if len(scene.solution.points) else []
    (width, height), length = view.corners[1] - view.corners[0], style.unit("length")[1]
    tall = 1 if len(windows) < 2 else 2
    columns = -(-len(windows) // tall)
    ratios = [float(np.clip(width / height, 0.6, 2)), *[1.0 / tall] * columns]
    ratios += [0.5 + 0.9 * len(parts)] * bool(parts)
    figure.set_size_inches(2 + HEIGHT * 0.9 * sum(ratios), HEIGHT)
    figure.set_layout_engine("constrained", w_pad=PANEL_PAD)
    grid = figure.add_gridspec(tall, len(ratios), width_ratios=ratios)
    bodies = figure.add_subplot(grid[:, 0])
    close = [figure.add_subplot(grid[k % tall, 1 + k // tall]) for k in range(len(windows))]
    if parts:
        beside = grid[:, -1].subgridspec(1, len(parts), wspace=0.05)
        _draw_pressures(beside.subplots(sharey=True, squeeze=False)[0], scene, view)
    shading, *_ = [_draw_bodies(axes, scene, view.limits) for axes in (bodies, *close)]
    space = " " if width / height > 0.9 else "\n"
    bodies.set_title(f"deformed bodies,{space}displacement × {scene.scale:g}")
    margin = np.array([-0.03, 0.03]) * max(width, height)
    xlim, ylim = (np.transpose(view.corners) + margin) / length
    bodies.set(xlim=xlim, ylim=ylim)
    _draw_windows(bodies, close, windows, length)
    label, kind = scene.shown.label, scene.shown.kind
    label, (_, unit) = style.title(label, kind), style.unit(kind)
    colour_bar(figure, shading, [bodies, *close], label, scene.values / unit)
    figure.suptitle(heading)
    for _ in range(2):  # labels move with the ticks that a first layout leaves
        figure.draw_without_rendering()


def _draw_bodies(axes: Axes, scene: Scene, limits: tuple[float, float]) -> Any:
    """The field on the deformed bodies, their outlines and, if `Style.mesh`, element edges."""
    from matplotlib.collections import LineCollection
    from matplotlib.tri import Triangulation

    style = scene.style
    _, length = style.unit("length")
    _, unit = style.unit(scene.shown.kind)
    moved = scene.moved / length
    triangles = Triangulation(moved[:, 0], moved[:, 1], scene.triangles)
    signed = limits[0] < 0 < limits[1]
    colours = DIVERGING if signed else SEQUENTIAL
    low, high = (limit / unit for limit in limits)
    drawing = {"shading": "gouraud", "cmap": colours, "vmin": low, "vmax": high}
    shading = axes.tripcolor(triangles, scene.values / unit, **drawing)
    inner, outer = (list(moved[scene.edges[at]]) for at in (~scene.outline, scene.outline))
    if style.mesh:
        light = "0.35" if signed else "w"
        axes.add_collection(LineCollection(inner, colors=light, lw=0.25, alpha=0.5))
    axes.add_collection(LineCollection(outer, colors="k", lw=0.8))
    x, y = coordinates(scene.solution)
    axes.set(aspect="equal", xlabel=style.title(x, "length"), ylabel=style.title(y, "length"))
    axes.locator_params(nbins=5)
    axes.ticklabel_format(**POWERS)
    return shading


def _draw_windows(
    bodies: Axes, close: Sequence[Axes], windows: Sequence[Window], unit: float
) -> None:
    """Frames of the windows around zones in the whole picture; axes of the close-ups."""
    several = len(windows) > 1
    for k, (axes, window) in enumerate(zip(close, windows, strict=True)):
        (x, y), (right, top) = (corner / unit for corner in window)
        bodies.indicate_inset((x, y, right - x, top - y), edgecolor="crimson", alpha=1, lw=1.2)
        name = f"zone {k + 1}" if several else "zone in contact"
        axes.set(xlim=(x, right), ylim=(y, top), title=name)
        axes.locator_params(nbins=3 if several else 5)
        axes.spines[:].set_color("crimson")
        if several:
            at: dict[str, Any] = {"xytext": (2, 2), "textcoords": "offset points"}
            bodies.annotate(str(k + 1), (right, top), **at, color="crimson", weight="bold")


def colour_bar(figure: Figure, shading: Any, axes: list[Axes], label: str, values: Array) -> None:
    """Colour bar; arrows and numbers tell what of `values` (k,) lies beyond its ends."""
    least, most, (low, high) = float(values.min()), float(values.max()), shading.get_clim()
    below, above = least < low, most > high
    extend = ("neither", "min", "max", "both")[below + 2 * above]
    label += f", least {least:.3g}" * below + f", largest {most:.3g}" * above
    bar = figure.colorbar(shading, ax=axes, label=label, extend=extend)
    bar.ax.ticklabel_format(axis="y", **POWERS)
    if least == most == 0.0:
        bar.set_ticks([0.0])


def shown_parts(scenes: Sequence[Scene]) -> list[Array]:
    """Intervals (2,) of the coordinate to show: one for each small zone if these are far apart."""
    every = np.concatenate([np.zeros(0), *(s for scene in scenes for *_, s in scene.lines)])
    first, last = (every.min(), every.max()) if every.size else (0.0, 0.0)
    parts: list[Array] = []
    zones = [zone.s for scene in scenes for zone in scene.paths]
    for s in sorted(zones, key=lambda s: float(s.min())):
        margin = max(ZONE_MARGINS[0] * np.ptp(s), ZONE_MARGINS[1] * (last - first))
        part = np.array([s.min() - margin, s.max() + margin])
        if parts and part[0] <= parts[-1][1]:
            parts[-1][1] = max(parts[-1][1], part[1])
        else:
            parts.append(part)
    whole = np.clip([parts[0][0], parts[-1][1]] if parts else [first, last], first, last)
    far = 1 < len(parts) <= MAX_PANELS and sum(map(np.ptp, parts)) < PANEL_SHARE * np.ptp(whole)
    return parts if far else [whole + 0.03 * np.ptp(whole) * np.array([-1, 1])]


def cut_pressure(scene: Scene) -> float | None:
    """End of the scale of pressures where peaks, as at corners, are cut off; None elsewhere."""
    pressure, typical = scene.solution.pressure, 0.0
    for _, rows, s in scene.paths:
        lengths = np.gradient(s) if len(s) > 1 else np.ones(1)
        typical = max(typical, _quantile(CUT_SHARE, pressure[rows], lengths))
    largest = float(pressure.max(initial=0.0))
    return CUT_RATIO / 2 * typical if largest > CUT_RATIO * typical > 0 else None


def _draw_pressures(several: Sequence[Axes], scene: Scene, view: View) -> None:
    """Pressure along the contact lines, a panel for each part of them."""
    stress, largest = scene.style.unit("stress")[1], scene.solution.pressure.max()
    for axes, part in zip(several, view.parts, strict=True):
        _draw_pressure(axes, scene, part)
    first, last = several[0], several[-1]
    if view.top is not None:
        first.set_ylim(-0.03 * view.top / stress, view.top / stress)
        if largest > view.top:
            first.set_ylabel(f"{first.get_ylabel()}, largest {largest / stress:.3g}")
    if not (largest or scene.style.profile):
        first.set_yticks([0.0])
    for axes in several[1:]:
        axes.set(ylabel="", title="")
    handles, labels = last.get_legend_handles_labels()
    named = dict(zip(labels, handles, strict=True))
    if len(named) > 1:
        last.legend(named.values(), named, loc="upper left", bbox_to_anchor=(1, 1))


def _draw_pressure(axes: Axes, scene: Scene, part: Array) -> None:
    """Pressure on an interval `part` (2,): points in contact are filled, open ones hollow."""
    solution, style = scene.solution, scene.style
    (_, length), (_, stress) = style.unit("length"), style.unit("stress")
    contact = solution.problem.contact
    peaks = np.array([np.abs(one.pressure).max(initial=0.0) for one in solution.pairs])
    free = np.flatnonzero(peaks < NO_PRESSURE * peaks.max(initial=0.0)).tolist()
    several = len(contact) > 1
    for pair, rows, s in scene.lines:
        if pair in free:
            continue
        colour, mark = colour_and_mark(pair)
        active, p, at = solution.active[rows], solution.pressure[rows] / stress, s / length
        title = f"pair {pair}: {contact[pair].secondary}" if several else None
        size = 4 + 2 * min(len(contact) - 1 - pair, 2)  # visible behind later pairs
        axes.plot(at, p, color=colour, lw=1, marker=mark, ms=4, markevery=[], label=title)
        for state, fill, name in ((active, colour, "in contact"), (~active, "w", "open")):
            if state.any():
                label = None if several else name
                axes.plot(at[state], p[state], mark, ms=size, mec=colour, mfc=fill, label=label)
    states = (solution.active, "0.4", "in contact"), (~solution.active, "w", "open")
    for state, fill, name in states if several else ():
        if state.any():
            axes.plot([], [], "o", ms=4, mec="0.4", mfc=fill, label=name)
    if free:
        others = f"pair{'s' * (len(free) > 1)} {', '.join(map(str, free))}"
        axes.plot([], [], " ", label=f"without pressure:\n{others}")
    if np.ptp(part) > 0:
        axes.set_xlim(*part / length)
    arcs = [pair.direction is None for pair in contact]
    names = ["arc position"] * any(arcs) + ["η, along the contact line"] * (not all(arcs))
    finish_pressures(axes, style, part, names)
    axes.set_title("contact pressure")


def colour_and_mark(pair: int) -> tuple[str, str]:
    """Colour and mark of a pair; the first 49 pairs differ in one of them."""
    n = len(COLOURS)
    return COLOURS[pair % n], MARKS[(pair + pair // n) % len(MARKS)]


def finish_pressures(axes: Axes, style: Style, part: Array, names: Iterable[str]) -> None:
    """Labels, by `names` of the coordinate, and the given profiles, on an interval `part` (2,)."""
    (_, length), (_, stress) = style.unit("length"), style.unit("stress")
    for k, (label, profile) in enumerate(style.profile.items()):
        if callable(profile):
            s = np.linspace(part[0], part[1], PROFILE_SAMPLES)
            p = np.broadcast_to(np.asarray(profile(s), dtype=float), s.shape)
        else:
            s, p = (np.asarray(values, dtype=float) for values in profile)
        stroke = STROKES[k % len(STROKES)]
        axes.plot(s / length, p / stress, stroke, color="k", lw=1.2, label=label, zorder=3)
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    axes.set_xlabel(style.title(" or ".join(names), "length"))
    axes.set_ylabel(style.title("contact pressure", "stress"))
    axes.ticklabel_format(**POWERS)
    axes.grid(alpha=0.3)


def slope_triangle(axes: Axes, x: Array, y: Array, rate: float) -> None:
    """A triangle of the slope -`rate` below the end of a curve `x`, `y` (k,), both logarithmic."""
    right, end = float(x[-1]), TRIANGLE_DEPTH * float(y[-1])
    left, start = right / TRIANGLE_SPAN, end * TRIANGLE_SPAN**rate
    axes.plot([left, right, left, left], [start, end, end, start], color="0.4", lw=0.8)
    beside: dict[str, Any] = {"textcoords": "offset points", "fontsize": 8, "color": "0.3"}
    for text, place, offset, ha, va in (
        (f"{rate:g}", (left, np.sqrt(end * start)), (-3, 0), "right", "center"),
        ("1", (np.sqrt(left * right), end), (0, -2), "center", "top"),
    ):
        axes.annotate(text, place, xytext=offset, ha=ha, va=va, **beside)


def plot_convergence(
    runs: Mapping[str, Run] | Run,
    path: str | os.PathLike[str] | None = None,
    *,
    rates: Mapping[str, float] | None = None,
) -> Figure:
    """Relative errors over unknowns, with a triangle of the optimal rate under each curve.

    Parameters
    ----------
    runs : mapping or sequence of Solution
        By label: levels of `adapt` or solutions on finer and finer meshes, drawn by their error
        estimates and, where they have been made, guaranteed bounds (dashed); or two arrays,
        unknowns (k,) and relative errors (k,). One run may be given as it is.
    path : path, optional
        File (.png); without one the picture is shown on the screen.
    rates : mapping, optional
        Rates of the triangles by label. Default: order / 2 of solutions, no triangle for arrays.

    Returns
    -------
    Figure
        Of matplotlib.

    Raises
    ------
    ValueError, OSError
        An empty run, a rate without a run, a path that cannot be written.
    """
    named = {str(k): run for k, run in runs.items()} if isinstance(runs, Mapping) else {"": runs}
    if unknown := set(rates or {}) - set(named):
        raise ValueError(f"rates: no run is called {', '.join(sorted(unknown))}")
    for label, run in named.items():
        if len(run[0] if isinstance(run, tuple) else run) == 0:
            raise ValueError(f'run "{label}" is empty')
    target = None if path is None else check_path(path, ".png")
    figure = new_figure(target, figsize=(6.5, 5))
    axes = figure.subplots()
    for k, (label, run) in enumerate(named.items()):
        name, rate, colour, mark = label, (rates or {}).get(label), *colour_and_mark(k)
        style: dict[str, Any] = {"color": colour, "marker": mark, "ms": 4}
        if isinstance(run, tuple):
            x, y = (np.asarray(values, dtype=float) for values in run)
        else:
            order = run[-1].order
            name, rate = label or f"estimate, order {order}", order / 2 if rate is None else rate
            sizes = [level.displacement.space.ndof for level in run]
            levels = list(zip(sizes, run, strict=True))
            x, y = np.transpose([(n, level.relative_error_estimate) for n, level in levels])
            if bound := [(n, one.relative_error_bound) for n, one in levels if one.bounded]:
                bound_name = f"{label}, bound".lstrip(", ")
                axes.plot(*np.transpose(bound), ls="--", mfc="w", label=bound_name, **style)
        axes.plot(x, y, label=name, **style)
        if rate is not None:
            slope_triangle(axes, x, y, rate)
    axes.set(xscale="log", yscale="log", xlabel="unknowns", ylabel="relative error, energy norm")
    axes.grid(which="major", alpha=0.3)
    axes.legend()
    show(figure, target)
    return figure
