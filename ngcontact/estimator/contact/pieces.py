"""Parts of segments that face, and what they leave."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...arrays import Index, Mask
from ...contact import MATCHED, ContactLine, Pieces, divided, end_to_end
from ...fem import BoundaryTrace
from ..terms import Parts
from .facing import directions, opposite

SLIVER = 1e-9  # share of a segment below which a part of it is none


def pieces_of(boundary: BoundaryTrace, line: ContactLine, carrying: Mask) -> tuple[Pieces, int]:
    """Parts of the secondary that face one segment of the primary each, or the obstacle.

    On segments that wholly face, and on those `carrying` (k,) contact points, of any pair. So many
    of them, the first ones, are whole segments whose ends face the ends of one.
    """
    if line.contact.primary is None:
        whole, facing = np.flatnonzero(line.faces), np.full(len(line.segments), -1)
    else:
        facing = _whole_segments(boundary, line, carrying)
        whole = np.flatnonzero(facing >= 0)
    ends = np.zeros(len(whole)), np.ones(len(whole))
    pieces = Pieces(whole, *ends, facing[whole], np.full(len(whole), 0.5))
    rest = np.flatnonzero((facing < 0) & (line.faces | carrying))
    if line.contact.primary is None or len(rest) == 0:
        return pieces, len(whole)
    parts = _parts(boundary, line, rest)
    both = Pieces(
        np.concatenate([pieces.local, rest[parts.local]]),
        np.concatenate([pieces.start, parts.start]),
        np.concatenate([pieces.stop, parts.stop]),
        np.concatenate([pieces.facing, parts.facing]),
        np.concatenate([pieces.opposite, parts.opposite]),
    )
    return both, len(whole)


def _whole_segments(boundary: BoundaryTrace, line: ContactLine, carrying: Mask) -> Index:
    """Segment of the primary whose ends the ends of each segment (k,) face, -1 where none.

    Ends without a point, as on Gamma_u, face the ends at the same place; they are looked at on
    segments `carrying` (k,) others.
    """
    faces = line.partner >= 0
    local, end = np.nonzero((line.rows[:, [0, -1]] < 0) & carrying[:, None])
    if len(local):
        segment = line.segments[local]
        x = boundary.curve[segment, -end]
        ends = boundary.curve[line.facing][:, [0, -1]].reshape(-1, 2)
        apart = np.linalg.norm(x[:, None] - ends, axis=2)
        nearest = apart.argmin(axis=1)
        rows = line.rows.copy()
        rows[local, -end] = len(faces) + np.arange(len(local))
        faces = np.append(faces, apart.min(axis=1) <= MATCHED * boundary.lengths(segment))
        partner = np.append(line.partner, line.facing[nearest // 2])
        partner_s = np.append(line.partner_s, nearest % 2)
        line = replace(line, rows=rows, partner=partner, partner_s=partner_s)
    return end_to_end(boundary, line, faces)


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


def covered_parts(boundary: BoundaryTrace, line: ContactLine, pieces: Pieces, whole: int) -> Parts:
    """Parts of both bodies' boundaries that face each other, two of every piece.

    The first `whole` ones are segments whose ends face the ends of another.
    """
    segment = line.segments[pieces.local]
    own = Parts(segment, pieces.start, pieces.stop)
    if line.contact.primary is None:
        return own
    low, high = np.zeros(len(segment)), np.ones(len(segment))
    rest = slice(whole, None)
    if whole < len(segment):
        s = np.concatenate([pieces.start[rest], pieces.stop[rest]])
        local, facing = np.tile(pieces.local[rest], 2), np.tile(pieces.facing[rest], 2)
        near = np.tile(pieces.opposite[rest], 2)
        d, _ = directions(boundary, line, local, s)
        t = opposite(boundary, boundary.point(line.segments[local], s), d, facing, near)
        inside = (s > 0) & (s < 1)  # where a vertex of the primary is passed
        ends = np.where(inside, np.round(t), t).reshape(2, -1)
        low[rest], high[rest] = np.sort(ends, axis=0)
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
