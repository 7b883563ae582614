"""Sides of both bodies that face each other, and the gap between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np
from scipy.special import comb

from ...arrays import Array, Index, Mask
from ...contact import FACING, ContactState, divided, jacobian, partners, prescribed_gap
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...lagrange import gauss, lagrange, lagrange_derivative
from ...problem import Contact
from .cells import Cells

SAME = 1e-7  # parameters of a segment that are one place
DATA = 16  # degree of the polynomials that stand for gaps and prescribed displacements on a side
MARGIN = 0.05  # of a segment, by which p* goes beyond the last zero of the gap
APART = 0.1  # of a segment: ends of contact nearer to a vertex are no vertices
PLACES, WEIGHTS = gauss(2 * DATA)
THROUGH = np.linalg.inv(lagrange(DATA, PLACES))  # from values at `PLACES` to Gauss-Lobatto points
NEWTON_STEPS = 12
SAMPLES = 200  # places on a segment among which the last zero of the gap is sought


def at_places(shapes: Callable[[int, Array], Array], t: Array) -> Array:
    """Polynomials (k, j, DATA + 1) of Gauss-Lobatto points, or their derivatives, at t (k, j)."""
    return shapes(DATA, t.ravel()).reshape(*t.shape, -1)


def bernstein(degree: int, t: Array) -> Array:
    """Bernstein polynomials (..., degree + 1) at `t` (...)."""
    i = np.arange(degree + 1)
    return np.asarray(comb(degree, i) * t[..., None] ** i * (1 - t[..., None]) ** (degree - i))


def directions(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """d (k, 2) at `s` (k,) of segments `segment` (k,) of the secondary."""
    if contact.direction is None:
        return trace.exact_normal(segment, s)
    return np.tile(contact.direction, (len(segment), 1))


@dataclass(frozen=True, eq=False)
class Met:
    """k places of a secondary and what they meet: lengths, and the primary's place (-1: none)."""

    gap: Array
    direction: Array
    segment: Index
    s: Array


def met(
    trace: BoundaryTrace,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    segment: Index,
    s: Array,
) -> Met:
    """The gap of u_h, d and the partner at `s` (k,) of segments `segment` (k,)."""
    line, contact = pair.line, pair.line.contact
    x, d = trace.point(segment, s), directions(trace, contact, segment, s)
    other, place, gap, _ = partners(trace, line.facing, segment, x, d)
    if contact.gap is not None:
        gap = prescribed_gap(contact, trace, segment, s, x)
    jump = trace.evaluate(displacement, segment, s)
    at = np.flatnonzero(other >= 0)
    if at.size:
        jump[at] -= trace.evaluate(displacement, other[at], place[at])
    return Met(gap - (jump * d).sum(axis=1), d, other, place)


def cuts_of(
    trace: BoundaryTrace, displacement: ng.CoefficientFunction, pairs: Sequence[ContactState]
) -> tuple[dict[int, Array], list[dict[int, tuple[float, int]]]]:
    """Places s of vertices to come, by segment; where contact ends.

    The latter pair by pair as (s, sign): contact lies towards s = 0 for the sign 1.
    """
    cuts: dict[int, list[float]] = {}
    every = []
    for pair in pairs:
        line, contact = pair.line, pair.line.contact
        ends = _ends(trace, displacement, pair)
        every.append(ends)
        mine: dict[int, list[float]] = {k: [s] for k, (s, _) in ends.items()}
        if contact.primary is not None:
            parts = divided(trace, contact, line.segments, line.facing)
            own = line.segments[parts.local]
            for k, s in zip(np.tile(own, 2), np.append(parts.start, parts.stop), strict=True):
                mine.setdefault(int(k), []).append(float(s))
            k = np.concatenate([line.segments, line.segments, np.repeat(list(mine), [len(s) for s in mine.values()])]).astype(np.intp)
            s = np.concatenate([np.zeros(len(line.segments)), np.ones(len(line.segments)), *mine.values()])
            d = directions(trace, contact, k, s)
            there, t, *_ = partners(trace, line.facing, k, trace.point(k, s), d)
            for m in np.flatnonzero(there >= 0):
                cuts.setdefault(int(there[m]), []).append(float(t[m]))
        for k, places in mine.items():
            cuts.setdefault(k, []).extend(places)
    inside = {k: _inside(np.array(s)) for k, s in cuts.items()}
    return {k: s for k, s in inside.items() if s.size}, every


