"""Where nodes lie along a part of a contact line: as close as its size and its turn ask."""

from __future__ import annotations

import numpy as np

from ..arrays import Array

TURN = 0.5  # largest turn (radians) of a curve along one contact segment
SPARE = 1e-9  # share by which a run of elements may exceed their size, not to gain one by round-off


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


def spaced(t: Array, x: Array, y: Array, maxh: float) -> Array:
    """Parameters (n,) of nodes between samples at `t` (k,), the first and the last included.

    `x` and `y` (k, 2) are the points there, and those that they see on the other curve; segments
    are no longer than `maxh` on either and turn by `TURN` at most.
    """
    total = _segments(x, y, maxh)
    count = max(1, int(np.ceil(total[-1] * (1 - SPARE))))
    return np.interp(np.linspace(0, total[-1], count + 1), total, t)
