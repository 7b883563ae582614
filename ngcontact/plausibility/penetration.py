"""Bodies that pass through each other between contact points, which see nothing of it."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index
from ..contact import ContactState, partners, prescribed_gap
from ..fem import BoundaryTrace

PLACES = (np.arange(4) + 0.5) / 4  # on a segment; what lies between them is 1 / 16 of its sagitta
MOST = 32  # segments of a pair that are looked at
ROUND_OFF = 100 * np.finfo(float).eps  # of lengths and displacements


@dataclass(frozen=True, eq=False)
class Penetration:
    """Where bodies of one pair pass through each other most.

    Attributes
    ----------
    depth : float
        How deep, a length; 0 where they do not.
    slope : float
        Depth over the length of the segment: times a modulus a pressure that is not there.
    place : ndarray (2,)
        Where, on the secondary.
    """

    depth: float
    slope: float
    place: Array


def _suspected(state: ContactState) -> Index:
    """Numbers (j,) in `line.segments` between whose nodes the gap may be negative.

    Not where all nodes are in contact, and not where the gap is wide beside its change on the
    segment and its neighbours.
    """
    line, gap = state.line, np.maximum(state.gap, 0.0)
    if state.active.all():
        return line.segments[:0]
    whole = np.flatnonzero((line.rows >= 0).all(axis=1))
    rows = line.rows[whole]
    high = np.zeros(len(gap))
    np.maximum.at(high, rows, np.broadcast_to(gap[rows].max(axis=1)[:, None], rows.shape))
    least, most = gap[rows].min(axis=1), high[rows].max(axis=1)
    near = np.flatnonzero((2 * least < most) & ~state.active[rows].all(axis=1))
    return whole[near[np.argsort(least[near], kind="stable")[:MOST]]]


def penetration(
    trace: BoundaryTrace, displacement: ng.GridFunction, state: ContactState
) -> Penetration:
    """Largest penetration between the contact points of one pair, on the curves of the mesh."""
    line, local = state.line, _suspected(state)
    none = Penetration(0.0, 0.0, np.full(2, np.nan))
    if line.contact.bilateral or not len(local):
        return none
    segment, s = np.repeat(line.segments[local], len(PLACES)), np.tile(PLACES, len(local))
    x, d = trace.point(segment, s), trace.normal(segment, s)
    if line.contact.direction is not None:
        d = np.tile(line.contact.direction, (len(s), 1))
    there, s_there, distance, _ = partners(trace, line.facing, segment, x, d, nodes=False)
    if line.contact.gap is not None:
        distance = prescribed_gap(line.contact, trace, segment, s, x)
    met = np.isfinite(distance) & ((there >= 0) | (line.contact.primary is None))
    if not met.any():
        return none
    segment, there, x, d = segment[met], there[met], x[met], d[met]
    s, s_there, distance = s[met], s_there[met], distance[met]
    u = trace.evaluate(displacement, segment, s)
    noise = ROUND_OFF * (np.abs(u).max() + np.abs(x).max())
    if line.contact.primary is not None:
        u = u - trace.evaluate(displacement, there, s_there)
    gap = distance - (u * d).sum(axis=1)  # (2.10)
    deepest = int(np.argmin(gap))
    if gap[deepest] >= -noise:
        return none
    depth, [length] = -float(gap[deepest]), trace.lengths(segment[[deepest]])
    return Penetration(depth, depth / float(length), x[deepest])
