"""Where triangles are cut, or divided, since p* ends or vertices of the other body pass there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from .pieces import NARROW, SLIVER, Pieces
from .reach import Reach

STRAIGHT_ON = 0.1  # turn up to which a boundary runs straight on beyond the end of a line


def facing_cuts(
    every_pieces: Sequence[Pieces],
    reaches: Sequence[Reach],
    boundary: BoundaryTrace,
    whole: Index,
    bent: Index,
) -> tuple[dict[int, Array], Index]:
    """Where vertices of secondaries lie on the segments that they face.

    `whole` (j,) are segments that must not be cut, `bent` (j,) those that are curved.

    Returns
    -------
    cuts : dict of ndarray (j,)
        Parameters by segment.
    uneven : ndarray of int (k,)
        Segments on which such a place is left, so that polynomials on one side are none on the
        other, or on which p* may jump, since one line ends there and the other does not, or its own
        boundary runs straight on, or which are straight and face a curve.
    """
    cuts: dict[int, Array] = {}
    uneven: list[int] = []
    for pieces, reach in zip(every_pieces, reaches, strict=True):
        uneven += _where_one_ends(pieces, reach, boundary)
        segments = pieces.line.segments[reach.acts]
        uneven += segments[straight_ends(boundary, segments).any(axis=1)].tolist()
        uneven += pieces.facing[np.isin(pieces.segment, bent) & (pieces.facing >= 0)].tolist()
        if pieces.line.contact.primary is None:
            continue
        ends, _ = pieces.opposite(boundary, pieces.places(np.array([0.0, 1.0])))
        if pieces.whole:
            ends = np.where(np.column_stack([pieces.start > 0, pieces.stop < 1]), ends, 0.0)
        segment, places = np.repeat(pieces.facing, 2), np.clip(ends.ravel(), 0.0, 1.0)
        for number in np.unique(segment).tolist():
            s = np.sort(np.append(cuts.get(number, []), places[segment == number]))
            inside = s[(s > SLIVER) & (s < 1 - SLIVER)]
            wide = inside[(inside > NARROW) & (inside < 1 - NARROW)]
            kept = wide[np.diff(wide, prepend=-1.0) > NARROW]
            apart = np.abs(inside[:, None] - np.concatenate([kept, [-1.0]])).min(axis=1)
            if number in whole:
                kept = kept[:0]
            if (apart > SLIVER).any() or (number in whole and inside.size):
                uneven.append(number)
            if kept.size:
                cuts[number] = kept
    return cuts, np.array(uneven, dtype=np.intp)


def straight_ends(boundary: BoundaryTrace, segments: Index) -> Mask:
    """Ends (k, 2) of `segments` (k,), of one line, at which it ends but its boundary runs on."""
    nodes = boundary.nodes[segments][:, [0, -1]]
    vertices, count = np.unique(nodes, return_counts=True)
    found = np.isin(nodes, vertices[count == 1])
    others = np.setdiff1d(np.flatnonzero(~boundary.inner), segments)
    ends = boundary.nodes[others][:, [0, -1]]
    for row, side in zip(*np.nonzero(found), strict=True):
        at, which = np.nonzero(ends == nodes[row, side])
        places = np.concatenate([[side], which]).astype(float)
        normal = boundary.normal(np.append(segments[row], others[at]), places)
        found[row, side] = (normal[1:] @ normal[0] > 1 - STRAIGHT_ON**2 / 2).any()
    return found


def _where_one_ends(pieces: Pieces, reach: Reach, boundary: BoundaryTrace) -> list[int]:
    """Facing segments on which p* ends, where the primary, or its boundary, goes on."""
    line, acts = pieces.line, reach.acts
    if line.contact.primary is None or not acts.any():
        return []
    nodes = boundary.nodes[line.segments][:, [0, -1]]
    vertices, count = np.unique(nodes[acts], return_counts=True)
    number = nodes[pieces.local]
    last = np.isin(number, vertices[count == 1])
    last &= np.column_stack([pieces.start == 0, pieces.stop == 1])
    off = np.column_stack([pieces.start, pieces.stop])
    off -= np.column_stack([reach.start, reach.stop])[pieces.local]
    last |= (np.abs(off) <= SLIVER) & (reach.inner & ~reach.closes)[pieces.local]
    row, side = np.nonzero(last & acts[pieces.local, None])
    s, _ = pieces.opposite(boundary, pieces.places(np.array([0.0, 1.0])))
    facing, s = pieces.facing[row], s[row, side]
    ends = boundary.nodes[line.facing][:, [0, -1]]
    vertices, count = np.unique(ends, return_counts=True)
    nearest = np.where(s < 0.5, boundary.nodes[facing, 0], boundary.nodes[facing, -1])
    goes_on = np.isin(nearest, vertices[count == 2])
    goes_on |= np.isin(nearest, ends[straight_ends(boundary, line.facing)])
    inside = (s > SLIVER) & (s < 1 - SLIVER)
    return [int(n) for n in facing[inside | goes_on]]
