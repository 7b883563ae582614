"""Sides of both bodies that face each other, and the gap between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre
from scipy.special import comb

from ...arrays import Array, Index, Mask
from ...contact import FACING, ContactState, divided, jacobian, partners, prescribed_gap
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...lagrange import gauss, lagrange, lagrange_derivative
from ...problem import Contact
from .cells import Cells

NOISE = 1e-14  # of a gap, relative to the displacements on both sides
INSIDE = 1e-14  # parameters of vertices, as seen from a side
SAME = 1e-7  # parameters of a segment that are one place
DATA = 16  # degree of the polynomials that stand for gaps and prescribed displacements on a side
NEAR = 1e-6  # of the shorter segment: vertices that face each other up to that are one; at
# 1.5e-7 stresses of orders 3 and 4 lose all digits, at 6e-7 B is as at 1e-2 (1 % at order 1)
OPPOSITE = 1e-9  # of a side, by which it may go beyond the one it faces; 1e-14 in 320 scenes
MARGIN = 0.05  # of a segment, by which p* goes beyond the last zero of the gap
APART = 0.1  # of a segment: ends of contact nearer to a vertex are no vertices
NARROW = 0.1  # of the sides beside it, a side between them on which r does not change
STIFF = 0.1  # sine of the angle to prescribed motions, up to which d is one of them
PLACES, WEIGHTS = gauss(2 * DATA)
LEGENDRE = np.linalg.inv(legendre.legvander(2 * PLACES - 1, DATA))  # to their coefficients
THROUGH = np.linalg.inv(lagrange(DATA, PLACES))  # from values at `PLACES` to Gauss-Lobatto points
NEWTON_STEPS = 12
SAMPLES = 200  # places on a segment among which the last zero of the gap is sought


def at_places(shapes: Callable[[int, Array], Array], t: Array) -> Array:
    """Lagrange's polynomials of Gauss-Lobatto points, or their derivatives, at `t` (k, j).

    There are DATA + 1 = m of them, (k, j, m); `shapes` is `lagrange` or `lagrange_derivative`.
    """
    return shapes(DATA, t.ravel()).reshape(*t.shape, -1)


def bernstein(degree: int, t: Array) -> Array:
    """Bernstein polynomials (..., degree + 1) at `t` (...,), from 0 to 1."""
    i = np.arange(degree + 1)
    return np.asarray(comb(degree, i) * t[..., None] ** i * (1 - t[..., None]) ** (degree - i))


def directions(trace: BoundaryTrace, contact: Contact, segment: Index, s: Array) -> Array:
    """Unit vectors d (k, 2) at `s` (k,) of segments `segment` (k,) of the secondary."""
    if contact.direction is None:
        return trace.exact_normal(segment, s)
    return np.tile(contact.direction, (len(segment), 1))


@dataclass(frozen=True, eq=False)
class Met:
    """What k places of a secondary meet.

    Attributes
    ----------
    gap : ndarray (k,)
        Of u_h, lengths.
    direction : ndarray (k, 2)
        d, unit vectors.
    segment : ndarray of int (k,)
        Of the primary, -1 where none is met.
    s : ndarray (k,)
        Parameters on these.
    faces : ndarray of bool (k,)
        Whether the places face the other body or the obstacle.
    """

    gap: Array
    direction: Array
    segment: Index
    s: Array
    faces: Mask


def met(
    trace: BoundaryTrace,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    segment: Index,
    s: Array,
) -> Met:
    """What `s` (k,) of the secondary's segments `segment` (k,) meet, with the gap of u_h."""
    line, contact = pair.line, pair.line.contact
    x, d = trace.point(segment, s), directions(trace, contact, segment, s)
    other, place, gap, _ = partners(trace, line.facing, segment, x, d)
    if contact.gap is not None:
        gap = prescribed_gap(contact, trace, segment, s, x)
    jump = trace.evaluate(displacement, segment, s)
    noise = np.abs(jump).max(initial=0.0)
    at = np.flatnonzero(other >= 0)
    if at.size:
        there = trace.evaluate(displacement, other[at], place[at])
        noise = max(noise, np.abs(there).max())
        jump[at] -= there
    faces = other >= 0
    if contact.primary is None:
        faces = (trace.normal(segment, s) * d).sum(axis=1) > FACING
    gap = gap - (jump * d).sum(axis=1)
    gap[np.abs(gap) <= NOISE * noise] = 0.0
    return Met(gap, d, other, place, faces)


