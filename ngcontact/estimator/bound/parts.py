"""Triangles in parts, islands of a mesh of their own, on which data are looked at closely."""

from __future__ import annotations

from functools import lru_cache

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...fem import narrow_forces
from ...problem import Problem
from ...quadrature import View, features_of, numbers, touched
from .cells import Cells, joined, places
from .polynomials import projected, scalars

PARTS = 4  # of each side
LEVELS = 2  # how often triangles are divided
SMOOTH = 1e-3  # of the largest force: what polynomials miss where none is divided
LEFT = 0.005  # share of the squares of what is missed, that may be on parts not divided again
BENT = 2  # times the order of rules on curved triangles, for polynomials in x
AT_ONCE = 200_000  # points at which forces are looked at together


@lru_cache
def pattern(thirds: bool) -> tuple[Array, Index]:
    """The equal parts of a triangle; those at its corners in `thirds` about their middles.

    There given tractions may be those of no symmetric stress.

    Returns
    -------
    shares : ndarray (p, 3)
        Of the triangle's corners in the vertices.
    corners : ndarray of int (k, 3)
        Vertices of each part, anticlockwise.
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
    return np.array(vertices) / PARTS, np.array(found)


def divided(cells: Cells, at: Index, thirds: bool) -> Cells:
    """Triangles `at` (b,) in the parts of `pattern`, each with vertices of its own."""
    shares, corners = pattern(thirds)
    p, k = len(shares), len(corners)
    return joined(
        cells.trace,
        cells.image(at, shares[:, [2, 0]])[0].reshape(-1, 2),
        (corners + p * np.arange(len(at))[:, None, None]).reshape(-1, 3),
        (shares @ cells.barycentric[at])[:, corners].reshape(-1, 3, 3),
        np.repeat(cells.parent[at], k),
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
        return points.x, points.weight * cells.measure(points.x), points.evaluate(cells, F)
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
        P = scalars(degree, cells.corners[some], x)
        force.append(projected(P, weight, values))
        both = np.stack([values - P @ force[-1], values])[..., components]
        norms.append(np.sqrt(np.einsum("bq,nbqd->nb", weight * cells.measure(x), both**2)))
    rest, size = np.concatenate(norms, axis=1)
    return np.concatenate(force), rest, size


def depths(problem: Problem, cells: Cells, degree: int, order: int, least: Index) -> Index:
    """How often triangles (n,) are divided, because forces are not near to polynomials.

    The polynomials are of a `degree`, the rules of an `order`; `least` (n,) times at least.
    """
    found, mesh = least.copy(), cells.trace.mesh
    if all(numbers(F) for F in problem.force.values()):
        return found
    narrow = narrow_forces(problem, mesh, cells.trace.order)
    for one in features_of(problem, mesh):
        if one.kind == "force" and len(one.places):
            view, spots = View(mesh, 2), np.column_stack([one.places, one.widths])
            at, feature = touched(spots, view, np.arange(mesh.ne))
            narrow[at[view.sizes[at] > PARTS * one.widths[feature]]] = True
    found[narrow[cells.parent]] = LEVELS
    for k, F in problem.force.items():
        at = np.flatnonzero(np.array(mesh.Materials(k).Mask())[cells.bodies])
        if not numbers(F) and at.size:
            found[at] = _depths(ng.CF(F), cells, at, found[at], (degree, order))
    return found


def _depths(
    F: ng.CoefficientFunction,
    cells: Cells,
    at: Index,
    asked: Index,
    rule: tuple[int, int],
    least: float = 0.0,
) -> Index:
    """Depths (b,) of triangles `at` (b,) for one force, from `asked` (b,) up to `LEVELS`.

    `rule` is the degree of the polynomials and the order of the rules. Polynomials are near to the
    force if they miss less, in the root of the mean square, than `least`; on parts, what they miss
    of it must count as well.
    """
    rest, size = np.zeros((2, len(at)))
    axial = slice(cells.trace.model.extent, None)
    for curved in (False, True):
        some = np.flatnonzero(cells.curved[at] == curved)
        if some.size:
            _, rest[some], size[some] = projection(F, cells, at[some], *rule, 0, False, axial)
    corners = cells.corners[at]
    root = np.sqrt(np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2)
    threshold = max(least, SMOOTH * float((size / root).max(initial=0.0)))
    rough = rest > threshold * root
    if least:
        order = np.argsort(rest)
        rough[order[np.cumsum(rest[order] ** 2) <= LEFT * (rest @ rest)]] = False
        return asked + rough
    depth = np.maximum(asked, rough)
    some = np.flatnonzero((depth > 0) & (asked < LEVELS))
    if some.size:
        parts = divided(cells, at[some], False)
        every = np.arange(len(parts.triangles))
        inner = _depths(F, parts, every, 0 * every, rule, threshold)
        depth[some] = 1 + inner.reshape(len(some), -1).max(axis=1)
    return depth
