"""How vertices of secondaries move where nodes do not face nodes.

A vertex takes the displacement that is asked for along the directions of all lines that meet there,
and none along those in which supports or other lines hold it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ....problem import Triangulation
from ..data import Discrete, EdgeConditions
from ..pressures import SLIVER
from .gaps import Opened

ALIKE = 1e-5  # turn between directions at a vertex below which they are one
TURNS = 1e-12  # ... along a segment
ROUND_OFF = 1e-5  # of a displacement, relative to what is more than round-off


@dataclass(frozen=True, eq=False)
class Side:
    """The k pieces of one line.

    Attributes
    ----------
    gap : Opened
        Their gaps.
    edge : ndarray of int (k,)
        Edges of their segments, see `Partition.edge_of_segment`.
    corners : ndarray of int (k, 2)
        Vertices of the mesh between which the segments run, as these edges do.
    ends : ndarray (k, 2)
        Parameters there of their starts and stops.
    vertex : ndarray of int (k, 2)
        Vertices there, -1 where none is.
    asked : ndarray (k, 2)
        r at both ends.
    directions : ndarray (k, d + 1, 2)
        d at the places of the gap.
    """

    gap: Opened
    edge: Index
    corners: Index
    ends: Array
    vertex: Index
    asked: Array
    directions: Array

    @property
    def toward(self) -> Array:
        """Directions (k, 2, 2) at both ends."""
        return self.directions[:, [0, -1]]

    @property
    def turns(self) -> Mask:
        """Pieces (k,) along which d turns."""
        return np.asarray(np.ptp(self.directions, axis=1).max(axis=1, initial=0.0) > TURNS)


def side_of(gap: Opened, boundary: BoundaryTrace, discrete: Discrete) -> Side:
    """Where the pieces of a gap lie on the segments of the mesh."""
    pieces, partition = gap.pieces, discrete.partition
    k = len(pieces.local)
    edge = partition.edge_of_segment[pieces.segment]
    corners = np.sort(boundary.nodes[pieces.segment][:, [0, -1]], axis=1)
    ends = np.column_stack([pieces.start, pieces.stop])
    ends = np.where(partition.along[edge][:, None], ends, 1 - ends)
    at = np.abs(ends[:, :, None] - [0.0, 1.0]) <= SLIVER
    vertex = np.where(at.any(axis=2), corners[np.arange(k)[:, None], at.argmax(axis=2)], -1)
    _, asked, _ = gap.lifted(np.arange(k), np.tile([0.0, 1.0], (k, 1)))
    return Side(gap, edge, corners, ends, vertex, asked, gap.points.direction.reshape(k, -1, 2))


def vertex_moves(
    sides: Sequence[Side],
    boundary: BoundaryTrace,
    conditions: EdgeConditions,
    discrete: Discrete,
    largest: float,
) -> Array:
    """Displacements (nv, 2) of the vertices, the least that lines and supports ask for."""
    asked, held = [], [_held_by_supports(conditions, discrete)]
    for side in sides:
        mine = side.vertex >= 0
        if side.gap.pieces.whole:
            held.append((side.vertex[mine], side.toward[mine]))
        else:
            asked.append((side.vertex[mine], side.toward[mine], side.asked[mine]))
        if side.gap.pieces.line.contact.primary is not None:
            nodes = boundary.nodes[side.gap.pieces.facing][:, [0, -1]]
            held += [(nodes[:, end], side.toward[:, end]) for end in (0, 1)]
            held += [(nodes[:, end], side.toward[:, 1 - end]) for end in (0, 1)]
    vertex, d, r = (np.concatenate(part) for part in zip(*asked, strict=True))
    where, along = (np.concatenate(part) for part in zip(*held, strict=True))
    on = np.isin(where, vertex)
    vertex, d = np.concatenate([vertex, where[on]]), np.concatenate([d, along[on]])
    r = np.append(r, np.zeros(np.count_nonzero(on)))
    far, move = _beyond(sides, boundary)
    free = ~np.isin(far, np.concatenate([vertex, where]))
    far, move = far[free], move[free]
    vertex = np.concatenate([vertex, far, far])
    d = np.concatenate([d, np.tile([1.0, 0.0], (len(far), 1)), np.tile([0.0, 1.0], (len(far), 1))])
    r = np.concatenate([r, move[:, 0], move[:, 1]])
    size = len(Triangulation(boundary.mesh).vertices)
    M, b = np.zeros((size, 2, 2)), np.zeros((size, 2))
    np.add.at(M, vertex, d[:, :, None] * d[:, None, :])
    np.add.at(b, vertex, d * r[:, None])
    v = np.einsum("kij,kj->ki", np.linalg.pinv(M, rcond=ALIKE**2, hermitian=True), b)
    v[np.abs(v) <= ROUND_OFF * largest] = 0.0
    off = np.abs((d * v[vertex]).sum(axis=1) - r)
    guides = discrete.partition.ends[discrete.curves.edge[discrete.curves.guided]].ravel()
    turning = np.concatenate([guides, *(_turning(side, boundary) for side in sides)])
    if (off > largest).any() or np.abs(v[turning]).max(initial=0.0) > largest:
        pairs = [s.gap.pieces.line.contact for s in sides if not s.gap.pieces.whole]
        nodal = [pair for pair in pairs if pair.rows == "nodal"]
        names = sorted({f'"{pair.secondary}"' for pair in nodal or pairs})
        raise ValueError(
            'no guaranteed bound is known for rows="nodal" where nodes do not face nodes, as on '
            f'{" or ".join(names)}; use rows="auto", or error_estimate'
            if nodal
            else "no guaranteed bound is known where supports or lines hold a vertex of a contact "
            f"line whose nodes do not face nodes, as at an end of {' or '.join(names)}; "
            "use error_estimate"
        )
    return np.asarray(v)


def _held_by_supports(conditions: EdgeConditions, discrete: Discrete) -> tuple[Index, Array]:
    """Vertices (k,) of supports, and directions (k, 2) along which they do not move."""
    e = len(conditions.frames)
    given = ~conditions.constrained.reshape(e, 2, -1)[:, :, 0]
    given[discrete.curves.edge[discrete.curves.guided]] = False  # there nothing may move
    edge, component = np.nonzero(given)
    vertex = discrete.partition.ends[edge]
    return vertex.ravel(), np.repeat(conditions.frames[edge, component], 2, axis=0)


def _turning(side: Side, boundary: BoundaryTrace) -> Index:
    """Vertices (k,) beside which d turns and nothing may move: facing ones, of `whole` pieces."""
    pieces, turns = side.gap.pieces, side.turns
    found = [side.vertex[turns].ravel()] if pieces.whole else []
    if pieces.line.contact.primary is not None:
        found.append(boundary.nodes[pieces.facing[turns]][:, [0, -1]].ravel())
    every = np.concatenate([np.zeros(0, dtype=np.intp), *found])
    return np.asarray(every[every >= 0], dtype=np.intp)


def _beyond(sides: Sequence[Side], boundary: BoundaryTrace) -> tuple[Index, Array]:
    """Vertices (k,) beyond the places where segments cease to face, and r d (k, 2) there."""
    found: list[Index] = [np.zeros(0, dtype=np.intp)]
    moves: list[Array] = [np.zeros((0, 2))]
    for side in sides:
        pieces = side.gap.pieces
        one = pieces.local[1:] == pieces.local[:-1]
        joined = one & (pieces.start[1:] - pieces.stop[:-1] <= SLIVER)
        for end, s, joins in (
            (0, pieces.start, np.append(False, joined)),
            (1, pieces.stop, np.append(joined, False)),
        ):
            at = np.flatnonzero((s > SLIVER) & (s < 1 - SLIVER) & ~joins)
            found.append(boundary.nodes[pieces.segment[at], -end])
            moves.append(side.asked[at, end, None] * side.toward[at, end])
    far, first = np.unique(np.concatenate(found), return_index=True)
    return far, np.concatenate(moves)[first]
