"""K_h = {B v <= g}: one unknown per row, HH81 (2.3), (2.5), (2.10).

All conditions hold at nodes. A change of basis, local to the nodes concerned, makes the left
side of every contact row - the normal value of a rigid pair, the jump between two bodies - an
unknown of its own: an active row is a fixed unknown, and every Newton step has a symmetric
positive definite sparse matrix. NumPy and SciPy only.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .rows import Conditions, Rows

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

PIVOT = 0.05  # least share of a row at the node whose unknown it becomes, if another is possible
INDEPENDENT = 1e-6  # sine below which two conditions at one node are the same
SATISFIED = 1e-8  # interpolation error of prescribed values, relative to the largest
ROUND_OFF = 1e-13  # of measured gaps, relative to the largest coordinate
LONGEST_CHAIN = 50  # bodies in a row whose contact lines share nodes


@dataclass(frozen=True, eq=False)
class Basis:
    """Node values u = T y in unknowns of which some are prescribed and one is each row's value.

    Attributes
    ----------
    T : sparse (2n, 2n)
    fixed : ndarray of bool (2n,)
        Prescribed unknowns.
    values : ndarray (2n,)
        Their values.
    unknown : ndarray of int (k,)
        Unknown that equals the left side of each kept row.
    kept : ndarray of int (k,)
        Kept rows; the others are prescribed altogether and satisfied.
    """

    T: sp.csr_matrix
    fixed: Mask
    values: Array
    unknown: Index
    kept: Index


def _frames(n: int, conditions: Conditions) -> tuple[Array, Mask, Array]:
    """Orthonormal frames (n, 2, 2) by columns, fixed slots (n, 2) and their values (n, 2)."""
    frame = np.tile(np.eye(2), (n, 1, 1))
    fixed = np.zeros((n, 2), dtype=bool)
    values = np.zeros((n, 2))
    node, a, value = conditions.node, conditions.direction, conditions.value
    order = np.argsort(node, kind="stable")
    nodes, first, count = np.unique(node[order], return_index=True, return_counts=True)
    lead = order[first]
    frame[nodes, :, 0] = a[lead]
    frame[nodes, :, 1] = np.column_stack([-a[lead, 1], a[lead, 0]])
    fixed[nodes, 0] = True
    values[nodes, 0] = value[lead]
    for i, start, size in zip(nodes[count > 1], first[count > 1], count[count > 1], strict=True):
        for other in order[start + 1 : start + size]:
            along, across = a[other] @ frame[i]
            if not fixed[i, 1] and abs(across) > INDEPENDENT:
                values[i, 1] = (value[other] - along * values[i, 0]) / across
                fixed[i, 1] = True
    return frame, fixed, values


def _blocks(blocks: Array) -> sp.csr_matrix:
    """Matrix (2n, 2n) of (n, 2, 2) node blocks in the numbering x first, then y."""
    n = len(blocks)
    i = np.arange(n)
    rows = np.concatenate([i, i, i + n, i + n])
    cols = np.concatenate([i, i + n, i, i + n])
    values = np.concatenate([blocks[:, 0, 0], blocks[:, 0, 1], blocks[:, 1, 0], blocks[:, 1, 1]])
    matrix = sp.coo_matrix((values, (rows, cols)), (2 * n, 2 * n)).tocsr()
    matrix.eliminate_zeros()
    return matrix


class _Hosts:
    """Assignment of rows to the nodes whose unknowns they become."""

    def __init__(self, fixed: Mask) -> None:
        self.fixed = fixed
        self.taken: dict[int, list[Array]] = {}

    def fits(self, node: int, coefficients: Array, least: float) -> bool:
        """Whether the row with these coefficients at `node` finds a free direction there."""
        free = np.where(self.fixed[node], 0.0, coefficients)
        rows = self.taken.get(node, [])
        size = np.linalg.norm(free)
        if size <= least or len(rows) + np.count_nonzero(self.fixed[node]) >= 2:
            return False
        if not rows:
            return True
        sine = abs(rows[0][0] * free[1] - rows[0][1] * free[0])
        return sine > INDEPENDENT * size * np.linalg.norm(rows[0])

    def take(self, node: int, coefficients: Array) -> None:
        """Let the row with these coefficients have a free direction at `node`."""
        self.taken.setdefault(node, []).append(np.where(self.fixed[node], 0.0, coefficients))


def _at(Bz: sp.csr_matrix, row: Index, node: Index) -> Array:
    """Coefficients (k, 2) of rows (k,) at nodes (k,)."""
    n = Bz.shape[1] // 2
    if row.size == 0:  # SciPy answers an empty index with a sparse matrix
        return np.zeros((0, 2))
    return np.column_stack([np.ravel(Bz[row, node]), np.ravel(Bz[row, node + n])])


def _assign(rows: Rows, Bz: sp.csr_matrix, fixed: Mask) -> Index:
    """Host node of every row, -1 where all of a row's unknowns are prescribed."""
    n = len(fixed)
    host = rows.node.copy()
    local = _at(Bz, np.arange(len(host)), host)
    free = np.where(fixed[host], 0.0, local)
    lonely = np.bincount(host, minlength=n)[host] == 1
    regular = lonely & (np.linalg.norm(free, axis=1) > PIVOT)
    hosts = _Hosts(fixed)
    for j in np.flatnonzero(regular) if not regular.all() else ():
        hosts.take(host[j], local[j])
    for j in np.flatnonzero(~regular):
        columns = np.unique(Bz[j].indices % n)
        entries = Bz[j].toarray().ravel()
        choices = [(np.hypot(entries[i], entries[i + n]), i) for i in columns if i != rows.node[j]]
        ranked = [rows.node[j], *(i for _, i in sorted(choices, reverse=True))]
        coefficients = {i: np.array([entries[i], entries[i + n]]) for i in ranked}
        for i, least in [(i, x) for x in (PIVOT, INDEPENDENT) for i in ranked]:
            if hosts.fits(i, coefficients[i], least):
                hosts.take(i, coefficients[i])
                host[j] = i
                break
        else:
            host[j] = -1
    return host