@dataclass(frozen=True, eq=False)
class Reach:
    """Where p* of a pair may act.

    Attributes
    ----------
    pair : ContactState
    segments : ndarray of int (k,)
        Of the secondary: in contact, beside such, or where u_h goes through the other body.
    contact : dict of int to list of (float, float)
        Intervals of s in contact on segments in which contact ends.
    """

    pair: ContactState
    segments: Index
    contact: dict[int, list[tuple[float, float]]]


def reach_of(
    trace: BoundaryTrace,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    degree: int,
    everywhere: bool,
) -> Reach:
    """The reach of a pair; `everywhere` on its line if that is asked for.

    Beyond it the gap is not negative, as Bernstein polynomials of a `degree` show.
    """
    line = pair.line
    if everywhere or line.contact.bilateral or not len(line.segments):
        return Reach(pair, line.segments, {})
    nodes = trace.nodes[line.segments][:, [0, -1]]
    active = np.append(pair.active, False)[line.rows].any(axis=1)
    near = np.asarray(np.isin(nodes, nodes[active]).any(axis=1))
    rest = np.flatnonzero(~near)
    if rest.size:
        near[rest] = ~_open(trace, displacement, pair, line.segments[rest], degree)
    return Reach(pair, line.segments[near], _contact_on(trace, displacement, pair))


def _open(
    trace: BoundaryTrace,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    segments: Index,
    degree: int,
) -> Mask:
    """Whether the gap is nowhere negative on segments (k,), on each part between vertices.

    Of parts that face in part, as beside the end of a body, points are looked at.
    """
    contact, j = pair.line.contact, len(PLACES)
    local, start, stop = np.arange(len(segments)), np.zeros(len(segments)), np.ones(len(segments))
    if contact.primary is not None:
        parts = divided(trace, contact, segments, pair.line.facing)
        local = np.append(parts.local, local)
        start, stop = np.append(parts.start, start), np.append(parts.stop, stop)
    s = start[:, None] + (stop - start)[:, None] * PLACES
    found = met(trace, displacement, pair, np.repeat(segments[local], j), s.ravel())
    gap, faces = found.gap.reshape(-1, j), found.faces.reshape(-1, j)
    open_ = np.asarray(~((gap < 0) & faces).any(axis=1))
    known = np.asarray(faces.all(axis=1))
    if contact.primary is not None:
        known[len(parts.local) :] = False  # segments as a whole: gaps have kinks
    c, off = _fitted(gap[known], degree)
    open_[known] = c.min(axis=1, initial=np.inf) >= off
    return np.bincount(local[~open_], minlength=len(segments)) == 0


def cuts_of(
    trace: BoundaryTrace, reaches: Sequence[Reach], more: Sequence[float] = ()
) -> dict[int, Array]:
    """Rising places s, (j,), of vertices to come, by segment: ends of contact, opposite vertices.

    And `more` on each segment of a reach. Vertices that all but face each other are one.
    """
    cuts: dict[int, list[float]] = {}
    length = trace.lengths(np.arange(len(trace.region)))
    size = np.full(trace.space.ndof, np.inf)  # shortest segment at each vertex
    np.minimum.at(size, trace.nodes[:, [0, -1]], length[:, None])

    def nearest(k: Index, s: Array) -> tuple[Index, Array]:
        """The vertices (r,) that are the nearer ends of segments (r,), and how far they are."""
        return trace.nodes[k, np.where(s < 0.5, 0, -1)], np.minimum(s, 1 - s) * length[k]

    def put(k: Index, s: Array) -> None:
        for number, place in zip(k.tolist(), s.tolist(), strict=True):
            cuts.setdefault(number, []).append(place)

    for reach in reaches:
        line, contact = reach.pair.line, reach.pair.line.contact
        ends = [(k, s) for k, parts in reach.contact.items() for part in parts for s in part]
        ends = [(k, s) for k, s in ends if APART < s < 1 - APART]
        ends += [(k, s) for k in reach.segments.tolist() for s in more]
        k, s = np.array([k for k, _ in ends], dtype=np.intp), np.array([s for _, s in ends])
        kept = np.ones(len(k), dtype=bool)
        if contact.primary is not None and len(reach.segments):
            parts = divided(trace, contact, reach.segments, line.facing)
            k = np.append(k, np.tile(reach.segments[parts.local], 2))
            s = np.concatenate([s, parts.start, parts.stop])
            s, there, t = _opposite(trace, reach.pair, k, s)
            (own, away), (other, beyond) = nearest(k, s), nearest(there, t)
            far = np.maximum(away, beyond) / np.minimum(size[own], size[other])
            # Whether two vertices are one, the place decides that the secondary's faces.
            corner = ((s <= SAME) | (s >= 1 - SAME)) & (there >= 0)
            pairs = own * len(size) + other
            same = np.isin(pairs, pairs[corner & (far <= NEAR)])
            same |= (far <= NEAR) & ~np.isin(own, own[corner & (far > NEAR)])
            kept = ~(same & (far <= 2 * NEAR)) | (there < 0)
            put(there[kept & (there >= 0)], t[kept & (there >= 0)])
        put(k[kept], s[kept])
    inside = {k: _inside(np.array(s)) for k, s in cuts.items()}
    return {k: s for k, s in inside.items() if s.size}


