"""Liftings on the secondary alone, where its nodes do not face nodes and so its vertices move, too.

The hats of the vertices carry their moves into all elements around them, and what is left on the
segments is 0 at their ends.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ....arrays import Array, Mask
from ....fem import BoundaryTrace
from ....lagrange import gauss
from ..data import Discrete, EdgeConditions
from ..pressures import SLIVER
from .edges import (
    DEGREE,
    EdgeField,
    at_points,
    by_segment,
    coefficients,
    derivative,
    samples,
)
from .gaps import Opened
from .vertices import Side, side_of, vertex_moves

SHARP = 1e-9  # difference of displacements at a vertex, relative to the gap: more than round-off


def on_secondaries(
    gaps: Sequence[Opened],
    boundary: BoundaryTrace,
    conditions: EdgeConditions,
    discrete: Discrete,
) -> tuple[Array, list[EdgeField]]:
    """What opens all gaps whose pieces are not `whole`.

    Returns
    -------
    moves : ndarray (nv, 2)
        Displacements of the vertices of the mesh.
    fields : list of EdgeField
        What is left between them.

    Raises
    ------
    ValueError
        Vertices where that cannot be met, as where a support overlaps the other body.
    """
    sides = [side_of(gap, boundary, discrete) for gap in gaps if gap.pieces.local.size]
    moved = [side for side in sides if not side.gap.pieces.whole]
    if not moved:
        return np.zeros((boundary.mesh.nv, 2)), []
    largest = SHARP * max(float(np.abs(side.gap.points.gap).max(initial=0.0)) for side in moved)
    v = vertex_moves(sides, boundary, conditions, discrete, largest)
    rests = [rest for side in moved for rest in _rest(side, v)]
    rests += _bridges(moved, v, largest)
    return -v, [_merged(rests)] if rests else []


def _rest(side: Side, v: Array) -> list[EdgeField]:
    """What the moves `v` (nv, 2) of vertices leave along d, where that is not 0."""
    corner = v[side.corners]
    at = np.flatnonzero(_asks(side, corner))
    if at.size == 0:
        return []
    t, weight = side.gap.panels(at)
    _, r, dr = side.gap.lifted(at, t)
    c = coefficients(side.directions[at])
    d, turn = at_points(c, t), at_points(derivative(c), t)
    span, corner = np.diff(side.ends[at], axis=1), corner[at]
    place = side.ends[at, :1] + span * t
    linear = corner[:, None, 0] + place[:, :, None] * (corner[:, 1] - corner[:, 0])[:, None]
    slope = span[:, :, None] * (corner[:, 1] - corner[:, 0])[:, None]
    left = r - (linear * d).sum(axis=2)
    change = dr - (slope * d).sum(axis=2) - (linear * turn).sum(axis=2)
    value = left[:, :, None] * d
    slope = (change[:, :, None] * d + left[:, :, None] * turn) / span[:, :, None]
    return [EdgeField(side.edge[at], place, weight * np.abs(span), value, slope)]


def _asks(side: Side, corner: Array) -> Mask:
    """Pieces (k,) on which r is not 0, or vertices of their edges move by `corner` (k, 2, 2)."""
    k = len(side.edge)
    _, r, _ = side.gap.lifted(np.arange(k), np.tile(samples(), (k, 1)))
    return np.asarray((r != 0).any(axis=1) | (corner != 0).any(axis=(1, 2)))


def _bridges(sides: Sequence[Side], v: Array, largest: float) -> list[EdgeField]:
    """Between pieces, where a segment faces nothing, the rest is linear."""
    edge = np.concatenate([side.edge for side in sides])
    ends = np.concatenate([side.ends for side in sides])
    d = np.concatenate([side.toward for side in sides])
    asked = np.concatenate([side.asked for side in sides])
    corner = v[np.concatenate([side.corners for side in sides])][:, None]
    linear = corner[:, :, 0] + ends[:, :, None] * (corner[:, :, 1] - corner[:, :, 0])
    value = (asked - (linear * d).sum(axis=2))[:, :, None] * d
    backwards = ends[:, 0] > ends[:, 1]
    ends[backwards], value[backwards] = ends[backwards, ::-1], value[backwards, ::-1]
    order = np.lexsort((ends[:, 0], edge))
    edge, ends, value = edge[order], ends[order], value[order]
    new = np.append(True, edge[1:] != edge[:-1])
    last = np.append(new[1:], True)
    low = np.where(new, 0.0, np.roll(ends[:, 1], 1))
    before = np.where(new[:, None], 0.0, np.roll(value[:, 1], 1, axis=0))
    start, stop = np.append(low, ends[last, 1]), np.append(ends[:, 0], np.ones(last.sum()))
    a, b = (
        np.concatenate([before, value[last, 1]]),
        np.concatenate([value[:, 0], np.zeros((last.sum(), 2))]),
    )
    edge, length = np.append(edge, edge[last]), stop - start
    narrow = length <= SLIVER
    if (length < -SLIVER).any() or np.abs((a - b)[narrow]).max(initial=0.0) > largest:
        raise ValueError(
            "no guaranteed bound is known where two lines ask for other displacements of one "
            f'place, as on "{sides[0].gap.pieces.line.contact.secondary}"; use error_estimate'
        )
    at = np.flatnonzero(~narrow & ((a != 0) | (b != 0)).any(axis=1))
    if at.size == 0:
        return []
    rule, w = gauss(2 * DEGREE)
    slope = (b - a)[at] / length[at, None]
    t = start[at, None] + length[at, None] * rule
    value = a[at, None] + slope[:, None] * (t - start[at, None])[:, :, None]
    slopes = np.broadcast_to(slope[:, None], value.shape)
    return [EdgeField(edge[at], t, length[at, None] * w, value, slopes)]


def _merged(fields: Sequence[EdgeField]) -> EdgeField:
    """All fields as one, with the sign of -r."""
    q = max(field.t.shape[1] for field in fields)

    def filled(name: str) -> Array:
        parts = []
        for field in fields:
            values = getattr(field, name)
            more = np.repeat(values[:, -1:], q - values.shape[1], axis=1)
            parts.append(np.concatenate([values, 0 * more if name == "weight" else more], axis=1))
        return np.concatenate(parts)

    edge = np.concatenate([field.edge for field in fields])
    every = EdgeField(edge, *(filled(name) for name in ("t", "weight", "value", "slope")))
    return by_segment(every.scaled(-np.ones(len(edge))), edge)
