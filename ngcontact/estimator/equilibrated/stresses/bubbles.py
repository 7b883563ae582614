"""Stresses that balance, inside one triangle, what polynomials of degree k - 1 miss of the loads.

Loads orthogonal to polynomials of degree 1 are the divergence of a stress t on the reference
triangle without tractions on its edges; with a symmetric stress t, J t J^T is one on the triangle
of Jacobian J, of divergence J div t and of tractions det J J t n per edge. So the least stresses
are found once. For tractions on an edge the triangle is divided in three, since a symmetric stress
on the whole has no freedom in its corners.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from ....arrays import Array, Index
from ..data import (
    CORNERS,
    HIGHER,
    OF_AXIS,
    PART_DEGREE,
    PARTS,
    Discrete,
    EdgeConditions,
    basis,
    dimension,
    part_corners,
)

EQUILATERAL = np.array([[1.0, 0.5], [0.0, np.sqrt(0.75)]])  # where stresses are least
NEGLIGIBLE = 1e-13  # singular values, relative, of conditions that repeat others

THIRDS = np.array([[0, 1, 3], [1, 2, 3], [2, 0, 3]])  # of a triangle, with its middle


def _operators(degree: int, corners: Array) -> tuple[Array, Array]:
    """Divergence (2 m, 3 n) and tractions per edge (3, 2 (k + 1), 3 n) of the triangle `corners`.

    Of (xx, yy, xy) in polynomials on it; edges run from vertex i + 1 to vertex i + 2.
    """
    table = basis(degree)
    sides = np.stack([corners[0] - corners[2], corners[1] - corners[2]], axis=1)
    inverse = np.linalg.inv(sides)
    D = np.einsum("cds,rd,rij->cisj", OF_AXIS, inverse, table.derivatives)
    edges = np.roll(corners, -2, axis=0) - np.roll(corners, -1, axis=0)
    normals = np.stack([edges[:, 1], -edges[:, 0]], axis=1)
    N = np.einsum("cds,ed,eqj->ecqsj", OF_AXIS, normals, table.traces)
    return D.reshape(-1, 3 * dimension(degree)), N.reshape(3, 2 * (degree + 1), -1)


def _metric(n: int, parts: int = 1) -> Array:
    """Squares of stresses on the equilateral triangle, of n polynomials: (3 n, 3 n) for a part."""
    by = _turned(EQUILATERAL[None])[0]
    square = np.kron(by.T @ np.diag([1.0, 1.0, 2.0]) @ by, np.eye(n))
    return np.asarray(np.kron(np.eye(parts), square), dtype=float)


def _turned(sides: Array) -> Array:
    """Matrices (b, 3, 3) of (xx, yy, xy) of J t J^T by those of t, for J = `sides` (b, 2, 2)."""
    (a, b), (c, d) = sides.transpose(1, 2, 0)
    rows = [[a * a, b * b, 2 * a * b], [c * c, d * d, 2 * c * d], [a * c, b * d, a * d + b * c]]
    return np.moveaxis(np.array(rows), 2, 0)


def _least(conditions: Array, right: Array, metric: Array) -> Array:
    """The least x (n, j) in a `metric` (n, n) of all with conditions x = right (m, j)."""
    half = np.linalg.inv(np.linalg.cholesky(metric)).T
    return half @ (np.linalg.pinv(conditions @ half, rcond=NEGLIGIBLE) @ right)


@lru_cache
def inside(low: int, high: int) -> Array:
    """Stresses (2, j, 3, n) of degree `high` without tractions, of given divergences.

    By component and polynomial of the divergence: the j of degrees `low` to `high` - 1.
    """
    D, N = _operators(high, CORNERS)
    m, first, n = dimension(high - 1), dimension(low - 1), dimension(high)
    given = np.zeros((2, m, 2, m - first))
    for component in range(2):
        given[component, first:, component] = np.eye(m - first)
    conditions = np.concatenate([D, N.reshape(-1, 3 * n)])
    right = np.zeros((len(conditions), 2 * (m - first)))
    right[: 2 * m] = given.reshape(2 * m, -1)
    x = _least(conditions, right, _metric(n))
    return np.asarray(x.T.reshape(2, m - first, 3, n))


@lru_cache
def beside(low: int, high: int) -> Array:
    """Stresses (2, j, 3, 3, n) without divergence in three parts, of tractions on edge 2.

    By component and Legendre polynomial of the tractions, of degrees `low` to `high`, from vertex 0
    to vertex 1; by part of the triangle, (xx, yy, xy), polynomial.
    """
    n, r, j = dimension(high), 2 * (high + 1), high + 1 - low
    corners = np.concatenate([CORNERS, [[1 / 3, 1 / 3]]])
    parts = [_operators(high, corners[part]) for part in THIRDS]
    signs = np.tile((-1.0) ** np.arange(high + 1), 2)
    rows, sides = [], []
    for i, (D, N) in enumerate(parts):
        wide = np.zeros((len(D) + r, 3, 3 * n))
        wide[:, i] = np.concatenate([D, N[2]])  # vertex 2 of each part is the middle
        right = np.zeros((len(wide), 2, j))
        if i == 0:
            for component in range(2):
                right[len(D) + component * (high + 1) + low :, component][:j] = np.eye(j)
        rows.append(wide)
        sides.append(right)
        # Edge 0, from its second vertex to the middle, is edge 1 of the next part, against it.
        wide = np.zeros((r, 3, 3 * n))
        wide[:, i] = N[0]
        wide[:, (i + 1) % 3] = parts[(i + 1) % 3][1][1] * signs[:, None]
        rows.append(wide)
        sides.append(np.zeros((r, 2, j)))
    conditions, right = np.concatenate(rows), np.concatenate(sides)
    x = _least(
        conditions.reshape(len(conditions), -1), right.reshape(len(right), -1), _metric(n, 3)
    )
    return np.asarray(x.T.reshape(2, j, 3, 3, n))


@lru_cache
def on_parts() -> Array:
    """Stresses (p, 2, j, p, 3, n) in the parts of the reference triangle, without tractions.

    Of divergences on one part, by component and polynomial; for sums of these that are orthogonal
    to rigid motions of the whole.
    """
    corners, degree = part_corners(), PART_DEGREE + 1
    p, n, r, j = len(corners), dimension(degree), 2 * (degree + 1), dimension(PART_DEGREE)
    D, N = zip(*(_operators(degree, part) for part in corners), strict=True)
    divergence = np.zeros((p, 2 * j, p, 3 * n))
    divergence[np.arange(p), :, np.arange(p)] = D
    # Edges by their middles: those of two parts run against each other.
    middles = (np.roll(corners, -1, axis=1) + np.roll(corners, -2, axis=1)).reshape(-1, 2) / 2
    _, edge = np.unique(np.round(2 * PARTS * middles), axis=0, return_inverse=True)
    signs = np.tile((-1.0) ** np.arange(degree + 1), 2)[:, None]
    tractions, seen = np.zeros((int(edge.max()) + 1, r, p, 3 * n)), set()
    for part, e in enumerate(edge.reshape(-1, 3).tolist()):
        for side, number in enumerate(e):
            tractions[number, :, part] = N[part][side] * (signs if number in seen else 1.0)
            seen.add(number)
    conditions = np.concatenate(
        [divergence.reshape(-1, 3 * n * p), tractions.reshape(-1, 3 * n * p)]
    )
    right = np.concatenate([np.eye(2 * j * p), np.zeros((len(conditions) - 2 * j * p, 2 * j * p))])
    x = _least(conditions, right, _metric(n, p))
    return np.asarray(x.T.reshape(p, 2, j, p, 3, n))


def bubble_norms(discrete: Discrete, conditions: EdgeConditions) -> Array:
    """Energy norms (n,) of stresses that balance what is missed of the loads, triangle by triangle.

    What these miss in turn is not in it.
    """
    partition, forces = discrete.partition, discrete.forces
    total = np.zeros(len(partition.triangles))
    at = np.flatnonzero(np.abs(forces.higher).max(axis=(1, 2)) > 0)
    k = discrete.degree
    if at.size:
        sides = partition.sides[at]
        load = np.linalg.inv(sides) @ forces.higher[at]
        t = np.einsum("bcj,cjsn->bsn", load, inside(k, k + HIGHER))
        total[at] += _norms(discrete, at, sides, t[:, None])
    for parts in forces.parts:
        sides = partition.sides[parts.at] @ parts.sides
        load = np.linalg.inv(sides)[:, None] @ parts.values
        t = np.einsum("bpcj,pcjqsn->bqsn", load, on_parts(), optimize=True)
        squares = _norms(discrete, parts.at, sides, t) ** 2 * np.linalg.det(parts.sides)
        total += np.sqrt(np.bincount(parts.at, squares, minlength=len(total)))
    edge = np.flatnonzero(np.abs(conditions.higher).max(axis=(1, 2)) > 0)
    if edge.size:
        np.add.at(total, partition.owner[0][edge], _beside_edges(discrete, conditions, edge))
    return total


def _beside_edges(discrete: Discrete, conditions: EdgeConditions, edge: Index) -> Array:
    """Energy norms (b,) of stresses with the higher tractions on edges (b,)."""
    partition, k = discrete.partition, discrete.degree
    at, side = (x[edge] for x in partition.owner)
    x = partition.vertices[partition.triangles[at[:, None], (side[:, None] + [1, 2, 3]) % 3]]
    sides = np.stack([x[:, 0] - x[:, 2], x[:, 1] - x[:, 2]], axis=2)
    signs = np.where(partition.flips[at, side][:, None], (-1.0) ** (k + np.arange(HIGHER)), 1.0)
    per_edge = partition.edge_lengths[edge] / np.linalg.det(sides)
    load = np.linalg.inv(sides) @ (conditions.higher[edge] * signs[:, None])
    t = np.einsum("b,bcj,cjpsn->bpsn", per_edge, load, beside(k, k + HIGHER - 1), optimize=True)
    return _norms(discrete, at, sides, t)


def _norms(discrete: Discrete, at: Index, sides: Array, t: Array) -> Array:
    """Energy norms (b,) of J t J^T in triangles `at` (b,), of `t` (b, p, 3, n) in equal parts."""
    compliance, rough = np.linalg.inv(discrete.law[at])[:, :3, :3], discrete.rough
    if rough is not None:
        number = rough.number[at]
        mine = np.flatnonzero(number >= 0)
        compliance[mine] = np.diag([1.0, 1.0, 2.0]) / rough.least[number[mine], None, None]
    compliance = compliance / discrete.least_measure(at)[:, None, None]
    tau = _turned(sides)[:, None] @ t
    mean = np.einsum("bpsn,bst,bptn->b", tau, compliance, tau, optimize=True) / t.shape[1]
    return np.sqrt(discrete.partition.areas[at] * mean)
