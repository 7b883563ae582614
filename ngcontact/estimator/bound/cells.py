"""The mesh of the equilibrated stress: triangles with a straight or one curved side.

Its vertices are those of the mesh, and places on Gamma_K: where contact ends, and where vertices
of one body face a side of the other. There both bodies have the same sides, so that p* is one
polynomial on each. A triangle with such a place, or with a curved side, becomes triangles with a
common apex, the opposite vertex or, where several sides ask for it, the middle.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...fem import BoundaryTrace
from ...lagrange import gauss
from ...problem import Triangulation

REFERENCE = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])  # NGSolve's corners, in this order
NEWTON_STEPS = 8
CLOSE = 1e-9  # of an element: the next step is round-off
WIDE = 0.1  # twice the area over the square of the diameter, from which triangles are divided
TURN = 0.5  # twice the sine of the angle between sides up to which they are on one line


@dataclass(frozen=True, eq=False)
class Cells:
    """Triangles, n of them, with e sides; b sides lie on the boundary.

    Side i of a triangle is opposite to corner i and runs from corner i + 1 to corner i + 2; a
    side's own parameter t in [0, 1] runs from its vertex of the lower number to the other.

    Attributes
    ----------
    trace : BoundaryTrace
        Boundary of the mesh that they divide.
    vertices : ndarray (nv, 2)
        Their corners, lengths.
    triangles : ndarray of int (n, 3)
        Anticlockwise; the base, side 0, is the one that may be curved, else the shortest.
    parent : ndarray of int (n,)
        Element of the mesh that each is a part of.
    reference : ndarray (n, 3, 2)
        Corners in the reference coordinates of the parent.
    ends : ndarray of int (e, 2)
        Vertices of the sides, the lower number first.
    sides : ndarray of int (n, 3)
        Side numbers.
    owner, local : ndarray of int (e,)
        A triangle of each side, and which of its sides it is.
    segment : ndarray of int (e,)
        Segment of the boundary that a side is part of, -1 inside of bodies.
    span : ndarray (e, 2)
        Parameters s on that segment at t = 0 and t = 1.
    curved : ndarray of bool (n,)
        Triangles with a curved base.
    """

    trace: BoundaryTrace
    vertices: Array
    triangles: Index
    parent: Index
    reference: Array
    ends: Index
    sides: Index
    owner: Index
    local: Index
    segment: Index
    span: Array
    curved: Mask

    @property
    def corners(self) -> Array:
        """Corners (n, 3, 2), lengths."""
        return self.vertices[self.triangles]

    @cached_property
    def diameters(self) -> Array:
        """Longest straight side (n,), lengths."""
        x = self.corners
        return np.linalg.norm(x - np.roll(x, 1, axis=1), axis=2).max(axis=1)

    @cached_property
    def backward(self) -> Mask:
        """Whether t runs against the sense of each triangle's side, (n, 3)."""
        start = np.roll(self.triangles, -1, axis=1)
        return start != self.ends[self.sides, 0]

    @cached_property
    def inner(self) -> Mask:
        """Sides (e,) between two triangles."""
        return np.bincount(self.sides.ravel(), minlength=len(self.ends)) > 1

    @property
    def bodies(self) -> Index:
        """Numbers (n,) of the material regions."""
        return Triangulation(self.trace.mesh).bodies[self.parent]

    def on_side(self, side: Index, t: Array) -> tuple[Index, Array]:
        """Segment (k,) and parameter s (k,) of places `t` (k,) on boundary sides `side` (k,)."""
        a, b = self.span[side].T
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
        """Points (k, 2) and derivatives by t (k, 2) at `t` (k,) of sides `side` (k,), lengths."""
        a, b = self.vertices[self.ends[side, 0]], self.vertices[self.ends[side, 1]]
        x, dx = a + t[:, None] * (b - a), b - a
        bent = np.flatnonzero(self.bent[side])
        if bent.size:
            segment, s = self.on_side(side[bent], t[bent])
            x[bent] = self.trace.point(segment, s)
            rate = np.diff(self.span[side[bent]], axis=1)
            dx[bent] = self.trace.derivative(segment, s) * rate
        return x, dx

    @cached_property
    def bent(self) -> Mask:
        """Curved sides (e,)."""
        bent = np.zeros(len(self.ends), dtype=bool)
        bent[self.sides[self.curved, 0]] = True
        return bent

    def evaluate(self, function: ng.CoefficientFunction, at: Index, reference: Array) -> Array:
        """Values (k, dim) in triangles `at` (k,) at places `reference` (k, 2) of their parents."""
        points = self._middles[self.parent[at]]
        points["x"], points["y"] = reference.T
        return np.asarray(function(points)).reshape(len(at), function.dim)

    @cached_property
    def _middles(self) -> np.ndarray:
        rule = ng.IntegrationRule([(1 / 3, 1 / 3, 0)], [1.0])
        return np.asarray(self.trace.mesh.MapToAllElements(rule, ng.VOL))

    def located(self, at: Index, x: Array, guess: Array) -> Array:
        """Reference places (k, 2) of `x` (k, 2) in the parents of triangles `at` (k,).

        By Newton's method from a `guess` (k, 2), exact where elements are straight.
        """
        bent = np.flatnonzero(self.trace.curved_elements[self.parent[at]])
        if bent.size == 0:
            return guess
        place, jacobian = ng.CF((ng.x, ng.y)), ng.specialcf.JacobianMatrix(2)
        found = guess.copy()
        for _ in range(NEWTON_STEPS):
            slope = self.evaluate(jacobian, at[bent], found[bent]).reshape(-1, 2, 2)
            miss = x[bent] - self.evaluate(place, at[bent], found[bent])
            step = np.linalg.solve(slope, miss[:, :, None])[:, :, 0]
            found[bent] += step
            if np.abs(step).max() <= CLOSE:
                break
        return found


