"""Which node hosts a contact row: the node of which one unknown becomes the row's value.

The node of the secondary, unless its displacement is prescribed there or other rows took its
directions; then a node of the facing segment. Between a stiff and a soft body the soft one's node:
the row's force is the unbalanced force there, which round-off of the stiff one would drown.
NumPy and SciPy only.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask
from .rows import Rows

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
