"""Parts of a contact line that face one segment of the other body each."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index, Mask
from ....contact import ContactLine, partners
from ....contact.projection import at as at_curve
from ....contact.projection import crossings, feet
from ....fem import BoundaryTrace
from ....problem import Contact

SLIVER = 1e-9  # share of a segment below which a piece of it is none
NARROW = 0.02  # share of a segment below which no part of it is cut off
STRAIGHT_ON = 0.1  # turn up to which a boundary runs straight on beyond the end of a line
TOUCHING = 4 * np.finfo(float).eps  # round-off of a measured gap, relative to the coordinates


def contact_directions(
    contact: Contact, boundary: BoundaryTrace, segment: Index, s: Array
) -> Array:
    """Unit vectors d (k, 2) at `s` (k,) of segments `segment` (k,): exact normals, or xi."""
    if contact.direction is None:
        return boundary.exact_normal(segment, s)
    return np.tile(contact.direction, (len(s), 1))


@dataclass(frozen=True, eq=False)
class Pieces:
    """Parts of segments of the secondary that face the other body, r of them.

    Attributes
    ----------
    line : ContactLine
        The pair.
    local : ndarray of int (r,)
        Segment, counted in the line.
    start, stop : ndarray (r,)
        Its interval of the parameter.
    facing : ndarray of int (r,)
        Segment of the boundary that it faces, -1 for an obstacle.
    """

    line: ContactLine
    local: Index
    start: Array
    stop: Array
    facing: Index

    @property
    def segment(self) -> Index:
        """Segments (r,) of the boundary."""
        return np.asarray(self.line.segments[self.local])

    @property
    def whole(self) -> bool:
        """Whether each is a segment, and so is what it faces."""
        return not self.line.means.any()

    def places(self, t: Array) -> Array:
        """Parameters (r, q) on the segments at parameters `t` (q,), or (r, q), on the pieces."""
        return np.asarray(self.start[:, None] + (self.stop - self.start)[:, None] * t)

    def opposite(self, boundary: BoundaryTrace, s: Array) -> tuple[Array, Array]:
        """Parameters (r, q) on the facing segments at `s` (r, q), and distances (r, q) along d."""
        q = s.shape[1]
        segment, flat = np.repeat(self.segment, q), s.ravel()
        facing = np.repeat(self.facing, q)
        if self.line.contact.primary is None:
            return np.zeros_like(s), np.zeros_like(s)
        x = boundary.point(segment, flat)
        d = contact_directions(self.line.contact, boundary, segment, flat)
        across = np.column_stack([-d[:, 1], d[:, 0]])
        there = crossings(x, across, boundary.curve, facing, np.full(len(flat), 0.5))
        distance = ((at_curve(boundary.curve, facing, there) - x) * d).sum(axis=1)
        distance[np.abs(distance) <= TOUCHING * np.abs(x).max(initial=0.0)] = 0.0
        return there.reshape(s.shape), distance.reshape(s.shape)


def pieces_of(line: ContactLine, boundary: BoundaryTrace) -> Pieces:
    """The segments that face the other body, cut where they pass its vertices."""
    local = np.flatnonzero(line.faces)
    start, stop = np.zeros(len(local)), np.ones(len(local))
    if line.contact.primary is None or local.size == 0:
        return Pieces(line, local, start, stop, np.full(len(local), -1))
    if line.means.any():
        ends = boundary.nodes[line.facing][:, [0, -1]]
        _, first = np.unique(ends, return_index=True)
        x = boundary.curve[line.facing][:, [0, -1]].reshape(-1, 2)[first]
        xi = None if line.contact.direction is None else np.array(line.contact.direction)
        passing, s = feet(x, boundary.curve[line.segments[local]], xi)
        number = np.arange(len(local))
        owner = np.concatenate([passing, number, number])
        cut = np.concatenate([s, start, stop])
        order = np.lexsort((cut, owner))
        owner, cut = owner[order], cut[order]
        one: Mask = (owner[1:] == owner[:-1]) & (np.diff(cut) > SLIVER)
        local, start, stop = local[owner[:-1][one]], cut[:-1][one], cut[1:][one]
    middle, segment = (start + stop) / 2, line.segments[local]
    d = contact_directions(line.contact, boundary, segment, middle)
    met, *_ = partners(boundary, line.facing, segment, boundary.point(segment, middle), d)
    return Pieces(line, local, start, stop, met)


def facing_cuts(
    every_pieces: Sequence[Pieces], boundary: BoundaryTrace, whole: Index, bent: Index
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
    for pieces in every_pieces:
        uneven += _where_one_ends(pieces, boundary)
        segments = pieces.line.segments[pieces.line.faces]
        uneven += segments[straight_ends(boundary, segments).any(axis=1)].tolist()
        uneven += pieces.facing[np.isin(pieces.segment, bent) & (pieces.facing >= 0)].tolist()
        if pieces.whole:
            continue
        ends, _ = pieces.opposite(boundary, pieces.places(np.array([0.0, 1.0])))
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


def _where_one_ends(pieces: Pieces, boundary: BoundaryTrace) -> list[int]:
    """Facing segments on which the secondary ends, where the primary goes on."""
    line = pieces.line
    if line.contact.primary is None or pieces.local.size == 0:
        return []
    nodes = boundary.nodes[line.segments][:, [0, -1]]
    vertices, count = np.unique(nodes[line.faces], return_counts=True)
    number = nodes[pieces.local]
    last = np.isin(number, vertices[count == 1])
    last &= np.column_stack([pieces.start == 0, pieces.stop == 1])
    row, side = np.nonzero(last)
    s, _ = pieces.opposite(boundary, pieces.places(np.array([0.0, 1.0])))
    facing, s = pieces.facing[row], s[row, side]
    ends = boundary.nodes[line.facing][:, [0, -1]]
    vertices, count = np.unique(ends, return_counts=True)
    nearest = np.where(s < 0.5, boundary.nodes[facing, 0], boundary.nodes[facing, -1])
    inside = (s > SLIVER) & (s < 1 - SLIVER)
    return [int(n) for n in facing[inside | np.isin(nearest, vertices[count == 2])]]
