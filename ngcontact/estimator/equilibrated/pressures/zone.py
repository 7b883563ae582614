"""Gamma_K for an equilibrated stress: pressures p* on it, the tractions they exert, the gap."""

from __future__ import annotations

import math
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ....arrays import Array, Index, Mask
from ....contact import ContactState, prescribed_gap
from ....contact.line import jacobian as contact_jacobian
from ....fem import BoundaryTrace
from ....triplets import from_triplets
from ..data import Discrete, Units, bent_segments, edge_parameters, legendre_values, with_hats
from .cuts import straight_ends
from .pieces import Pieces, contact_directions
from .reach import Reach

GAP_NOISE = 4e-15  # of a gap, relative to the displacement and, where it is measured, to positions


def bernstein(degree: int, s: Array) -> Array:
    """Values (q, d + 1) of the Bernstein polynomials at `s` (q,)."""
    i = np.arange(degree + 1)
    binomial = np.array([math.comb(degree, j) for j in i])
    return np.asarray(binomial * s[:, None] ** i * (1 - s[:, None]) ** (degree - i))


@dataclass(frozen=True, eq=False)
class ZonePoints:
    """Points of Gamma_K, q of them, on the segments of the secondary.

    Attributes
    ----------
    local : ndarray of int (q,)
        Segment, counted in the pair's line.
    s : ndarray (q,)
        Parameter on it.
    segment, facing : ndarray of int (q,)
        Segments of the boundary: its own, and the one that it faces, -1 for none.
    facing_s : ndarray (q,)
        Parameter there.
    weight : ndarray (q,)
        Of quadrature in arc length (P1) or eta (P2), times what a length counts for.
    direction : ndarray (q, 2)
        d.
    gap : ndarray (q,)
        After deformation, over strain times length.
    """

    local: Index
    s: Array
    segment: Index
    facing: Index
    facing_s: Array
    weight: Array
    direction: Array
    gap: Array


@dataclass(frozen=True, eq=False)
class Zone:
    """One pair: m pressures, coefficients of continuous piecewise polynomials.

    Attributes
    ----------
    state : ContactState
        The pair.
    reach : Reach
        Where it acts.
    number : ndarray of int (j, d + 1)
        Coefficients of Bernstein polynomials there on each segment of the line, -1 where p* is 0.
    size : int
        m.
    """

    state: ContactState
    reach: Reach
    number: Index
    size: int

    def values(self, local: Index, s: Array) -> sp.csr_array:
        """Matrix (q, m) to the values at `s` (q,) of the segments `local` (q,) of the line."""
        degree = self.number.shape[1] - 1
        t = self.reach.places(local, s)
        share, column = bernstein(degree, t), self.number[local]
        row = np.broadcast_to(np.arange(len(s))[:, None], column.shape)
        kept = (column >= 0) & ((t >= 0) & (t <= 1))[:, None]
        return from_triplets(share[kept], row[kept], column[kept], (len(s), self.size))

    @property
    def full(self) -> Mask:
        """Segments (j,) of the line, facing or with a p*, that are in contact with all nodes."""
        line = self.state.line
        full = np.append(self.state.active, True)[line.rows].all(axis=1)
        return np.asarray(full & (line.faces | (self.reach.acts & (line.rows >= 0).any(axis=1))))