@dataclass(frozen=True, eq=False)
class Places:
    """Quadrature points of b triangles, q in each.

    Attributes
    ----------
    at : ndarray of int (b,)
        The triangles.
    x : ndarray (b, q, 2)
        Points, lengths.
    weight : ndarray (b, q)
        Weights in the plane, areas.
    reference : ndarray (b, q, 2)
        Reference coordinates in the parents.
    spread : ndarray (b, q, 2, 2)
        Derivatives of x by (a, b), where x = corner 0 + a (corner 1 - corner 0) + b (corner 2 -
        corner 0) if the base is straight.
    local : ndarray (q, 2)
        These (a, b).
    """

    at: Index
    x: Array
    weight: Array
    reference: Array
    spread: Array
    local: Array

    def evaluate(self, cells: Cells, function: ng.CoefficientFunction) -> Array:
        """Values (b, q, dim) of a function at the points."""
        b, q = self.weight.shape
        flat = self.reference.reshape(-1, 2)
        return cells.evaluate(function, np.repeat(self.at, q), flat).reshape(b, q, -1)


def places(cells: Cells, at: Index, order: int) -> Places:
    """Quadrature of degree `order` in triangles `at` (b,), all straight or all with a curved base.

    Towards a curved base points lie on straight lines from the apex.

    Raises
    ------
    ContactError
        A curved side goes beyond the middle of its element.
    """
    corners = cells.corners[at]
    if len(at) and cells.curved[at[0]]:
        g, w = gauss(order)
        sigma, t = (z.ravel() for z in np.meshgrid(g, g, indexing="ij"))
        weight = np.outer(w * g, w).ravel()
        side = np.repeat(cells.sides[at, 0], len(t))
        own = np.where(
            np.repeat(cells.backward[at, 0], len(t)), 1 - np.tile(t, len(at)), np.tile(t, len(at))
        )
        base, slope = (z.reshape(len(at), -1, 2) for z in cells.points(side, own))
        slope = np.where(cells.backward[at, 0][:, None, None], -slope, slope)
        away = base - corners[:, :1]
        x = corners[:, :1] + sigma[:, None] * away
        # x = apex + sigma (base(t) - apex), a = sigma (1 - t), b = sigma t
        by_a, by_b = away - t[:, None] * slope, away + (1 - t)[:, None] * slope
        spread = np.stack([by_a, by_b], axis=-1)
        local = np.column_stack([sigma * (1 - t), sigma * t])
    else:
        rule = ng.IntegrationRule(ng.TRIG, order)
        local, weight = np.array([p[:2] for p in rule.points]), np.array(rule.weights)
        edges = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]], axis=-1)
        x = corners[:, :1] + np.einsum("bij,qj->bqi", edges, local)
        spread = np.broadcast_to(edges[:, None], (len(at), len(weight), 2, 2))
    share = np.column_stack([1 - local.sum(axis=1), local])
    guess = np.einsum("qc,bcd->bqd", share, cells.reference[at])
    number = np.repeat(at, len(weight))
    found = cells.located(number, x.reshape(-1, 2), guess.reshape(-1, 2)).reshape(x.shape)
    area = np.linalg.det(spread)
    if not (area > 0).all():
        raise ContactError("a curved side of the mesh goes beyond the middle of its element")
    return Places(at, x, area * weight, found, spread, local)


