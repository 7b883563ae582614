"""The gap of the discrete displacement as polynomials, and liftings after which it is open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ..data import Discrete, Units
from ..pressures import Pieces, Zone, ZonePoints, zone_points
from .edges import EdgeField, at_points, coefficients, derivative, hat_norms, norms, panels, samples

SHARP = 1e-9  # difference of displacements at a vertex, relative to the gap: more than round-off


class Opened(Protocol):
    """A function on the pieces of Gamma_K, and what is added to it: that of a `Gap`, say."""

    @property
    def zone(self) -> Zone:
        """The pair."""

    @property
    def pieces(self) -> Pieces:
        """Its parts."""

    @property
    def points(self) -> ZonePoints:
        """Places on each."""

    def lifted(self, at: Index, t: Array) -> tuple[Array, Array, Array]:
        """The function (j, q), r (j, q), r' (j, q) at `t` (j, q) of pieces `at` (j,)."""

    def panels(self, at: Index) -> tuple[Array, Array]:
        """Points (j, q), weights (j, q) of pieces `at` (j,), cut where r has kinks."""


@dataclass(frozen=True, eq=False)
class Gap:
    """The gap of one pair on its k pieces, as polynomials, and what is added to it.

    Attributes
    ----------
    zone : Zone
        The pair.
    pieces : Pieces
        Its parts.
    points : ZonePoints
        d + 1 places on each.
    values : ndarray (k, d + 1)
        Legendre coefficients of the gap, over strain times length.
    kept : ndarray (k, d + 1)
        The same of what stays of the gap where contact closes it; 0 at nodal rows.
    closed : ndarray of bool (k,)
        Pieces on which the gap is closed but for that, others keep theirs or open to 0.
    """

    zone: Zone
    pieces: Pieces
    points: ZonePoints
    values: Array
    kept: Array
    closed: Mask

    def lifted(self, at: Index, t: Array) -> tuple[Array, Array, Array]:
        """The gap (j, q) at `t` (j, q) of pieces `at` (j,), r (j, q), and its derivative (j, q)."""
        gap, slope = (at_points(c, t) for c in (self.values[at], derivative(self.values[at])))
        kept, more = (at_points(c, t) for c in (self.kept[at], derivative(self.kept[at])))
        closed = self.closed[at, None]
        r = np.where(closed, kept - gap, np.maximum(-gap, 0.0))
        return gap, r, np.where(closed, more - slope, -slope * (gap < 0))

    def panels(self, at: Index) -> tuple[Array, Array]:
        """Points (j, q), weights (j, q) of pieces `at` (j,), cut where an open gap changes sign."""
        return panels(np.where(self.closed[at, None], 0.0, self.values[at]))


def gap_of(
    zone: Zone,
    pieces: Pieces,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    units: Units,
    supported: Index,
) -> Gap:
    """The gap after deformation.

    Where rows are means it does not vanish at vertices: r is -gap in contact and (gap)_- beside,
    and at vertices between the two, or `supported` (j,) ones, the positive part is kept.
    """
    s, line = samples(), zone.state.line
    points = zone_points(zone.state, pieces, boundary, displacement, units, s, np.ones(len(s)))
    sampled = points.gap.reshape(len(pieces.local), len(s))
    values = coefficients(sampled)
    closed = (zone.full | line.contact.bilateral) & line.faces
    kept = np.zeros_like(values)
    if not pieces.whole:
        nodes = boundary.nodes[line.segments][:, [0, -1]]
        vertices, count = np.unique(nodes, return_counts=True)
        loose = np.union1d(np.union1d(nodes[~closed], supported), vertices[count == 1])
        for side, place in ((0, pieces.start == 0), (1, pieces.stop == 1)):
            end = np.isin(nodes[pieces.local, side], loose) & place & closed[pieces.local]
            size = np.maximum(sampled[:, -side], 0.0) * end
            # The hat of the vertex is linear on the segment: on every piece of it.
            at = np.zeros(len(line.segments))
            np.add.at(at, pieces.local, size)
            hats = pieces.places(s) if side else 1 - pieces.places(s)
            kept += coefficients(at[pieces.local, None] * hats)
    return Gap(zone, pieces, points, values, kept, closed[pieces.local])