def _opposite(
    trace: BoundaryTrace, pair: ContactState, k: Index, s: Array
) -> tuple[Array, Index, Array]:
    """Places (r,) of segments `k` (r,), and segments (r,) and places (r,) opposite along d.

    Places `s` (r,) inside of segments are moved until a vertex lies opposite.
    """
    contact, facing, s = pair.line.contact, pair.line.facing, s.copy()
    inner = (s > SAME) & (s < 1 - SAME)
    for _ in range(NEWTON_STEPS):
        d = directions(trace, contact, k, s)
        there, t, *_ = partners(trace, facing, k, trace.point(k, s), d)
        near = np.flatnonzero(inner & (there >= 0) & (np.minimum(t, 1 - t) < APART))
        vertex, along = np.round(t[near]), trace.derivative(k[near], s[near])
        away = trace.point(there[near], vertex) - trace.point(there[near], t[near])
        s[near] += (away * along).sum(axis=1) / (along**2).sum(axis=1)
        s[near] = s[near].clip(0, 1)
    exact = near[np.abs(t[near] - vertex) <= NEAR]
    t[exact] = np.round(t[exact])
    return s, there, t


def _inside(s: Array) -> Array:
    """Rising places strictly between 0 and 1, each once."""
    s = np.sort(s[(s > SAME) & (s < 1 - SAME)])
    return s[np.diff(s, prepend=-1.0) > SAME]


def _contact_on(
    trace: BoundaryTrace, displacement: ng.CoefficientFunction, pair: ContactState
) -> dict[int, list[tuple[float, float]]]:
    """Intervals of s in contact on segments in which contact ends, which face with all nodes."""
    line, found = pair.line, {}
    active = np.append(pair.active, False)[line.rows]
    places = trace.places(line.segments)
    turns = np.diff(active.astype(int), axis=1)
    for i in np.flatnonzero((turns != 0).any(axis=1) & line.faces):
        ends = [0.0] if active[i, 0] else []
        for j in np.flatnonzero(turns[i]):
            s = np.linspace(places[i, j], places[i, j + 1], SAMPLES)
            segment = np.full(SAMPLES, line.segments[i])
            below = np.flatnonzero(met(trace, displacement, pair, segment, s).gap < 0)
            if active[i, j]:  # contact up to the last zero of the gap, and a little farther
                ends.append(float(s[below[-1]] if below.size else s[0]) + MARGIN)
            else:
                ends.append(float(s[below[0]] if below.size else s[-1]) - MARGIN)
        ends += [1.0] if active[i, -1] else []
        found[int(line.segments[i])] = list(zip(ends[::2], ends[1::2], strict=True))
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
    away : ndarray of int (r,)
        Sides of the secondary of which nothing faces, as over a slot.
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
    away: Index
    equality: bool

    @cached_property
    def back(self) -> Array:
        """Parameters t (k, j) of the secondary, opposite to the primary's Gauss points."""
        nodes = self.there @ THROUGH.T
        t = np.where((nodes[:, -1] < nodes[:, 0])[:, None], 1 - PLACES, PLACES)
        for _ in range(NEWTON_STEPS):
            value = np.einsum("kji,ki->kj", at_places(lagrange, t), nodes)
            slope = np.einsum("kji,ki->kj", at_places(lagrange_derivative, t), nodes)
            t = t - (value - PLACES) / slope
        return t

    @cached_property
    def rates(self) -> Array:
        """|dt| of the secondary per dt of the primary, (k, j), at the latter's Gauss points."""
        slopes = at_places(lagrange_derivative, self.back)
        return np.abs(1 / np.einsum("kji,il,kl->kj", slopes, THROUGH, self.there))

    def on_primary(self, values: Array) -> Array:
        """Functions (k, j, c) at the Gauss points of the primary's sides.

        `values` (k, j, c) are those at the secondary's.
        """
        return np.einsum("kji,il,klc->kjc", at_places(lagrange, self.back), THROUGH, values)

    @property
    def lift(self) -> Array:
        """What w adds to the gap, r (k, j)."""
        lift = self.after @ bernstein(self.after.shape[1] - 1, PLACES).T - self.gap
        return np.where(self.open[:, None], 0.0, lift)


