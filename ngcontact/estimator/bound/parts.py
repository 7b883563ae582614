"""Triangles in parts, islands of a mesh of their own, on which data are looked at closely."""

from __future__ import annotations

from functools import lru_cache

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...fem import narrow_forces
from ...problem import Problem
from ...quadrature import numbers
from .cells import Cells, joined, places
from .polynomials import frame_of, projected, scalars

PARTS = 4  # of each side
LEVELS = 2  # how often triangles are divided
SMOOTH = 1e-3  # of the largest force: what polynomials miss where none is divided
LEFT = 0.005  # share of the squares of what is missed, that may be on parts not divided again
AT_ONCE = 200_000  # points at which forces are looked at together


@lru_cache
def pattern(m: int) -> tuple[Array, Index, Index, Array]:
    """The m^2 equal parts of a triangle; those at its corners in three about their middles, m > 1.

    There given tractions may be those of no symmetric stress. Side 0 of a part is the one that lies
    on the triangle's, where one does.

    Returns
    -------
    shares : ndarray (p, 3)
        Of the triangle's corners in the vertices.
    corners : ndarray of int (k, 3)
        Vertices of each part, anticlockwise.
    outer : ndarray of int (k, 3)
        The triangle's side on which each side lies, or -1.
    span : ndarray (k, 3, 2)
        Where it starts and ends on that, from 0 to 1 in the triangle's sense.
    """
    at = {ij: n for n, ij in enumerate((i, j) for i in range(m + 1) for j in range(m + 1 - i))}
    vertices = [(m - i - j, i, j) for i, j in at]
    found = []
    for i, j in at:
        if i + j < m:
            up = [at[i, j], at[i + 1, j], at[i, j + 1]]
            if m > 1 and any(max(vertices[v]) == m for v in up):
                vertices.append(tuple(np.mean([vertices[v] for v in up], axis=0)))
                middle = len(vertices) - 1
                found += [[middle, up[1], up[2]], [middle, up[2], up[0]], [middle, up[0], up[1]]]
            else:
                found.append(up)
        if i + j < m - 1:
            found.append([at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]])
    shares, corners = np.array(vertices) / m, np.array(found)
    for turn in (0, 1, 2):  # the outer side first, of all the triangle's side 0
        ends = shares[np.roll(corners, -1, axis=1)], shares[np.roll(corners, -2, axis=1)]
        on = (ends[0] == 0) & (ends[1] == 0)  # (k, 3 own sides, 3 sides of the triangle)
        outer = np.where(on.any(axis=2), on.argmax(axis=2), -1)
        if turn < 2:
            rank = np.where(outer < 0, 3, outer)
            roll = (rank.argmin(axis=1)[:, None] + np.arange(3)) % 3
            corners = np.take_along_axis(corners, roll, axis=1)
    along = np.stack(ends, axis=2)[
        np.arange(len(corners))[:, None, None],
        np.arange(3)[:, None],
        np.arange(2),
        (outer[:, :, None] + 2) % 3,
    ]
    return shares, corners, outer, along


def divided(cells: Cells, at: Index, m: int = PARTS) -> Cells:
    """Triangles `at` (b,) in parts, those of each together; no two share a vertex."""
    shares, corners, outer, along = pattern(m)
    b, p, k = len(at), len(shares), len(corners)
    x = np.einsum("pc,bcd->bpd", shares, cells.corners[at])
    bent = np.flatnonzero(cells.curved[at])
    if bent.size:
        sigma = 1 - shares[:, 0]
        t = np.divide(shares[:, 2], sigma, out=np.zeros(p), where=sigma > 0)
        own = np.where(cells.backward[at[bent], 0, None], 1 - t, t)
        base, _ = cells.points(np.repeat(cells.sides[at[bent], 0], p), own.ravel())
        apex = cells.corners[at[bent], :1]
        x[bent] = apex + sigma[:, None] * (base.reshape(-1, p, 2) - apex)
    reference = np.einsum("pc,bcd->bpd", shares, cells.reference[at])
    sides = cells.sides[at]
    span = np.where(cells.backward[at][..., None], cells.span[sides][..., ::-1], cells.span[sides])
    start, stop = span[:, outer, 0], span[:, outer, 1]  # (b, k, 3)
    return joined(
        cells.trace,
        x.reshape(-1, 2),
        (corners + p * np.arange(b)[:, None, None]).reshape(-1, 3),
        reference[:, corners].reshape(-1, 3, 2),
        np.repeat(cells.parent[at], k),
        np.where(outer < 0, -1, cells.segment[sides][:, outer]).reshape(-1, 3),
        (start[..., None] + (stop - start)[..., None] * along).reshape(-1, 3, 2),
        (cells.curved[at][:, None] & (outer[:, 0] == 0)).ravel(),
    )