def cells_of(trace: BoundaryTrace, cuts: Mapping[int, Array], loaded: Index, held: Index) -> Cells:
    """Divide the mesh.

    Parameters
    ----------
    trace : BoundaryTrace
    cuts : dict of int to ndarray (j,)
        Rising parameters s of new vertices on segments of the boundary.
    loaded, held : ndarray of int (k,)
        Segments that carry something, and those on which the whole displacement is prescribed.
    """
    view = Triangulation(trace.mesh)
    old, ends = view.triangles, view.segments
    segment = _segments_of_elements(trace, old, ends)
    bent, cut = np.zeros((2, len(ends) + 1), dtype=bool)
    bent[:-1], cut[list(cuts)] = trace.curved_segments, True
    special = (bent | cut)[segment]
    beside = bent[segment].any(axis=1) & ((segment >= 0).sum(axis=1) > 1)
    middle = (special.sum(axis=1) > 1) | beside
    parts = np.flatnonzero(middle | cut[segment].any(axis=1))
    whole = np.setdiff1d(np.arange(len(old)), parts)
    roll = (special[whole].argmax(axis=1)[:, None] + np.arange(3)) % 3  # the base first
    own = np.take_along_axis(segment[whole], roll, axis=1)
    triangles = np.take_along_axis(old[whole], roll, axis=1)
    ahead = ends[own, 0] == np.roll(triangles, -1, axis=1)
    spans = np.where(ahead[:, :, None], [0.0, 1.0], [1.0, 0.0])
    made = _Parts(trace, view, segment, cuts)
    for e in parts.tolist():
        made.divide(e, None if middle[e] else int(special[e].argmax()))
    new = made.arrays()
    both: tuple[Any, ...] = (triangles, REFERENCE[roll], whole, own, spans)
    triangles, reference, parent, own, spans = (
        np.concatenate(pair) for pair in zip(both, new, strict=True)
    )
    vertices = np.concatenate([view.vertices, *made.places])
    curved = bent[own[:, 0]]
    cells = joined(trace, vertices, triangles, reference, parent, own, spans, curved)
    return _parted(cells, dependent(cells, loaded, held))


def joined(
    trace: BoundaryTrace,
    vertices: Array,
    triangles: Index,
    reference: Array,
    parent: Index,
    own: Index,
    spans: Array,
    curved: Mask,
) -> Cells:
    """Cells of triangles whose sides are known to lie on segments, or inside.

    Parameters
    ----------
    vertices : ndarray (nv, 2)
    triangles : ndarray of int (n, 3)
        Side 0 is the curved one where there is one; else the shortest becomes side 0.
    reference : ndarray (n, 3, 2)
    parent : ndarray of int (n,)
    own : ndarray of int (n, 3)
        Segment that each side is part of, -1 inside of elements.
    spans : ndarray (n, 3, 2)
        Parameters s on it where the side begins and ends, anticlockwise.
    curved : ndarray of bool (n,)
    """
    shortest = np.where(curved, 0, _lengths(vertices[triangles]).argmin(axis=1))
    roll = (shortest[:, None] + np.arange(3)) % 3
    triangles, own = (np.take_along_axis(x, roll, axis=1) for x in (triangles, own))
    reference, spans = (np.take_along_axis(x, roll[..., None], axis=1) for x in (reference, spans))
    start = np.roll(triangles, -1, axis=1).ravel()
    stop = np.roll(triangles, -2, axis=1).ravel()
    low, high = np.minimum(start, stop), np.maximum(start, stop)
    _, first, sides = np.unique(low * len(vertices) + high, return_index=True, return_inverse=True)
    span = spans.reshape(-1, 2)[first]
    return Cells(
        trace=trace,
        vertices=vertices,
        triangles=triangles,
        parent=parent,
        reference=reference,
        ends=np.column_stack([low, high])[first],
        sides=sides.reshape(-1, 3),
        owner=first // 3,
        local=first % 3,
        segment=np.where(trace.inner[own.ravel()[first]], -1, own.ravel()[first]),
        span=np.where((start > stop)[first, None], span[:, ::-1], span),
        curved=curved,
    )


