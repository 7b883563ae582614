"""The choice of p* for all pairs together."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ....arrays import Array
from ....fem import BoundaryTrace
from ....lagrange import gauss
from ..data import Discrete, EdgeConditions, Units
from .balance import balanced, line_sums
from .choice import Side, Sums, best_pressure
from .pieces import Pieces
from .zone import Zone, ZonePoints, tractions, zone_points


def selected(
    zones: Sequence[Zone],
    every_pieces: Sequence[Pieces],
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    stress: ng.CoefficientFunction,
    discrete: Discrete,
    conditions: EdgeConditions,
    units: Units,
    limits: Sequence[Array] | None = None,
) -> tuple[Discrete, Array, list[Array]]:
    """Choose p*: the data with all loads in balance, all tractions (e, 2, r), p* of each pair.

    Parameters
    ----------
    zones, every_pieces : sequence of Zone, of Pieces
        The pairs.
    boundary, displacement, stress
        The discrete solution.
    discrete : Discrete
        The same on the triangles.
    conditions : EdgeConditions
        Of the e edges.
    units : Units
        Of the latter two.
    limits : sequence of ndarray (m,), optional
        Sizes that coefficients of either sign do not exceed, wherever the gap is open; without
        them p* >= 0 on unilateral pairs.

    Returns
    -------
    discrete : Discrete
        With what quadrature has left of balanced loads.
    given : ndarray (e, 2, r)
        Tractions of loads and of p*.
    coefficients : list of ndarray (m,)
        Of p*, each over the unit of stress.
    """
    e, r = conditions.constrained.shape
    starts = np.concatenate([[0], np.cumsum([zone.size for zone in zones])]).astype(int)
    every = sp.eye_array(int(starts[-1])).tocsr()
    wishes = Wishes([], [], np.zeros(len(every.indptr) - 1))
    exerted = [sp.csr_array((2 * e * r, 0))]
    for zone, pieces, (start, stop) in zip(zones, every_pieces, pairwise(starts), strict=True):
        t, w = gauss(2 * discrete.degree + 2)
        points = zone_points(zone.state, pieces, boundary, displacement, units, t, w)
        exerted.append(tractions(discrete, zone, points, e))
        _add(wishes, zone, points, every[start:stop], boundary, stress, discrete, conditions, units)
    pressures = sp.hstack(exerted).tocsr()
    discrete, *balance = balanced(discrete, conditions, pressures)
    if limits is None:
        least = [-np.inf if zone.state.line.contact.bilateral else 0.0 for zone in zones]
        bounds = np.repeat(least, np.diff(starts)), np.full(starts[-1], np.inf)
    else:
        high = np.concatenate([np.zeros(0), *limits])
        wishes.closing[:], bounds = 0.0, (-high, high)
    b = best_pressure(wishes.sides, wishes.sums, wishes.closing, bounds, balance)
    given = conditions.given + (pressures @ b).reshape(e, 2, r)
    return discrete, given, [b[i:j] for i, j in pairwise(starts)]


@dataclass(frozen=True, eq=False)
class Wishes:
    """What p* shall be near to.

    Attributes
    ----------
    sides : list of Side
        Tractions of the discrete stress.
    sums : list of Sums
        Forces along each line.
    closing : ndarray (m,)
        Integrals of the basis functions times the open gap.
    """

    sides: list[Side]
    sums: list[Sums]
    closing: Array


def _add(
    wishes: Wishes,
    zone: Zone,
    points: ZonePoints,
    into: sp.csr_array,
    boundary: BoundaryTrace,
    stress: ng.CoefficientFunction,
    discrete: Discrete,
    conditions: EdgeConditions,
    units: Units,
) -> None:
    """Add those of one pair, whose coefficients are the rows of `into` of all."""
    partition = discrete.partition
    supported = np.unique(partition.ends[~conditions.constrained.any(axis=1)])
    p, total = zone.values(points.local, points.s), 0.0
    for side, softness in _sides(zone, points, p, boundary, stress, discrete, units):
        wishes.sides.append(Side(side.p @ into, side.target, side.weight))
        total += softness
    line = line_sums(zone, boundary, points, supported, units, total)
    wishes.sums.append(Sums(line.moments @ into, line.forces, line.weight, line.open_))
    open_ = np.where(zone.full[points.local], 0.0, np.maximum(points.gap, 0.0))
    wishes.closing[:] += into.T @ (p.T @ (points.weight * open_))


def _sides(
    zone: Zone,
    points: ZonePoints,
    p: sp.csr_array,
    boundary: BoundaryTrace,
    stress: ng.CoefficientFunction,
    discrete: Discrete,
    units: Units,
) -> list[tuple[Side, float]]:
    """What -sigma_n is on both bodies where p* may act, and the compliance of each."""
    used = np.flatnonzero(np.diff(p.indptr) > 0)
    found = []
    on_boundary = ng.BoundaryFromVolumeCF(stress)
    law = discrete.law[discrete.partition.owner[0]]
    compliance = np.linalg.inv(law)[:, [0, 1], [0, 1]].max(axis=1)
    for sign, segment, s in ((1, points.segment, points.s), (-1, points.facing, points.facing_s)):
        at = used[segment[used] >= 0]
        if at.size == 0:
            continue
        sigma = boundary.evaluate(on_boundary, segment[at], s[at]).reshape(-1, 2, 2)
        normal, d = boundary.normal(segment[at], s[at]), points.direction[at]
        target = -sign * np.einsum("ki,kij,kj->k", d, sigma, normal) / units.stress
        target /= np.abs((normal * d).sum(axis=1))
        edge = discrete.partition.edge_at(segment[at], s[at])
        softness = compliance[edge]
        weight = points.weight[at] * discrete.partition.edge_lengths[edge] * softness
        found.append((Side(p[at], target, weight), float(np.median(softness))))
    return found
