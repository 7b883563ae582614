"""Where contact turns from binding to non-binding, inside elements and at corners."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

from ..arrays import Array, Index, Mask
from .corners import in_contact, twins
from .line import ContactLine

# Stencil of the fit, by measurement on Hertz contact at orders 1 to 4: the two points next to the
# contact carry the error of the element in which it ends.
SKIPPED = 2
FEWEST = 8  # points of the fit, or three per order and two if that is more
DEGREE = 3  # of the fit, 2 at order 1
SAMPLES = 65  # places at which the fit is evaluated to bracket its zero


def _neighbours(line: ContactLine) -> tuple[dict[int, list[int]], Index]:
    """Neighbours of every contact point along the line, and all links (l, 2) of two points.

    The two points at a corner of the line are neighbours without a distance.
    """
    pairs = np.stack([line.rows[:, :-1].ravel(), line.rows[:, 1:].ravel()], axis=1)
    links = np.concatenate([pairs[(pairs >= 0).all(axis=1)], twins(line)])
    neighbours: dict[int, list[int]] = {}
    for a, b in links.tolist():
        neighbours.setdefault(a, []).append(b)
        neighbours.setdefault(b, []).append(a)
    return neighbours, links


def _run(start: int, before: int, neighbours: dict[int, list[int]], active: Mask) -> list[int]:
    """Points from `start` on, away from `before`, as long as they share the state of `start`."""
    run, last = [start], before
    while True:
        onward = [i for i in neighbours[run[-1]] if i != last]
        if not onward or active[onward[0]] != active[start] or onward[0] in run:
            return run
        last = run[-1]
        run.append(onward[0])


def _closing_point(distance: Array, gap: Array, order: int) -> float | None:
    """Distance at which the gap closes, by a fit of gap^(2/3) over the open points, or None.

    `distance` (k,) grows away from the contact, whose last point has distance 0.
    """
    chosen = slice(SKIPPED, SKIPPED + max(FEWEST, 3 * order + 2))
    x, y = distance[chosen], np.maximum(gap[chosen], 0.0) ** (2 / 3)
    if len(x) < 2 or y[-1] <= 0:
        return None
    fit = np.polynomial.Polynomial.fit(x, y, min(DEGREE, order + 1, len(x) - 1))
    # The last active point may lie on the open side by the error of one element. The zero is
    # bracketed: the roots of a companion matrix are lost where leading coefficients are round-off.
    places, step = np.linspace(-distance[0], x[0], SAMPLES, retstep=True)
    below = np.flatnonzero(fit(places) <= 0)
    if len(below) == 0 or below[-1] == SAMPLES - 1:
        return None
    low = places[below[-1]]
    return float(low + step * brentq(lambda t: fit(low + step * t), 0, 1, xtol=1e-15))


@dataclass(frozen=True, eq=False)
class Transitions:
    """Places where contact of one pair turns from binding to non-binding, k of them.

    Attributes
    ----------
    inner, outer : ndarray of int (k,)
        The last active and the first open contact point; at a corner the next but one.
    position : ndarray (k, 2)
        The transition itself.
    beyond : ndarray (k,)
        How far it lies from the last active point, along the line, outwards; a length.
    closed, opened : list
        By end the points (q,) from the last active one inwards, and from the first open one
        outwards, in the order of the line, as far as contact is closed or open.
    """

    inner: Index
    outer: Index
    position: Array
    beyond: Array
    closed: list[Index]
    opened: list[Index]


def transitions_on(line: ContactLine, gap: Array, active: Mask) -> Transitions:
    """Transitions between neighbours of which one is active.

    Near a frictionless transition the gap grows like the 3/2 power of the distance, so that
    gap^(2/3) is a smooth function of it with a simple zero at the transition. That zero is found
    from a cubic fitted to the open points near by, the nearest ones left out. Without enough of
    them - contact that opens at a few points only - it is the middle between the two points.
    Between the two points at a corner it is the corner.

    Parameters
    ----------
    line : ContactLine
        The pair.
    gap : ndarray (m,)
        At its points after deformation, lengths.
    active : ndarray of bool (m,)
        Points in contact.
    """
    neighbours, links = _neighbours(line)
    active = in_contact(line, active)
    x, order = line.position, line.rows.shape[1] - 1
    ends, found, beyond = [], [], []
    inwards: list[Index] = []
    outwards: list[Index] = []
    for link in links[active[links[:, 0]] != active[links[:, 1]]].tolist():
        inner, outer = sorted(link, key=lambda i: not active[i])
        opened = _run(outer, inner, neighbours, active)
        closed = _run(inner, outer, neighbours, active)
        inwards.append(np.array(closed))
        outwards.append(np.array(opened))
        if line.node[inner] == line.node[outer]:  # the node touches one side of a corner only
            ends.append((inner, opened[min(1, len(opened) - 1)]))
            found.append(x[inner])
            beyond.append(0.0)
            continue
        if len(opened) > 1 and any(active[i] for i in neighbours[opened[-1]]):
            opened = opened[: (len(opened) + 1) // 2]  # the other half belongs to its other end
        steps = np.linalg.norm(np.diff(x[[inner, *opened]], axis=0), axis=1)
        distance = np.cumsum(steps)
        at = _closing_point(distance, gap[opened], order)
        if at is None:
            at = distance[0] / 2
        closed = closed[:2]
        beyond.append(at)
        path = np.array([*closed[::-1], *opened])
        along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(x[path], axis=0), axis=1))])
        at += along[len(closed) - 1]
        ends.append((inner, outer))
        found.append([np.interp(at, along, x[path, axis]) for axis in (0, 1)])
    inner_outer = np.array(ends, dtype=np.intp).reshape(-1, 2)
    position = np.array(found).reshape(-1, 2)
    inner, outer = inner_outer.T
    return Transitions(inner, outer, position, np.array(beyond), inwards, outwards)


def ending_segments(line: ContactLine, ends: Transitions) -> Index:
    """Numbers (j,) in `line.segments` where contact ends; at corners, of those beside."""
    inner = (line.rows[:, :, None] == ends.inner).any(axis=1)
    outer = (line.rows[:, :, None] == ends.outer).any(axis=1)
    both = inner & outer
    at = np.where(both.any(axis=0), both, inner | outer)
    return np.flatnonzero(at.any(axis=1))
