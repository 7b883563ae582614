"""First active sets: from the gaps, or from a solution on another mesh."""

from __future__ import annotations

import numpy as np
from scipy.spatial import cKDTree

from ..arrays import Mask
from ..contact import transitions_on
from ..qp import Iterate
from .discrete_problem import DiscreteProblem

SEPARATION = 1e-6  # of the directions at a corner, relative to the zone
TOUCHING = 1e-12  # gap, relative to the zone, up to which points start active


def first_active_set(discrete: DiscreteProblem) -> Mask:
    """Cold start: the points that touch before the load.

    Bodies that contact alone can hold are first placed, rigid, where the load presses them.
    """
    p = discrete.program
    gap, carries = p.g, np.zeros(len(p.g), dtype=bool)
    if (rigid := discrete.rigid) is not None:
        gap, carries = gap - rigid.rows @ rigid.placing, rigid.carries
    start, active = 0, [np.zeros(0, dtype=bool)]
    for line in discrete.lines:
        distance = gap[start : start + len(line.node)]
        start += len(line.node)
        size = np.ptp(line.position, axis=0).max(initial=0.0)
        active.append(distance <= TOUCHING * size)
    return np.concatenate(active) | carries


def carried_active_set(
    discrete: DiscreteProblem, previous: DiscreteProblem, state: Iterate
) -> Mask:
    """Warm start: the state of the nearest contact point of the same pair on another mesh.

    At orders above 1 the points around a transition are told by the side of it they lie on: it is
    located more closely than the nodes of either mesh.
    """
    slack = previous.program.g - state.u[previous.program.unknown]
    start, carried = 0, [np.zeros(0, dtype=bool)]
    for new, old in zip(discrete.lines, previous.lines, strict=True):
        at = slice(start, start + len(old.node))
        start = at.stop
        if len(old.node) == 0 or len(new.node) == 0:
            carried.append(np.zeros(len(new.node), dtype=bool))
            continue
        # Two points at a corner are told apart by their directions.
        size = SEPARATION * np.ptp(old.position, axis=0).max(initial=0.0)
        tree = cKDTree(np.column_stack([old.position, size * old.direction]))
        places = np.column_stack([new.position, size * new.direction])
        distance, near = tree.query(places, k=[1, min(2, len(old.node))])
        away, nearest = distance[:, 0], near[:, 0]
        # A new point in the middle of two: active if one of them is, whatever round-off says.
        tied = distance[:, 1] <= (1 + 1e-6) * away
        active = state.active[at][nearest] | (tied & state.active[at][near[:, 1]])
        if previous.space.trace.order > 1 and away.max() > size:  # not the same points
            ends = transitions_on(old, slack[at], state.active[at])
            for inner, outer, place in zip(ends.inner, ends.outer, ends.position, strict=True):
                around = (nearest == inner) | (nearest == outer)
                inwards = old.position[inner] - old.position[outer]
                active[around] = (new.position[around] - place) @ inwards >= 0
        carried.append(active)
    return np.concatenate(carried)
