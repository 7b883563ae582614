"""Where on the segments of a contact line the pressure p* acts.

Where a segment faces the other body in part, p* is a polynomial on that part, and the triangle
beside it is cut at its end. Where next to nothing is bare p* falls to 0 there, with its slope,
without a cut; where a cut must not be, p* is 0 on the segment, and its neighbours carry more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index, Mask
from .pieces import NARROW, SLIVER, Pieces


@dataclass(frozen=True, eq=False)
class Reach:
    """Intervals of p* on the j segments of a line.

    Attributes
    ----------
    start, stop : ndarray (j,)
        Parameters of their ends, the same where p* is 0.
    falls : ndarray of bool (j, 2)
        Whether p* vanishes with its slope at start and stop.
    closes : ndarray of bool (j, 2)
        Whether contact ends there, and p* vanishes.
    """

    start: Array
    stop: Array
    falls: Mask
    closes: Mask

    @property
    def acts(self) -> Mask:
        """Segments (j,) with a p*."""
        return np.asarray(self.stop > self.start)

    def places(self, local: Index, s: Array) -> Array:
        """Parameters on the intervals at `s` (k,) or (k, q) of the segments `local` (k,)."""
        shape = (-1,) + (1,) * (s.ndim - 1)
        start, stop = self.start[local].reshape(shape), self.stop[local].reshape(shape)
        return np.asarray((s - start) / np.where(stop > start, stop - start, 1.0))

    @property
    def inner(self) -> Mask:
        """Ends (j, 2) inside segments."""
        return np.column_stack([self.start > 0, self.stop < 1]) & self.acts[:, None]


def reaches_of(
    every_pieces: Sequence[Pieces], every_spans: Sequence[Array], uncut: Index
) -> tuple[list[Reach], dict[int, Array]]:
    """The reach of p* on each pair, and where to cut segments for that.

    Contact is on the parts `every_spans` (j, 2) of the segments of each, see `contact_ends`; none
    of the segments `uncut` (k,) is cut elsewhere.

    Returns
    -------
    reaches : list of Reach
        Of all pairs.
    cuts : dict of ndarray (c,)
        Parameters by segment.
    """
    facing = [pieces.line.facing for pieces in every_pieces]
    uncut = np.concatenate([uncut, *facing]).astype(np.intp)
    cuts: dict[int, Array] = {}
    reaches = []
    for pieces, spans in zip(every_pieces, every_spans, strict=True):
        ends = _longest(pieces)
        falls = np.zeros(ends.shape, dtype=bool)
        bare = np.column_stack([ends[:, 0], 1 - ends[:, 1]])
        length = ends[:, 1] - ends[:, 0]
        for local in np.flatnonzero((bare > 0).any(axis=1) & (length > 0)).tolist():
            number = int(pieces.line.segments[local])
            wide = ends[local, bare[local] > NARROW]
            others = np.setdiff1d(cuts.get(number, np.zeros(0)), wide)
            apart = np.abs(wide[:, None] - others).min(initial=1.0) > NARROW
            free = number not in uncut and apart and not _crossed(every_pieces, number, wide)
            if length[local] <= NARROW or (wide.size and not free):
                ends[local] = 0.0
                continue
            falls[local] = (bare[local] > 0) & (bare[local] <= NARROW)
            if wide.size:
                cuts[number] = np.union1d(others, wide)
        closes = (spans != [0.0, 1.0]) & (spans > ends[:, :1]) & (spans < ends[:, 1:])
        for local, end in zip(*np.nonzero(closes), strict=True):
            number = int(pieces.line.segments[local])
            cuts[number] = np.union1d(cuts.get(number, np.zeros(0)), spans[local, end])
        ends = np.where(closes, spans, ends)
        reaches.append(Reach(ends[:, 0], ends[:, 1], falls & ~closes, closes))
    return reaches, cuts


def _longest(pieces: Pieces) -> Array:
    """The longest interval (j, 2) of each segment that faces without a break; 0, 0 for none."""
    ends = np.zeros((len(pieces.line.segments), 2))
    local, start, stop = pieces.local, pieces.start, pieces.stop
    if local.size == 0:
        return ends
    new = np.append(True, (local[1:] != local[:-1]) | (start[1:] - stop[:-1] > SLIVER))
    first, last = np.flatnonzero(new), np.append(np.flatnonzero(new)[1:], len(local)) - 1
    low, high = start[first], stop[last]
    order = np.argsort(high - low, kind="stable")
    ends[local[first][order]] = np.column_stack([low, high])[order]
    ends[ends <= SLIVER] = 0.0
    ends[ends >= 1 - SLIVER] = 1.0
    return ends


def _crossed(every_pieces: Sequence[Pieces], number: int, places: Array) -> bool:
    """Whether parts of a segment that face one segment have one of the `places` (q,) inside."""
    return any(
        ((start < places - SLIVER) & (stop > places + SLIVER)).any()
        for pieces in every_pieces
        for mine in [pieces.segment == number]
        for start, stop in [(pieces.start[mine, None], pieces.stop[mine, None])]
    )
