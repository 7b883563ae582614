"""K_h = {B v <= g}: one unknown per row, HH81 (2.3), (2.5), (2.10).

All conditions hold at nodes. A change of basis, local to the nodes concerned, makes the left
side of every contact row - the normal value of a rigid pair, the jump between two bodies - an
unknown of its own: an active row is a fixed unknown, and every Newton step has a symmetric
positive definite sparse matrix. NumPy and SciPy only.

A row replaces an unknown of the secondary's node, unless its displacement is prescribed there or
other rows took its directions; then of a node of the facing segment. Between a stiff and a soft
body it is the soft one's node: the row's force is the unbalanced force there, which round-off of
the stiff one would drown.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ..arrays import Array, Index, Mask, from_triplets
from .rows import Conditions, Rows

SAME_IN_A_RING = 1e6  # condition of rows that refer to each other from which they repeat each other
PIVOT = 0.05  # least share of a row at the node whose unknown it becomes, if another is possible
INDEPENDENT = 1e-6  # sine below which two conditions at one node are the same
INTERPOLATED = 1e-8  # error of prescribed values, relative to the largest, that is no interference
MEASURED = 1e-13  # error of gaps, relative to the largest coordinate, that is none either
CONTRAST = 1e3  # stiffness of the secondary over that facing it above which the latter hosts


class _Pivots:
    """Assignment of rows to the nodes whose unknowns they become.

    Attributes
    ----------
    fixed : ndarray of bool (n, 2)
        Prescribed directions.
    taken : dict of int to list of ndarray (2,)
        Coefficients of the rows that nodes have.
    """

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


def coefficients_at(Bz: sp.csr_array, row: Index, node: Index) -> Array:
    """Coefficients (k, 2) of rows `row` (k,) of `Bz` (m, 2n) at the nodes `node` (k,)."""
    n = Bz.shape[1] // 2
    if row.size == 0:  # SciPy answers an empty index with a sparse array
        return np.zeros((0, 2))
    return np.column_stack([Bz[row, node], Bz[row, node + n]])


def _preferred(rows: Rows, stiffness: Array) -> Index:
    """Node (m,) of the secondary, or the nearest one that faces it where that is much softer."""
    if rows.coupling.nnz == 0:
        return rows.node
    coupling = rows.coupling.tocoo()
    falling = np.argsort(-np.abs(coupling.data), kind="stable")
    facing = rows.node.copy()  # where nothing does
    facing[coupling.row[falling[::-1]]] = coupling.col[falling[::-1]]  # the largest comes last
    softer = CONTRAST * stiffness[facing] < stiffness[rows.node]
    return np.where(softer, facing, rows.node)


def pivots(rows: Rows, Bz: sp.csr_array, fixed: Mask, stiffness: Array) -> Index:
    """Host node (m,) of every row, -1 where all of a row's unknowns are prescribed.

    Parameters
    ----------
    rows : Rows
        m of them.
    Bz : sparse (m, 2n)
        The rows in the frames of the nodes.
    fixed : ndarray of bool (n, 2)
        Prescribed directions.
    stiffness : ndarray (n,)
        Force per displacement, by its order of magnitude.
    """
    n = len(fixed)
    preferred = _preferred(rows, stiffness)
    host = preferred.copy()
    local = coefficients_at(Bz, np.arange(len(host)), host)
    free = np.where(fixed[host], 0.0, local)
    lonely = np.bincount(host, minlength=n)[host] == 1
    regular = lonely & (np.linalg.norm(free, axis=1) > PIVOT)
    hosts = _Pivots(fixed)
    for j in np.flatnonzero(regular) if not regular.all() else ():
        hosts.take(host[j], local[j])
    for j in np.flatnonzero(~regular):
        row = Bz[j : j + 1]
        columns = np.unique(row.indices % n)
        entries = row.toarray().ravel()
        choices = [(np.hypot(entries[i], entries[i + n]), i) for i in columns if i != preferred[j]]
        ranked = [preferred[j], *(i for _, i in sorted(choices, reverse=True))]
        coefficients = {i: np.array([entries[i], entries[i + n]]) for i in ranked}
        for i, least in [(i, x) for x in (PIVOT, INDEPENDENT) for i in ranked]:
            if hosts.fits(i, coefficients[i], least):
                hosts.take(i, coefficients[i])
                host[j] = i
                break
        else:
            host[j] = -1
    return host


def check_prescribed(
    rows: Rows, Bz: sp.csr_array, fixed: Mask, values: Array, drop: Index, length: float
) -> None:
    """Raise unless the rows that find no free unknown hold for the prescribed values.

    Parameters
    ----------
    rows : Rows
        m of them.
    Bz : sparse (m, 2n)
        The rows in the frames of the nodes.
    fixed : ndarray of bool (2n,)
        Prescribed unknowns there.
    values : ndarray (2n,)
        Their values.
    drop : ndarray of int (k,)
        The rows in question.
    length : float
        Largest coordinate, to whose round-off the gaps are known.

    Raises
    ------
    ValueError
        A row is violated, or all its free unknowns are those of other rows.
    """
    size = np.abs(values).max(initial=0.0)
    for j in drop:
        columns, entries = Bz[j : j + 1].indices, Bz[j : j + 1].data
        where = f"the contact row at node {rows.node[j]} with direction {rows.direction[j]}"
        if (np.abs(entries[~fixed[columns]]) > INDEPENDENT).any():
            raise ValueError(
                f"{where} depends on other contact rows there; leave one of the pairs out, or end "
                "one of the contact boundaries before that point"
            )
        value = float(entries @ values[columns])
        allowed = INTERPOLATED * max(size, abs(rows.g[j])) + MEASURED * length
        excess = value - rows.g[j]
        if (abs(excess) if rows.equality[j] else excess) > allowed:
            raise ValueError(
                f"{where} is violated by prescribed displacements on both sides: they close the "
                f"gap by {value:g} where it is {rows.g[j]:g}; prescribe displacements without "
                "interference"
            )


@dataclass(frozen=True, eq=False)
class BasisTransformation:
    """Node values u = T y in unknowns of which some are prescribed and one is each row's value.

    Attributes
    ----------
    T : sparse (2n, 2n)
        From the unknowns to x of all nodes, then y.
    fixed : ndarray of bool (2n,)
        Prescribed unknowns.
    values : ndarray (2n,)
        Their values.
    unknown : ndarray of int (k,)
        Unknown that equals the left side of each kept row.
    kept : ndarray of int (k,)
        Kept rows; the others are prescribed altogether and satisfied.
    local : ndarray (n, 2, 2)
        From the values of a node to its two unknowns, but for the rows.
    """

    T: sp.csr_array
    fixed: Mask
    values: Array
    unknown: Index
    kept: Index
    local: Array

    def coordinates(self, values: Array, rows: Array) -> Array:
        """Unknowns (2n, r) of node `values` (2n, r) with the values `rows` (k, r) of kept rows."""
        n = len(self.local)
        y = np.einsum("nij,jnr->inr", self.local, values.reshape(2, n, -1)).reshape(2 * n, -1)
        y[self.unknown] = rows
        y[self.fixed] = 0.0
        return y


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


def _blocks(blocks: Array) -> sp.csr_array:
    """Matrix (2n, 2n) of (n, 2, 2) node blocks in the numbering x first, then y."""
    n = len(blocks)
    columns = np.tile(np.arange(n, dtype=np.int32)[:, None] + np.array([0, n], np.int32), (2, 1))
    starts = np.arange(0, 4 * n + 1, 2, dtype=np.int32)
    values = blocks.transpose(1, 0, 2).flatten()  # a copy, which loses its zeros
    matrix = sp.csr_array((values, columns.ravel(), starts), shape=(2 * n, 2 * n))
    matrix.eliminate_zeros()
    return matrix


def _local_systems(host: Index, coefficients: Array, fixed: Mask) -> tuple[Index, Array, Array]:
    """Make each row's part at its host an unknown there.

    Parameters
    ----------
    host : ndarray of int (k,)
        Host node of each row.
    coefficients : ndarray (k, 2)
        Of the row at its host, in the host's frame.
    fixed : ndarray of bool (n, 2)
        Prescribed slots.

    Returns
    -------
    unknown : ndarray of int (k,)
        Slot of the row: the first free one of its host, the second for a second row.
    M, inverse : ndarray (n, 2, 2)
        2 x 2 systems of rows, completed by the direction across a single row; their inverses.
    """
    n = len(fixed)
    order = np.argsort(host, kind="stable")
    again = np.zeros(len(host), dtype=bool)
    again[1:] = host[order][1:] == host[order][:-1]
    slot = np.empty(len(host), dtype=np.intp)
    slot[order] = again | fixed[host[order], 0]
    local = np.where(fixed[host], 0.0, coefficients)
    M = np.tile(np.eye(2), (n, 1, 1))
    M[host, slot] = local
    single = (np.bincount(host, minlength=n)[host] == 1) & ~fixed[host].any(axis=1)
    across = np.column_stack([-local[single, 1], local[single, 0]])
    M[host[single], 1] = across / np.linalg.norm(across, axis=1)[:, None]
    inverse = np.tile(np.eye(2), (n, 1, 1))
    inverse[host] = np.linalg.inv(M[host])
    return host + n * slot, M, inverse


def _elsewhere(Bz: sp.csr_array, host: Index, fixed: Mask) -> sp.csr_array:
    """What rows `Bz` (k, 2n) contain but for the slots of their `host` (k,) not `fixed` (2n,)."""
    row = np.repeat(np.arange(len(host)), np.diff(Bz.indptr))
    other = (Bz.indices % (Bz.shape[1] // 2) != host[row]) | fixed[Bz.indices]
    other &= Bz.data != 0
    if not other.any():
        return sp.csr_array(Bz.shape)
    return from_triplets(Bz.data[other], row[other], Bz.indices[other], Bz.shape)


def _solved(inverse: Array, unknown: Index, rest: sp.csr_array) -> sp.csr_array:
    """H (2n, 2n) in z = H y: what rows contain of other unknowns moves to the right, z = G y + N z.

    Parameters
    ----------
    inverse : ndarray (n, 2, 2)
        The blocks of G.
    unknown : ndarray of int (k,)
        Slots of the rows.
    rest : sparse (k, 2n)
        The other unknowns in them.
    """
    G = _blocks(inverse)
    k = np.arange(len(unknown))
    N = -(G @ from_triplets(np.ones(len(k)), unknown, k, rest.shape[::-1]) @ rest)
    N.eliminate_zeros()
    N, G = _without_rings(N, G)
    H, term = G, N @ G
    while term.nnz:  # as often as bodies in a row have contact lines that share nodes
        H = H + term
        term = N @ term
        term.eliminate_zeros()
    return H


def _without_rings(N: sp.csr_array, G: sp.csr_array) -> tuple[sp.csr_array, sp.csr_array]:
    """Equations H = G + N H solved for the unknowns that refer to each other in rings."""
    _, group = connected_components(N, connection="strong")
    ring = np.flatnonzero(np.bincount(group)[group] > 1)
    if ring.size == 0:
        return N, G
    inside = N[ring][:, ring]
    block = np.eye(ring.size) - inside.toarray()
    if np.linalg.cond(block) > SAME_IN_A_RING:
        raise ValueError(
            "contact rows depend on each other in a ring; leave one of the contact pairs out, or "
            "give each pair of boundaries once"
        )
    size = N.shape[0]
    place = sp.eye_array(size, format="csr")[:, ring]
    change = sp.csr_array(np.linalg.inv(block) - np.eye(ring.size))
    S = sp.eye_array(size) + place @ change @ place.T
    N = (S @ (N - place @ inside @ place.T)).tocsr()
    N.eliminate_zeros()
    return N, (S @ G).tocsr()


def change_of_basis(
    conditions: Conditions,
    rows: Rows,
    length: float = 0.0,
    stiffness: Array | None = None,
) -> BasisTransformation:
    """Basis in which prescribed conditions and contact rows are single unknowns.

    Parameters
    ----------
    conditions : Conditions
        Gamma_u and Gamma_0.
    rows : Rows
        Gamma_K, on the n nodes of all bodies.
    length : float
        Largest coordinate, to whose round-off the gaps are known.
    stiffness : ndarray (n,), optional
        Force per displacement at the nodes, by its order of magnitude; alike when left out.

    Raises
    ------
    ValueError
        Prescribed displacements on both sides violate a row, or rows depend on each other.
    """
    n = rows.coupling.shape[1]
    frame, fixed, values = _frames(n, conditions)
    R = _blocks(frame)
    Bz = (rows.matrix @ R).tocsr()
    flat_fixed, flat_values = fixed.T.ravel(), values.T.ravel()
    host = pivots(rows, Bz, fixed, np.ones(n) if stiffness is None else stiffness)
    check_prescribed(rows, Bz, flat_fixed, flat_values, np.flatnonzero(host < 0), length)
    kept = np.flatnonzero(host >= 0)
    if len(kept) < len(host):
        host, Bz = host[kept], Bz[kept]
    coefficients = coefficients_at(Bz, np.arange(len(host)), host)
    unknown, M, inverse = _local_systems(host, coefficients, fixed)
    rest = _elsewhere(Bz, host, flat_fixed)
    T = _blocks(frame @ inverse) if rest.nnz == 0 else R @ _solved(inverse, unknown, rest)
    return BasisTransformation(
        T=T.tocsr(),
        fixed=flat_fixed,
        values=flat_values,
        unknown=unknown,
        kept=kept,
        local=M @ frame.transpose(0, 2, 1),
    )
