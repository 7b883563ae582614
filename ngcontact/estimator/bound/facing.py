"""Sides of both bodies that face each other, and the gap between them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import ngsolve as ng
import numpy as np
from scipy.special import comb

from ...arrays import Array, Index, Mask
from ...contact import FACING, ContactState, divided, jacobian, partners, prescribed_gap
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...lagrange import gauss, lagrange
from ...problem import Contact
from .cells import Cells

SAME = 1e-7  # parameters of a segment that are one place
DATA = 16  # degree of the polynomials that stand for gaps and prescribed displacements on a side
ROUND_OFF = 1e-14  # of gaps, relative to coordinates
NEAR = 1e-3  # of a segment: vertices that face each other up to that are one
MARGIN = 0.05  # of a segment, by which p* goes beyond the last zero of the gap
APART = 0.1  # of a segment: ends of contact nearer to a vertex are no vertices
NARROW = 0.1  # of the sides beside it, a side between them on which r does not change
STIFF = 0.1  # sine of the angle to prescribed motions, up to which d is one of them
PLACES, WEIGHTS = gauss(2 * DATA)
THROUGH = np.linalg.inv(lagrange(DATA, PLACES))  # from values there to Gauss-Lobatto points
SAMPLES = 200  # places on a segment among which the last zero of the gap is sought

End: TypeAlias = tuple[int, float, int]  # segment, s, 1 where contact lies towards s = 0 or -1


def bernstein(degree: int, t: Array) -> Array:
    """Bernstein polynomials (..., degree + 1) at `t` (...)."""
    i = np.arange(degree + 1)
    return np.asarray(comb(degree, i) * t[..., None] ** i * (1 - t[..., None]) ** (degree - i))


def directions(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """D (k, 2) at `s` (k,) of segments `segment` (k,) of the secondary."""
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
    trace: BoundaryTrace,
    displacement: ng.CoefficientFunction,
    pairs: Sequence[ContactState],
    more: Sequence[float] = (),
) -> tuple[dict[int, Array], list[list[End]]]:
    """Places s of vertices to come, by segment; where contact ends, pair by pair.

    There are `more` of them on each segment of a secondary.
    """
    cuts: dict[int, list[float]] = {}
    every = []
    length = trace.lengths(np.arange(len(trace.region)))
    size = np.full(trace.space.ndof, np.inf)  # shortest segment at each vertex
    np.minimum.at(size, trace.nodes[:, [0, -1]], length[:, None])

    def nearest(k: Index, s: Array) -> tuple[Index, Array]:
        """The vertices (r,) that are the nearer ends of segments (r,), and how far they are."""
        return trace.nodes[k, np.where(s < 0.5, 0, -1)], np.minimum(s, 1 - s) * length[k]

    for pair in pairs:
        line, contact = pair.line, pair.line.contact
        ends = _ends(trace, displacement, pair)
        every.append(ends)
        k = np.array([segment for segment, _, _ in ends], dtype=np.intp)
        k = np.append(k, np.repeat(line.segments, len(more)))
        s = np.array([*(place for _, place, _ in ends), *(len(line.segments) * list(more))])
        kept = np.ones(len(k), dtype=bool)
        if contact.primary is not None:
            parts = divided(trace, contact, line.segments, line.facing)
            k = np.append(k, np.tile(line.segments[parts.local], 2))
            s = np.concatenate([s, parts.start, parts.stop])
            d = directions(trace, contact, k, s)
            there, t, *_ = partners(trace, line.facing, k, trace.point(k, s), d)
            own, away = nearest(k, s)
            other, beyond = nearest(there, t)
            size_of_both = np.minimum(size[own], size[other])
            near = np.maximum(away, beyond) <= NEAR * size_of_both
            # Whether two vertices are one, the place decides that the secondary's faces.
            corner = (s <= SAME) | (s >= 1 - SAME)
            same = set(zip(own[near & corner].tolist(), other[near & corner].tolist(), strict=True))
            apart = set(own[~near & corner & (there >= 0)].tolist())
            about = np.maximum(away, beyond) <= 2 * NEAR * size_of_both
            one = [
                (a, b) in same or (n and a not in apart)
                for a, b, n in zip(own.tolist(), other.tolist(), near.tolist(), strict=True)
            ]
            kept = ~(about & np.array(one, dtype=bool)) | (there < 0)
            for number, place in zip(
                there[kept & (there >= 0)].tolist(), t[kept & (there >= 0)].tolist(), strict=True
            ):
                cuts.setdefault(number, []).append(place)
        for number, place in zip(k[kept].tolist(), s[kept].tolist(), strict=True):
            cuts.setdefault(number, []).append(place)
    inside = {k: _inside(np.array(s)) for k, s in cuts.items()}
    return {k: s for k, s in inside.items() if s.size}, every


def _inside(s: Array) -> Array:
    """Rising places strictly between 0 and 1, each once."""
    s = np.sort(s[(s > SAME) & (s < 1 - SAME)])
    return s[np.diff(s, prepend=-1.0) > SAME]


def _ends(
    trace: BoundaryTrace, displacement: ng.CoefficientFunction, pair: ContactState
) -> list[End]:
    """Where contact ends inside segments that face the other body, away from their vertices."""
    line, found = pair.line, []
    active = np.append(pair.active, False)[line.rows]
    places = trace.places(line.segments)
    turns = np.diff(active.astype(int), axis=1) * line.faces[:, None]
    for i, j in zip(*np.nonzero(turns * (not line.contact.bilateral)), strict=True):
        s = np.linspace(places[i, j], places[i, j + 1], SAMPLES)
        gap = met(trace, displacement, pair, np.full(SAMPLES, line.segments[i]), s).gap
        sign = -int(turns[i, j])
        inside = np.append(s[gap < 0], s[0 if sign > 0 else -1])
        at = float(sign * (sign * inside).max() + sign * MARGIN)
        if APART < at < 1 - APART:
            found.append((int(line.segments[i]), at, sign))
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
    open : ndarray of bool (k,)
        Sides on which w adds nothing; `after` only tells that the gap of u_h is not negative.
    closed : ndarray of bool (k,)
        Sides in contact as a whole.
    share : ndarray (k, 2)
        Of what w adds to the gap, that the secondary takes at t = 0 and t = 1.
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
    open: Mask
    closed: Mask
    share: Array
    equality: bool

    @property
    def lift(self) -> Array:
        """R (k, j): what w adds to the gap."""
        lift = self.after @ bernstein(self.after.shape[1] - 1, PLACES).T - self.gap
        return np.where(self.open[:, None], 0.0, lift)


def facing_of(
    cells: Cells,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    ends: Sequence[End],
    degree: int,
    held: Array,
    share: float,
) -> Facing:
    """What of a pair faces, and the gap after a lifting of `degree`.

    The secondary takes a `share` of that, but for vertices that cannot move along d; `held` (nv, 2,
    2) are the projections of motions of all vertices on those that are prescribed.
    """
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
    slots = side[~keep]
    side, segment, s = side[keep], segment[every], s[every]
    gap, d = found.gap[every].reshape(-1, j), found.direction[every].reshape(-1, j, 2)
    other, there = np.full(len(side), -1), np.zeros((len(side), j))
    if contact.primary is not None:
        place = found.s[every].reshape(-1, j)
        met_segment = found.segment[every].reshape(-1, j)
        middle = met_segment[:, j // 2]
        other = cells.side_at(middle, place[:, j // 2])
        there = _continued(cells.own_parameter(other, place), met_segment == middle[:, None])
    rate = np.abs(np.diff(cells.span[side], axis=1))
    weight = WEIGHTS * rate * jacobian(trace, contact, segment, s).reshape(-1, j)
    order = np.argsort(line.segments)
    local = order[np.searchsorted(line.segments[order], cells.segment[side])]
    closed = np.append(pair.active, False)[line.rows[local]].all(axis=1)
    middle, nearest = cells.span[side].mean(axis=1), np.full(len(side), np.inf)
    for k, at, sign in ends:
        away = middle - at
        on = (cells.segment[side] == k) & (np.abs(away) < nearest)
        closed[on], nearest[on] = away[on] * sign < 0, np.abs(away[on])
    closed = closed | contact.bilateral
    shares, stiff = _shares(cells, side, other, there, d, held, share)
    noise = ROUND_OFF * np.abs(cells.vertices).max()
    ends_of = _across(cells, slots, side)[cells.ends[side]]
    after, bare = _after(ends_of, gap, closed, stiff, degree, noise)
    if contact.bilateral:
        after, bare = np.zeros_like(after), np.zeros_like(bare)
    kept = side, other, there, d, weight, gap, after, bare, closed, shares
    return Facing(pair, *kept, contact.bilateral)


def _continued(there: Array, own: Mask) -> Array:
    """Parameters (k, j), of which those that are not `own` (k, j) lie beyond the nearer end."""
    for i in np.flatnonzero(~own.all(axis=1)):
        at = np.flatnonzero(own[i])
        rise = np.polyfit(PLACES[at], there[i, at], 1)
        there[i, ~own[i]] = np.clip(np.polyval(rise, PLACES[~own[i]]), 0.0, 1.0)
    return there


def held_motions(cells: Cells, sides: Sequence[Index], directions: Sequence[Array]) -> Array:
    """Projections (nv, 2, 2) of vertices' motions on those that sides (k,) hold.

    They hold motions along `directions` (k, j, 2), from end to end.
    """
    M = np.zeros((len(cells.vertices), 2, 2))
    for side, direction in zip(sides, directions, strict=True):
        d = direction[:, [0, -1]]
        np.add.at(M, cells.ends[side], d[..., :, None] * d[..., None, :])
    size, vectors = np.linalg.eigh(M)
    vectors = np.where(size[:, None] > STIFF**2 * size[:, None, -1:], vectors, 0.0)
    vectors[size[:, -1] == 0] = 0.0
    return np.asarray(vectors @ vectors.transpose(0, 2, 1))


def _at_ends(values: Array) -> Array:
    """Functions (k, j, c) at the Gauss points of sides: at their ends, (k, 2, c)."""
    return np.einsum("ej,kjc->kec", THROUGH[[0, -1]], values)


def _across(cells: Cells, slots: Index, side: Index) -> Index:
    """A vertex for each (nv,): one for both ends of `slots` (r,) far shorter than sides."""
    number = np.arange(len(cells.vertices))
    length = np.linalg.norm(np.diff(cells.vertices[cells.ends], axis=1)[:, 0], axis=1)
    beside = np.zeros(len(number))
    np.maximum.at(beside, cells.ends[side], length[side, None])
    for a, b in cells.ends[slots[length[slots] < NARROW * beside[cells.ends[slots]].min(axis=1)]]:
        number[number == number[b]] = number[a]
    return number


def _shares(
    cells: Cells,
    side: Index,
    other: Index,
    there: Array,
    direction: Array,
    held: Array,
    share: float,
) -> tuple[Array, Mask]:
    """`Facing.share` (k, 2), and whether neither body can move along d there."""
    d = _at_ends(direction)

    def moves(vertex: Index) -> Mask:
        rest = d - np.einsum("keij,kej->kei", held[vertex], d)
        return np.asarray(np.linalg.norm(rest, axis=2) > STIFF)

    own = moves(cells.ends[side])
    if (other < 0).any():
        return np.ones((len(side), 2)), ~own
    facing = (_at_ends(there[..., None])[..., 0] > 0.5).astype(np.intp)
    opposite = moves(cells.ends[other[:, None], facing])
    shares = np.where(own == opposite, share, np.where(own, 1.0, 0.0))
    return shares, ~own & ~opposite


def guides_of(
    cells: Cells, displacement: ng.CoefficientFunction, side: Index, degree: int
) -> Facing:
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
        open=np.zeros(k, dtype=bool),
        closed=np.ones(k, dtype=bool),
        share=np.ones((k, 2)),
        equality=True,
    )


def _after(
    ends: Index, gap: Array, closed: Mask, stiff: Mask, degree: int, noise: float
) -> tuple[Array, Mask]:
    """Bernstein coefficients (k, degree + 1) of gaps that are nowhere negative, near to `gap`.

    And whether `gap` itself is not negative, and stays. What is below `noise` is 0.

    `ends` (k, 2) are the vertices of the sides, at which r is one number of all neighbours: that
    closes the gap where they are `closed` (k,), but not at `stiff` ones (k, 2), which do not move.
    """
    B, root = bernstein(degree, PLACES), np.sqrt(WEIGHTS)
    c = np.empty((len(gap), degree + 1))
    c[:, [0, -1]] = gap @ THROUGH[[0, -1]].T
    rest = root * (gap - c[:, [0, -1]] @ B[:, [0, -1]].T)
    c[:, 1:-1] = np.linalg.lstsq(root[:, None] * B[:, 1:-1], rest.T, rcond=None)[0].T
    _, number = np.unique(ends, return_inverse=True)
    number = number.reshape(-1, 2)
    lift, bare = np.full(number.size, -np.inf), np.zeros(number.size, dtype=bool)
    np.logical_or.at(bare, number[~closed], True)
    np.logical_or.at(bare, number[stiff], True)
    np.maximum.at(lift, number, -c[:, [0, -1]])
    lift[bare] = np.maximum(lift[bare], 0.0)
    after = np.where(closed[:, None], 0.0, np.maximum(c, 0.0))
    after[:, [0, -1]] = c[:, [0, -1]] + lift[number]
    after[np.abs(after) <= noise] = 0.0
    off = np.abs(c @ B.T - gap).max(axis=1, initial=0.0)
    bare = ~closed & (c.min(axis=1) > off) & (lift[number] == 0).all(axis=1)
    return after, bare
