"""The mesh of the equilibrated stress: triangles with a straight or one curved side.

Its vertices are those of the mesh, and places on Gamma_K: where contact ends, and where vertices
of one body face a side of the other. There both bodies have the same sides, so that p* is one
polynomial on each. A triangle with such a place is divided from the opposite vertex or, where
several sides require it, first about the middle. Where data are no polynomials cells are bisected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ...quadrature import SampledElements
from .polynomials import coordinates

NEWTON_STEPS = 8
NEWTON_STEP = 1e-9  # of an element: the next step is round-off
WIDE_TRIANGLE = 0.1  # twice the area over the squared diameter, from which triangles are divided
# Twice the sine of the angle between sides that are on one line: where loads may contradict each
# other; but for round-off; nearly, so that tractions are more than 1e5 times what they balance.
SAME_LINE = 0.5
ONE_LINE = 1e-12
NEARLY_ONE_LINE = 1e-5
CURVED_LENGTH = 2.0  # times the length of curved sides, which are to be divided before others


@dataclass(frozen=True, eq=False)
class Cells:
    """Triangles, n of them, with e sides.

    Side i of a triangle is opposite to corner i and runs from corner i + 1 to corner i + 2; a
    side's own parameter t in [0, 1] runs from its vertex of the lower number to the other. The
    base, side 0, is the one that may be curved, else the shortest.
    """

    trace: BoundaryTrace  # boundary of the mesh that they divide
    vertices: Array  # (nv, 2) lengths
    triangles: Index  # (n, 3) numbers of the corners, anticlockwise
    parent: Index  # (n,) element of the mesh that each is a part of
    barycentric: Array  # (n, 3, 3) coordinates of the corners in it
    ends: Index  # (e, 2) vertices of the sides, the lower number first
    sides: Index  # (n, 3) sides of the triangles
    owner: Index  # (e,) a triangle of each side ...
    local: Index  # (e,) ... and which of its sides it is
    segment: Index  # (e,) segment of the boundary that a side is part of, -1 inside of bodies
    span: Array  # (e, 2) parameters s on it at t = 0 and t = 1
    curved: Mask  # (n,) triangles with a curved base
    bent: Mask  # (e,) curved sides

    @property
    def corners(self) -> Array:
        """Corners (n, 3, 2), lengths."""
        return self.vertices[self.triangles]

    @cached_property
    def diameters(self) -> Array:
        """Longest straight side (n,), lengths."""
        return np.asarray(self.lengths[self.sides].max(axis=1))

    @cached_property
    def turn(self) -> Array:
        """Angles (n,) by which bases turn."""
        _, slope = self.around(np.arange(len(self.triangles)), 0, np.array([0.0, 1.0]))
        start, stop = (slope @ np.array([1.0, 1j])).T
        return np.abs(np.angle(stop / start))

    @cached_property
    def backward(self) -> Mask:
        """Whether t runs against the sense of each triangle's side, (n, 3)."""
        start = np.roll(self.triangles, -1, axis=1)
        return start != self.ends[self.sides, 0]

    @property
    def inner(self) -> Mask:
        """Sides (e,) between two triangles."""
        return self.segment < 0

    @cached_property
    def on_axis(self) -> Mask:
        """Triangles (n,) with a side on the axis."""
        at_axis = np.asarray(self.trace.model.on_axis(self.vertices))
        sides = np.asarray(at_axis[self.ends].all(axis=1))
        return np.asarray(sides[self.sides].any(axis=1))

    @property
    def bodies(self) -> Index:
        """Numbers (n,) of the material regions."""
        return self.trace.arrays.bodies[self.parent]

    @cached_property
    def lengths(self) -> Array:
        """Lengths (e,) of the chords of sides."""
        return np.linalg.norm(np.diff(self.vertices[self.ends], axis=1)[:, 0], axis=1)

    def sides_on(self, segments: Index) -> Index:
        """Sides (k,) that are parts of `segments` (j,) of the boundary."""
        return np.flatnonzero(np.isin(self.segment, segments))

    def on_side(self, side: Index, t: Array) -> tuple[Index, Array]:
        """Segments (k,) and parameters s, like `t`, of places `t` (k,) or (k, j) on `side` (k,)."""
        a, b = self.span[side].T.reshape(2, -1, *[1] * (t.ndim - 1))
        return self.segment[side], a + (b - a) * t

    def side_at(self, segment: Index, s: Array) -> Index:
        """Sides (k,) that hold the places `s` (k,) of boundary segments `segment` (k,)."""
        order = np.lexsort((self.span.min(axis=1), self.segment))
        key = 4.0 * self.segment[order] + self.span[order].min(axis=1)
        return order[np.searchsorted(key, 4.0 * segment + s, side="right") - 1]

    def own_parameter(self, side: Index, s: Array) -> Array:
        """Parameters t (k, j) on sides `side` (k,) of places `s` (k, j) of their segments."""
        a, b = self.span[side, 0, None], self.span[side, 1, None]
        return np.asarray((s - a) / (b - a))

    def points(self, side: Index, t: Array) -> tuple[Array, Array]:
        """Points (k, 2) and derivatives by t (k, 2) at `t` (k,) of sides `side` (k,), lengths.

        Or (k, j, 2) at `t` (k, j).
        """
        side = np.broadcast_to(side if side.ndim == t.ndim else side[..., None], t.shape)
        a, b = self.vertices[self.ends[side, 0]], self.vertices[self.ends[side, 1]]
        x, dx, bent = a + t[..., None] * (b - a), b - a, self.bent[side]
        if bent.any():
            segment, s = self.on_side(side[bent], t[bent])
            x[bent] = self.trace.point(segment, s)
            dx[bent] = self.trace.derivative(segment, s) * np.diff(self.span[side[bent]], axis=1)
        return x, dx

    def around(self, at: Index, i: int | Index, t: Array) -> tuple[Array, Array]:
        """The same, (b, j, 2) each, at `t` (j,) on sides `i` (b,) of triangles `at` (b,).

        Anticlockwise.
        """
        back = self.backward[at, i][..., None]
        x, dx = self.points(self.sides[at, i], np.where(back, 1 - t, t))
        return x, np.where(back[..., None], -dx, dx)

    def image(self, at: Index, local: Array) -> tuple[Array, Array]:
        """Points (b, q, 2) of triangles `at` (b,), and derivatives (b, q, 2, 2) by `local` (q, 2).

        `local` are shares (a, b) of corners 2 and 0 where the base is straight. Where it is curved
        points lie on straight lines from the apex, x = x_0 + (1 - b) (base(a / (1 - b)) - x_0).
        """
        a, b = local.T
        t = np.divide(a, 1 - b, out=np.zeros(len(a)), where=b < 1)
        apex, (base, slope) = self.corners[at, :1], self.around(at, 0, t)
        x = apex + (1 - b)[:, None] * (base - apex)
        return x, np.stack([slope, t[:, None] * slope - (base - apex)], axis=-1)

    def measure(self, x: Array) -> Array:
        """The model's measure (...,) at points `x` (..., 2)."""
        return np.asarray(self.trace.model.measure(x.reshape(-1, 2))).reshape(x.shape[:-1])

    @cached_property
    def elements(self) -> SampledElements:
        """The elements of the mesh, the `parent` of each triangle, where functions have values."""
        return SampledElements(self.trace.mesh, 2)