def zone_of(
    state: ContactState,
    reach: Reach,
    boundary: BoundaryTrace,
    degree: int,
    everywhere: bool = False,
) -> Zone:
    """Where p* may differ from 0, as polynomials of a degree: where forces are, and beside.

    Or `everywhere` on the line, if such pressures cannot balance the loads.
    """
    line = state.line
    at = np.flatnonzero(reach.acts)
    segment, nodes = line.segments[at], boundary.nodes[line.segments[at]]
    ends = np.tile([0.0, 1.0], len(at))
    normal = boundary.exact_normal(np.repeat(segment, 2), ends)
    point, _ = boundary.number_points(np.repeat(segment, 2), nodes[:, [0, -1]].ravel(), normal)
    point = point.reshape(-1, 2)
    inner, falls = reach.inner[at], reach.falls[at]  # ends that no other segment shares
    point[inner] = point.max(initial=-1) + 1 + np.arange(np.count_nonzero(inner))
    force = np.append(state.force, 0.0)[line.rows[at]]
    carries = (force != 0).any(axis=1) | line.contact.bilateral | everywhere
    touched = np.zeros(point.max(initial=-1) + 1, dtype=bool)
    touched[point[carries]] = True
    near = touched[point].any(axis=1)
    fixed = np.zeros(len(touched), dtype=bool)  # the ends of what is near, within the line
    fixed[point[~near]] = True
    bent = np.isin(segment, bent_segments(boundary))  # not divided: tractions must not jump
    fixed[point[straight_ends(boundary, segment) & bent[:, None]]] = True
    fixed[point[falls]] = True
    fixed[point[reach.closes[at]]] = True
    number = np.full((len(line.segments), degree + 1), -1)
    coefficient = np.full(len(touched), -1)
    used = np.zeros(len(touched), dtype=bool)
    used[point[near]] = True
    used &= ~fixed
    coefficient[used] = np.arange(np.count_nonzero(used))
    size = np.count_nonzero(used)
    free = np.ones((np.count_nonzero(near), degree - 1), dtype=bool)
    free[falls[near, 0], 0] = free[falls[near, 1], -1] = False
    inside = np.where(free, size + np.cumsum(free).reshape(free.shape) - 1, -1)
    number[at[near], 1:-1] = inside
    number[np.ix_(at[near], np.array([0, degree]))] = coefficient[point[near]]
    return Zone(state, reach, number, int(size + np.count_nonzero(free)))


def zone_points(
    state: ContactState,
    pieces: Pieces,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    units: Units,
    t: Array,
    weight: Array,
) -> ZonePoints:
    """Points at `t` (q,) on each piece, with weights `weight` (q,) there."""
    line, contact = state.line, state.line.contact
    strain, length = units.strain, units.length
    places = pieces.places(t)
    there, distance = (x.ravel() for x in pieces.opposite(boundary, places))
    q, s = len(t), places.ravel()
    local, facing = np.repeat(pieces.local, q), np.repeat(pieces.facing, q)
    segment = line.segments[local]
    x = boundary.point(segment, s)
    d = contact_directions(contact, boundary, segment, s)
    if contact.gap is not None:
        distance = prescribed_gap(contact, boundary, segment, s, x)
    u = boundary.evaluate(displacement, segment, s)
    noise = np.full(len(s), GAP_NOISE * np.abs(u).max(initial=0.0))
    if contact.gap is None:
        noise[distance != 0] += GAP_NOISE * np.abs(x).max(initial=0.0)
    met = facing >= 0
    if met.any():
        u[met] -= boundary.evaluate(displacement, facing[met], there[met])
    gap = distance - (u * d).sum(axis=1)
    gap[np.abs(gap) <= noise] = 0.0
    scale = np.outer(pieces.stop - pieces.start, weight).ravel()
    return ZonePoints(
        local=local,
        s=s,
        segment=segment,
        facing=facing,
        facing_s=there,
        weight=scale * contact_jacobian(boundary, contact, segment, s) / units.measure,
        direction=d,
        gap=gap / strain / length,
    )


def tractions(discrete: Discrete, zone: Zone, points: ZonePoints, edges: int) -> sp.csr_array:
    """Matrix (e * 2 * r, m) from p* to what `EdgeConditions.given` needs of it, on both bodies."""
    partition, degree = discrete.partition, discrete.degree
    p = zone.values(points.local, points.s)
    r = 2 * (degree + 1)
    total = sp.csr_array((edges * 2 * r, zone.size))
    for sign, segment, s in (
        (-1.0, points.segment, points.s),
        (1.0, points.facing, points.facing_s),
    ):
        at = np.flatnonzero(segment >= 0)
        if at.size == 0:
            continue
        edge, t = edge_parameters(partition, segment[at], s[at])
        moments = legendre_values(degree - 1, t) @ with_hats(degree).transpose(0, 2, 1)
        factor = sign * points.weight[at] / partition.edge_lengths[edge]
        values = np.einsum("k,kf,hkq->khfq", factor, points.direction[at], moments)
        values = values.reshape(len(at), -1)
        row = (edge[:, None] * 2 * r + np.arange(2 * r)).ravel()
        column = np.repeat(np.arange(len(at)), 2 * r)
        shape = (edges * 2 * r, len(at))
        total = total + from_triplets(values.ravel(), row, column, shape) @ p[at]
    return total.tocsr()
