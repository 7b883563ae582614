"""Coarser spaces of a finite element space, in the unknowns of its contact rows and supports.

Degree p contains degree 1 on the same mesh, and that the functions of degree 1 whose values at
vertices made by refinement are the means of their parents'. NumPy and SciPy only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Integers, from_triplets

COARSEST = 10_000  # unknowns below which a factor costs less than what coarser spaces save
VERTEX_RATIO = 0.5  # of the vertices that the next coarser space has at most
PRODUCT_ROUND_OFF = 1e-14  # of products of changes of basis, whose entries are of size 1
MAX_LINKS = 10  # bodies whose contact lines share nodes; more only in rings


@dataclass(frozen=True, eq=False)
class Coarsening:
    """The step to a coarser space."""

    P: sp.csr_array  # (n, k) from the k unknowns of the coarser space to the n of the finer one
    kept: Integers  # (k,) unknowns of the finer space that mean the same


def coarsenings(
    T: sp.csr_array, parents: Integers, linear: sp.csr_array, coarsest: int = COARSEST, d: int = 2
) -> list[Coarsening]:
    """Coarser spaces, finest first, until one has `coarsest` unknowns or the first mesh is met.

    Node values and edge functions are u = T y of the unknowns y, d of each node, with `T`
    (d * n, d * n): x of all nodes first, vertices before all others. `parents` (nv, 2) are the ends
    of the edges that refinement halved, -1 for vertices of the first mesh; `linear` (n, nv) the
    functions of degree 1 in nodes and edge functions. Contact rows that refer to each other in a
    ring, whose unknowns have no local inverse, are an `ArithmeticError`.
    """
    n, vertices = T.shape[0] // d, len(parents)
    steps = [(linear, np.arange(vertices))] if n > vertices else []
    found = []
    for P, kept in steps + _vertex_steps(parents, coarsest // d):
        every = np.concatenate([kept + i * P.shape[0] for i in range(d)])
        P = sp.block_diag([P] * d, format="csr")
        coarse = (T[every] @ P).tocsr()  # rows there refer to partners that stay
        found.append(Coarsening((_inverse(T, d) @ (P @ coarse)).tocsr(), every))
        T = coarse
    return found


def _depths(parents: Integers) -> Integers:
    """Number of generations of parents of each vertex, (nv,)."""
    depth = np.zeros(len(parents), dtype=np.intp)
    new = np.flatnonzero(parents[:, 0] >= 0)
    while True:
        deeper = 1 + depth[parents[new]].max(axis=1)
        if np.array_equal(deeper, depth[new]):
            return depth
        depth[new] = deeper


def _vertex_steps(parents: Integers, most: int) -> list[tuple[sp.csr_array, Integers]]:
    """Interpolations (n, k) of vertex values and the vertices that stay, half at most."""
    steps: list[tuple[sp.csr_array, Integers]] = []
    depth = _depths(parents)
    counts = np.bincount(depth).cumsum()
    while depth.size > most:
        few = np.flatnonzero(counts <= VERTEX_RATIO * depth.size)
        if few.size == 0:
            break
        last, deepest = int(few[-1]), len(counts) - 1
        kept, new = np.flatnonzero(depth <= last), np.flatnonzero(depth > last)
        rows = np.concatenate([kept, np.repeat(new, 2)])
        columns = np.concatenate([kept, parents[new].ravel()])
        values = np.concatenate([np.ones(kept.size), np.full(2 * new.size, 0.5)])
        means = from_triplets(values, rows, columns, (depth.size, depth.size))
        P = means
        for _ in range(deepest - last - 1):  # parents of parents
            P = means @ P
        steps.append((P[:, kept], kept))
        number = np.full(depth.size, -1)
        number[kept] = np.arange(kept.size)
        parents = np.where(parents[kept] < 0, -1, number[parents[kept]])
        depth, counts = depth[kept], counts[: last + 1]
    return steps


def _inverse(T: sp.csr_array, d: int) -> sp.csr_array:
    """Inverse of a change of basis (d * n, d * n), which is the identity but at few nodes."""
    n, same = T.shape[0] // d, sp.eye_array(T.shape[0], format="csr")
    change = T - same
    nodes = np.unique(change.tocoo().row % n)
    here = (nodes + n * np.arange(d)[:, None]).ravel()
    # With T = I + E C, where E are the columns `here` of I: I - E (C E + I)^-1 C.
    there = _inverse_of_blocks(T[here][:, here], d) @ change[here]
    return (same - same[:, here] @ there).tocsr()


def _inverse_of_blocks(T: sp.csr_array, d: int) -> sp.csr_array:
    """The same by blocks of the nodes, and what rows contain of other nodes."""
    n = T.shape[0] // d
    pairs = [(i, j) for i in range(d) for j in range(d)]
    parts = [T.diagonal((j - i) * n)[min(i, j) * n :][:n] for i, j in pairs]
    blocks = np.linalg.inv(np.array(parts).T.reshape(n, d, d)).transpose(1, 2, 0)
    rows, columns = (np.add.outer(n * np.array(x), np.arange(n)) for x in zip(*pairs, strict=True))
    G = from_triplets(blocks.ravel(), rows.ravel(), columns.ravel(), T.shape)
    G.eliminate_zeros()
    rest = sp.eye_array(d * n, format="csr") - G @ T
    rest.data[np.abs(rest.data) < PRODUCT_ROUND_OFF] = 0.0
    rest.eliminate_zeros()
    inverse, term = G, rest @ G
    for _ in range(MAX_LINKS):
        if term.nnz == 0:
            return inverse.tocsr()
        inverse, term = inverse + term, rest @ term
    raise ArithmeticError("contact rows refer to each other in a ring")