@dataclass(frozen=True, eq=False)
class Places:
    """Quadrature points of b triangles, q in each."""

    cells: Cells
    at: Index  # (b,) the triangles
    local: Array  # (q, 2) their places (a, b) in each, as of `Cells.image`
    x: Array  # (b, q, 2) points, lengths
    slopes: Array  # (b, q, 2, 2) derivatives by (a, b)
    weight: Array  # (b, q) weights in the plane times the model's measure

    @cached_property
    def corners(self) -> Array:
        """Corners (b, 3, 2) of the triangles, lengths."""
        return self.cells.corners[self.at]

    @cached_property
    def affine(self) -> Array:
        """(a, b) in straight triangles with the same corners: (b, q, 2), or (q, 2) in all."""
        curved = self.cells.curved[self.at].any()
        return coordinates(self.corners, self.x) if curved else self.local

    @cached_property
    def reference(self) -> Array:
        """Reference coordinates (b, q, 2) in the parents."""
        cells, parent = self.cells, self.cells.parent[self.at]
        shares = np.column_stack([self.local[:, 1], 1 - self.local.sum(axis=1), self.local[:, 0]])
        found = shares @ cells.barycentric[self.at, :, :2]
        bent = np.flatnonzero(cells.trace.curved_elements[parent])
        for _ in range(NEWTON_STEPS if bent.size else 0):
            at = parent[bent], found[bent]
            slope = cells.elements.evaluate(ng.specialcf.JacobianMatrix(2), *at)
            miss = self.x[bent] - cells.elements.evaluate(ng.CF((ng.x, ng.y)), *at)
            step = np.linalg.solve(slope.reshape(*miss.shape, 2), miss[..., None])[..., 0]
            found[bent] += step
            if np.abs(step).max() <= NEWTON_STEP:
                break
        return found

    def evaluate(self, function: ng.CoefficientFunction) -> Array:
        """Values (b, q, dim) of a function at the points."""
        return self.cells.elements.evaluate(function, self.cells.parent[self.at], self.reference)


