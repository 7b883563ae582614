"""Triangles in parts, islands of a mesh of their own, on which data are looked at closely."""

from __future__ import annotations

from functools import lru_cache

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from .cells import Cells, joined, places
from .polynomials import frame_of, projected, scalars

PARTS = 4  # of each side
LEVELS = 2  # how often triangles are divided
BENT = 2  # times the order of rules on curved triangles, for polynomials in x
AT_ONCE = 200_000  # points at which forces are looked at together


@lru_cache
def pattern(thirds: bool) -> tuple[Array, Index, Index, Array]:
    """The equal parts of a triangle; those at its corners in `thirds` about their middles.

    There given tractions may be those of no symmetric stress. What lies on the triangle's side 0 is
    side 0 of its part.

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
    lattice = [(i, j) for i in range(PARTS + 1) for j in range(PARTS + 1 - i)]
    at = {ij: n for n, ij in enumerate(lattice)}
    vertices, found = [(PARTS - i - j, i, j) for i, j in lattice], []
    for i, j in lattice:
        if i + j < PARTS:
            a, b, c = up = [at[i, j], at[i + 1, j], at[i, j + 1]]
            if thirds and any(max(vertices[v]) == PARTS for v in up):
                middle = len(vertices)
                vertices.append(tuple(np.mean([vertices[v] for v in up], axis=0)))
                found += [[middle, b, c], [middle, c, a], [middle, a, b]]
            else:
                found.append(up)
        if i + j < PARTS - 1:
            found.append([at[i + 1, j], at[i + 1, j + 1], at[i, j + 1]])
    shares, corners = np.array(vertices) / PARTS, np.array(found)
    ends = shares[np.stack([np.roll(corners, -1, axis=1), np.roll(corners, -2, axis=1)], axis=2)]
    on = (ends == 0).all(axis=2)  # (k, 3 own sides, 3 sides of the triangle)
    outer = np.where(on.any(axis=2), on.argmax(axis=2), -1)
    span = np.take_along_axis(ends, (outer[..., None, None] + 2) % 3, axis=3)[..., 0]
    return shares, corners, outer, span


def divided(cells: Cells, at: Index, thirds: bool) -> Cells:
    """Triangles `at` (b,) in the parts of `pattern`, each with vertices of its own."""
    shares, corners, outer, along = pattern(thirds)
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
    start, stop = np.moveaxis(span[:, outer], -1, 0)[..., None]  # (b, k, 3, 1)
    return joined(
        cells.trace,
        x.reshape(-1, 2),
        (corners + p * np.arange(b)[:, None, None]).reshape(-1, 3),
        reference[:, corners].reshape(-1, 3, 2),
        np.repeat(cells.parent[at], k),
        np.where(outer < 0, -1, cells.segment[sides][:, outer]).reshape(-1, 3),
        (start + (stop - start) * along).reshape(-1, 3, 2),
        (cells.curved[at][:, None] & (outer[:, 0] == 0)).ravel(),
    )


def looked_at(
    F: ng.CoefficientFunction, cells: Cells, at: Index, order: int, depth: int, thirds: bool
) -> tuple[Array, Array, Array]:
    """Points (b, q, 2), weights (b, q) and values (b, q, dim) of F in triangles `at` (b,).

    All are straight, or all have a curved base. The rule is of an `order` on each of their parts:
    they are divided `depth` times by `pattern`, with `thirds` at corners or not.
    """
    if depth == 0:
        bent = len(at) > 0 and cells.curved[at[0]]
        points = places(cells, at, BENT * order if bent else order)
        measure = cells.trace.model.measure(points.x.reshape(-1, 2)).reshape(points.weight.shape)
        return points.x, points.weight * measure, points.evaluate(cells, F)
    parts, found = divided(cells, at, thirds), []
    for curved in (False, True):
        some = np.flatnonzero(parts.curved == curved)
        if some.size:
            own = looked_at(F, parts, some, order, depth - 1, thirds)
            found.append([z.reshape(len(at), -1, *z.shape[2:]) for z in own])
    x, weight, values = (np.concatenate(z, axis=1) for z in zip(*found, strict=True))
    return x, weight, values


def projection(
    F: ng.CoefficientFunction,
    cells: Cells,
    at: Index,
    degree: int,
    order: int,
    depth: int,
    thirds: bool,
    components: slice,
) -> tuple[Array, Array, Array]:
    """Polynomials near to a force F in triangles `at` (b,), by the rules of `looked_at`.

    Returns
    -------
    coefficients : ndarray (b, m, 2)
        Of the polynomials of a `degree`, as of `projected`.
    rest, size : ndarray (b,)
        L2 norms of some `components` of what they miss of F, and of F, times the measure.
    """
    force, norms = [], []
    step = max(1, AT_ONCE // (len(pattern(thirds)[1]) ** depth * (order // 2 + 1) ** 2))
    for start in range(0, len(at), step):
        some = at[start : start + step]
        x, weight, values = looked_at(F, cells, some, order, depth, thirds)
        frame = frame_of(cells.corners[some])
        force.append(projected(degree, frame, x, weight, values))
        both = np.stack([values - scalars(degree, frame, x) @ force[-1], values])[..., components]
        weight = weight * cells.trace.model.measure(x.reshape(-1, 2)).reshape(weight.shape)
        norms.append(np.sqrt(np.einsum("bq,nbqd->nb", weight, both**2)))
    rest, size = np.concatenate(norms, axis=1)
    return np.concatenate(force), rest, size
