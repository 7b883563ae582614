"""Close-ups of zones in contact, and colours that one singular corner does not spoil."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Array
from .scene import Scene

MOST = 4  # close-ups
SMALL = 0.2  # half of a close-up's size over that of the picture, from which the picture shows it
MARGIN = 0.9  # half of a close-up's size over that of its zone
LEAST = 0.02, 0.002  # half-sizes, relative to the picture, of single points and of any zone
SHARE = 0.005  # of an area, beyond whose value colours may saturate
SPARE = 1.25  # largest value over that one up to which they do not

Window = tuple[Array, Array]  # lower left and upper right corner, each (2,)


def _window(zone: Array, low: Array, high: Array) -> Window:
    """The square about the points of a zone (c, 2), inside of the picture from `low` to `high`."""
    size = (high - low).max()
    first, last = zone.min(axis=0), zone.max(axis=0)
    extent = (last - first).max()
    half = max(MARGIN * extent, LEAST[0 if len(zone) < 3 else 1] * size)
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
    return [w for w in windows if (w[1] - w[0]).max() < 2 * SMALL * size][:MOST]


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
    top = largest if largest <= SPARE * top else top
    top = top or 1.0
    return (-top, top) if scene.shown.signed else (0.0, top)