def _check_prescribed(
    rows: Rows, Bz: sp.csr_matrix, fixed: Mask, values: Array, drop: Index, length: float
) -> None:
    """Raise unless the rows that find no free unknown hold for the prescribed values."""
    size = np.abs(values).max(initial=0.0)
    for j in drop:
        columns, entries = Bz[j].indices, Bz[j].data
        where = f"the contact row at node {rows.node[j]} with direction {rows.direction[j]}"
        if (np.abs(entries[~fixed[columns]]) > INDEPENDENT).any():
            raise ValueError(
                f"{where} depends on other contact rows there; leave one of the pairs out, or end "
                "one of the contact boundaries before that point"
            )
        value = float(entries @ values[columns])
        allowed = SATISFIED * max(size, abs(rows.g[j])) + ROUND_OFF * length
        if value > rows.g[j] + allowed:
            raise ValueError(
                f"{where} is violated by prescribed displacements on both sides: they close the "
                f"gap by {value:g} where it is {rows.g[j]:g}; prescribe displacements without "
                "interference"
            )


def change_of_basis(n: int, conditions: Conditions, rows: Rows, length: float = 0.0) -> Basis:
    """Basis in which prescribed conditions and contact rows are single unknowns.

    Parameters
    ----------
    n : int
        Number of nodes (scalar unknowns).
    conditions : Conditions
        Gamma_u and Gamma_0.
    rows : Rows
        Gamma_K.
    length : float
        Largest coordinate, to whose round-off the gaps are known.

    Raises
    ------
    ValueError
        Prescribed displacements on both sides violate a row, or rows depend on each other.
    """
    frame, fixed, values = _frames(n, conditions)
    R = _blocks(frame)
    Bz = (rows.matrix(n) @ R).tocsr()
    flat_fixed, flat_values = fixed.T.ravel(), values.T.ravel()
    host = _assign(rows, Bz, fixed)
    _check_prescribed(rows, Bz, flat_fixed, flat_values, np.flatnonzero(host < 0), length)
    kept = np.flatnonzero(host >= 0)
    host = host[kept]

    # Slot of each row at its host: the first free one, the second for a second row.
    order = np.argsort(host, kind="stable")
    slot = np.empty(len(host), dtype=np.intp)
    again = np.concatenate([[False], host[order][1:] == host[order][:-1]])[: len(host)]
    slot[order] = np.where(again | fixed[host[order], 0], 1, 0)
    unknown = host + n * slot

    # Local systems M z = y; what the rows contain of other unknowns moves to the right.
    local = np.where(fixed[host], 0.0, _at(Bz, kept, host))
    M = np.tile(np.eye(2), (n, 1, 1))
    M[host, slot] = local
    alone = np.bincount(host, minlength=n) == 1
    single = alone[host] & ~fixed[host].any(axis=1)
    turned = np.column_stack([-local[single, 1], local[single, 0]])
    M[host[single], 1] = turned / np.linalg.norm(turned, axis=1)[:, None]
    inverse = np.tile(np.eye(2), (n, 1, 1))
    inverse[host] = np.linalg.inv(M[host])
    G = _blocks(inverse)

    free_here = (
        np.repeat(np.arange(len(host)), 2),
        np.concatenate([host[:, None], host[:, None] + n], axis=1).ravel(),
    )
    rest = Bz[kept] - sp.coo_matrix((local.ravel(), free_here), (len(host), 2 * n)).tocsr()
    place = sp.coo_matrix((np.ones(len(host)), (unknown, np.arange(len(host)))), (2 * n, len(host)))
    N = -(G @ place.tocsr() @ rest)
    N.eliminate_zeros()
    H, term = G, N @ G
    for _ in range(LONGEST_CHAIN):
        term.eliminate_zeros()
        if term.nnz == 0:
            break
        H = H + term
        term = N @ term
    else:
        raise ValueError(
            "contact pairs refer to each other in a ring; swap secondary and primary of one pair"
        )
    return Basis(
        T=(R @ H).tocsr(), fixed=flat_fixed, values=flat_values, unknown=unknown, kept=kept
    )
