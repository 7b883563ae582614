"""Jumps of functions along segments, told from steep variation."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..arrays import Array, Index

PARTS = 32  # of a segment, at whose ends a function is looked at: of narrower bumps it sees none
QUARTERS = np.linspace(0, 1, 5)
STEPS = 18  # in which a part is quartered: what still changes across 1e-12 of a segment jumps
KEPT = 0.9  # share of a change that the last half of the steps leave of a jump; of x^(1/10), 0.3
STEADY = 1e-9  # change across a part, relative to the largest value, that is not looked into


def steps_on(values: Callable[[Index, Array], Array], segments: Index) -> tuple[Index, Array]:
    """Segments (j,) on which a function jumps, and parameters (j,) there; at ends, too.

    Of the quarters of each part in which it changes the one is kept whose change differs most from
    that of the others, again and again: a smooth change shrinks by that, that of a jump does not.

    Parameters
    ----------
    values : callable
        The function (k,) at parameters (k,) of segments (k,).
    segments : ndarray of int (n,)
        Which.
    """
    s = np.linspace(0, 1, PARTS + 1)
    found = values(np.repeat(segments, len(s)), np.tile(s, len(segments))).reshape(-1, len(s))
    largest = np.abs(found).max(initial=0.0)
    row, part = np.nonzero(np.abs(np.diff(found, axis=1)) > STEADY * largest)
    at, low, size = segments[row], s[part], 1 / PARTS
    change = before = np.abs(found[row, part + 1] - found[row, part])
    every = np.arange(len(at))
    for number in range(STEPS if at.size else 0):
        places = low[:, None] + size * QUARTERS
        steps = np.diff(values(np.repeat(at, 5), places.ravel()).reshape(-1, 5), axis=1)
        odd = np.abs(steps - np.median(steps, axis=1, keepdims=True)).argmax(axis=1)
        low, size, change = places[every, odd], size / 4, np.abs(steps[every, odd])
        if number == STEPS // 2:
            before = change
    jumps = (change >= KEPT * before) & (change > STEADY * largest)
    at, first_of = np.unique(at[jumps], return_index=True)
    return at, low[jumps][first_of]