def _inside(s: Array) -> Array:
    """Rising places strictly between 0 and 1, each once."""
    s = np.sort(s[(s > SAME) & (s < 1 - SAME)])
    return s[np.diff(s, prepend=-1.0) > SAME]


def _ends(
    trace: BoundaryTrace, displacement: ng.CoefficientFunction, pair: ContactState
) -> dict[int, tuple[float, int]]:
    """Where contact ends inside segments that face the other body, away from their vertices."""
    line, found = pair.line, {}
    if line.contact.bilateral:
        return {}
    active = np.append(pair.active, False)[line.rows]
    places = trace.places(line.segments)
    turns = np.diff(active.astype(int), axis=1)
    for i in np.flatnonzero((np.abs(turns).sum(axis=1) == 1) & line.faces):
        j = int(np.flatnonzero(turns[i])[0])
        sign = -int(turns[i, j])
        s = np.linspace(places[i, j], places[i, j + 1], SAMPLES)
        gap = met(trace, displacement, pair, np.full(SAMPLES, line.segments[i]), s).gap
        below = np.flatnonzero(gap < 0)
        edge = (s[below[-1]] if below.size else s[0]) if sign > 0 else (s[below[0]] if below.size else s[-1])
        at = float(edge + sign * MARGIN)
        if APART < at < 1 - APART:
            found[int(line.segments[i])] = (at, sign)
    return found


@dataclass(frozen=True, eq=False)
class Facing:
    """k sides on which the motion along d is bounded: by the other body, an obstacle, a guide.

    Functions are given at the j Gauss points of `PLACES` on each side, t of the secondary's.

    Attributes
    ----------
    pair : ContactState or None
        None for a guide.
    side, other : ndarray of int (k,)
        Of the secondary, and of the primary, -1 without one.
    there : ndarray (k, j)
        Parameters on the primary's sides.
    direction : ndarray (k, j, 2)
        d.
    weight : ndarray (k, j)
        Arc length (P1) or eta (P2) per t, with the model's measure and the weights of Gauss.
    gap : ndarray (k, j)
        Gap of u_h, lengths.
    after : ndarray (k, degree + 1)
        Bernstein coefficients of the gap of u_h + w, not negative.
    closed : ndarray of bool (k,)
        Sides in contact as a whole.
    equality : bool
        Whether the gap is 0 and forces have any sign.
    """

    pair: ContactState | None
    side: Index
    other: Index
    there: Array
    direction: Array
    weight: Array
    gap: Array
    after: Array
    closed: Mask
    equality: bool

    @cached_property
    def back(self) -> Array:
        """t (k, j) of the secondary opposite to the Gauss points of the primary's sides."""
        nodes = self.there @ THROUGH.T
        t = np.where((nodes[:, -1] < nodes[:, 0])[:, None], 1 - PLACES, PLACES)
        for _ in range(NEWTON_STEPS):
            value = np.einsum("kji,ki->kj", at_places(lagrange, t), nodes)
            slope = np.einsum("kji,ki->kj", at_places(lagrange_derivative, t), nodes)
            t = np.clip(t - (value - PLACES) / slope, 0.0, 1.0)
        return t

    @cached_property
    def rates(self) -> Array:
        """|dt| of the secondary per dt of the primary, (k, j), at the latter's Gauss points."""
        slopes = at_places(lagrange_derivative, self.back)
        return np.abs(1 / np.einsum("kji,il,kl->kj", slopes, THROUGH, self.there))

    def on_primary(self, values: Array) -> Array:
        """Functions (k, j, c) of the secondary's t at the Gauss points of the primary's sides."""
        return np.einsum("kji,il,klc->kjc", at_places(lagrange, self.back), THROUGH, values)

    @property
    def lift(self) -> Array:
        """r (k, j): what w adds to the gap."""
        return np.asarray(self.after @ bernstein(self.after.shape[1] - 1, PLACES).T - self.gap)


