"""Where contact turns from binding to non-binding, inside elements."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .gap import ContactLine

Array = NDArray[np.float64]


def _links(line: ContactLine) -> tuple[dict[int, list[int]], NDArray[np.intp]]:
    """Neighbours of every contact point along the line, and all links (l, 2) of two points."""
    pairs = np.stack([line.rows[:, :-1].ravel(), line.rows[:, 1:].ravel()], axis=1)
    links = pairs[(pairs >= 0).all(axis=1)]
    neighbours: dict[int, list[int]] = {}
    for a, b in links.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    return neighbours, links


def _root(near: float, far: float, length: float) -> float:
    """Distance beyond `near` at which the line through (-length, far), (0, near) vanishes."""
    return near * length / (far - near) if far > near else float("inf")


def transition_points(
    line: ContactLine, pressure: Array, gap: Array, active: NDArray[np.bool_]
) -> Array:
    """Points (k, 2) between neighbours of which one is active.

    Near a frictionless transition p behaves like the square root of the distance on the binding
    side, the gap like its 3/2 power on the other. The zeros of the lines through p^2 and through
    gap^(2/3) at the two nearest points of each side are averaged, each kept between the last
    active and the first open point.

    Parameters
    ----------
    line : ContactLine
        The pair.
    pressure, gap : ndarray (m,)
        At its points.
    active : ndarray of bool (m,)
        Points in contact.
    """
    neighbours, links = _links(line)
    x = line.position
    found = []
    for a, b in links[active[links[:, 0]] != active[links[:, 1]]].tolist():
        inner, outer = (a, b) if active[a] else (b, a)
        step = float(np.linalg.norm(x[outer] - x[inner]))
        fractions: list[float] = []
        for at, state, value in (
            (inner, True, np.maximum(pressure, 0) ** 2),
            (outer, False, np.maximum(gap, 0) ** (2 / 3)),
        ):
            behind = [i for i in neighbours[at] if active[i] == state and i not in (inner, outer)]
            if behind:
                length = float(np.linalg.norm(x[at] - x[behind[0]]))
                root = _root(float(value[at]), float(value[behind[0]]), length)
                fraction = min(root / step, 1.0)
                fractions.append(fraction if state else 1 - fraction)
        mean = float(np.mean(fractions)) if fractions else 0.5
        found.append(x[inner] + mean * (x[outer] - x[inner]))
    return np.array(found).reshape(-1, 2)
