"""Lines of contact points in order, and the zones in contact on them."""

from __future__ import annotations

import numpy as np
from scipy.sparse.csgraph import connected_components, dijkstra

from ...arrays import Array, Index
from ...solved import Solved
from ..nodes import neighbour_tree


def contact_lines(solution: Solved) -> list[tuple[int, Index, Array]]:
    """Contact points in order along their lines: (pair, rows, coordinate) for every line.

    Of the k points of each line `rows` (k,) index ``solution.points``, and the coordinate (k,) is a
    length: eta, across the fixed direction xi (P2), or without one (P1) the arc position, a sum of
    chords. Both rise with the coordinate of which more changes along the line, whichever body is
    the secondary. A pair whose points lie on separate pieces of boundary gives several lines, one
    behind the other.
    """
    lines = []
    for pair in np.unique(solution.pair).tolist():
        rows = np.flatnonzero(solution.pair == pair)
        points = solution.points[rows]
        direction = solution.problem.contact[pair].direction
        if direction is None:
            lines += [(pair, rows[order], s) for order, s in _arcs(points)]
        else:
            dx, dy = np.asarray(direction, dtype=float) / np.hypot(*direction)
            across = np.array([-dy, dx])
            eta = points @ (_rising(across) * across)
            order = np.argsort(eta, kind="stable")
            lines.append((pair, rows[order], eta[order]))
    return lines


def _rising(along: Array) -> float:
    """Sign that makes the larger component of `along` (2,) positive."""
    return -1.0 if along[np.argmax(np.abs(along))] < 0 else 1.0


def _arcs(points: Array) -> list[tuple[Index, Array]]:
    """Order and arc position of points on curves: walks along the tree of neighbours."""
    tree = neighbour_tree(points)
    count, piece = connected_components(tree, directed=False)
    arcs: list[tuple[Index, Array]] = []
    start = 0.0
    for k in range(count):
        members = np.flatnonzero(piece == k)
        s = dijkstra(tree, directed=False, indices=members[0])[members]
        s = dijkstra(tree, directed=False, indices=members[np.argmax(s)])[members]
        first, last = points[members[np.argmin(s)]], points[members[np.argmax(s)]]
        s = start + (s.max() - s if _rising(last - first) < 0 else s)
        order = np.argsort(s, kind="stable")
        arcs.append((members[order], s[order]))
        start = s.max()
    return arcs


def zones_of(solution: Solved) -> list[Index]:
    """Contact points (c,) of each zone in contact, the zone of the largest force first.

    A zone is a run of neighbouring points in contact on one line.
    """
    zones = []
    for _, rows, _ in contact_lines(solution):
        active = solution.active[rows]
        run = np.cumsum(np.diff(active, prepend=False))  # odd in contact, even where open
        zones += [rows[run == k] for k in range(1, run[-1] + 1, 2)]
    return sorted(zones, key=lambda zone: -float(np.abs(solution.force[zone]).sum()))
