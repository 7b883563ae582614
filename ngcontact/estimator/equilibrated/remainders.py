"""Tractions on curves and on facing sides that polynomials on the edges do not meet."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Index, Mask
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ...problem import Problem
from .data import ROUND_OFF, Discrete, Units, edge_places, legendre_values, tractions_on_curves
from .liftings import at_points, coefficients, derivative, samples
from .pressures import Pieces, Zone, contact_directions, contact_jacobian

COVERED = 1e-7  # share of an edge below which a part that faces nothing is none
NOISE = 1e-13  # of a traction, relative to the largest: met but for round-off


@dataclass(frozen=True, eq=False)
class Strip:
    """Tractions asked for at q points on each of k edges, or parts of them, per chord.

    Attributes
    ----------
    edge : ndarray of int (k,)
        The edges.
    t : ndarray (k, q)
        Places on them, as they run.
    weight : ndarray (k, q)
        Of quadrature in `t`.
    asked : ndarray (k, q, 2)
        Tractions times ds over the chord and dt, without a unit.
    counts : ndarray of bool (k, 2)
        Components that are asked for.
    action : ndarray (k, q, 2)
        What p* is multiplied with in them, 0 where there is none.
    pair : int
        Which p*, or -1.
    piece : ndarray of int (k,)
        Of which piece of the pair, or -1.
    s : ndarray (k, q)
        Parameter on the secondary's segment.
    """

    edge: Index
    t: Array
    weight: Array
    asked: Array
    counts: Mask
    action: Array
    pair: int
    piece: Index
    s: Array


def asked_tractions(
    problem: Problem,
    boundary: BoundaryTrace,
    discrete: Discrete,
    zones: Sequence[Zone],
    every_pieces: Sequence[Pieces],
    pressures: Sequence[Array],
    units: Units,
) -> list[Strip]:
    """Tractions that the stress shall have on curved edges and on both sides of Gamma_K.

    But on turning guides, where what the stress is decides.

    Parameters
    ----------
    problem, boundary, discrete, units
        The data.
    zones, every_pieces : sequence of Zone, of Pieces
        The pairs.
    pressures : sequence of ndarray (m,)
        Coefficients of p* of each.
    """
    strips = []
    for pair, (zone, pieces, b) in enumerate(zip(zones, every_pieces, pressures, strict=True)):
        if pieces.local.size:
            strips += _on_zone(pair, zone, pieces, b, boundary, discrete, units)
    curves = discrete.curves
    covered = np.unique(np.concatenate([[-1], *(strip.edge for strip in strips)]))
    edge = np.setdiff1d(curves.edge[~curves.guided], covered)
    if edge.size:
        strips.append(_on_curves(problem, boundary, discrete, edge, units))
    return strips


def missed_tractions(
    discrete: Discrete, stress: tuple[Array, Array], strips: Sequence[Strip]
) -> Array:
    """Norms (e,) of what a stress misses of the tractions asked for.

    Parameters
    ----------
    discrete, strips
        The data.
    stress : tuple of ndarray (n, 3, m), (n, 3, r)
        Coefficients of the stress, and of its tractions on the edges.
    """
    squares = np.zeros(len(discrete.partition.ends))
    largest = np.abs(stress[0]).max(initial=0.0)
    for strip in strips:
        density, stretch = traction_density(discrete, stress, strip.edge, strip.t)
        off = (density - strip.asked) * strip.counts[:, None]
        square = (strip.weight * (off**2).sum(axis=2) / stretch).sum(axis=1)
        np.add.at(squares, strip.edge, discrete.partition.edge_lengths[strip.edge] * square)
    norms = np.sqrt(squares)
    partition = discrete.partition
    touching = partition.touching(discrete.balance.at_axis(partition))
    noise = np.where(touching, ROUND_OFF, NOISE) * np.sqrt(partition.edge_lengths) * largest
    return np.where(norms > noise, norms, 0.0)


def traction_density(
    discrete: Discrete, stress: tuple[Array, Array], edge: Index, t: Array
) -> tuple[Array, Array]:
    """Tractions (k, q, 2) per chord at `t` (k, q) of edges `edge` (k,), and ds per chord (k, q).

    Of `stress` (n, 3, m), (n, 3, r): coefficients, and tractions on the edges of triangles.
    """
    partition, (raw, traction) = discrete.partition, stress
    triangle, side = (x[edge] for x in partition.owner)
    c = traction[triangle, side].reshape(len(edge), 2, -1)
    values = legendre_values(c.shape[2] - 1, t.ravel()).reshape(*t.shape, -1)
    density, stretch = np.einsum("kqi,kci->kqc", values, c), np.ones_like(t)
    for k in np.flatnonzero(discrete.curves.number[edge] >= 0):
        by, ds = tractions_on_curves(
            partition, discrete.curves, discrete.degree, edge[k : k + 1], t[k]
        )
        density[k] = by[0] @ raw[triangle[k]].ravel()
        stretch[k] = ds[0]
    return density, stretch


def _bare(edge: Index, t: Array, weight: Array, asked: Array, counts: Mask | None = None) -> Strip:
    """Tractions without p*."""
    k, none = len(edge), np.zeros_like(asked)
    counts = np.ones((k, 2), dtype=bool) if counts is None else counts
    return Strip(edge, t, weight, asked, counts, none, -1, np.full(k, -1), np.zeros_like(t))


def _on_curves(
    problem: Problem, boundary: BoundaryTrace, discrete: Discrete, edge: Index, units: Units
) -> Strip:
    """Loads on curved edges (j,)."""
    partition = discrete.partition
    segment = partition.segment[edge]
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    t = np.tile(rule, (len(edge), 1))
    s = np.where(partition.along[edge][:, None], t, 1 - t)
    at, flat = np.repeat(segment, len(rule)), s.ravel()
    counts = np.ones((len(edge), 2), dtype=bool)
    for pattern, components in problem.displacement.items():
        on = boundary.lies_on(segment, pattern)
        for axis, value in enumerate(components):
            if value is not None:
                counts[on, axis] = False
    asked = np.zeros((*t.shape, 2))
    _, dx = edge_places(partition, edge, discrete.curves, t)
    stretch = np.linalg.norm(dx, axis=2) / partition.edge_lengths[edge][:, None]
    for pattern in problem.traction:
        on = boundary.lies_on(segment, pattern)
        points = np.repeat(on, len(rule))
        P = boundary.evaluate(problem.traction_vector(pattern), at[points], flat[points])
        P = P * boundary.measure(at[points], flat[points])[:, None] / units.traction
        asked[on] += P.reshape(-1, len(rule), 2) * stretch[on][:, :, None]
    return _bare(edge, t, np.tile(w, (len(edge), 1)), asked, counts)


def _on_zone(
    pair: int,
    zone: Zone,
    pieces: Pieces,
    b: Array,
    boundary: BoundaryTrace,
    discrete: Discrete,
    units: Units,
) -> list[Strip]:
    """p* on both sides of a pair: first on the secondary."""
    line, partition = zone.state.line, discrete.partition
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    s = pieces.places(rule)
    at, flat = np.repeat(pieces.segment, len(rule)), s.ravel()
    p = (zone.values(np.repeat(pieces.local, len(rule)), flat) @ b).reshape(s.shape)
    d = contact_directions(line.contact, boundary, at, flat).reshape(*s.shape, 2)
    ds = contact_jacobian(boundary, line.contact, at, flat).reshape(s.shape) / units.measure
    length = pieces.stop - pieces.start
    acting = (ds * length[:, None])[:, :, None] * d
    ends = np.column_stack([pieces.start, pieces.stop])
    slope = np.repeat(length[:, None], len(rule), axis=1)
    sides = [(-1.0, pieces.segment, s, slope, ends)]
    if line.contact.primary is not None:
        c = coefficients(pieces.opposite(boundary, pieces.places(samples()))[0])
        t, ends = np.tile(rule, (len(s), 1)), np.tile([0.0, 1.0], (len(s), 1))
        slope = np.abs(at_points(derivative(c), t))
        sides.append((1.0, pieces.facing, at_points(c, t), slope, at_points(c, ends)))
    strips, both = [], np.ones((len(s), 2), dtype=bool)
    for sign, segment, place, slope, ends in sides:
        edge = partition.edge_at(segment, place.mean(axis=1))
        t, slope = partition.on_edges(edge, place), slope / partition.shares[edge][:, None]
        slope = np.maximum(slope, np.finfo(float).tiny)
        action = sign * acting / (slope * partition.edge_lengths[edge][:, None])[:, :, None]
        every, asked = np.arange(len(edge)), action * p[:, :, None]
        strips.append(Strip(edge, t, w * slope, asked, both, action, pair, every, s))
        strips += _uncovered(discrete, edge, partition.on_edges(edge, ends))
    return strips


def _uncovered(discrete: Discrete, edge: Index, ends: Array) -> list[Strip]:
    """The parts of edges that pieces, with `ends` (k, 2) on them, leave: no tractions."""
    low, high = ends.min(axis=1), ends.max(axis=1)
    found, begin, width = [], [], []
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    for number in np.unique(edge):
        mine = np.flatnonzero(edge == number)
        order = mine[np.argsort(low[mine])]
        stops = np.maximum.accumulate(np.concatenate([[0.0], high[order]]))
        for a, b in zip(stops, np.append(low[order], 1.0), strict=True):
            if b - a > COVERED:
                found.append(number)
                begin.append(a)
                width.append(b - a)
    if not found:
        return []
    size = np.array(width)[:, None]
    place = np.array(begin)[:, None] + size * rule
    return [_bare(np.array(found), place, size * w, np.zeros((*place.shape, 2)))]
