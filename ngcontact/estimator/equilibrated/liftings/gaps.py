"""The gap of the discrete displacement as polynomials, and liftings after which it is open."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Protocol

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ..data import Discrete, Units
from ..pressures import SLIVER, Pieces, Zone, ZonePoints, zone_points
from .closing import closed_beside
from .edges import (
    EdgeField,
    at_points,
    by_segment,
    coefficients,
    derivative,
    norms,
    panels,
    samples,
)

STEEP = 12  # power of a vertex's hat by which what stays open there falls: p* is small near it


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
    closed : ndarray (k, 2)
        Interval of each piece on which the gap is closed but for that, from 1 to 0 where there is
        none; elsewhere it stays or opens to 0.
    """

    zone: Zone
    pieces: Pieces
    points: ZonePoints
    values: Array
    kept: Array
    closed: Array

    def lifted(self, at: Index, t: Array) -> tuple[Array, Array, Array]:
        """The gap (j, q) at `t` (j, q) of pieces `at` (j,), r (j, q), and its derivative (j, q)."""
        gap, slope = (at_points(c, t) for c in (self.values[at], derivative(self.values[at])))
        kept, more = (at_points(c, t) for c in (self.kept[at], derivative(self.kept[at])))
        closed = self.shut(at, t)
        r = np.where(closed, kept - gap, np.maximum(-gap, 0.0))
        return gap, r, np.where(closed, more - slope, -slope * (gap < 0))

    def shut(self, at: Index, t: Array) -> Mask:
        """Whether the gap is closed at `t` (j, q) of pieces `at` (j,); (j, q)."""
        return np.asarray((t >= self.closed[at, :1]) & (t <= self.closed[at, 1:]))

    def panels(self, at: Index) -> tuple[Array, Array]:
        """Points (j, q), weights (j, q) of pieces `at` (j,), cut where an open gap changes sign."""
        whole = (self.closed[at] == [0, 1]).all(axis=1)
        return panels(np.where(whole[:, None], 0.0, self.values[at]))


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
    and at vertices between the two, or `supported` (j,) ones, the positive part is kept, but of
    bilateral contact.
    """
    s, line = samples(), zone.state.line
    points = zone_points(zone.state, pieces, boundary, displacement, units, s, np.ones(len(s)))
    sampled = points.gap.reshape(len(pieces.local), len(s))
    values = coefficients(sampled)
    closed = zone.full | line.contact.bilateral
    nodes = boundary.nodes[line.segments][:, [0, -1]]
    beside = closed_beside(zone, pieces, values, nodes, supported)
    shut = np.where(closed[pieces.local, None], [0.0, 1.0], beside)
    kept = np.zeros_like(values)
    if not pieces.whole and not line.contact.bilateral:
        vertices, count = np.unique(nodes, return_counts=True)
        open_ = np.repeat(~closed[:, None], 2, axis=1)
        for side, ends in enumerate((pieces.start, pieces.stop)):
            open_[pieces.local[(ends == side) & (shut[:, side] == side)], side] = False
        loose = np.union1d(np.union1d(nodes[open_], supported), vertices[count == 1])
        for side, place in ((0, pieces.start == 0), (1, pieces.stop == 1)):
            end = np.isin(nodes[pieces.local, side], loose) & place & closed[pieces.local]
            size = np.maximum(sampled[:, -side], 0.0) * end
            # The hat of the vertex is one on the whole segment: on every piece of it.
            at = np.zeros(len(line.segments))
            np.add.at(at, pieces.local, size)
            hats = pieces.places(s) if side else 1 - pieces.places(s)
            kept += coefficients(at[pieces.local, None] * hats**STEEP)
    gap = Gap(zone, pieces, points, values, kept, shut)
    return gap if line.contact.bilateral else _without_steps(gap, boundary)


def _without_steps(gap: Gap, boundary: BoundaryTrace) -> Gap:
    """A gap after whose lifting next to nothing that is bare need not stretch over a step.

    Where p* falls to 0 beside a bare end, as over the edge of a slot, the gap may stay open.
    """
    pieces, reach, kept = gap.pieces, gap.zone.reach, gap.kept.copy()
    nodes = boundary.nodes[pieces.line.segments][:, [0, -1]]
    ends = np.tile([0.0, 1.0], (len(pieces.local), 1))
    value, r, _ = gap.lifted(np.arange(len(ends)), ends)
    s = pieces.places(ends)
    for local, side in zip(*np.nonzero(reach.falls), strict=True):
        low, high = reach.start[local], reach.stop[local]
        mine, place = pieces.local == local, (low, high)[side]
        row = np.flatnonzero(mine & (np.abs(s[:, side] - place) <= SLIVER))
        at_vertex = (nodes[pieces.local] == nodes[local, side]) & (np.abs(s - [0, 1]) == 0)
        beyond = float(r[at_vertex & ~mine[:, None]].max(initial=0.0))
        if row.size and gap.closed[row[0], 1] > gap.closed[row[0], 0]:
            hat = np.abs(pieces.places(samples())[mine] - (low, high)[1 - side]) / (high - low)
            kept[mine] += coefficients(max(float(value[row[0], side]) + beyond, 0.0) * hat)
    return replace(gap, kept=kept)


def without_idle(gaps: Sequence[Gap], boundary: BoundaryTrace) -> list[Gap]:
    """Gaps without parts of segments that need nothing: no p*, no r, no vertex that moves.

    As those of arcs that turn away from the other body, on which gaps are no polynomials.
    """
    idle, moving = [], []
    for gap in gaps:
        local, line = gap.pieces.local, gap.pieces.line
        _, r, _ = gap.lifted(np.arange(len(local)), np.tile(samples(), (len(local), 1)))
        still = (r == 0).all(axis=1)
        idle.append(still & ~line.faces[local] & (gap.zone.number[local] < 0).all(axis=1))
        moving.append(boundary.nodes[line.segments[local[~still]]][:, [0, -1]].ravel())
    vertices = np.concatenate([np.zeros(0, dtype=np.intp), *moving])
    found = []
    for gap, rests in zip(gaps, idle, strict=True):
        pieces, points = gap.pieces, gap.points
        ends = boundary.nodes[pieces.segment][:, [0, -1]]
        at = np.flatnonzero(~rests | np.isin(ends, vertices).any(axis=1))
        if len(at) == len(rests):
            found.append(gap)
            continue
        rows = (at[:, None] * len(samples()) + np.arange(len(samples()))).ravel()
        found.append(
            replace(
                gap,
                pieces=pieces.only(at),
                points=ZonePoints(*(getattr(points, one.name)[rows] for one in fields(points))),
                values=gap.values[at],
                kept=gap.kept[at],
                closed=gap.closed[at],
            )
        )
    return found


def on_contact(gap: Opened, discrete: Discrete) -> list[EdgeField]:
    """What to lift so that [w] = -r where nodes face nodes, on both bodies, by compliance."""
    pieces = gap.pieces
    every = np.arange(len(pieces.local))
    shape = len(every), -1
    _, r, _ = gap.lifted(every, np.tile(samples(), (len(every), 1)))
    at = np.flatnonzero(np.abs(r).max(axis=1, initial=0.0) > 0)
    if at.size == 0:
        return []
    t, weight = gap.panels(at)
    _, r, dr = gap.lifted(at, t)
    d = coefficients(gap.points.direction.reshape(*shape, 2)[at])
    direction, turn = at_points(d, t), at_points(derivative(d), t)
    value, slope = r[:, :, None] * direction, dr[:, :, None] * direction + r[:, :, None] * turn
    length = (pieces.stop - pieces.start)[at, None]
    sides = [(pieces.segment[at], pieces.start[at, None] + length * t, length * np.ones_like(t))]
    if pieces.line.contact.primary is not None:
        c = coefficients(gap.points.facing_s.reshape(shape)[at])
        sides.append((pieces.facing[at], at_points(c, t), at_points(derivative(c), t)))
    fields = [_field(discrete, *one, (value, slope, weight)) for one in sides]
    both = [by_segment(field, pieces.segment[at]) for field in fields]
    if len(both) == 1:
        return [both[0].scaled(-np.ones(len(both[0].edge)))]
    one, other = (norms(discrete, field) ** 2 for field in both)
    share = np.divide(other, one + other, out=np.zeros_like(one), where=one + other > 0)
    return [both[0].scaled(-share), both[1].scaled(1 - share)]


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
