"""Panels of a picture: bodies with a field, pressures along contact lines, close-ups of zones."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from ...arrays import Array, Index
from ...solved import Solved
from .scene import COLOURS, MARKS, RISING, SIGNED, Scene, Style, contact_lines

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.ticker import ScalarFormatter


CLOSE_UPS = 4  # close-ups
SMALL = 0.2  # half of a close-up's size over that of the picture, from which the picture shows it
MARGIN = 0.9  # half of a close-up's size over that of its zone
HALF_SIZES = 0.02, 0.002  # half-sizes, relative to the picture, of single points and of any zone
SHARE = 0.005  # of an area, beyond whose value colours may saturate
CUT_OFF = 1.25  # largest value over that one up to which they do not


Window = tuple[Array, Array]  # lower left and upper right corner, each (2,)


def _window(zone: Array, low: Array, high: Array) -> Window:
    """The square about the points of a zone (c, 2), inside of the picture from `low` to `high`."""
    size = (high - low).max()
    first, last = zone.min(axis=0), zone.max(axis=0)
    extent = (last - first).max()
    half = max(MARGIN * extent, HALF_SIZES[0 if len(zone) < 3 else 1] * size)
    middle = (first + last) / 2
    # At the rim of the picture, as on a symmetry plane, the window moves inwards.
    inner, outer = low + 0.95 * half, high - 0.95 * half
    middle = np.where(inner < outer, np.clip(middle, inner, outer), middle)
    return middle - half, middle + half


def _overlap(one: Window, other: Window) -> bool:
    """Whether two windows share a point."""
    return bool(np.all(one[0] < other[1]) and np.all(other[0] < one[1]))


def close_ups(scenes: Sequence[Scene]) -> list[Window]:
    """Windows on the small zones in contact of one or more scenes, those of large forces first.

    Zones whose windows overlap share one; of those that a picture of all shows well there is none.
    """
    low = np.min([scene.moved.min(axis=0) for scene in scenes], axis=0)
    high = np.max([scene.moved.max(axis=0) for scene in scenes], axis=0)
    groups: list[Array] = []
    for zone in [zone for scene in scenes[::-1] for zone in scene.zones]:
        joined = zone
        while True:
            window = _window(joined, low, high)
            met = [k for k, g in enumerate(groups) if _overlap(window, _window(g, low, high))]
            if not met:
                break
            joined = np.concatenate([*(groups[k] for k in met), joined])
            groups = [g for k, g in enumerate(groups) if k not in met]
        groups.append(joined)
    windows = [_window(group, low, high) for group in groups]
    size = (high - low).max()
    return [w for w in windows if (w[1] - w[0]).max() < 2 * SMALL * size][:CLOSE_UPS]


def _typical(values: Array, areas: Array) -> float:
    """Value that all but `SHARE` of the area (t,) keeps below."""
    order = np.argsort(values)
    share = np.cumsum(areas[order]) / areas.sum()
    return float(values[order][np.searchsorted(share, 1 - SHARE).clip(0, len(order) - 1)])


def colour_range(scene: Scene, windows: Sequence[Window]) -> tuple[float, float]:
    """Ends of the colour scale: of the bodies and in each window, without single peaks.

    Peaks are what lies above the value that all but `SHARE` of an area keeps below, far above:
    stresses at corners and at ends of supports, which grow on every finer mesh.
    """
    values, areas = np.abs(scene.shown.values), scene.areas()
    mean, middle = values[scene.triangles].mean(axis=1), scene.moved[scene.triangles].mean(axis=1)
    top = _typical(mean, areas)
    for low, high in windows:
        seen = np.all((middle >= low) & (middle <= high), axis=1)
        if seen.any():
            top = max(top, _typical(mean[seen], areas[seen]))
    largest = float(values.max(initial=0.0))
    top = largest if largest <= CUT_OFF * top else top
    top = top or 1.0
    return (-top, top) if scene.shown.signed else (0.0, top)


BESIDE, LEAST = 0.75, 0.002  # shown beside a zone: of its length, and of all that is shown
FAR, MOST = 0.4, 4  # zones have panels of their own where they fill less than that, and are so many
SINGLE, SPARE = 0.1, 4.0  # share of a zone whose pressures are cut if they are so much above others
POWERS = -3, 4  # of ten, from which numbers on a scale are given with one for all
SAMPLES = 400  # of a function that is drawn over the pressure


def draw_bodies(axes: Axes, scene: Scene, style: Style, limits: tuple[float, float]) -> Any:
    """The field on the deformed bodies, element edges where asked for, outlines of the bodies."""
    from matplotlib.collections import LineCollection
    from matplotlib.tri import Triangulation

    _, length = style.unit("length")
    _, unit = style.unit(scene.shown.kind)
    moved = scene.moved / length
    triangles = Triangulation(moved[:, 0], moved[:, 1], scene.triangles)
    shading = axes.tripcolor(
        triangles,
        scene.shown.values / unit,
        shading="gouraud",
        vmin=limits[0] / unit,
        vmax=limits[1] / unit,
        cmap=SIGNED if limits[0] < 0 < limits[1] else RISING,
    )
    light = "0.35" if shading.get_cmap().name == SIGNED else "w"
    inner, outer = (list(moved[scene.edges[at]]) for at in (~scene.outline, scene.outline))
    if style.mesh:
        axes.add_collection(LineCollection(inner, colors=light, lw=0.25, alpha=0.5))
    axes.add_collection(LineCollection(outer, colors="k", lw=0.8))
    x, y = scene.axes
    axes.set(aspect="equal", xlabel=style.title(x, "length"), ylabel=style.title(y, "length"))
    axes.locator_params(nbins=5)
    _format(axes)
    return shading


def powers() -> ScalarFormatter:
    """Numbers of a scale, with one power of ten for all where they are large or small."""
    from matplotlib.ticker import ScalarFormatter

    formatter = ScalarFormatter(useMathText=True)
    formatter.set_powerlimits(POWERS)
    return formatter


def _format(axes: Axes) -> None:
    """The same on both axes."""
    axes.xaxis.set_major_formatter(powers())
    axes.yaxis.set_major_formatter(powers())


def draw_windows(
    bodies: Axes, close: Sequence[Axes], windows: Sequence[Window], unit: float
) -> None:
    """Frames of the windows in the picture of the bodies, and the close-ups cut to them."""
    from matplotlib.patches import Rectangle

    for k, (axes, window) in enumerate(zip(close, windows, strict=True)):
        low, high = (corner / unit for corner in window)
        frame = Rectangle((low[0], low[1]), *(high - low), fill=False, color="crimson", lw=1.2)
        bodies.add_patch(frame)
        name = "zone in contact" if len(windows) == 1 else f"zone {k + 1}"
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), title=name)
        axes.locator_params(nbins=5 if len(windows) == 1 else 3)
        axes.spines[:].set_color("crimson")
        if len(windows) > 1:
            bodies.annotate(
                str(k + 1),
                (high[0], high[1]),
                xytext=(2, 2),
                textcoords="offset points",
                color="crimson",
                weight="bold",
            )


def shown_part(solution: Solved, lines: list[tuple[int, Index, Array]]) -> Array | None:
    """Ends (2,) of what is shown of long boundaries: the zones in contact and what is beside.

    Of each of the `lines` (l,) its pair, numbers (k,) of contact points, their coordinates (k,).
    """
    if not solution.active.any() or len(solution.points) < 2:
        return None
    places = np.concatenate([s[solution.active[rows]] for _, rows, s in lines])
    every = np.concatenate([s for *_, s in lines])
    low, high = places.min(), places.max()
    margin = max(0.75 * (high - low), 0.02 * np.ptp(every))
    low, high = max(low - margin, every.min()), min(high + margin, every.max())
    return np.array([low - 0.03 * margin, high + 0.03 * margin])


def shown_parts(solution: Solved) -> list[Array]:
    """Ends (2,) of each interval of the coordinate in which pressures are shown.

    One for each zone, where zones are small and far from each other, or one for all.
    """
    lines = contact_lines(solution)
    whole = shown_part(solution, lines)
    if whole is None:
        every = np.concatenate([s for *_, s in lines] or [np.zeros(1)])
        return [np.array([every.min(), every.max()])]
    parts: list[Array] = []
    for zone in sorted(_zones(solution, lines), key=lambda zone: float(zone[0].min())):
        low, high = zone[0].min(), zone[0].max()
        margin = max(BESIDE * (high - low), LEAST * np.ptp(whole))
        part = np.array([low - margin, high + margin])
        if parts and part[0] <= parts[-1][1]:
            parts[-1][1] = max(parts[-1][1], part[1])
        else:
            parts.append(part)
    far = 1 < len(parts) <= MOST and sum(map(np.ptp, parts)) < FAR * np.ptp(whole)
    return parts if far else [whole]


def _zones(solution: Solved, lines: list[tuple[int, Index, Array]]) -> list[tuple[Array, Array]]:
    """Coordinates (c,) and pressures (c,) of each zone in contact."""
    zones = []
    for _, rows, s in lines:
        run = np.cumsum(np.diff(solution.active[rows], prepend=False))  # odd in contact
        at = [run == k for k in range(1, run[-1] + 1, 2)]
        zones += [(s[zone], solution.pressure[rows][zone]) for zone in at]
    return zones


def cut_pressure(solution: Solved) -> float | None:
    """End of the scale of pressures where single points, as at corners, lie far above the others.

    In each zone all but `SINGLE` of its length lie below.
    """
    typical = 0.0
    for s, p in _zones(solution, contact_lines(solution)):
        order = np.argsort(p, kind="stable")
        share = np.cumsum(np.gradient(s)[order]) if len(s) > 1 else np.ones(1)
        last = int(np.searchsorted(share, (1 - SINGLE) * share[-1]))
        typical = max(typical, float(p[order][min(last, len(p) - 1)]))
    largest = float(solution.pressure.max(initial=0.0))
    return SPARE / 2 * typical if largest > SPARE * typical > 0 else None


def draw_pressures(
    several: Sequence[Axes], solution: Solved, style: Style, parts: Sequence[Array]
) -> None:
    """Pressure along the contact lines: one panel for each of the `parts` (2,), with one scale."""
    (_, stress), top = style.unit("stress"), cut_pressure(solution)
    for axes, part in zip(several, parts, strict=True):
        draw_pressure(axes, solution, style, part)
    first, *others = several
    if top is not None:
        first.set_ylim(-0.03 * top / stress, top / stress)
        text = f"↑ largest {solution.pressure.max() / stress:.3g}"
        first.annotate(text, (0.5, 0.98), xycoords="axes fraction", ha="center", va="top")
    if others:
        low = min(axes.get_ylim()[0] for axes in several)
        first.set_ylim(low, max(axes.get_ylim()[1] for axes in several))
        for axes in others:
            axes.sharey(first)
            axes.set(ylabel="", title="")
            axes.tick_params(labelleft=False)
            axes.yaxis.get_offset_text().set_visible(False)
        for axes in several[:-1]:
            if (legend := axes.get_legend()) is not None:
                legend.remove()
        if others[-1].get_legend() is not None:
            # Above its panel, which has no title: inside it would cover points.
            above = {"loc": "lower right", "bbox_to_anchor": (1, 1), "borderaxespad": 0.3}
            others[-1].legend(fontsize="small", ncols=2, **above)


def draw_pressure(axes: Axes, solution: Solved, style: Style, part: Array) -> None:
    """Pressure along one `part` (2,) of the lines, full where in contact and hollow where open."""
    (_, length), (_, stress) = style.unit("length"), style.unit("stress")
    lines, contact = contact_lines(solution), solution.problem.contact
    several = len(contact) > 1
    for k, (pair, rows, s) in enumerate(lines):
        colour, mark = _look(pair)
        active, p, at = solution.active[rows], solution.pressure[rows] / stress, s / length
        new = several and pair not in [other for other, *_ in lines[:k]]
        title = f"pair {pair}: {contact[pair].secondary}" if new else None
        size = 4 + 2 * min(len(contact) - 1 - pair, 2)  # seen behind those of later pairs
        axes.plot(at, p, color=colour, lw=1, marker=mark, ms=4, markevery=[], label=title)
        for state, fill, name in ((active, colour, "in contact"), (~active, "w", "open")):
            label = name if state.any() and not several and k == 0 else None
            axes.plot(at[state], p[state], mark, ms=size, mec=colour, mfc=fill, label=label)
    for state, fill, name in (
        (solution.active, "0.4", "in contact"),
        (~solution.active, "w", "open"),
    ):
        if several and state.any():
            axes.plot([], [], "o", ms=4, mec="0.4", mfc=fill, label=name)
    if np.ptp(part) > 0:
        axes.set_xlim(*part / length)
    _draw_profiles(axes, style, part)
    if several or style.profile or not solution.active.all():
        axes.legend()
    axes.axhline(0, color="0.6", lw=0.8, zorder=0)
    names = {
        "arc position" if pair.direction is None else "η, along the contact line"
        for pair in contact
    }
    axes.set(
        xlabel=style.title(" or ".join(sorted(names)), "length"),
        ylabel=style.title("contact pressure", "stress"),
        title="contact pressure",
    )
    _format(axes)
    axes.grid(alpha=0.3)


def _look(pair: int) -> tuple[str, str]:
    """Colour and mark of a pair."""
    return COLOURS[pair % len(COLOURS)], MARKS[pair % len(MARKS)]


def _draw_profiles(axes: Axes, style: Style, part: Array) -> None:
    """What the user wants to see over the pressure."""
    (_, length), (_, stress) = style.unit("length"), style.unit("stress")
    strokes = ("-", "--", ":", "-.")
    for k, (label, profile) in enumerate(style.profile.items()):
        if callable(profile):
            s = np.linspace(part[0], part[1], SAMPLES)
            p = np.broadcast_to(np.asarray(profile(s), dtype=float), s.shape)
        else:
            s, p = (np.asarray(values, dtype=float) for values in profile)
        stroke = strokes[k % len(strokes)]
        axes.plot(s / length, p / stress, stroke, color="k", lw=1.2, label=label, zorder=3)