def facing_of(
    cells: Cells,
    displacement: ng.CoefficientFunction,
    reach: Reach,
    degree: int,
    held: Array,
    share: float,
) -> Facing:
    """What of a pair's reach faces, and the gap after a lifting of `degree`.

    The secondary takes a `share` of that, but for vertices that cannot move along d; `held`
    (nv, 2, 2) are the projections of `held_motions`.

    Raises
    ------
    ContactError
        Bodies overlap where a side faces the other body in part.
    """
    pair, trace = reach.pair, cells.trace
    line, contact = pair.line, pair.line.contact
    side = np.flatnonzero(np.isin(cells.segment, reach.segments))
    j = len(PLACES)
    segment, s = cells.on_side(np.repeat(side, j), np.tile(PLACES, len(side)))
    found = met(trace, displacement, pair, segment, s)
    faces = found.faces
    keep = np.asarray(faces.reshape(-1, j).all(axis=1))
    every = keep.repeat(j)
    if (found.gap[faces & ~every] < 0).any():
        raise ContactError("bodies overlap where a side of the mesh faces the other in part")
    slots = side[~keep]
    away = side[~faces.reshape(-1, j).any(axis=1)]
    side, segment, s = side[keep], segment[every], s[every]
    gap = _with_ends(cells, displacement, pair, side, found.gap[every].reshape(-1, j))
    d = found.direction[every].reshape(-1, j, 2)
    other, there = np.full(len(side), -1), np.zeros((len(side), j))
    if contact.primary is not None:
        place = found.s[every].reshape(-1, j)
        segments = found.segment[every].reshape(-1, j)
        middle = segments[:, j // 2]
        other = cells.side_at(middle, place[:, j // 2])
        there = _continued(cells.own_parameter(other, place), segments == middle[:, None])
        ends = there @ THROUGH[[0, -1]].T
        beyond = np.abs(ends - (ends > 0.5)).max(axis=1)
        if (beyond > OPPOSITE).any():
            x, y = cells.vertices[cells.ends[side[beyond.argmax()]]].mean(axis=0)
            raise ValueError(
                f'no guaranteed bound is known where vertices on "{contact.secondary}" and '
                f'"{contact.primary}" face each other to within {beyond.max():.0e} of a side, as '
                f"near ({x:.6g}, {y:.6g}): move them together or farther apart, or refine"
            )
    rate = np.abs(np.diff(cells.span[side], axis=1))
    weight = WEIGHTS * rate * jacobian(trace, contact, segment, s).reshape(-1, j)
    order = np.argsort(line.segments)
    local = order[np.searchsorted(line.segments[order], cells.segment[side])]
    closed = np.append(pair.active, False)[line.rows[local]].all(axis=1)
    low, high = np.sort(cells.span[side], axis=1).T
    for k, parts in reach.contact.items():
        for a, b in parts:
            closed |= (cells.segment[side] == k) & (low >= a - SAME) & (high <= b + SAME)
    closed = np.asarray(closed | contact.bilateral)
    shares, stiff = _shares(cells, side, other, there, d, held, share)
    number, narrow = _across(cells, slots, side)
    vertices = number[cells.ends[side]]
    most = np.zeros(len(cells.vertices))  # one share at a vertex that faces two bodies
    np.maximum.at(most, vertices, shares)
    shares = most[vertices]
    after, bare = _after(vertices, gap, closed, stiff, narrow, degree)
    if contact.bilateral:
        after, bare = np.zeros_like(after), np.zeros_like(bare)
    kept = side, other, there, d, weight, gap, after, bare, closed, shares, away
    return Facing(pair, *kept, contact.bilateral)


def _with_ends(
    cells: Cells,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    side: Index,
    gap: Array,
) -> Array:
    """The `gap` (k, j) of sides (k,) as polynomials with its own values at their vertices.

    Those that Gauss points continue to there are not the same on two sides of a narrow gap.
    """
    t = np.tile([INSIDE, 1 - INSIDE], len(side))
    ends = met(cells.trace, displacement, pair, *cells.on_side(np.repeat(side, 2), t))
    nodes = gap @ THROUGH.T
    own = ends.faces.reshape(-1, 2)
    nodes[:, [0, -1]] = np.where(own, ends.gap.reshape(-1, 2), nodes[:, [0, -1]])
    return np.asarray(nodes @ lagrange(DATA, PLACES).T)


def _continued(there: Array, own: Mask) -> Array:
    """Parameters (k, j), of which those that are not `own` (k, j) lie beyond the nearer end."""
    for i in np.flatnonzero(~own.all(axis=1)):
        at = np.flatnonzero(own[i])
        rise = np.polyfit(PLACES[at], there[i, at], 1)
        there[i, ~own[i]] = np.polyval(rise, PLACES[~own[i]])
    return there


def held_motions(cells: Cells, sides: Sequence[Index], directions: Sequence[Array]) -> Array:
    """Projections (nv, 2, 2) of motions of all vertices on those that conditions prescribe.

    Parameters
    ----------
    sides : sequence of ndarray of int (k,)
        Of each condition.
    directions : sequence of ndarray (k, j, 2)
        Along which it prescribes motions, at j points from t = 0 to t = 1.
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


def _across(cells: Cells, slots: Index, side: Index) -> tuple[Index, Mask]:
    """A vertex for each (nv,): one for both ends of a `side` (k,) or slot far shorter than others.

    And whether sides are that short. `slots` (r,) are sides of which nothing faces.
    """
    number, every = np.arange(len(cells.vertices)), np.append(side, slots)
    length = np.linalg.norm(np.diff(cells.vertices[cells.ends], axis=1)[:, 0], axis=1)
    beside = np.zeros(len(number))
    np.maximum.at(beside, cells.ends[side], length[side, None])
    narrow = length[every] < NARROW * beside[cells.ends[every]].min(axis=1)
    for a, b in cells.ends[every[narrow]]:
        number[number == number[b]] = number[a]
    return number, narrow[: len(side)]


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
    """Sides `side` (k,) of Gamma_0, as bilateral contact with an obstacle without a gap.

    `degree` is that of w.
    """
    k, j = len(side), len(PLACES)
    every, t = np.repeat(side, j), np.tile(PLACES, k)
    segment, s = cells.on_side(every, t)
    x, dx = cells.points(every, t)
    d = cells.trace.exact_normal(segment, s)
    gap = -(cells.trace.evaluate(displacement, segment, s) * d).sum(axis=1)  # (3.8)
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
        away=side[:0],
        equality=True,
    )


def _fitted(gap: Array, degree: int) -> tuple[Array, Array]:
    """Bernstein coefficients (k, degree + 1) near to gaps (k, j), the same at the ends.

    And what the gaps, polynomials of degree `DATA`, differ from these at most (k,): no Legendre
    polynomial is more than 1.
    """
    B, root = bernstein(degree, PLACES), np.sqrt(WEIGHTS)
    c = np.empty((len(gap), degree + 1))
    c[:, [0, -1]] = gap @ THROUGH[[0, -1]].T
    rest = root * (gap - c[:, [0, -1]] @ B[:, [0, -1]].T)
    c[:, 1:-1] = np.linalg.lstsq(root[:, None] * B[:, 1:-1], rest.T, rcond=None)[0].T
    return c, np.abs((gap - c @ B.T) @ LEGENDRE.T).sum(axis=1)


def _after(
    ends: Index, gap: Array, closed: Mask, stiff: Mask, narrow: Mask, degree: int
) -> tuple[Array, Mask]:
    """Bernstein coefficients (k, degree + 1) of gaps that are nowhere negative, near to `gap`.

    And whether `gap` itself is not negative, and stays.

    `ends` (k, 2) are the vertices of the sides, at which r is one number of all neighbours: that
    closes the gap where they are `closed` (k,), but not at `stiff` ones (k, 2), which do not move.
    On `narrow` sides (k,) r is that number, too.
    """
    c, off = _fitted(gap, degree)
    _, number = np.unique(ends, return_inverse=True)
    number = number.reshape(-1, 2)
    lift, bare = np.full(number.size, -np.inf), np.zeros(number.size, dtype=bool)
    np.logical_or.at(bare, number[~closed], True)
    np.logical_or.at(bare, number[stiff], True)
    np.maximum.at(lift, number, -c[:, [0, -1]])
    np.maximum.at(lift, number[narrow, 0], -c[narrow].min(axis=1))
    lift[bare] = np.maximum(lift[bare], 0.0)
    after = np.where(closed[:, None], 0.0, np.maximum(c, 0.0))
    after[:, [0, -1]] = c[:, [0, -1]] + lift[number]
    after[narrow] = c[narrow] + lift[number[narrow, :1]]
    bare = ~closed & (c.min(axis=1) > off) & (lift[number] == 0).all(axis=1)
    return after, bare