def places(cells: Cells, at: Index, order: int) -> Places:
    """Quadrature of degree `order` in triangles `at` (b,), all straight or all with a curved base.

    On curved ones in the distance from the apex, and in the parameter of the base.

    Raises
    ------
    ContactError
        A curved side goes beyond the middle of its element.
    """
    if cells.curved[at].any():
        g, w = gauss(order)
        sigma, t = (z.ravel() for z in np.meshgrid(g, g, indexing="ij"))
        local, weight = np.column_stack([sigma * t, 1 - sigma]), np.outer(w * g, w).ravel()
    else:
        rule = ng.IntegrationRule(ng.TRIG, order)
        local, weight = np.array(rule.points)[:, :2], np.array(rule.weights)
    x, slopes = cells.image(at, local)
    area = slopes[..., 0, 0] * slopes[..., 1, 1] - slopes[..., 0, 1] * slopes[..., 1, 0]
    if not (area > 0).all():
        raise ContactError("a curved side of the mesh goes beyond the middle of its element")
    return Places(cells, at, local, x, slopes, area * weight * cells.measure(x))


def alike(kind: Sequence[np.ndarray], some: Index) -> Iterator[tuple[list[int], Index]]:
    """The kinds of triangles `some` (k,), each with its triangles (b,).

    `kind` (n,) or (n, j) each are numbers of all n triangles that are the same in one.
    """
    kinds, number = np.unique(np.column_stack(kind)[some], axis=0, return_inverse=True)
    for k, one in enumerate(kinds.tolist()):
        yield one, some[number.ravel() == k]


def cells_of(trace: BoundaryTrace, cuts: tuple[Index, Array]) -> Cells:
    """Divide the mesh.

    Parameters
    ----------
    trace : BoundaryTrace
    cuts : ndarray of int (r,), ndarray (r,)
        Segments of the boundary with parameters s of new vertices, rising on each.
    """
    view, ne = trace.arrays, trace.mesh.ne
    whole = np.broadcast_to(np.eye(3), (ne, 3, 3))
    cells = joined(trace, view.vertices, view.elements, whole, np.arange(ne))
    segment, s = cuts
    cut = np.isin(cells.segment, segment)
    several = (cells.bent | cut)[cells.sides].sum(axis=1) > 1
    beside = cells.curved & ((cells.segment >= 0)[cells.sides].sum(axis=1) > 1)
    cells, _ = parted(cells, np.flatnonzero(several | beside))
    while len(segment):  # the middle one of each side
        side, first, count = np.unique(
            cells.side_at(segment, s), return_index=True, return_counts=True
        )
        own = first + count // 2
        cells, _ = _split(cells, side, cells.own_parameter(side, s[own, None])[:, 0])
        segment, s = np.delete(segment, own), np.delete(s, own)
    return cells