def _lengths(corners: Array) -> Array:
    """Lengths (n, 3) of the straight sides opposite to `corners` (n, 3, 2)."""
    return np.linalg.norm(np.roll(corners, -2, axis=1) - np.roll(corners, -1, axis=1), axis=2)


def _parted(cells: Cells, at: Index) -> Cells:
    """Triangles `at` (k,) in three about the middles of their inscribed circles.

    Parts of thin triangles are thin with one short side, not flat.
    """
    own, spans = cells.segment[cells.sides], cells.span[cells.sides]
    spans = np.where(cells.backward[..., None], spans[..., ::-1], spans)
    rest = np.setdiff1d(np.arange(len(cells.triangles)), at)
    middle = len(cells.vertices) + np.arange(len(at))
    share = _lengths(cells.corners[at])
    share /= share.sum(axis=1, keepdims=True)
    place, x = (np.einsum("kc,kcd->kd", share, y[at]) for y in (cells.reference, cells.corners))
    inside = np.full(len(at), -1)
    whole_ones = cells.triangles, cells.reference, cells.parent, own, spans
    parts: list[list[Any]] = [[x[rest]] for x in whole_ones]
    whole = np.broadcast_to([0.0, 1.0], (len(at), 2))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        corners, reference = cells.triangles[at], cells.reference[at]
        new = (
            np.stack([middle, corners[:, j], corners[:, k]], axis=1),
            np.stack([place, reference[:, j], reference[:, k]], axis=1),
            cells.parent[at],
            np.stack([own[at, i], inside, inside], axis=1),
            np.stack([spans[at, i], whole, whole], axis=1),
        )
        for values, value in zip(parts, new, strict=True):
            values.append(value)
    vertices = np.concatenate([cells.vertices, x])
    curved = np.concatenate([cells.curved[rest], cells.curved[at], np.zeros(2 * len(at), bool)])
    triangles, reference, parent, own, spans = (np.concatenate(x) for x in parts)
    return joined(cells.trace, vertices, triangles, reference, parent, own, spans, curved=curved)


def dependent(cells: Cells, loaded: Index, held: Index) -> Index:
    """Triangles (k,) at vertices where given tractions may be those of no symmetric stress.

    Where n and m are the normals of two sides of a triangle, n.(s m) = m.(s n) at their vertex.
    Around a vertex of the boundary all sides of which lie on two lines, as at a corner of one
    triangle or between two on a straight boundary, these equations have a sum without tractions of
    inner sides: a condition on those that are given. Another triangle there takes it away.

    Parameters
    ----------
    cells : Cells
    loaded, held : ndarray of int (k,)
        As of `cells_of`.
    """
    count = len(cells.vertices)
    border = ~cells.inner
    carries, free = np.zeros((2, count), dtype=bool)
    carries[cells.ends[border & np.isin(cells.segment, loaded)]] = True
    free[cells.ends[border & np.isin(cells.segment, held)]] = True
    side, end = np.nonzero((carries & ~free)[cells.ends])
    vertex = cells.ends[side, end]
    _, along = cells.points(side, end.astype(float))
    line = along @ np.array([1.0, 1j])
    line = line**2 / np.abs(line) ** 2  # one number for both senses
    at_two = np.zeros(count, dtype=bool)
    at_two[vertex] = True
    left = np.arange(len(vertex))
    for _ in range(2):  # take away the sides of one line
        one = np.zeros(count, dtype=complex)
        one[vertex[left]] = line[left]
        left = left[np.abs(line[left] - one[vertex[left]]) > TURN]
    at_two[vertex[left]] = False
    chosen = np.full(count, -1)
    x = cells.corners  # straight ones, and wide ones, if there are any
    wide = np.abs(np.linalg.det(x[:, 1:] - x[:, :1])) / cells.diameters**2
    order = np.lexsort((wide, ~cells.curved))
    chosen[cells.triangles[order]] = order[:, None]
    every = at_two[cells.triangles].any(axis=1) & ~cells.curved & (wide > WIDE)
    return np.union1d(chosen[at_two], np.flatnonzero(every))


