"""First active sets: from the gaps, or from a solution on another mesh."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Mask
from ..contact import ContactLine, ContactState, by_line
from .discrete_problem import DiscreteProblem

TOUCHING = 1e-12  # gap, relative to the zone, up to which points start active
APART = 1e-6  # distance of the two points at a corner, by their directions, relative to the zone
TIED = 1e-6  # difference of two distances, relative to them, that round-off may have made


def first_active_set(discrete: DiscreteProblem) -> Mask:
    """Cold start (m,): the points that touch before the load.

    Bodies that contact alone can hold are first placed, rigid, where the load presses them.
    """
    p = discrete.program
    gap, carries = p.g, np.zeros(len(p.g), dtype=bool)
    if (rigid := discrete.rigid) is not None:
        gap, carries = gap - rigid.rows @ rigid.placing, rigid.carries
    active = [np.zeros(0, dtype=bool)]
    for line, distance in zip(discrete.lines, by_line(discrete.lines, gap), strict=True):
        size = np.ptp(line.position, axis=0).max() if len(line.node) else 0.0
        active.append(distance <= TOUCHING * size)
    return np.concatenate(active) | carries


def carried_active_set(lines: Sequence[ContactLine], previous: Sequence[ContactState]) -> Mask:
    """Warm start (m,): the state of the nearest contact point of the same pair on another mesh.

    At orders above 1 the points around a transition are told by the side of it they lie on: it is
    located more closely than the nodes of either mesh.
    """
    carried = [_carried(new, old) for new, old in zip(lines, previous, strict=True)]
    return np.concatenate([np.zeros(0, dtype=bool), *carried])


def _carried(new: ContactLine, old: ContactState) -> Mask:
    """First active points of one pair, (m,)."""
    known = old.line
    if known.node.size == 0 or new.node.size == 0:
        return np.zeros(new.node.size, dtype=bool)
    # Two points at a corner are told apart by their directions.
    size = APART * np.ptp(known.position, axis=0).max(initial=0.0)
    tree = cKDTree(np.column_stack([known.position, size * known.direction]))
    places = np.column_stack([new.position, size * new.direction])
    distance, near = tree.query(places, k=[1, min(2, known.node.size)])
    away, nearest = distance[:, 0], near[:, 0]
    # A new point in the middle of two: active if one of them is, whatever round-off says.
    tied = distance[:, 1] <= (1 + TIED) * away
    active: Mask = old.active[nearest] | (tied & old.active[near[:, 1]])
    order = known.rows.shape[1] - 1
    if order > 1 and away.max() > size:  # not the same points
        ends = old.transitions
        for inner, outer, place in zip(ends.inner, ends.outer, ends.position, strict=True):
            around = (nearest == inner) | (nearest == outer)
            inwards = known.position[inner] - known.position[outer]
            active[around] = (new.position[around] - place) @ inwards >= 0
    return active
