"""Conditions at nodes: prescribed displacements and contact rows. NumPy and SciPy only."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, TypeVar

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, from_triplets

REPEATED = 1e-9  # difference of coefficients, each at most 1, below which two rows are one


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions a.u(x_i) = value at nodes, those of Gamma_u before those of Gamma_0."""

    node: Index  # (k,) numbers i of the nodes
    direction: Array  # (k, d) unit vectors a
    value: Array  # (k,) prescribed displacements along them, in units of length


@dataclass(frozen=True, eq=False)
class Rows:
    """Contact rows d_j.(u(x_j) - sum_k c_jk u(x_k)) <= g_j, m of them, on n nodes.

    The sum is the displacement that faces node j: the trace of the facing body at one point for
    rows at nodes, a mean of it for others.
    """

    node: Index  # (m,) node j of the secondary
    direction: Array  # (m, d) unit vectors
    # (m, n) weights c of the nodes of the facing body; an empty row for a rigid obstacle
    coupling: sp.csr_array
    g: Array  # (m,) bounds, in units of length
    equality: Mask  # (m,) rows that hold with equality, Remark 3.3

    @cached_property
    def matrix(self) -> sp.csr_array:
        """B (m, d * n) on node values: x components first, then y."""
        (m, n), d = self.coupling.shape, self.direction.shape[1]
        c = self.coupling.tocoo()
        row = np.concatenate([np.arange(m), c.row])
        column = np.concatenate([self.node, c.col])
        weight = np.concatenate([np.ones(m), -c.data])
        # (2.3), (2.5): n.(v' - v''); (2.10): v''_xi - v'_xi
        values = (weight[:, None] * self.direction[row]).T
        columns = np.concatenate([column + i * n for i in range(d)])
        B = from_triplets(values.ravel(), np.tile(row, d), columns, (m, d * n))
        B.eliminate_zeros()
        return B

    def select(self, rows: Index) -> Rows:
        """Some of the rows, by their numbers `rows` (k,)."""
        if np.array_equal(rows, np.arange(len(self.node))):
            return self
        return Rows(*(getattr(self, x.name)[rows] for x in fields(Rows)))

    def repeated(self) -> Index:
        """Number (m,) of an earlier row with the same left side, or the row's own number.

        Where two contact lines meet smoothly, both ask for the row of their common node.
        """
        number = np.arange(len(self.node))
        order = np.argsort(self.node, kind="stable")
        alike = self.node[order][1:] == self.node[order][:-1]
        if not alike.any():
            return number
        B = self.matrix
        for first, second in zip(order[:-1][alike], order[1:][alike], strict=True):
            if abs(B[first : first + 1] - B[second : second + 1]).max() <= REPEATED:
                number[second] = number[first]
        return number


def no_rows(n: int, d: int = 2) -> Rows:
    """The rows of a problem without contact on n nodes."""
    none = np.zeros(0, dtype=np.intp)
    return Rows(none, np.zeros((0, d)), sp.csr_array((0, n)), np.zeros(0), none > 0)


def no_conditions(d: int = 2) -> Conditions:
    """The conditions of a problem without supports."""
    return Conditions(np.zeros(0, dtype=np.intp), np.zeros((0, d)), np.zeros(0))


Part = TypeVar("Part", Conditions, Rows)


def concatenated(parts: Sequence[Part]) -> Part:
    """Conditions, or rows, of all parts in order; there is at least one part."""
    if len(parts) == 1:
        return parts[0]
    kind = type(parts[0])

    def stacked(name: str) -> Any:
        arrays = [getattr(part, name) for part in parts]
        return sp.vstack(arrays, format="csr") if sp.issparse(arrays[0]) else np.concatenate(arrays)

    return kind(*(stacked(x.name) for x in fields(kind)))