class _Parts:
    """Triangles that take the place of elements, with the vertices that they add."""

    def __init__(
        self, trace: BoundaryTrace, view: Triangulation, segment: Index, cuts: Mapping[int, Array]
    ) -> None:
        self.trace, self.view, self.segment, self.cuts = trace, view, segment, cuts
        self.places: list[Array] = []
        self.rows: tuple[list, ...] = ([], [], [], [], [])
        self.number = {k: self._added(self._on(k, s)) for k, s in cuts.items()}

    def _on(self, k: int, s: Array) -> Array:
        return self.trace.point(np.full(len(s), k), s)

    def _added(self, x: Array) -> list[int]:
        first = len(self.view.vertices) + sum(map(len, self.places))
        self.places.append(x)
        return list(range(first, first + len(x)))

    def divide(self, e: int, base: int | None) -> None:
        """Add the triangles between side `base` of element `e` and its apex.

        Without a base those between all sides and the middle.
        """
        old, segment = self.view.triangles[e], self.segment[e]
        if base is None:
            (apex,), at = self._added(self.view.vertices[old].mean(axis=0)[None]), np.full(2, 1 / 3)
        else:
            apex, at = int(old[base]), REFERENCE[base]
        for i in (0, 1, 2) if base is None else (base,):
            j, k, number = (i + 1) % 3, (i + 2) % 3, int(segment[i])
            s = np.array([0.0, *self.cuts.get(number, ()), 1.0])
            chain = [*self.number.get(number, ())]
            if number >= 0 and self.view.segments[number, 0] != old[j]:
                s, chain = s[::-1], chain[::-1]
            chain = [int(old[j]), *chain, int(old[k])]
            place = REFERENCE[j] + np.abs(s - s[0])[:, None] * (REFERENCE[k] - REFERENCE[j])
            for m in range(len(s) - 1):
                own = [number, -1, -1]
                if base is not None:  # the element's own other sides
                    own[1] = int(segment[j]) if m == len(s) - 2 else -1
                    own[2] = int(segment[k]) if m == 0 else -1
                spans = [(s[m], s[m + 1]), *(self._whole(own[c], (j, k)[c - 1], e) for c in (1, 2))]
                corners = [at, place[m], place[m + 1]]
                made = ([apex, chain[m], chain[m + 1]], corners, e, own, spans)
                for values, value in zip(self.rows, made, strict=True):
                    values.append(value)

    def _whole(self, segment: int, side: int, e: int) -> tuple[float, float]:
        """Parameters of a whole segment along a side of an element."""
        start = self.view.triangles[e, (side + 1) % 3]
        return (0.0, 1.0) if self.view.segments[segment, 0] == start else (1.0, 0.0)

    def arrays(self) -> tuple[Array, ...]:
        """Triangles, corners in the parents, parents, segments and their spans at the sides."""
        shapes = ((3,), (3, 2), (), (3,), (3, 2))
        kinds = (np.intp, float, np.intp, np.intp, float)
        return tuple(
            np.array(rows, dtype=kind).reshape(-1, *shape)
            for rows, kind, shape in zip(self.rows, kinds, shapes, strict=True)
        )


def _segments_of_elements(trace: BoundaryTrace, triangles: Index, ends: Index) -> Index:
    """Segment (ne, 3) at the side opposite to each corner, -1 where there is none."""
    nv = int(triangles.max()) + 1
    start, stop = np.roll(triangles, -1, axis=1), np.roll(triangles, -2, axis=1)
    keys = np.minimum(start, stop) * nv + np.maximum(start, stop)
    own = ends.min(axis=1) * nv + ends.max(axis=1)
    order = np.argsort(own)
    at = np.minimum(np.searchsorted(own[order], keys), len(own) - 1)
    return np.where(own[order][at] == keys, order[at], -1)