def facing_of(
    cells: Cells,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    ends: dict[int, tuple[float, int]],
    degree: int,
) -> Facing:
    """What of a pair faces, and the gap after a lifting of `degree`."""
    trace, line, contact = cells.trace, pair.line, pair.line.contact
    side = np.flatnonzero(np.isin(cells.segment, line.segments))
    j = len(PLACES)
    segment, s = cells.on_side(np.repeat(side, j), np.tile(PLACES, len(side)))
    found = met(trace, displacement, pair, segment, s)
    if contact.primary is None:
        faces = (trace.normal(segment, s) * found.direction).sum(axis=1) > FACING
    else:
        faces = found.segment >= 0
    keep = faces.reshape(-1, j).all(axis=1)
    every = keep.repeat(j)
    if contact.primary is not None and (found.gap[faces & ~every] < 0).any():
        raise ContactError("bodies overlap where a side of the mesh faces the other in part")
    side, segment, s = side[keep], segment[every], s[every]
    gap, d = found.gap[every].reshape(-1, j), found.direction[every].reshape(-1, j, 2)
    other, there = np.full(len(side), -1), np.zeros((len(side), j))
    if contact.primary is not None:
        place = found.s[every].reshape(-1, j)
        middle = found.segment[every].reshape(-1, j)[:, j // 2]
        other = cells.side_at(middle, place[:, j // 2])
        there = cells.own_parameter(other, place)
    rate = np.abs(np.diff(cells.span[side], axis=1))
    weight = WEIGHTS * rate * jacobian(trace, contact, segment, s).reshape(-1, j)
    order = np.argsort(line.segments)
    local = order[np.searchsorted(line.segments[order], cells.segment[side])]
    closed = np.append(pair.active, False)[line.rows[local]].all(axis=1)
    for k, (at, sign) in ends.items():
        on = cells.segment[side] == k
        closed[on] = (cells.span[side[on]].mean(axis=1) < at) == (sign > 0)
    closed = closed | contact.bilateral
    after = _after(cells.ends[side], gap, closed, degree)
    after = np.zeros_like(after) if contact.bilateral else after
    return Facing(pair, side, other, there, d, weight, gap, after, closed, contact.bilateral)


def guides_of(cells: Cells, displacement: ng.CoefficientFunction, side: Index, degree: int) -> Facing:
    """Sides (k,) of Gamma_0, as bilateral contact with an obstacle without a gap."""
    k, j = len(side), len(PLACES)
    every, t = np.repeat(side, j), np.tile(PLACES, k)
    segment, s = cells.on_side(every, t)
    x, dx = cells.points(every, t)
    d = cells.trace.exact_normal(segment, s)
    gap = -(cells.trace.evaluate(displacement, segment, s) * d).sum(axis=1)
    ds = np.linalg.norm(dx, axis=1) * cells.trace.model.measure(x)
    return Facing(
        pair=None,
        side=side,
        other=np.full(k, -1),
        there=np.zeros((k, j)),
        direction=d.reshape(k, j, 2),
        weight=WEIGHTS * ds.reshape(k, j),
        gap=gap.reshape(k, j),
        after=np.zeros((k, degree + 1)),
        closed=np.ones(k, dtype=bool),
        equality=True,
    )


def _after(ends: Index, gap: Array, closed: Mask, degree: int) -> Array:
    """Bernstein coefficients (k, degree + 1) of gaps that are nowhere negative, near to `gap`.

    `ends` (k, 2) are the vertices of the sides, at which the gaps of neighbours are one number: 0
    where all of them are `closed` (k,).
    """
    B = bernstein(degree, PLACES) * np.sqrt(WEIGHTS)[:, None]
    c = np.linalg.lstsq(B, (np.sqrt(WEIGHTS) * gap).T, rcond=None)[0].T
    _, number = np.unique(ends, return_inverse=True)
    number = number.reshape(-1, 2)
    value, bare = np.zeros(number.size), np.zeros(number.size, dtype=bool)
    np.maximum.at(value, number, c[:, [0, -1]])
    np.logical_or.at(bare, number[~closed], True)
    value[~bare] = 0.0
    after = np.where(closed[:, None], 0.0, np.maximum(c, 0.0))
    after[:, [0, -1]] = value[number]
    return after
