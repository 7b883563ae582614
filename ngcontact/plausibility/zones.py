"""Zones in contact: connected parts of a contact line, their forces and lengths."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index
from ..contact import ContactLine, ContactState, in_contact, twins


@dataclass(frozen=True, eq=False)
class Zones:
    """The k connected zones of one pair in which its bodies touch.

    Attributes
    ----------
    number : ndarray of int (m,)
        Zone of each contact point, -1 where the gap is open.
    force, weight : ndarray (k,)
        Sums over the points of each zone: a force per unit thickness, a length.
    segments : ndarray (k,)
        Length in segments: half of the interval between two nodes in which it ends counts.
    ends : ndarray of int (k,)
        Transitions to open points.
    """

    number: Index
    force: Array
    weight: Array
    segments: Array
    ends: Index


def links(line: ContactLine) -> tuple[Index, Index]:
    """Pairs of neighbouring points: (l, 2) on one segment, (t, 2) on both sides of a corner."""
    one, other = line.rows[:, :-1].ravel(), line.rows[:, 1:].ravel()
    both = np.flatnonzero((one >= 0) & (other >= 0))
    return np.array([one[both], other[both]]).T, twins(line)


def connected(count: int, pairs: Index) -> Index:
    """Least number (n,), of a `count` n, to which each is joined by `pairs` (k, 2)."""
    number = np.arange(count)
    while True:
        one, other = number[pairs.T]
        if (one == other).all():
            return number
        low = np.minimum(one, other)
        np.minimum.at(number, one, low)
        np.minimum.at(number, other, low)
        while ((further := number[number]) != number).any():
            number = further


def zones_of(state: ContactState) -> Zones:
    """The zones of one pair."""
    line = state.line
    along, across = links(line)
    closed = in_contact(line, state.active) if len(across) else state.active
    both = np.concatenate([along, across])
    touching = closed[both].sum(axis=1)
    number = connected(len(closed), both[touching == 2])
    first = closed & (number == np.arange(len(closed)))
    k = np.count_nonzero(first)
    number = np.where(closed, (np.cumsum(first) - 1)[number], -1)

    def summed(points: Index, values: Array) -> Array:
        return np.asarray(np.bincount(number[points], values, minlength=k), dtype=float)

    def counted(points: Index) -> Index:
        return np.bincount(number[points], minlength=k)

    at = np.flatnonzero(closed)
    inside, ending = along[touching[: len(along)] == 2], both[touching == 1]
    ends = counted(ending[closed[ending]])
    return Zones(
        number=number,
        force=summed(at, state.force[at]),
        weight=summed(at, line.weight[at]),
        segments=(counted(inside[:, 0]) + ends / 2) / (line.rows.shape[1] - 1),
        ends=ends,
    )