def joined(
    trace: BoundaryTrace, vertices: Array, triangles: Index, barycentric: Array, parent: Index
) -> Cells:
    """Cells of `triangles` (n, 3) by their `vertices` (nv, 2).

    `parent` (n,) and `barycentric` (n, 3, 3) are those of `Cells`, in the order of the triangles.
    Sides on one side of a parent lie on its segment of the boundary.
    """
    view = trace.arrays
    at = view.elements[trace.element][:, :, None] == view.facets[:, None]  # (k, corners, ends)
    last, outer = at[..., 1].argmax(axis=1), np.flatnonzero(~trace.inner)
    segments = np.full(view.elements.shape, -1)  # opposite to each corner of the elements
    segments[trace.element[outer], (~at.any(axis=2))[outer].argmax(axis=1)] = outer
    zero = barycentric == 0
    on = np.roll(zero, -1, axis=1) & np.roll(zero, -2, axis=1)  # (n, 3 sides, 3 of the parent)
    own = np.where(on, segments[parent][:, None], -1).max(axis=2)
    bent = np.append(trace.curved_segments, False)
    x = vertices[triangles]
    length = np.linalg.norm(np.roll(x, -2, axis=1) - np.roll(x, -1, axis=1), axis=2)
    base = np.where(bent[own], -1.0, length).argmin(axis=1)
    roll = (base[:, None] + np.arange(3)) % 3
    triangles, own = (np.take_along_axis(x, roll, axis=1) for x in (triangles, own))
    barycentric = np.take_along_axis(barycentric, roll[..., None], axis=1)
    start, stop = (np.roll(triangles, -k, axis=1).ravel() for k in (1, 2))
    both = np.sort(np.column_stack([start, stop]), axis=1)
    _, first, sides = np.unique(both @ [len(vertices), 1], return_index=True, return_inverse=True)
    owner, local = np.divmod(first, 3)
    segment = own[owner, local]
    ends = (local[:, None] + [1, 2]) % 3
    span = barycentric[owner[:, None], ends, last[segment][:, None]]
    span = np.where((start > stop)[first, None], span[:, ::-1], span)
    return Cells(
        trace=trace,
        vertices=vertices,
        triangles=triangles,
        parent=parent,
        barycentric=barycentric,
        ends=both[first],
        sides=sides.reshape(-1, 3),
        owner=owner,
        local=local,
        segment=segment,
        span=span,
        curved=bent[own[:, 0]],
        bent=bent[segment],
    )


def _with_parts(
    cells: Cells, of: Index, order: Index, moved: Index, number: Index, share: Array, new: Array
) -> tuple[Cells, Index]:
    """The cells with k others in place of those that these are part `of` (k,).

    Of the corners in an `order` (k, 3) one, `moved` (k,), becomes the vertex that is `number` (k,)
    of the `new` (r, 2) ones, with shares `share` (k, 3) of the corners. Also returned are the
    cells (m,) that each of all is or is part of.
    """
    every = np.arange(len(of))
    triangles, places = (x[of[:, None], order] for x in (cells.triangles, cells.barycentric))
    triangles[every, moved] = len(cells.vertices) + number
    places[every, moved] = (share[:, None] @ places)[:, 0]
    rest = np.setdiff1d(np.arange(len(cells.triangles)), of)
    whole = np.append(rest, of)
    finer = joined(
        cells.trace,
        np.concatenate([cells.vertices, new]),
        np.concatenate([cells.triangles[rest], triangles]),
        np.concatenate([cells.barycentric[rest], places]),
        cells.parent[whole],
    )
    return finer, whole


def _split(cells: Cells, at: Index, t: Array) -> tuple[Cells, Index]:
    """Cells with new vertices at `t` (r,) of sides `at` (r,), divided from the opposite corners.

    No triangle has two of these sides. Also returned is what `_with_parts` does.
    """
    rank, new = np.argsort(at), cells.points(at, t)[0]
    owner, local = np.nonzero(np.isin(cells.sides, at))
    number = rank[np.searchsorted(at[rank], cells.sides[owner, local])]
    t = np.where(cells.backward[owner, local], 1 - t[number], t[number])
    order, share = (local[:, None] + np.arange(3)) % 3, np.column_stack([0 * t, 1 - t, t])
    both, moved = np.tile(np.arange(len(owner)), 2), np.repeat([2, 1], len(owner))
    return _with_parts(cells, owner[both], order[both], moved, number[both], share[both], new)


