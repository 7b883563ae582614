"""Residuals on Gamma_K: tractions of both sides, complementarity, penetration, data followed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import partial

import numpy as np
from numpy.polynomial.legendre import legvander

from ...arrays import Array, Index, Mask
from ...contact import ContactLine, ContactState, Pieces, prescribed_gap
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ..terms import (
    DATA_BONUS,
    BoundaryResidual,
    BoundaryTerms,
    PressureShare,
    ScaledSolution,
    Squares,
)
from .facing import FacingPoints, covered_parts, facing_points, pieces_of

ALIKE = 1 - 1e-6  # cosine of directions from which points of two pairs at a node are one
GAP_NOISE = 4e-15  # of a gap, relative to the displacement and, where it is measured, to positions
BUMP = 2.0  # |w| |d_s w| over the largest w^2; 1 at least, 1.2 to 1.7 of hats, Gauss's, parabolas
UNRESOLVED = 0.1  # distance of a gap from polynomials over its range, from which it is followed
NO_GAP = 1e-12  # ... relative to the gap, below which there is none
DIVIDED = 4  # parts of a piece whose gap is followed
PARTS = 100_000  # pieces looked at, from which no more are divided


def following_gap(boundary: BoundaryTrace, line: ContactLine, pieces: Pieces, order: int) -> Pieces:
    """Pieces divided until `gap` data are polynomials on each, by its Gauss points of `order`.

    Or until `PARTS` are reached. Gaps between measured curves are resolved by those.
    """
    gap, rule = line.contact.gap, gauss(order)[0]
    if gap is None or isinstance(gap, float) or len(pieces.local) == 0:
        return pieces
    ends = np.concatenate([[0.0], rule, [1.0]])
    between = (ends[1:] + ends[:-1]) / 2
    basis = [legvander(2 * s - 1, len(rule) - 1) for s in (rule, between)]
    follow = basis[1] @ np.linalg.inv(basis[0])
    done, number = [], 0

    while len(pieces.local):
        length = pieces.stop - pieces.start
        segment = line.segments[pieces.local]
        at_rule, at_between = (
            _gap_at(boundary, line, segment, pieces.start[:, None] + length[:, None] * s)
            for s in (rule, between)
        )
        number += len(pieces.local)
        low, high = (f(at_rule, axis=1) for f in (np.min, np.max))
        allowed = UNRESOLVED * (high - low) + NO_GAP * np.abs(at_rule).max()
        rough = np.abs(at_between - at_rule @ follow.T).max(axis=1) > allowed
        rough &= number < PARTS
        done.append(_select(pieces, np.flatnonzero(~rough)))
        pieces = _select(pieces, np.repeat(np.flatnonzero(rough), DIVIDED))
        step = (pieces.stop - pieces.start) / DIVIDED
        start = pieces.start + step * np.tile(np.arange(DIVIDED), rough.sum())
        pieces = replace(pieces, start=start, stop=start + step)
    if len(done) == 1:
        return done[0]
    parts = {name.name: [getattr(x, name.name) for x in done] for name in fields(Pieces)}
    found = Pieces(**{name: np.concatenate(values) for name, values in parts.items()})
    return _select(found, np.lexsort((found.start, found.local)))


def _select(pieces: Pieces, at: Index) -> Pieces:
    """Pieces of the numbers `at` (n,)."""
    return Pieces(**{name.name: getattr(pieces, name.name)[at] for name in fields(Pieces)})


def _gap_at(boundary: BoundaryTrace, line: ContactLine, segment: Index, s: Array) -> Array:
    """Data of the gap (r, n) at `s` (r, n) of segments (r,), lengths."""
    every, where = np.repeat(segment, s.shape[1]), s.ravel()
    x = boundary.point(every, where)
    return prescribed_gap(line.contact, boundary, every, where, x).reshape(s.shape)


def closing_energy(
    solution: ScaledSolution,
    where: tuple[Index, Array, Array],
    stiffness: Array,
    w: Array,
    *,
    or_more: bool = False,
) -> Array:
    """Energy (k,) of a displacement `w` (k,) of the boundary, without a unit: c |w|^2 h / l.

    l is the element's diameter h, or where it is shorter the length |w| / |d_s w| in which w
    changes on the segment: |w| |d_s w| bounds the square of w in H^(1/2). Of a w that jumps it is
    infinite; where more than w does as well it is at most that of a bump as high as w.

    Parameters
    ----------
    solution : ScaledSolution
        In units of its own.
    where : tuple of ndarray (k,), (k,), (k, 2)
        Segments, weights of the quadrature and positions of the points, in order along segments.
    stiffness : ndarray (k,)
        c, a modulus over h.
    w : ndarray (k,)
        The displacement.
    or_more : bool
        Whether a larger displacement closes the gap as well.
    """
    segment, weight, position = where
    change = np.diff(w) ** 2 * (segment[1:] == segment[:-1])
    if not change.any():
        return stiffness * w**2
    size = len(solution.boundary.region)
    apart = np.linalg.norm(np.diff(position, axis=0), axis=1)
    # Points coincide to round-off at a jump.
    steep = np.divide(change, apart, out=np.zeros_like(change), where=apart > 0)
    steep *= solution.boundary.model.measure(position[1:])
    square, rise = (
        np.bincount(at, x, size) for at, x in ((segment, weight * w**2), (segment[1:], steep))
    )
    seen = np.bincount(segment[1:], apart * (segment[1:] == segment[:-1]), size)
    whole = solution.boundary.lengths(np.arange(size))
    sloping = rise * whole / np.where(seen > 0, seen, np.inf)
    h = solution.diameter[solution.boundary.element]
    ratio = np.divide(sloping, square, out=np.zeros(size), where=square > 0)
    times = h * np.sqrt(ratio)
    if or_more:
        most = np.zeros(size)
        np.maximum.at(most, segment, solution.boundary.model.measure(position) * w**2)
        times = np.minimum(
            times, BUMP * h * np.divide(most, square, out=np.zeros(size), where=square > 0)
        )
    return stiffness * w**2 * np.maximum(times, 1)[segment]


@dataclass(frozen=True, eq=False)
class _Side:
    """One body's tractions at the k points of a line, per unit of s (P1) or eta (P2).

    The last axis of `along` (k, 2) and `across` (k, 2, 2) is the traction sigma_h n, the former
    with pi_h, and that of a unit pressure. `weight` (k,) is that of squared tractions, `stiffness`
    (k,) that of squared depths.
    """

    segment: Index
    s: Array
    element: Index
    weight: Array
    stiffness: Array
    along: Array
    across: Array


def on_contact(
    solution: ScaledSolution, pair: ContactState, pairs: Sequence[ContactState]
) -> BoundaryTerms:
    """Residuals on both sides of one pair.

    Parameters
    ----------
    solution : ScaledSolution
        In units of its own.
    pair : ContactState
        Contact forces and state of its points, in the units of the data.
    pairs : sequence of ContactState
        All of the problem.
    """
    boundary, line = solution.boundary, pair.line
    nodal, active = at_nodes(boundary, pair, pairs)
    pieces, whole = pieces_of(boundary, line, np.asarray(np.isfinite(nodal).any(axis=1)))
    if len(pieces.local) == 0:
        return BoundaryTerms()
    order = 2 * solution.order + DATA_BONUS
    points = facing_points(boundary, line, following_gap(boundary, line, pieces, order), order)
    nodal = pressure_on_segments(nodal, boundary.places(line.segments))
    pressure = (boundary.shapes(points.segment, points.s) * nodal[points.local]).sum(axis=1)
    pressure /= solution.unit
    full = np.asarray(active.all(axis=1))[points.local]
    sides = [_side(solution, points, pressure, own=True)]
    if line.contact.primary is not None:
        sides.append(_side(solution, points, -pressure, own=False))
    residuals = [_tangential(side) for side in sides]  # (3.11), (3.11')
    residuals += _normal(sides, pressure, full, line.contact.bilateral)  # (3.10), (3.10')
    # Where both bodies meet the softer gives way to a depth.
    stiffness = np.min([side.stiffness for side in sides], axis=0)
    closed, depth = _gap_squares(solution, line, points, (pressure, full, stiffness))
    squares = []
    for side in sides:
        share = points.weight / len(sides)
        for name, values in (("complementarity", closed), ("penetration", depth)):
            squares.append(Squares(name, side.element, share * values))
    return BoundaryTerms(residuals, squares, covered_parts(boundary, line, pieces, whole))


def at_nodes(
    boundary: BoundaryTrace, pair: ContactState, pairs: Sequence[ContactState]
) -> tuple[Array, Mask]:
    """Pressure and state of the points at the nodes of each segment of the secondary.

    Where the point is another pair's, as between two primaries, that one's.

    Parameters
    ----------
    boundary : BoundaryTrace
        The boundary.
    pair : ContactState
        Of m points on k segments.
    pairs : sequence of ContactState
        All of the problem.

    Returns
    -------
    pressure : ndarray (k, order + 1)
        Force over weight, a force per area; NaN without a point, at an end of Gamma_K on Gamma_u.
    active : ndarray of bool (k, order + 1)
        Whether it is in contact; without a point true.
    """
    line = pair.line
    pressure = np.append(pair.pressure, np.nan)[line.rows]
    active = np.append(pair.active, True)[line.rows]
    nodes, (segment, s) = boundary.nodes[line.segments].ravel(), boundary.at_nodes(line.segments)
    for other in pairs if (line.rows < 0).any() else ():
        if other is pair:
            continue
        at = np.flatnonzero(np.isnan(pressure).ravel() & np.isin(nodes, other.line.node))
        if at.size == 0:
            continue
        d = boundary.exact_normal(segment[at], s[at])
        if line.contact.direction is not None:
            d[:] = line.contact.direction
        # At a corner the point whose direction is the nearer one.
        alike = np.where(nodes[at, None] == other.line.node, d @ other.line.direction.T, -1.0)
        best, same = alike.argmax(axis=1), alike.max(axis=1) > ALIKE
        pressure.ravel()[at[same]] = other.pressure[best[same]]
        active.ravel()[at[same]] = other.active[best[same]]
    return pressure, active


def pressure_on_segments(values: Array, places: Array) -> Array:
    """Nodal values (k, order + 1) of pi_h on each segment of the secondary.

    At a node without a value, NaN, what the polynomial through the segment's other nodes has there;
    0 where there are none.

    Parameters
    ----------
    values : ndarray (k, order + 1)
        Pressures at the nodes.
    places : ndarray (k, order + 1)
        Parameters of the nodes.
    """
    missing = np.isnan(values)
    values = np.where(missing, 0.0, values)
    for k in np.flatnonzero(missing.any(axis=1) & ~missing.all(axis=1)):
        known = ~missing[k]
        powers = np.vander(2 * places[k] - 1, int(known.sum()))
        values[k, missing[k]] = powers[missing[k]] @ np.linalg.solve(
            powers[known], values[k, known]
        )
    return values


def _side(solution: ScaledSolution, points: FacingPoints, pressure: Array, *, own: bool) -> _Side:
    """The tractions of the secondary, or those of the primary; `pressure` (k,) is pi_h or -pi_h."""
    boundary, d = solution.boundary, points.direction
    segment, s = (points.segment, points.s) if own else (points.facing, points.facing_s)
    stretch, element = points.stretch[0 if own else 1], boundary.element[segment]
    t = np.stack([solution.traction(segment, s), boundary.normal(segment, s)], axis=2)
    t *= stretch[:, None, None]
    along = np.einsum("kij,ki->kj", t, d)
    across = t - d[:, :, None] * along[:, None, :]
    along[:, 0] += pressure
    return _Side(
        segment=segment,
        s=s,
        element=element,
        weight=solution.edge_weight[element] * points.weight / stretch,
        stiffness=solution.rigidity[element] / solution.diameter[element],
        along=along,
        across=across,
    )


def _tangential(side: _Side) -> BoundaryResidual:
    """The traction across the direction of contact: no friction."""
    share = PressureShare(np.arange(len(side.s)), side.segment, side.s, side.across[..., 1])
    return BoundaryResidual("tangential", side.element, side.weight, side.across[..., 0], [share])


def _normal(
    sides: list[_Side], pressure: Array, full: Mask, bilateral: bool
) -> list[BoundaryResidual]:
    """The traction along it plus the positive part of pi_h; in contact half the jump.

    Any pressure that is not negative may stand for pi_h, by which the estimate compares both sides:
    where a segment is in contact with all its nodes that is the mean of both tractions, and the
    stiffer body takes up the difference. `pressure` and `full` (k,) are at all points.
    """
    own, other = sides[0], sides[-1]
    tension = np.zeros_like(pressure) if bilateral else np.maximum(-pressure, 0)
    signs = (1, -1)[: len(sides)]
    if len(sides) == 1:
        full = np.zeros_like(full)
    elif not bilateral:
        full = full & (pressure + (other.along[:, 0] - own.along[:, 0]) / 2 >= 0)
    at, least = np.flatnonzero(full), np.min([side.weight for side in sides], axis=0)
    residuals = []
    for side, opposite, sign in zip(sides, sides[::-1], signs, strict=True):
        value = side.along.copy()
        value[:, 0] += sign * tension
        value[at] = side.along[at] / 2
        value[at, 0] += opposite.along[at, 0] / 2
        factor = opposite.along[at, 1:] / 2
        shares = [
            PressureShare(at, opposite.segment[at], opposite.s[at], factor),
            PressureShare(np.arange(len(side.s)), side.segment, side.s, value[:, 1:]),
        ]
        weight = np.where(full, least, side.weight)
        residuals.append(BoundaryResidual("pressure", side.element, weight, value[:, :1], shares))
    return residuals


def _gap_squares(
    solution: ScaledSolution,
    line: ContactLine,
    points: FacingPoints,
    state: tuple[Array, Mask, Array],
) -> tuple[Array, Array]:
    """Squares (k,) of complementarity and of penetration, per unit of s or eta.

    `state` are the pressure, whether all nodes of the segment are in contact, and the stiffness of
    the softer body, (k,) each.
    """
    boundary, contact = solution.boundary, line.contact
    pressure, full, stiffness = state
    u = boundary.evaluate(solution.displacement, points.segment, points.s)
    noise = np.full(len(points.s), GAP_NOISE * np.abs(u).max())
    if contact.gap is None:
        noise[points.distance != 0] += GAP_NOISE * np.abs(points.position).max()
    if contact.primary is not None:
        u -= boundary.evaluate(solution.displacement, points.facing, points.facing_s)
    gap = points.distance - (u * points.direction).sum(axis=1)
    gap[np.abs(gap) <= noise] = 0.0  # its root counts: 1e-16 would be an estimate of 1e-8
    gap /= solution.strain
    opening, depth = np.maximum(gap, 0), np.minimum(gap, 0)
    where = points.segment, points.weight, points.position
    cost = partial(closing_energy, solution, where, stiffness)
    if contact.bilateral:  # Remark 3.3: apart is as wrong as overlapping, and any force is right
        return np.zeros_like(gap), cost(gap)
    closed = np.maximum(pressure, 0) * opening  # (3.12), (3.12')
    closing = np.minimum(closed, cost(opening))
    # (3.9), (3.9')
    return np.where(full, closing, closed), cost(depth, or_more=True)
