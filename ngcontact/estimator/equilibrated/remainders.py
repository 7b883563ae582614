"""Tractions on curves and on facing sides that polynomials on the edges do not meet."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...arrays import Array, Index
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ...problem import Problem
from .data import ROUND_OFF, Discrete, Units, legendre_values, tractions_on_curves
from .liftings import at_points, coefficients, derivative, samples
from .pressures import Pieces, Zone, contact_directions, contact_jacobian

COVERED = 1e-7  # share of an edge below which a part that faces nothing is none
NOISE = 1e-13  # of a traction, relative to the largest: met but for round-off


def missed_tractions(
    problem: Problem,
    boundary: BoundaryTrace,
    discrete: Discrete,
    stress: tuple[Array, Array],
    zones: Sequence[Zone],
    every_pieces: Sequence[Pieces],
    pressures: Sequence[Array],
    units: Units,
) -> Array:
    """Norms (e,) of what the stress misses of tractions on curved edges and on Gamma_K.

    Parameters
    ----------
    problem, boundary, discrete, units
        The data.
    stress : tuple of ndarray (n, 3, m), (n, 3, r)
        Coefficients of the stress, and of its tractions on the edges.
    zones, every_pieces : sequence of Zone, of Pieces
        The pairs.
    pressures : sequence of ndarray (m,)
        Coefficients of p* of each.
    """
    squares = np.zeros(len(discrete.partition.ends))
    covered = np.zeros(len(squares), dtype=bool)
    largest = np.abs(stress[0]).max(initial=0.0)
    for zone, pieces, b in zip(zones, every_pieces, pressures, strict=True):
        for edge, square in _on_zone(zone, pieces, b, boundary, discrete, stress, units):
            np.add.at(squares, edge, square)
            covered[edge] = True
    if discrete.curves.edge.size:
        edge, square = _on_curves(problem, boundary, discrete, stress, units)
        kept = ~covered[edge]
        squares[edge[kept]] += square[kept]
    norms = np.sqrt(squares)
    partition = discrete.partition
    touching = partition.touching(discrete.balance.at_axis(partition))
    noise = np.where(touching, ROUND_OFF, NOISE) * np.sqrt(partition.edge_lengths) * largest
    return np.where(norms > noise, norms, 0.0)


def _density(
    discrete: Discrete, stress: tuple[Array, Array], edge: Index, t: Array
) -> tuple[Array, Array]:
    """Tractions (k, q, 2) of the stress per chord at `t` (k, q) of edges, and ds per chord."""
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


def _on_curves(
    problem: Problem,
    boundary: BoundaryTrace,
    discrete: Discrete,
    stress: tuple[Array, Array],
    units: Units,
) -> tuple[Index, Array]:
    """Curved edges (j,), and squared norms (j,) of the loads there less the tractions."""
    partition, edge = discrete.partition, discrete.curves.edge
    segment = partition.segment[edge]
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    t = np.tile(rule, (len(edge), 1))
    s = np.where(partition.along[edge][:, None], t, 1 - t)
    density, stretch = _density(discrete, stress, edge, t)
    at, flat = np.repeat(segment, len(rule)), s.ravel()
    free = np.zeros((len(edge), 2), dtype=bool)
    for pattern, components in problem.displacement.items():
        on = boundary.lies_on(segment, pattern)
        for axis, value in enumerate(components):
            if value is not None:
                free[on, axis] = True
    for pattern in problem.traction:
        on = boundary.lies_on(segment, pattern)
        points = np.repeat(on, len(rule))
        P = boundary.evaluate(problem.traction_vector(pattern), at[points], flat[points])
        P = P * boundary.measure(at[points], flat[points])[:, None] / units.traction
        density[on] -= P.reshape(-1, len(rule), 2) * stretch[on][:, :, None]
    density[np.broadcast_to(free[:, None], density.shape)] = 0.0
    chord = partition.edge_lengths[edge]
    return edge, chord * (w * (density**2).sum(axis=2) / stretch).sum(axis=1)


def _on_zone(
    zone: Zone,
    pieces: Pieces,
    b: Array,
    boundary: BoundaryTrace,
    discrete: Discrete,
    stress: tuple[Array, Array],
    units: Units,
) -> list[tuple[Index, Array]]:
    """Edges (k,) of both sides, and squared norms (k,) of p* less their tractions."""
    line, partition = zone.state.line, discrete.partition
    if pieces.local.size == 0:
        return []
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    s = pieces.places(rule)
    at, flat = np.repeat(pieces.segment, len(rule)), s.ravel()
    p = (zone.values(np.repeat(pieces.local, len(rule)), flat) @ b).reshape(s.shape)
    d = contact_directions(line.contact, boundary, at, flat).reshape(*s.shape, 2)
    ds = contact_jacobian(boundary, line.contact, at, flat).reshape(s.shape) / units.measure
    asked = (p * ds * (pieces.stop - pieces.start)[:, None])[:, :, None] * d
    length = pieces.stop - pieces.start
    sides = [(-1.0, pieces.segment, s, np.repeat(length[:, None], len(rule), axis=1))]
    if line.contact.primary is not None:
        c = coefficients(pieces.opposite(boundary, pieces.places(samples()))[0])
        t = np.tile(rule, (len(s), 1))
        sides.append((1.0, pieces.facing, at_points(c, t), np.abs(at_points(derivative(c), t))))
    found = []
    for sign, segment, place, slope in sides:
        edge = partition.edge_at(segment, place.mean(axis=1))
        t, slope = partition.on_edges(edge, place), slope / partition.shares[edge][:, None]
        density, stretch = _density(discrete, stress, edge, t)
        chord = partition.edge_lengths[edge]
        slope = np.maximum(slope, np.finfo(float).tiny)
        off = density - sign * asked / (slope * chord[:, None])[:, :, None]
        square = (w * slope * (off**2).sum(axis=2) / stretch).sum(axis=1)
        found.append((edge, chord * square))
        bare = _uncovered(discrete, stress, edge, t)
        if bare is not None:
            found.append(bare)
    return found


def _uncovered(
    discrete: Discrete, stress: tuple[Array, Array], edge: Index, t: Array
) -> tuple[Index, Array] | None:
    """Edges that pieces, with points `t` (k, q), cover in part; squared tractions beside."""
    low, high = t.min(axis=1), t.max(axis=1)
    found, squares = [], []
    rule, w = gauss(4 * discrete.degree * discrete.geometry)
    inset = rule[0]  # of the outermost point of a piece, relative to its length
    for number in np.unique(edge):
        mine = np.flatnonzero(edge == number)
        reach = (high[mine] - low[mine]) / (1 - 2 * inset)
        starts = low[mine] - inset * reach
        order = np.argsort(starts)
        ends = np.concatenate([[0.0], (starts + reach)[order]])
        begins = np.concatenate([starts[order], [1.0]])
        for a, b in zip(np.maximum.accumulate(ends), begins, strict=True):
            if b - a > COVERED:
                place = (a + (b - a) * rule)[None]
                density, stretch = _density(discrete, stress, np.array([number]), place)
                square = (w * (density[0] ** 2).sum(axis=1) / stretch[0]).sum()
                found.append(number)
                squares.append((b - a) * discrete.partition.edge_lengths[number] * square)
    return (np.array(found, dtype=np.intp), np.array(squares)) if found else None