def bisected(
    cells: Cells, marked: Mask, linked: Callable[[Cells], tuple[Index, Index, Array]]
) -> tuple[Cells, Index]:
    """Cells divided in the middle of the longest sides of triangles `marked` (n,), or towards that.

    And the cells (m,) that each is or is part of. A side is divided where it is the longest of all
    triangles beside it; from a marked triangle the way there goes over the longest sides of
    neighbours, which come first (Rivara 1984, Int. J. Numer. Meth. Eng. 20:745). Sides that face
    each other are one: `linked` tells both, (k,) and (k,), and the places (k,) on the latter that
    face the middles of the former.
    """
    side, other, there = linked(cells)
    one, t = np.arange(len(cells.ends)), np.full(len(cells.ends), 0.5)
    one[other], t[other] = side, there
    length = cells.lengths * np.where(cells.bent, CURVED_LENGTH, 1.0)
    rank, of = np.argsort(np.argsort(length, kind="stable")), one[cells.sides]  # no two are alike
    longest = of[np.arange(len(of)), rank[of].argmax(axis=1)]
    wanted, count = np.isin(one, longest[marked]), 0
    while count < (count := wanted.sum()):
        wanted[longest[wanted[of].any(axis=1)]] = True
    wanted[of[of != longest[:, None]]] = False
    at = np.flatnonzero(wanted[one])
    return _split(cells, at, t[at])


def parted(cells: Cells, at: Index) -> tuple[Cells, Index]:
    """Cells with triangles `at` (k,) divided in three about the centres of their inscribed circles.

    So parts of thin triangles are not flat. Triangles with a curved side are divided about the
    centre of gravity, which is farther from the longest side. Also returned are the cells (m,) that
    each is or is part of.
    """
    share = np.where(cells.curved[at, None], 1.0, cells.lengths[cells.sides[at]])
    share /= share.sum(axis=1, keepdims=True)
    new, number = (share[:, None] @ cells.corners[at])[:, 0], np.repeat(np.arange(len(at)), 3)
    order, moved = np.tile([0, 1, 2], (len(number), 1)), np.tile([0, 1, 2], len(at))
    return _with_parts(cells, at[number], order, moved, number, share[number], new)


def dependent(cells: Cells, loaded: Index, held: Index) -> Index:
    """Triangles (k,) at vertices where no symmetric stress may have the given tractions.

    With the normals n and m of two sides of a triangle n.(s m) = m.(s n) at their vertex. If all
    sides at a vertex lie on two lines, the sum of these equations contains given tractions alone:
    they may contradict it on `loaded` sides. Where sides lie on two lines only nearly, as at some
    vertices of a mesh that is nearly symmetric, inner tractions would be round-off times a large
    number. More triangles at the vertex remove this condition. `loaded` (k,) are segments that
    carry something, `held` (k,) those on which the whole displacement is prescribed.
    """
    loads, supports = np.zeros((2, len(cells.vertices)), dtype=bool)
    loads[cells.ends[cells.sides_on(loaded)]] = True
    supports[cells.ends[cells.sides_on(held)]] = True
    side, end = np.repeat(np.arange(len(cells.ends)), 2), np.tile([0, 1], len(cells.ends))
    vertex = cells.ends.ravel()
    line = cells.points(side, end.astype(float))[1] @ np.array([1.0, 1j])
    line = line**2 / np.abs(line) ** 2  # one number for both senses
    off, left = np.zeros(len(loads)), np.arange(len(vertex))
    for _ in range(2):  # take away the sides of one line
        one = np.zeros(len(loads), dtype=complex)
        one[vertex[left]] = line[left]
        apart = np.abs(line[left] - one[vertex[left]])
        np.maximum.at(off, vertex[left], np.where(apart > SAME_LINE, 0.0, apart))
        left = left[apart > SAME_LINE]
    off[vertex[left]] = np.inf
    at_two = ~supports & ((loads & (off < np.inf)) | ((off > ONE_LINE) & (off < NEARLY_ONE_LINE)))
    x, widest = cells.corners, np.zeros(len(at_two))
    wide = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / cells.diameters**2
    np.maximum.at(widest, cells.triangles, wide[:, None])
    enough = wide[:, None] >= np.minimum(WIDE_TRIANGLE, widest)[cells.triangles]
    return np.flatnonzero((at_two[cells.triangles] & enough).any(axis=1))
