"""Parts of segments that face, and what they leave."""

from __future__ import annotations

import numpy as np

from ...arrays import Index, Mask
from ...contact import ContactLine, Pieces, divided, end_to_end
from ...fem import BoundaryTrace
from ..terms import Parts
from .facing import directions, opposite

SLIVER = 1e-9  # share of a segment below which a part of it is none


def pieces_of(boundary: BoundaryTrace, line: ContactLine, carrying: Mask) -> Pieces:
    """Parts of the secondary that face one segment of the primary each, or the obstacle.

    On segments that wholly face, and on those `carrying` (k,) contact points, of any pair.
    """
    if line.contact.primary is None:
        whole, facing = np.flatnonzero(line.faces), np.full(len(line.segments), -1)
    else:
        facing = end_to_end(boundary, line, np.ones(len(line.node), dtype=bool))
        whole = np.flatnonzero(facing >= 0)
    ends = np.zeros(len(whole)), np.ones(len(whole))
    pieces = Pieces(whole, *ends, facing[whole], np.full(len(whole), 0.5))
    rest = np.flatnonzero((facing < 0) & (line.faces | carrying))
    if line.contact.primary is None or len(rest) == 0:
        return pieces
    parts = _parts(boundary, line, rest)
    return Pieces(
        np.concatenate([pieces.local, rest[parts.local]]),
        np.concatenate([pieces.start, parts.start]),
        np.concatenate([pieces.stop, parts.stop]),
        np.concatenate([pieces.facing, parts.facing]),
        np.concatenate([pieces.opposite, parts.opposite]),
    )


def _parts(boundary: BoundaryTrace, line: ContactLine, rest: Index) -> Pieces:
    """Pieces of the segments `rest` (j,), by their numbers there.

    Looked for beside the partners of their points; elsewhere where those do not cover them.
    """
    points, segments = line.rows[rest], line.segments[rest]
    ends = boundary.nodes[line.facing][:, [0, -1]]
    met = boundary.nodes[line.partner[points[points >= 0]]][:, [0, -1]]
    near = line.facing[np.isin(ends, met).any(axis=1)]
    if len(near):
        parts = divided(boundary, line.contact, segments, near)
        covered = np.bincount(parts.local, parts.stop - parts.start, len(rest))
        if (covered > 1 - SLIVER).all():
            return parts
    return divided(boundary, line.contact, segments, line.facing)


def covered_parts(boundary: BoundaryTrace, line: ContactLine, pieces: Pieces) -> Parts:
    """Parts of both bodies' boundaries that face each other, two of every piece."""
    segment = line.segments[pieces.local]
    own = Parts(segment, pieces.start, pieces.stop)
    if line.contact.primary is None:
        return own
    ends = []
    for s in (pieces.start, pieces.stop):
        d, _ = directions(boundary, line, pieces.local, s)
        t = opposite(boundary, boundary.point(segment, s), d, pieces.facing, pieces.opposite)
        inside = (s > 0) & (s < 1)  # where a vertex of the primary is passed
        ends.append(np.where(inside, np.round(t), t))
    low, high = np.sort(ends, axis=0)
    return Parts(
        np.concatenate([segment, pieces.facing]),
        np.concatenate([pieces.start, low]),
        np.concatenate([pieces.stop, high]),
    )


def remaining(inner: Mask, covered: list[Parts]) -> Parts:
    """What `covered` leaves of all segments that are not `inner` (q,)."""
    segment, start, stop = (
        np.concatenate([getattr(parts, name) for parts in covered] or [np.zeros(0)])
        for name in ("segment", "start", "stop")
    )
    outer = np.flatnonzero(~inner)
    # Every segment as an interval [2 n, 2 n + 1] of one axis; an empty part at both of its ends.
    both = np.concatenate([segment, outer, outer]).astype(np.intp)
    start = 2 * both + np.concatenate([start, np.zeros(len(outer)), np.ones(len(outer))])
    stop = 2 * both + np.concatenate([stop, np.zeros(len(outer)), np.ones(len(outer))])
    order = np.lexsort((stop, start))
    reached = np.maximum.accumulate(stop[order])
    low, high, number = reached[:-1], start[order][1:], both[order]
    left = (number[1:] == number[:-1]) & (high - low > SLIVER)
    number = number[1:][left]
    return Parts(number, low[left] - 2 * number, high[left] - 2 * number)