def looked_at(
    F: ng.CoefficientFunction, cells: Cells, at: Index, order: int, depth: int
) -> tuple[Array, Array, Array]:
    """Points (b, q, 2), weights (b, q) and values (b, q, dim) of F in triangles `at` (b,).

    All are straight or have a curved base; a rule of an `order` on them, divided `depth` times.
    """
    if depth == 0:
        points = places(cells, at, order)
        measure = cells.trace.model.measure(points.x.reshape(-1, 2)).reshape(points.weight.shape)
        return points.x, points.weight * measure, points.evaluate(cells, F)
    parts = divided(cells, at)
    found = []
    for curved in (False, True):
        some = np.flatnonzero(parts.curved == curved)
        if some.size:
            values = looked_at(F, parts, some, order, depth - 1)
            found.append([z.reshape(len(at), -1, *z.shape[2:]) for z in values])
    x, weight, values = (np.concatenate(z, axis=1) for z in zip(*found, strict=True))
    return x, weight, values


def projection(
    F: ng.CoefficientFunction,
    cells: Cells,
    at: Index,
    degree: int,
    order: int,
    depth: int,
    components: slice = slice(None),
) -> tuple[Array, Array, Array]:
    """Coefficients (b, m, 2) of polynomials of a degree near to F, norms (b,) of the rest, and of F.

    In triangles `at` (b,) as of `looked_at`; norms of some `components`, times the measure.
    """
    force, rest, size = [], [], []
    step = max(1, AT_ONCE // (len(pattern(PARTS)[1]) ** depth * (order // 2 + 1) ** 2))
    for start in range(0, len(at), step):
        some = at[start : start + step]
        x, weight, values = looked_at(F, cells, some, order, depth)
        frame = frame_of(cells.corners[some])
        force.append(projected(degree, frame, x, weight, values))
        left = (values - scalars(degree, frame, x) @ force[-1])[..., components]
        measure = cells.trace.model.measure(x.reshape(-1, 2)).reshape(weight.shape)
        for found, function in ((rest, left), (size, values[..., components])):
            found.append(np.sqrt(np.einsum("bq,bqd->b", weight * measure, function**2)))
    return np.concatenate(force), np.concatenate(rest), np.concatenate(size)


def depths(problem: Problem, cells: Cells, degree: int, order: int, least: Mask) -> Index:
    """How often triangles (n,) are divided: where forces are not near to polynomials.

    With stresses of a `degree`, by rules of an `order`; once at least on curves, and where `least`
    (n,) says so.
    """
    mesh = cells.trace.mesh
    found = (least | cells.curved).astype(np.intp)
    if all(numbers(ng.CF(F)) for F in problem.force.values()):
        return found
    degree -= 1 + cells.trace.model.extent
    narrow = narrow_forces(problem, mesh, cells.trace.order)[cells.parent]
    bodies = [
        (ng.CF(F), np.flatnonzero(np.array(mesh.Materials(k).Mask())[cells.bodies]))
        for k, F in problem.force.items()
    ]

    def of(cells: Cells, at: Index, F: ng.CoefficientFunction, least: float, level: int) -> Index:
        depth, rest, size = np.zeros((3, len(at)))
        axial = slice(cells.trace.model.extent, None)
        for curved in (False, True):
            some = np.flatnonzero(cells.curved[at] == curved)
            if some.size:
                _, rest[some], size[some] = projection(F, cells, at[some], degree, order, 0, axial)
        area = np.abs(np.linalg.det(cells.corners[at][:, 1:] - cells.corners[at][:, :1])) / 2
        rest, size = rest / np.sqrt(area), size / np.sqrt(area)
        least = max(least, SMOOTH * size.max(initial=0.0))
        rough = rest > least
        if level == LEVELS:
            rough |= narrow[at]
        else:
            largest = np.sort(area * rest**2)[::-1]
            enough = np.searchsorted(np.cumsum(largest), (1 - LEFT) * largest.sum())
            rough &= area * rest**2 >= largest[min(enough, len(largest) - 1)]
        if not rough.any():
            return depth.astype(np.intp)
        depth[rough] = 1
        if level > 1:
            parts = divided(cells, at[rough])
            inner = of(parts, np.arange(len(parts.triangles)), F, least, level - 1)
            depth[rough] += inner.reshape(rough.sum(), -1).max(axis=1)
            if level == LEVELS:
                depth[narrow[at]] = LEVELS
        return depth.astype(np.intp)

    for F, at in bodies:
        if not numbers(F):
            found[at] = np.maximum(found[at], of(cells, at, F, 0.0, LEVELS))
    return found
