"""Where nodes lie along a part of a contact line: as close as its size and its turn ask.

And where the gap of facing curves is least: contact starts there, unseen if between nodes.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise

import numpy as np

from ..arrays import Array

TURN = 0.5  # largest turn (radians) of a curve along one contact segment
SPARE = 1e-9  # share by which a run of elements may exceed their size, not to gain one by round-off
NARROW = 0.1  # of the size of a segment: gaps that contact may close
CONSTANT = 1e-6  # of the size of a segment: change within half of it up to which a gap has no least
THERE = 1e-6  # of a segment: distance up to which a node lies at a place
CLOSE = 0.1  # of a segment: distance within which a place leaves it to the node beside it
FINER = 2**-6  # of a sample's distance: from its error of 1e-5 to one of 1e-9, above round-off


def _segments(x: Array, y: Array, maxh: float) -> Array:
    """How many segments reach up to each of the points `x`, `y` (k, 2) of facing curves, (k,)."""
    density = np.zeros(len(x) - 1)
    for points in (x, y):
        steps = np.diff(points, axis=0)
        angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        turn = np.abs(np.gradient(angle)) if len(angle) > 1 else np.zeros(1)
        density = np.maximum(density, np.linalg.norm(steps, axis=1) / maxh)
        density = np.maximum(density, turn / TURN)
    return np.concatenate([[0.0], np.cumsum(density)])


def narrowest(t: Array, x: Array, y: Array, maxh: float, gap: Callable[[Array], Array]) -> Array:
    """Parameters (j,) between samples at `t` (k,) at which a narrow gap is least, or largest.

    `x`, `y` (k, 2) and `maxh` as in `spaced`; `gap` maps (n,) to signed distances (n,) whose
    sense is not known: bodies apart and bodies that overlap first touch at one or the other.
    """
    before, here, after = (values := gap(t))[:-2], values[1:-1], values[2:]
    bend = before - 2 * here + after
    step = np.diff(_segments(x, y, maxh))
    change = np.abs(bend) / 8 / np.maximum(step[:-1], step[1:]) ** 2  # within half a segment
    turns = (np.abs(here) <= NARROW * maxh) & ((before - here) * (after - here) >= 0)
    place = t[1:-1][turns & (change > CONSTANT * maxh)]
    apart = (t[-1] - t[0]) / (len(t) - 1)
    for width in (apart, FINER * apart) if len(place) else ():  # vertices of parabolas
        before, here, after = (gap(place + side * width) for side in (-1, 0, 1))
        place = place + width / 2 * (before - after) / (before - 2 * here + after)
    return np.unique(place[(place > t[0]) & (place < t[-1])])


def spaced(t: Array, x: Array, y: Array, maxh: float, places: Array) -> Array:
    """Parameters (n,) of nodes between samples at `t` (k,), the first and the last included.

    `x` and `y` (k, 2) are the points there, and those that they see on the other curve; segments
    are no longer than `maxh` on either and turn by `TURN` at most. Nodes lie at the parameters
    `places` (j,), but for those beside an end or another one.
    """
    total = _segments(x, y, maxh)

    def even(start: float, stop: float) -> Array:
        count = max(1, int(np.ceil((stop - start) * (1 - SPARE))))
        return np.linspace(start, stop, count + 1)

    marks = even(0, total[-1])
    stops = np.interp(places, t, total)
    stops = stops[(stops > CLOSE) & (stops < total[-1] - CLOSE)]
    stops = stops[np.diff(stops, prepend=0.0) > CLOSE]
    if (np.abs(stops[:, None] - marks).min(axis=1) > THERE).any():
        bounds = [0.0, *stops.tolist(), total[-1]]
        marks = np.unique(np.concatenate([even(*part) for part in pairwise(bounds)]))
    return np.interp(marks, total, t)
