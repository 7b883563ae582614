"""Parts of a contact line that face one segment of the other body each."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index
from ....contact import ContactLine, crossings, divided, partners
from ....contact import at as at_curve
from ....fem import BoundaryTrace
from ....problem import Contact

SLIVER = 1e-9  # share of a segment below which a piece of it is none
END_TO_END = 1e-7  # of a segment, up to which its ends face those of another but for round-off
NARROW = 0.02  # share of a segment below which no part of it is cut off
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
    whole : bool
        Whether each is a segment, or a part of one, and so is what it faces, node to node.
    """

    line: ContactLine
    local: Index
    start: Array
    stop: Array
    facing: Index
    whole: bool

    @property
    def segment(self) -> Index:
        """Segments (r,) of the boundary."""
        return np.asarray(self.line.segments[self.local])

    def only(self, at: Index) -> Pieces:
        """Those `at` (q,) of them."""
        start, stop = self.start[at], self.stop[at]
        return Pieces(self.line, self.local[at], start, stop, self.facing[at], self.whole)

    def divided(self, at: Index, places: Array) -> Pieces:
        """With those `at` (q,) in two parts at `places` (q,)."""
        stop = self.stop.copy()
        stop[at] = places
        local, facing = (np.append(x, x[at]) for x in (self.local, self.facing))
        start, stop = np.append(self.start, places), np.append(stop, self.stop[at])
        order = np.lexsort([start, local])
        local, start, stop, facing = local[order], start[order], stop[order], facing[order]
        return Pieces(self.line, local, start, stop, facing, self.whole)

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
    """The parts of segments that face the other body, cut where they pass its vertices."""
    local = np.flatnonzero(line.faces & ~line.means.any())
    pieces = _whole(line, boundary, local)
    if line.contact.primary is None:
        return pieces
    ends, _ = pieces.opposite(boundary, pieces.places(np.array([0.0, 1.0])))
    met = np.abs(np.sort(ends, axis=1) - [0.0, 1.0]).max(axis=1, initial=0.0) <= END_TO_END
    met &= pieces.facing >= 0
    rest = np.setdiff1d(np.arange(len(line.segments)), local[met])
    parts = divided(boundary, line.contact, line.segments[rest], line.facing)
    if parts.local.size == 0 and met.all():
        return pieces
    found = (
        np.concatenate([local[met], rest[parts.local]]),
        np.concatenate([pieces.start[met], parts.start]),
        np.concatenate([pieces.stop[met], parts.stop]),
        np.concatenate([pieces.facing[met], parts.facing]),
    )
    order = np.lexsort(found[1::-1])
    local, start, stop, facing = (values[order] for values in found)
    return Pieces(line, local, start, stop, facing, whole=False)


def _whole(line: ContactLine, boundary: BoundaryTrace, local: Index) -> Pieces:
    """Segments `local` (k,) of a line as one piece each."""
    k = len(local)
    met = np.full(k, -1)
    if line.contact.primary is not None and k:
        middle, segment = np.full(k, 0.5), line.segments[local]
        d = contact_directions(line.contact, boundary, segment, middle)
        met, *_ = partners(boundary, line.facing, segment, boundary.point(segment, middle), d)
    return Pieces(line, local, np.zeros(k), np.ones(k), met, whole=True)
