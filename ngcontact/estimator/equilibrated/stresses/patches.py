"""Stresses on the patches of vertices: multipliers on the edges that meet at each vertex."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.linalg.lapack import dpotrf, dpotrs

from ....arrays import Array, Index
from ..data import EdgeConditions, Partition

AT_ONCE = 300_000  # numbers in the matrices of patches that are solved together
SHIFT = 1e-10  # relative, by which singular matrices are solved; refined away where it matters
REFINEMENTS = 3
SOLVED = 1e-12  # residual, relative, above which a patch is solved by its eigenvectors
SOFT = 1e-5  # relative compliance of tractions that need be met but nearly
TRUNCATED = 1e-13  # eigenvalues, relative, that are zero: of rigid motions, of crossing lines


@dataclass(frozen=True, eq=False)
class _Patches:
    """Patches with the same number of edges at their vertices, b of them.

    `triangle` (t,) and `corner` (t,) are their triangles, `patch` (t,) to which they belong, `slot`
    (t,) the which of its patch, `place` (t, 2) the numbers of its two edges in the patch; `spokes`
    (b, s) are the edges and `end` (b, s) which end of each is the vertex.
    """

    triangle: Index
    corner: Index
    patch: Index
    slot: Index
    place: Index
    spokes: Index
    end: Index


def _grouped(partition: Partition, unknowns: int) -> Iterator[_Patches]:
    """All patches, in groups that bound the memory; `unknowns` are those of an edge."""
    n = len(partition.triangles)
    vertex = partition.triangles.ravel()
    order = np.argsort(vertex, kind="stable")
    triangle, corner = np.divmod(order, 3)
    vertex = vertex[order]
    edge = np.stack([partition.edges[triangle, (corner + i) % 3] for i in (1, 2)], axis=1)
    size = len(partition.ends)
    keys, place = np.unique(vertex[:, None] * size + edge, return_inverse=True)
    place = place.reshape(-1, 2)
    owner, spoke = np.divmod(keys, size)  # spokes, vertex by vertex
    count = np.bincount(owner, minlength=len(partition.vertices))
    first = np.concatenate([[0], np.cumsum(count)[:-1]])
    start = np.searchsorted(vertex, np.arange(len(count)))
    slot = np.arange(3 * n) - start[vertex]
    for number in np.unique(count[count > 0]):
        members = np.flatnonzero(count == number)
        block = max(1, AT_ONCE // (number * unknowns) ** 2)
        for low in range(0, len(members), block):
            chosen = members[low : low + block]
            local = np.full(len(count), -1)
            local[chosen] = np.arange(len(chosen))
            at = np.flatnonzero(local[vertex] >= 0)
            spokes = spoke[first[chosen][:, None] + np.arange(number)]
            yield _Patches(
                triangle=triangle[at],
                corner=corner[at],
                patch=local[vertex[at]],
                slot=slot[at],
                place=place[at] - first[vertex[at]][:, None],
                spokes=spokes,
                end=(partition.ends[spokes][:, :, 1] == chosen[:, None]).astype(np.intp),
            )


def _solved(A: Array, b: Array, size: Array) -> Array:
    """Solutions (k, n) of consistent semidefinite systems `A` (k, n, n), right sides `b` (k, n).

    `size` (k,) is that of the terms of the right sides, before they cancel.
    """
    size_of = np.einsum("kii->ki", A)
    scale = np.sqrt(np.where(size_of > 0, size_of, 1.0))
    A = A / scale[:, :, None] / scale[:, None, :]
    size = size / scale.min(axis=1)
    b = b / scale
    shifted = A + SHIFT * np.eye(A.shape[1])
    x, rest = np.zeros_like(b), np.full(len(b), np.inf)
    for k in range(len(b)):  # NumPy has no Cholesky solver for many matrices, LU takes five times
        factor, failed = dpotrf(shifted[k], lower=True)
        if not failed:
            residual = b[k]
            for _ in range(1 + REFINEMENTS):
                x[k] += dpotrs(factor, residual, lower=True)[0]
                residual = b[k] - A[k] @ x[k]
            rest[k] = np.abs(residual).max()
    bad = np.flatnonzero(~(rest <= SOLVED * size))
    if bad.size:
        values, vectors = np.linalg.eigh(A[bad])
        kept = values > TRUNCATED * values[:, -1:]
        inverted = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
        along = np.einsum("kij,ki->kj", vectors, b[bad])
        x[bad] = np.einsum("kij,kj->ki", vectors, inverted * along)
    return np.asarray(x / scale)


def multipliers(
    partition: Partition, S: Array, g: Array, conditions: EdgeConditions, given: Array
) -> Array:
    """Multipliers (n, 3, 2 r) of the two edges at each vertex of each triangle.

    Parameters
    ----------
    partition : Partition
        Of n triangles and e edges.
    S : ndarray (n, 3, 2 r, 2 r)
        Tractions on the two edges by their multipliers, condensed, for each vertex.
    g : ndarray (n, 3, 2 r)
        Tractions on them without multipliers.
    conditions : EdgeConditions
        Which components of the tractions are prescribed, or continuous.
    given : ndarray (e, 2, r)
        Their values on the boundary, weighted by the hats of both ends of the edge.
    """
    constrained = conditions.constrained
    r = constrained.shape[1]
    sizes = np.abs(g).max(axis=2)
    result = np.zeros_like(g)
    for group in _grouped(partition, r):
        b, spokes = group.spokes.shape
        A, rhs = np.zeros((b, spokes * r, spokes * r)), np.zeros((b, spokes * r))
        size = np.abs(given[group.spokes, group.end]).max(axis=(1, 2))
        columns = (group.place[:, :, None] * r + np.arange(r)).reshape(-1, 2 * r)
        for slot in range(int(group.slot.max()) + 1):
            at = np.flatnonzero(group.slot == slot)
            p, c = group.patch[at], columns[at]
            mine = group.triangle[at], group.corner[at]
            A[p[:, None, None], c[:, :, None], c[:, None, :]] += S[mine]
            rhs[p[:, None], c] += g[mine]
            size[p] = np.maximum(size[p], sizes[mine])
        rhs -= given[group.spokes, group.end].reshape(b, -1)
        free = ~constrained[group.spokes].reshape(b, -1)
        patch, row = np.nonzero(free)
        A[patch, row] = 0.0
        A[patch, :, row] = 0.0
        A[patch, row, row] = 1.0
        rhs[free] = 0.0
        patch, row = np.nonzero(conditions.soft[group.spokes].reshape(b, -1))
        A[patch, row, row] *= 1 + SOFT
        x = _solved(A, rhs, size)
        result[group.triangle, group.corner] = x[group.patch[:, None], columns]
    return result
