"""Sides of both bodies that face each other, and the gap between them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import NamedTuple

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre
from scipy.special import comb

from ...arrays import Array, Index, Mask
from ...contact import (
    FACING_COSINE,
    ContactState,
    divided,
    facing_pieces,
    jacobian,
    nodal_line,
    partners,
    prescribed_gap,
    rays,
)
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...lagrange import gauss, lagrange
from ...problem import Contact, Problem
from .cells import Cells

GAP_NOISE = 1e-14  # of a gap, relative to the displacements on both sides
POSITION_NOISE = 4 * np.finfo(float).eps  # ... and to the largest coordinate
INSIDE_SIDE = 1e-14  # parameters of vertices, as seen from a side
SAME_PLACE = 1e-7  # parameters of a segment that are one place
DATA_DEGREE = 16  # of polynomials that stand for gaps and prescribed displacements on a side
SAME_VERTEX = 1e-6  # of the shorter segment: vertices that face each other up to that are one; at
# 1.5e-7 stresses of orders 3 and 4 lose all digits, at 6e-7 B is as at 1e-2 (1 % at order 1)
SIDE_OVERHANG = 1e-9  # of a side, by which it may exceed the one it faces; 1e-14 in 320 scenes
CONTACT_MARGIN = 0.05  # of a segment, by which p* goes beyond the last zero of the gap
VERTEX_DISTANCE = 0.1  # of a segment: ends of contact nearer to a vertex are no vertices
NARROW_SIDE = 0.1  # of the sides beside it, a side between them on which r does not change
PARALLEL_MOTION = 0.1  # sine of the angle to prescribed motions, up to which d is one of them
POINTS, WEIGHTS = gauss(2 * DATA_DEGREE)
# From values at `POINTS` to Legendre's coefficients, and to values at Gauss-Lobatto points.
LEGENDRE = legendre.legvander(2 * POINTS - 1, DATA_DEGREE)
TO_LEGENDRE = np.linalg.inv(LEGENDRE)
TO_LOBATTO = np.linalg.inv(lagrange(DATA_DEGREE, POINTS))
TO_ENDS = TO_LOBATTO[[0, -1]]
NEWTON_STEPS = 12
ZERO_SAMPLES = 200  # places on a segment among which the last zero of the gap is sought


def bernstein(degree: int, t: Array) -> Array:
    """Bernstein polynomials (..., degree + 1) at `t` (...,), from 0 to 1."""
    i = np.arange(degree + 1)
    return np.asarray(comb(degree, i) * t[..., None] ** i * (1 - t[..., None]) ** (degree - i))


def at_places(function: Callable[[Index, Array], Array], segment: Index, s: Array) -> Array:
    """Values (k, j, ...) of a `function` of n places at `s` (k, j) of segments `segment` (k,)."""
    values = function(np.repeat(segment, s.shape[1]), s.ravel())
    return values.reshape(*s.shape, *values.shape[1:])


def jump(
    trace: BoundaryTrace,
    function: ng.CoefficientFunction,
    place: tuple[Index, Array],
    opposite: tuple[Index, Array] | None = None,
) -> tuple[Array, float]:
    """Values (k, j, 2) at a place less those opposite, and the largest component of both.

    Segments and s are, of the `place` (k,) and (k, j), and of the `opposite` (k, j) and (k, j)
    one, where segments may be -1.
    """
    values = at_places(partial(trace.evaluate, function), *place)
    largest = float(np.abs(values).max(initial=0.0))
    if opposite is not None and (some := opposite[0] >= 0).any():
        there = trace.evaluate(function, opposite[0][some], opposite[1][some])
        largest = max(largest, float(np.abs(there).max()))
        values[some] -= there
    return values, largest


class OppositePoints(NamedTuple):
    """Points that face j places on each of k segments of a secondary."""

    gap: Array  # (k, j) of u_h
    direction: Array  # (k, j, 2) d
    segment: Index  # (k, j) of the primary, -1 where none is met
    s: Array  # (k, j) parameters on these
    faces: Mask  # (k, j) whether the place faces the body or the obstacle


def opposite_points(
    trace: BoundaryTrace,
    displacement: ng.CoefficientFunction,
    pair: ContactState,
    segment: Index,
    s: Array,
) -> OppositePoints:
    """Points that face the places `s` (k, j) on segments `segment` (k,) of the secondary."""
    contact, every, t = pair.line.contact, np.repeat(segment, s.shape[1]), s.ravel()
    x, d = trace.point(every, t), rays(trace, contact, every, t)
    opposite = partners(trace, pair.line.facing, every, x, d)
    other, there, gap = opposite.segment, opposite.s, opposite.distance
    faces = other >= 0
    if contact.primary is None:
        faces = (trace.normal(every, t) * d).sum(axis=1) > FACING_COSINE
    if contact.gap is not None:
        gap = prescribed_gap(contact, trace, every, t, x)
    at = other.reshape(s.shape), there.reshape(s.shape)
    u, size = jump(trace, displacement, (segment, s), at)
    gap = gap - (u.reshape(d.shape) * d).sum(axis=1)
    gap[np.abs(gap) <= GAP_NOISE * size] = 0.0
    return OppositePoints(gap.reshape(s.shape), d.reshape(u.shape), *at, faces.reshape(s.shape))


def guides(problem: Problem, trace: BoundaryTrace) -> list[ContactState]:
    """Gamma_0 as bilateral contact with an obstacle without a gap; the axis guides by itself."""
    if trace.on_axis[trace.segments(problem.guide)].all():
        return []
    line, _ = nodal_line(trace, Contact(str(problem.guide), gap=0.0, bilateral=True))  # (3.8)
    return [ContactState(line, line.gap, 0 * line.gap, np.ones(len(line.gap), dtype=bool))]


class PressureSupport(NamedTuple):
    """Parts of the boundary on which p* of a pair may act."""

    pair: ContactState
    # (k,) of the secondary: in contact, beside contact, or where u_h penetrates the other body
    segments: Index
    contact: Array  # (r, 3) segments with contact, and s where it begins and ends on each


def pressure_support(
    trace: BoundaryTrace, displacement: ng.CoefficientFunction, pair: ContactState, degree: int
) -> PressureSupport:
    """The support of p*: elsewhere Bernstein polynomials of a `degree` show that the gap is open.

    They do on each part between vertices of both bodies. Segments that face in part, as beside the
    end of a body, are examined in points.
    """
    line = pair.line
    if line.contact.bilateral or not len(line.segments):
        segments = line.segments[~trace.on_axis[line.segments]]
        return PressureSupport(pair, segments, np.zeros((0, 3)))
    nodes, active = trace.nodes[line.segments][:, [0, -1]], line.on_segments(pair.active, False)
    near = np.asarray(np.isin(nodes, nodes[active.any(axis=1)]).any(axis=1))
    parts, _ = facing_pieces(trace, line, ~near)  # opposite vertices make kinks
    if len(parts.local):
        s = parts.start[:, None] + parts.share[:, None] * POINTS
        there = opposite_points(trace, displacement, pair, line.segments[parts.local], s)
        overlap = np.asarray(((there.gap < 0) & there.faces).any(axis=1))
        smooth = there.faces.all(axis=1)
        c, off = fitted(there.gap[smooth], degree)
        overlap[smooth] = c.min(axis=1, initial=np.inf) < off
        near[parts.local[overlap]] = True
    found = [(k, 0.0, 1.0) for k in line.segments[active.all(axis=1)].tolist()]
    places, turns = trace.places(line.segments), np.diff(active.astype(int), axis=1)
    for i in np.flatnonzero((turns != 0).any(axis=1) & line.faces):
        ends = [0.0] if active[i, 0] else []
        for j in np.flatnonzero(turns[i]):  # contact up to the last zero of the gap, and farther
            s = np.linspace(places[i, j], places[i, j + 1], ZERO_SAMPLES)
            s = s if active[i, j] else s[::-1]
            gap = opposite_points(trace, displacement, pair, line.segments[[i]], s[None]).gap[0]
            last = np.append(s[0], s[gap < 0])[-1]
            ends.append(last + CONTACT_MARGIN * np.sign(s[-1] - s[0]))
        ends += [1.0] if active[i, -1] else []
        found += [(line.segments[i], *both) for both in zip(ends[::2], ends[1::2], strict=True)]
    return PressureSupport(pair, line.segments[near], np.reshape(found, (-1, 3)))


def new_vertices(
    trace: BoundaryTrace, reaches: Sequence[PressureSupport], more: Sequence[float]
) -> tuple[Index, Array]:
    """Segments (r,) and parameters s (r,) of new vertices: ends of contact, opposite vertices.

    Each segment where p* may act also gets vertices at the parameters `more`. Vertices that face
    each other up to `SAME_VERTEX` get none.
    """
    length = trace.lengths(np.arange(len(trace.region)))
    found = [np.zeros((0, 2))]
    for reach in reaches:
        line, own = reach.pair.line, reach.segments
        k, s = np.repeat(reach.contact[:, 0].astype(np.intp), 2), reach.contact[:, 1:].ravel()
        inner = (s > VERTEX_DISTANCE) & (s < 1 - VERTEX_DISTANCE)
        k = np.append(k[inner], np.repeat(own, len(more)))
        s = np.append(s[inner], np.tile(more, len(own)))
        if line.contact.primary is not None and len(own):
            parts = divided(trace, line.contact, own, line.facing)
            k = np.append(k, np.tile(own[parts.local], 2))
            s = np.concatenate([s, parts.start, parts.stop])
            s, (there, t) = _opposite(trace, reach.pair, k, s)
            here, opposite, faced = length[k], length[there], there >= 0
            away = np.maximum(np.minimum(s, 1 - s) * here, np.minimum(t, 1 - t) * opposite)
            apart = away > SAME_VERTEX * np.minimum(here, opposite)
            found.append(np.column_stack([there, t])[faced & apart])
            k, s = k[~faced | apart], s[~faced | apart]
        found.append(np.column_stack([k, s]))
    k, s = np.unique(np.concatenate(found), axis=0).T
    k, s = (x[(s > SAME_PLACE) & (s < 1 - SAME_PLACE)] for x in (k, s))
    new = np.append(True, (np.diff(k) > 0) | (np.diff(s) > SAME_PLACE))[: len(k)]
    return k[new].astype(np.intp), s[new]


def _opposite(
    trace: BoundaryTrace, pair: ContactState, k: Index, s: Array
) -> tuple[Array, tuple[Index, Array]]:
    """Places (r,) of segments `k` (r,), and segments (r,) and places (r,) opposite along d.

    Places `s` (r,) inside of segments are moved until a vertex lies opposite.
    """
    contact, facing = pair.line.contact, pair.line.facing
    inner = (s > SAME_PLACE) & (s < 1 - SAME_PLACE)
    for _ in range(NEWTON_STEPS):
        met = partners(trace, facing, k, trace.point(k, s), rays(trace, contact, k, s))
        there, t = met.segment, met.s
        near = np.flatnonzero(inner & (there >= 0) & (np.minimum(t, 1 - t) < VERTEX_DISTANCE))
        vertex, along = np.round(t[near]), trace.derivative(k[near], s[near])
        away = trace.point(there[near], vertex) - trace.point(there[near], t[near])
        step = (away * along).sum(axis=1) / (along**2).sum(axis=1)
        if not (np.abs(step) > INSIDE_SIDE).any():
            break
        s[near] = (s[near] + step).clip(0, 1)
    return s, (there, t)


def facing_middles(
    cells: Cells, displacement: ng.CoefficientFunction, supports: Sequence[PressureSupport]
) -> tuple[Index, Index, Array]:
    """Sides (k,) on which p* may act, those (k,) they face, and there their middles, (k,)."""
    found = [(np.zeros(0, dtype=np.intp), np.zeros(0, dtype=np.intp), np.zeros(0))]
    for support in supports:
        side = cells.sides_on(support.segments)
        place = cells.on_side(side, np.array([[0.5]]))
        there = opposite_points(cells.trace, displacement, support.pair, *place)
        faces = there.segment[:, 0] >= 0
        other = cells.side_at(there.segment[faces, 0], there.s[faces, 0])
        found.append((side[faces], other, cells.own_parameter(other, there.s[faces])[:, 0]))
    side, other, t = (np.concatenate(x) for x in zip(*found, strict=True))
    return side, other, t


@dataclass(frozen=True, eq=False)
class FacingSides:
    """k sides on which the motion along d is bounded: by the other body, an obstacle, a guide.

    Functions are given at the j Gauss points of `POINTS` on each side, t of the secondary's.
    """

    pair: ContactState
    side: Index  # (k,) of the secondary
    other: Index  # (k,) of the primary, -1 without one
    there: Array  # (k, j) parameters on the primary's sides
    direction: Array  # (k, j, 2) d
    weight: Array  # (k, j) length (P1) or eta (P2) per t, with the measure and Gauss weights
    psi: Array  # (j, n) Bernstein polynomials of p*
    gap: Array  # (k, j) of u_h, lengths
    lift: Array  # (k, j) r, what w adds to it
    lifted_gap: Array  # (k, n) Bernstein coefficients >= 0 of gap + r, or near to it where r is 0
    touched: Mask  # (k, 2) ends that sides in contact as a whole share
    pressed: Mask  # (k, n) coefficients of p* that are likely to be positive
    share: Array  # (k, 2) of what w adds to the gap, that the secondary takes at t = 0 and t = 1
    slots: Index  # (r,) sides of the secondary of which nothing faces, as over a slot

    @property
    def equality(self) -> bool:
        """Whether the gap is 0 and forces have any sign."""
        return self.pair.line.contact.bilateral

    @property
    def bound(self) -> Array:
        """Integrals (k, n) of psi_j (gap_h + r)."""
        return np.asarray(((self.gap + self.lift) * self.weight) @ self.psi)  # (3.9)

    @property
    def mass(self) -> Array:
        """Integrals (k, n) of psi_j: the force of a unit coefficient."""
        return np.asarray(self.weight @ self.psi)

    def force(self, pressure: Array) -> Array:
        """Forces (k, j) at the points, with the weights of Gauss.

        `pressure` (k, n) are coefficients of p*.
        """
        return np.asarray(pressure @ self.psi.T * self.weight)

    def on_primary(self, values: Array) -> Array:
        """Functions (k, j, c) at the Gauss points of the primary's sides.

        `values` (k, j, c) are those opposite to the secondary's.
        """
        across = np.linalg.solve(legendre.legvander(2 * self.there - 1, DATA_DEGREE), values)
        return np.asarray(LEGENDRE @ across)


def facing_sides(
    cells: Cells,
    displacement: ng.CoefficientFunction,
    reach: PressureSupport,
    degrees: tuple[int, int],
    held: Array,
    moduli: Array,
) -> FacingSides:
    """The sides on which p* of a pair acts, with the lifted gap; `degrees` are those of both.

    Both bodies share the lifting by compliance, one over the `moduli` (n,) of the cells, but for
    vertices that cannot move along d; `held` (nv, 2, 2) are the squares of `held_motions`.

    Raises
    ------
    ContactError
        Bodies overlap where a side faces the other body in part.
    ValueError
        Sides that face each other do not begin and end at opposite places.
    """
    pair, trace, line = reach.pair, cells.trace, reach.pair.line
    contact, (of_pressure, degree) = line.contact, degrees
    every = cells.sides_on(reach.segments)
    t = np.concatenate([[INSIDE_SIDE], POINTS, [1 - INSIDE_SIDE]])
    found = opposite_points(trace, displacement, pair, *cells.on_side(every, t[None]))
    faces = found.faces[:, 1:-1]
    keep = np.asarray(faces.all(axis=1))
    if (found.gap[:, 1:-1][faces & ~keep[:, None]] < 0).any():
        raise ContactError("bodies overlap where a side of the mesh faces the other in part")
    side, away, ends = every[keep], every[~faces.any(axis=1)], found.gap[keep][:, [0, -1]]
    d, segments, place = found.direction[keep, 1:-1], found.segment[keep, 1:-1], found.s[keep, 1:-1]
    # As polynomials with their own values at vertices: those that Gauss points continue to there
    # are not the same on two sides of a narrow gap.
    nodes = found.gap[keep, 1:-1] @ TO_LOBATTO.T
    nodes[:, [0, -1]] = np.where(found.faces[keep][:, [0, -1]], ends, nodes[:, [0, -1]])
    # No Legendre polynomials that only round-off has, of coordinates where these say how far it is:
    # w would have their degrees.
    size = abs(contact.gap) if isinstance(contact.gap, float) else np.abs(cells.vertices).max()
    modes = nodes @ (TO_LEGENDRE @ lagrange(DATA_DEGREE, POINTS)).T
    largest = np.maximum.accumulate(np.abs(modes[:, ::-1]), axis=1)[:, ::-1]
    modes[largest <= POSITION_NOISE * size] = 0.0
    gap = modes @ LEGENDRE.T
    other, there = np.full(len(side), -1), np.zeros(gap.shape)
    if contact.primary is not None:
        middle = gap.shape[1] // 2
        other = cells.side_at(segments[:, middle], place[:, middle])
        there = cells.own_parameter(other, place)
        ends = there @ TO_ENDS.T
        beyond = np.abs(ends - (ends > 0.5)).max(axis=1)
        beyond[(segments != segments[:, [middle]]).any(axis=1)] = 1.0
        if (beyond > SIDE_OVERHANG).any():
            x, y = cells.vertices[cells.ends[side[beyond.argmax()]]].mean(axis=0)
            raise ValueError(
                f'no guaranteed bound is known where vertices on "{contact.secondary}" and '
                f'"{contact.primary}" face each other to within {beyond.max():.0e} of a side, as '
                f"near ({x:.6g}, {y:.6g}): move them together or farther apart, or refine"
            )
    segment, s = cells.on_side(side, POINTS[None])
    ds = at_places(partial(jacobian, trace, contact), segment, s)
    number, start, stop = reach.contact.T
    low, high = np.sort(cells.span[side], axis=1).T[..., None]
    inside = (low >= start - SAME_PLACE) & (high <= stop + SAME_PLACE)
    closed = ((segment[:, None] == number) & inside).any(axis=1) | contact.bilateral
    # Shares are as compliances: all where only one body can move, and one number at a vertex.
    alone = float(contact.primary is None)
    d_ends, opposite = np.einsum("ej,kjc->kec", TO_ENDS, d), np.zeros((len(side), 2))
    own = _moves(held[cells.ends[side]], d_ends) / moduli[cells.owner[side], None]
    if contact.primary is not None:
        at = (there @ TO_ENDS.T > 0.5).astype(np.intp)
        across = held[cells.ends[other[:, None], at]]
        opposite = _moves(across, d_ends) / moduli[cells.owner[other], None]
    one, narrow = _merged_vertices(cells, side, every[~keep])
    vertices, most, total = one[cells.ends[side]], np.zeros(len(one)), own + opposite
    np.maximum.at(most, vertices, np.divide(own, total, out=alone + 0 * own, where=total > 0))
    if contact.bilateral:
        after, lift = np.zeros((len(side), degree + 1)), -gap
    else:
        after, lift = _lifted_gap(vertices, gap, closed, total == 0, narrow, degree)
    vanishes = np.median(after, axis=1) <= 0
    pressed = np.repeat((closed | vanishes)[:, None], of_pressure + 1, axis=1)
    touched = np.isin(vertices, vertices[closed])
    pressed[:, [0, -1]] |= touched
    return FacingSides(
        pair=pair,
        side=side,
        other=other,
        there=there,
        direction=d,
        weight=WEIGHTS * (high - low) * ds,
        psi=bernstein(of_pressure, POINTS),
        gap=gap,
        lift=lift,
        lifted_gap=after,
        touched=touched,
        pressed=pressed,
        share=most[vertices],
        slots=away,
    )


def held_motions(
    cells: Cells, held: Sequence[tuple[Index, Array]], supports: Sequence[PressureSupport]
) -> Array:
    """Squares (nv, 2, 2) of the motions that conditions prescribe, summed at all vertices.

    Sides and directions at their ends that are `held` (k,) and (k, 2, 2), of each condition, and
    those of guides and bilateral obstacles.
    """
    M, held = np.zeros((len(cells.vertices), 2, 2)), list(held)
    for support in supports:
        contact, side = support.pair.line.contact, cells.sides_on(support.segments)
        if contact.bilateral and contact.primary is None:
            ends = cells.on_side(side, np.array([[0.0, 1.0]]))
            held.append((side, at_places(partial(rays, cells.trace, contact), *ends)))
    for side, d in held:
        np.add.at(M, cells.ends[side], d[..., :, None] * d[..., None, :])
    return M


def _moves(held: Array, d: Array) -> Mask:
    """Whether vertices (k, 2) can move along `d` (k, 2, 2); `held` are as of `held_motions`."""
    onto = held @ np.linalg.pinv(held, rcond=PARALLEL_MOTION**2, hermitian=True)
    rest = d - (onto @ d[..., None])[..., 0]
    return np.asarray(np.linalg.norm(rest, axis=2) > PARALLEL_MOTION)


def _merged_vertices(cells: Cells, side: Index, slots: Index) -> tuple[Index, Mask]:
    """Numbers (nv,) of vertices, equal at both ends of slivers, and which sides (k,) are slivers.

    A `side` (k,) or slot is one if it is far shorter than its neighbours; `slots` (r,) are sides
    that do not face as a whole.
    """
    number, every = np.arange(len(cells.vertices)), np.append(side, slots)
    length = cells.lengths
    beside = np.zeros(len(number))
    np.maximum.at(beside, cells.ends[side], length[side, None])
    narrow = length[every] < NARROW_SIDE * beside[cells.ends[every]].min(axis=1)
    for a, b in cells.ends[every[narrow]]:
        number[number == number[b]] = number[a]
    return number, narrow[: len(side)]


def fitted(gap: Array, degree: int) -> tuple[Array, Array]:
    """Bernstein coefficients (k, degree + 1) near to a `gap` (k, j), equal to it at the ends.

    And bounds (k,) of the difference: gaps are polynomials of degree `DATA_DEGREE`, and no Legendre
    polynomial exceeds 1.
    """
    B, root = bernstein(degree, POINTS), np.sqrt(WEIGHTS)
    c = np.empty((len(gap), degree + 1))
    c[:, [0, -1]] = gap @ TO_ENDS.T
    rest = root * (gap - c[:, [0, -1]] @ B[:, [0, -1]].T)
    c[:, 1:-1] = np.linalg.lstsq(root[:, None] * B[:, 1:-1], rest.T, rcond=None)[0].T
    return c, np.abs((gap - c @ B.T) @ TO_LEGENDRE.T).sum(axis=1)


def _lifted_gap(
    ends: Index, gap: Array, closed: Mask, stiff: Mask, narrow: Mask, degree: int
) -> tuple[Array, Array]:
    """Bernstein coefficients (k, degree + 1) of a gap that is nowhere negative, near to `gap`.

    And r (k, j), the difference: 0 where `gap` itself is not negative. At the vertices `ends`
    (k, 2) r is the same for all sides: it closes the gap where sides are `closed` (k,), but not at
    `stiff` vertices (k, 2), which do not move. On `narrow` sides (k,) r is constant.
    """
    c, off = fitted(gap, degree)
    lift = np.full(ends.max(initial=0) + 1, -np.inf)
    np.maximum.at(lift, ends, -c[:, [0, -1]])
    np.maximum.at(lift, ends[narrow, 0], -c[narrow].min(axis=1))
    np.maximum.at(lift, ends[stiff | ~closed[:, None]], 0.0)
    after = np.where(closed[:, None], 0.0, np.maximum(c, 0.0))
    after[:, [0, -1]] = c[:, [0, -1]] + lift[ends]
    after[narrow] = c[narrow] + lift[ends[narrow, :1]]
    stays = ~closed & (c.min(axis=1) > off) & (lift[ends] == 0).all(axis=1)
    r = after @ bernstein(degree, POINTS).T - gap
    return after, np.where(stays[:, None], 0.0, r)
