"""Where contact ends inside of segments: there p* ends, and the triangles beside are cut."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....arrays import Array, Index
from ....contact import ContactState
from ....fem import BoundaryTrace
from .pieces import NARROW, Pieces

BESIDE = 0.1  # share of a segment up to which contact that ends there ends at its end
SAFE = 0.05  # ... by which p* ends beyond: where it falls short of contact B is much larger
OFF = 1e-6  # of a segment, distance up to which a place lies on it


def contact_ends(
    pairs: Sequence[ContactState],
    every_pieces: Sequence[Pieces],
    boundary: BoundaryTrace,
    uncut: Index,
    ending: bool,
) -> list[Array]:
    """Where contact is on the j segments of each line: parts (j, 2) of them, 0 to 1 but at ends.

    On segments that can be cut there, as can those that they face, and are not `uncut` (k,). A
    place next to an end of a piece is that, and is none at an end of a segment. Stresses of order 1
    are too poor for p* to gain. None is sought unless contact may be `ending`.
    """
    found = []
    for pair, pieces in zip(pairs, every_pieces, strict=True):
        line = pair.line
        spans = np.tile([0.0, 1.0], (len(line.segments), 1))
        found.append(spans)
        # Means over open and closed parts do not tell where contact ends that fills no segment.
        filled = (pair.active[line.rows] & (line.rows >= 0)).all(axis=1).any()
        if (
            not ending
            or boundary.order == 1
            or line.contact.bilateral
            or (line.means.any() and not filled)
        ):
            continue
        others = [other for other in every_pieces if other is not pieces]
        fixed = [np.concatenate([other.line.segments, other.line.facing]) for other in others]
        fixed += [uncut, np.intersect1d(line.segments, line.facing)]
        _place(spans, pair, pieces, boundary, np.concatenate(fixed))
        spans[spans[:, 1] - spans[:, 0] < NARROW] = 0.0, 1.0
    return found


def _place(
    spans: Array, pair: ContactState, pieces: Pieces, boundary: BoundaryTrace, fixed: Index
) -> None:
    """Set the ends of contact of one pair in `spans` (j, 2), none on segments `fixed` (k,)."""
    line, ends = pair.line, pair.transitions
    at = np.flatnonzero(~np.isin(line.segments, fixed))
    if at.size == 0:
        return
    start, side = (boundary.point(line.segments[at], np.full(len(at), s)) for s in (0.0, 1.0))
    side = side - start
    length = np.linalg.norm(side, axis=1)
    away = line.position[ends.outer] - line.position[ends.inner]
    for x, outwards in zip(ends.position, away, strict=True):
        s = ((x - start) * side).sum(axis=1) / length**2
        off = np.linalg.norm(x - start - np.clip(s, 0.0, 1.0)[:, None] * side, axis=1)
        nearest = int((off / length).argmin())
        if off[nearest] > OFF * length[nearest]:
            continue
        end = int((outwards * side[nearest]).sum() > 0)
        z = float(s[nearest]) + (SAFE if end else -SAFE)
        place = _between(pieces, int(at[nearest]), z, boundary, fixed)
        if place is not None:
            spans[at[nearest], end] = place


def _between(
    pieces: Pieces, local: int, z: float, boundary: BoundaryTrace, fixed: Index
) -> float | None:
    """The place `z` of a segment, or an end of its piece next to it; None if it must not be cut."""
    here = np.flatnonzero((pieces.local == local) & (pieces.start < z) & (pieces.stop > z))
    if here.size == 0 or np.isin(pieces.facing[here], fixed).any():
        return None
    piece, near = pieces.only(here[:1]), NARROW
    start, stop = float(piece.start[0]), float(piece.stop[0])
    if pieces.line.contact.primary is not None:
        there, _ = piece.opposite(boundary, np.array([[start, stop]]))
        near *= max(1.0, (stop - start) / float(np.ptp(there)))
    if z - start < near:
        z = start
    elif stop - z < near:
        z = stop
    return z if BESIDE < z < 1 - BESIDE else None


def split(pieces: Pieces, spans: Array) -> Pieces:
    """Pieces with those divided in which contact ends, by parts `spans` (j, 2) of the segments."""
    for z in spans[pieces.local].T if pieces.local.size else ():
        cut = np.flatnonzero((pieces.start < z) & (z < pieces.stop))
        if cut.size:
            return split(pieces.divided(cut, z[cut]), spans)
    return pieces