def on_contact(
    gap: Opened, boundary: BoundaryTrace, supported: Index, discrete: Discrete
) -> tuple[list[EdgeField], list[tuple[Index, Array]]]:
    """What to lift so that K is met: fields on edges, or triangles (k,) and energy norms (k,).

    On both bodies, shared by compliance, where rows are at nodes; on the secondary where they are
    means, since then vertices move, too, but for the `supported` (j,) ones.

    Raises
    ------
    ValueError
        Corners with such rows, and supports that overlap the other body.
    """
    pieces = gap.pieces
    every = np.arange(len(pieces.local))
    shape = len(every), -1
    _, r, _ = gap.lifted(every, np.tile(samples(), (len(every), 1)))
    at = np.flatnonzero(np.abs(r).max(axis=1, initial=0.0) > 0)
    if at.size == 0:
        return [], []
    t, weight = gap.panels(at)
    _, r, dr = gap.lifted(at, t)
    d = coefficients(gap.points.direction.reshape(*shape, 2)[at])
    direction, turn = at_points(d, t), at_points(derivative(d), t)
    value, slope = r[:, :, None] * direction, dr[:, :, None] * direction + r[:, :, None] * turn
    length = (pieces.stop - pieces.start)[at, None]
    sides = [(pieces.segment[at], pieces.start[at, None] + length * t, length * np.ones_like(t))]
    if not pieces.whole:
        parts = value, slope, weight
        return [], _on_secondary(gap, at, sides[0], parts, boundary, supported, discrete)
    if pieces.line.contact.primary is not None:
        c = coefficients(gap.points.facing_s.reshape(shape)[at])
        sides.append((pieces.facing[at], at_points(c, t), at_points(derivative(c), t)))
    fields = [_field(discrete, *one, (value, slope, weight)) for one in sides]
    if len(fields) == 1:
        return fields, []
    one, other = (norms(discrete, field) ** 2 for field in fields)
    share = np.divide(other, one + other, out=np.zeros_like(one), where=one + other > 0)
    return [fields[0].scaled(share), fields[1].scaled(1 - share)], []


def _field(
    discrete: Discrete, segment: Index, s: Array, ds: Array, parts: tuple[Array, Array, Array]
) -> EdgeField:
    """A displacement on edges by value, slope and weight with respect to another parameter."""
    partition, (value, slope, weight) = discrete.partition, parts
    edge = partition.edge_of_segment[segment]
    along = partition.along[edge][:, None]
    return EdgeField(
        edge=edge,
        t=np.where(along, s, 1 - s),
        weight=weight * np.abs(ds),
        value=value,
        slope=slope / np.where(along, ds, -ds)[:, :, None],
    )


def _on_secondary(
    gap: Opened,
    at: Index,
    side: tuple[Index, Array, Array],
    parts: tuple[Array, Array, Array],
    boundary: BoundaryTrace,
    supported: Index,
    discrete: Discrete,
) -> list[tuple[Index, Array]]:
    """Liftings on the secondary alone: hats of the vertices, and the rest on the edges."""
    partition, pieces = discrete.partition, gap.pieces
    v, seen = np.zeros((len(partition.vertices), 2)), np.zeros(len(partition.vertices), dtype=bool)
    nodes = boundary.nodes[pieces.segment][:, [0, -1]]
    directions = gap.points.direction.reshape(len(pieces.local), -1, 2)
    largest = SHARP * np.abs(gap.points.gap).max(initial=0.0)
    for which, ends in ((0, pieces.start == 0), (-1, pieces.stop == 1)):
        mine = np.flatnonzero(ends)
        t = np.full((len(mine), 1), float(-which))
        _, r, _ = gap.lifted(mine, t)
        move, vertex = r * directions[mine, which], nodes[mine, which]
        old = np.abs(v[vertex] - move).max(axis=1) * seen[vertex]
        if (old > largest).any():
            raise ValueError(
                "no guaranteed bound is known for dual rows on both sides of a corner, as on "
                f'"{pieces.line.contact.secondary}"; use error_estimate'
            )
        v[vertex], seen[vertex] = move, True
    if np.abs(v[supported]).max(initial=0.0) > largest:
        raise ValueError(
            "no guaranteed bound is known where a support overlaps the other body, as at an end of "
            f'"{pieces.line.contact.secondary}"; use error_estimate'
        )
    v[supported] = 0.0
    segment, s, ds = side
    field = _field(discrete, segment, s, ds, parts)
    ends = v[partition.ends[field.edge]]
    t = field.t[:, :, None]
    rest = EdgeField(
        edge=field.edge,
        t=field.t,
        weight=field.weight,
        value=field.value - (1 - t) * ends[:, None, 0] - t * ends[:, None, 1],
        slope=field.slope - (ends[:, 1] - ends[:, 0])[:, None],
    )
    triangle, corner = np.nonzero((v[partition.triangles] != 0).any(axis=2))
    moves = v[partition.triangles[triangle, corner]]
    return [
        *_by_edge(discrete, rest),
        (triangle, hat_norms(discrete, triangle, corner, moves)),
    ]


def _by_edge(discrete: Discrete, field: EdgeField) -> Sequence[tuple[Index, Array]]:
    """Triangles and norms of a field given on several pieces of an edge, which one m continues."""
    edge, number = np.unique(field.edge, return_inverse=True)
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    place = np.arange(len(number)) - np.concatenate([[0], np.cumsum(count)[:-1]])[number[order]]
    q = field.t.shape[1]

    def merged(values: Array) -> Array:
        result = np.zeros((len(edge), int(count.max()), *values.shape[1:]))
        result[number[order], place] = values[order]
        return result.reshape(len(edge), int(count.max()) * q, *values.shape[2:])

    t = merged(field.t)
    whole = EdgeField(edge, t, merged(field.weight), merged(field.value), merged(field.slope))
    return [(discrete.partition.owner[0][edge], norms(discrete, whole))]
