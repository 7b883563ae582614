"""Residuals on Gamma_K: tractions of both sides, complementarity, penetration."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index, Mask
from ..contact import ContactLine, ContactState, at_quadrature, partners, prescribed_gap
from ..fem import BoundaryTrace
from ..lagrange import gauss_lobatto, lagrange
from .terms import (
    DATA_BONUS,
    BoundaryResidual,
    BoundaryTerms,
    PressureShare,
    ScaledSolution,
    Squares,
)

GAP_NOISE = 4e-15  # of a gap, relative to the displacement and, where it is measured, to positions


@dataclass(frozen=True, eq=False)
class _Points:
    """Quadrature points on a contact line, k of them.

    `weight` (k,) is that of the quadrature in s (P1) or eta (P2), `direction` (k, 2) d, `pressure`
    (k,) pi_h over the unit of stress, `full` (k,) whether all nodes of the segment are in contact,
    `facing` (k,) and `facing_s` (k,) the partner point, `met` (k,) whether there is one or an
    obstacle, `distance` (k,) the gap eps before deformation.
    """

    segment: Index
    s: Array
    weight: Array
    position: Array
    direction: Array
    pressure: Array
    full: Mask
    facing: Index
    facing_s: Array
    met: Mask
    distance: Array


@dataclass(frozen=True, eq=False)
class _Side:
    """One body's tractions at the points `at` (k,) of a line, per unit of s (P1) or eta (P2).

    The last axis of `along` (k, 2) and `across` (k, 2, 2) is the traction sigma_h n, the former
    with pi_h, and that of a unit pressure. `weight` (k,) is that of squared tractions, `stiffness`
    (k,) that of squared depths.
    """

    at: Index
    segment: Index
    s: Array
    element: Index
    weight: Array
    stiffness: Array
    along: Array
    across: Array


def on_contact(solution: ScaledSolution, pair: ContactState) -> BoundaryTerms:
    """Residuals on both sides of one pair.

    Parameters
    ----------
    solution : ScaledSolution
        In units of its own.
    pair : ContactState
        Contact forces and state of its points, in the units of the data.
    """
    line = pair.line
    if not line.faces.any():
        return BoundaryTerms()
    points = _quadrature_points(solution, pair)
    covered = [points.segment]
    sides = [_side(solution, line, points, own=True)]
    if line.contact.primary is not None:
        sides.append(_side(solution, line, points, own=False))
        covered.append(_met_from_behind(solution.boundary, line))
    # Where both bodies meet the stiffer takes up a jump, the softer gives way to a depth.
    least = np.full((2, len(points.s)), np.inf)
    for side in sides:
        least[:, side.at] = np.minimum(least[:, side.at], [side.weight, side.stiffness])
    residuals = []
    for side, other in zip(sides, sides[::-1], strict=True):
        residuals.append(_tangential(side))  # (3.11), (3.11')
        residuals.append(_normal(side, other, points.full, least[0]))  # (3.10), (3.10')
    closed, depth = _gap_squares(solution, line, points, least[1])
    squares = []
    for side in sides:
        share = points.weight[side.at] / len(sides)
        for name, values in (("complementarity", closed), ("penetration", depth)):
            squares.append(Squares(name, side.element, share * values[side.at]))
    return BoundaryTerms(residuals, squares, np.concatenate(covered))


def pressure_on_segments(line: ContactLine, pressure: Array, order: int) -> Array:
    """Nodal values (k, order + 1) of pi_h on each segment of the secondary.

    The pressure of the contact point at the node; at a node without one, an end of Gamma_K on
    Gamma_u, what the polynomial through the segment's other nodes has there.

    Parameters
    ----------
    line : ContactLine
        The pair and its m points on k segments.
    pressure : ndarray (m,)
        At its points, force over weight: a force per area.
    order : int
        Degree of pi_h.
    """
    values = np.append(pressure, 0.0)[line.rows]
    nodes = gauss_lobatto(order)
    for k in np.flatnonzero((line.rows < 0).any(axis=1) & line.faces):
        known = line.rows[k] >= 0
        if known.any():
            degree = known.sum() - 1
            scaled = None if degree else (0, 1)  # one node spans no interval, which old NumPy asks
            fit = np.polynomial.Polynomial.fit(nodes[known], values[k, known], degree, scaled)
            values[k, ~known] = fit(nodes[~known])
    return values


def _quadrature_points(solution: ScaledSolution, pair: ContactState) -> _Points:
    """Points on the segments that face the primary, and what is opposite to them."""
    line, contact, boundary, order = pair.line, pair.line.contact, solution.boundary, solution.order
    local, segment, s, weight = at_quadrature(line, boundary, 2 * order + DATA_BONUS)
    nodal = pressure_on_segments(line, pair.pressure, order)
    pressure = (lagrange(order, s) * nodal[local]).sum(axis=1) / solution.unit
    full = np.asarray(np.append(pair.active, True)[line.rows].all(axis=1))[local]
    x = boundary.point(segment, s)
    if contact.direction is None:
        d = boundary.normal(segment, s)
    else:
        d = np.tile(contact.direction, (len(s), 1))
    if contact.primary is None:
        facing, facing_s, distance = np.full(len(s), -1), np.zeros(len(s)), np.zeros(len(s))
        met = np.ones(len(s), dtype=bool)
    else:
        facing, facing_s, distance, _ = partners(boundary, line.facing, segment, x, d)
        met = facing >= 0
    if contact.gap is not None:
        distance = prescribed_gap(contact, boundary, segment, s, x)
    return _Points(
        *(segment, s, weight, x, d, pressure, full),
        *(facing, facing_s, met, distance),
    )


def _met_from_behind(boundary: BoundaryTrace, line: ContactLine) -> Index:
    """Segments of the primary whose middle faces the secondary, (q,)."""
    middle = np.full(len(line.facing), 0.5)
    x = boundary.point(line.facing, middle)
    if line.contact.direction is None:
        d = boundary.normal(line.facing, middle)
    else:
        d = np.tile(-np.array(line.contact.direction), (len(x), 1))
    back, *_ = partners(boundary, line.segments, line.facing, x, d)
    return line.facing[back >= 0]


def _side(solution: ScaledSolution, line: ContactLine, points: _Points, *, own: bool) -> _Side:
    """The tractions of the secondary, or those of the primary where it is met."""
    boundary = solution.boundary
    if own:
        at, segment, s = np.arange(len(points.s)), points.segment, points.s
    else:
        at = np.flatnonzero(points.met)
        segment, s = points.facing[at], points.facing_s[at]
    d, element = points.direction[at], boundary.element[segment]
    normal = boundary.normal(segment, s)
    stretch = np.ones(len(s))  # ds per unit of s or eta
    if line.contact.direction is not None:
        stretch = 1 / np.abs((normal * d).sum(axis=1))
    t = np.stack([solution.traction(segment, s), normal], axis=2)
    t *= stretch[:, None, None]
    along = np.einsum("kij,ki->kj", t, d)
    across = t - d[:, :, None] * along[:, None, :]
    along[:, 0] += points.pressure[at] if own else -points.pressure[at]
    return _Side(
        at=at,
        segment=segment,
        s=s,
        element=element,
        weight=solution.edge_weight[element] * points.weight[at] / stretch,
        stiffness=solution.mu[element] / solution.diameter[element],
        along=along,
        across=across,
    )


def _tangential(side: _Side) -> BoundaryResidual:
    """The traction across the direction of contact: no friction."""
    share = PressureShare(np.arange(len(side.at)), side.segment, side.s, side.across[..., 1])
    return BoundaryResidual("tangential", side.element, side.weight, side.across[..., 0], [share])


def _normal(side: _Side, other: _Side, full: Mask, least: Array) -> BoundaryResidual:
    """The traction along it plus pi_h; half the difference of both sides where in contact.

    `full` and `least` (k,), whether and with which weight that holds, are over all points.
    """
    mine, theirs = np.arange(len(side.at)), np.zeros(0, dtype=np.intp)
    if other is not side:
        _, mine, theirs = np.intersect1d(
            side.at, other.at[full[other.at]], assume_unique=True, return_indices=True
        )
        theirs = np.flatnonzero(full[other.at])[theirs]
    value, weight = side.along.copy(), side.weight.copy()
    shares = []
    if other is not side:
        weight[mine] = least[side.at[mine]]
        value[mine] /= 2
        value[mine, 0] += other.along[theirs, 0] / 2
        factor = other.along[theirs, 1:] / 2
        shares.append(PressureShare(mine, other.segment[theirs], other.s[theirs], factor))
    shares.append(PressureShare(np.arange(len(side.at)), side.segment, side.s, value[:, 1:]))
    return BoundaryResidual("pressure", side.element, weight, value[:, :1], shares)


def _gap_squares(
    solution: ScaledSolution, line: ContactLine, points: _Points, stiffness: Array
) -> tuple[Array, Array]:
    """Squares (k,) of complementarity and of penetration, per unit of s or eta.

    `stiffness` (k,) is that of the softer body.
    """
    boundary, contact = solution.boundary, line.contact
    u = boundary.evaluate(solution.displacement, points.segment, points.s)
    noise = np.full(len(points.s), GAP_NOISE * np.abs(u).max())
    if contact.gap is None:
        noise[points.distance != 0] += GAP_NOISE * np.abs(points.position).max()
    if contact.primary is not None:
        at = np.flatnonzero(points.met)
        there = points.facing[at], points.facing_s[at]
        u[at] -= boundary.evaluate(solution.displacement, *there)
    opening = points.distance - (u * points.direction).sum(axis=1)
    gap = np.where(points.met, opening, 0.0)
    gap[np.abs(gap) <= noise] = 0.0  # its root counts: 1e-16 would be an estimate of 1e-8
    gap /= solution.strain
    # Bilateral contact, Remark 3.3: apart is as wrong as overlapping, and any force is right.
    depth = stiffness * gap**2 * ((gap < 0) | contact.bilateral)  # (3.9), (3.9')
    closed = np.maximum(points.pressure, 0) * np.maximum(gap, 0)  # (3.12), (3.12')
    closed = closed * (not contact.bilateral)
    closed = np.where(points.full, np.minimum(closed, stiffness * gap**2), closed)
    return closed, depth
