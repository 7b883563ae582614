"""Where a gap is closed on segments in which contact ends."""

from __future__ import annotations

import numpy as np

from ....arrays import Array, Index
from ..pressures import Pieces, Zone
from .edges import at_points

GRID = 65  # places on a piece between which a gap has one zero
HALVINGS = 50


def closed_beside(
    zone: Zone, pieces: Pieces, values: Array, nodes: Index, supported: Index
) -> Array:
    """Intervals (k, 2) of k pieces on which the gap is closed, from 1 to 0 for none.

    Where contact ends inside of a segment, up to the last zero of the gap, with Legendre
    coefficients `values` (k, d + 1): there r = -gap has no kink, and p* need not meet the gap.
    At the other end it starts where it does beside, or at the first zero where supports or open
    segments are beside. `nodes` (j, 2) are the ends of the segments, `supported` (v,) vertices.
    """
    found, reach = np.tile([1.0, 0.0], (len(values), 1)), zone.reach
    t = np.linspace(0, 1, GRID)
    met = at_points(values, np.tile(t, (len(values), 1))) <= 0
    low, high = reach.start[pieces.local], reach.stop[pieces.local]
    met &= ((pieces.start >= low) & (pieces.stop <= high))[:, None]
    ending = np.zeros(len(nodes), dtype=bool)
    ending[pieces.local[met.any(axis=1)]] = True
    ending &= reach.closes.any(axis=1) & ~zone.full
    held = (zone.full | ending)[:, None] & ~reach.closes & ~np.isin(nodes, supported)
    vertices, count = np.unique(nodes[held], return_counts=True)
    held &= np.isin(nodes, vertices[count == 2])
    for local in np.flatnonzero(ending).tolist():
        rows = np.flatnonzero(
            (pieces.local == local) & (low <= pieces.start) & (pieces.stop <= high)
        )
        at = np.argwhere(met[rows])
        start, stop = (
            float(end * len(rows))
            if held[local, end]
            else at[-end, 0] + _zero(values[rows[at[-end, 0]]], t, int(at[-end, 1]), end)
            for end in (0, 1)
        )
        number = np.arange(len(rows))
        a, b = np.clip(start - number, 0.0, 1.0), np.clip(stop - number, 0.0, 1.0)
        found[rows[b > a]] = np.column_stack([a, b])[b > a]
    return found


def _zero(c: Array, t: Array, place: int, end: int) -> float:
    """The zero of a gap, of coefficients `c` (d + 1,), beside a place of `t` where it is <= 0."""
    beyond = place + (1 if end else -1)
    if not 0 <= beyond < len(t):
        return float(end)
    inner, outer = float(t[place]), float(t[beyond])
    for _ in range(HALVINGS):
        middle = (inner + outer) / 2
        if at_points(c[None], np.array([[middle]]))[0, 0] <= 0:
            inner = middle
        else:
            outer = middle
    return inner
