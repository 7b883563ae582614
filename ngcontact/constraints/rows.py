"""Conditions at nodes: prescribed displacements and contact rows. NumPy and SciPy only."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask
from ..triplets import from_triplets

REPEATED = 1e-9  # difference of coefficients, each at most 1, below which two rows are one


@dataclass(frozen=True, eq=False)
class Conditions:
    """Conditions a.u(x_i) = value at nodes, those of Gamma_u before those of Gamma_0.

    Attributes
    ----------
    node : ndarray of int (k,)
    direction : ndarray (k, 2)
        Unit vectors.
    value : ndarray (k,)
    """

    node: Index
    direction: Array
    value: Array


@dataclass(frozen=True, eq=False)
class Rows:
    """Contact rows d.(u(x_i) - trace of the facing body) <= g, m of them.

    Attributes
    ----------
    node : ndarray of int (m,)
        Node of the secondary.
    direction : ndarray (m, 2)
    partner : ndarray of int (m, q)
        Nodes of the facing segment; any nodes for a rigid obstacle.
    share : ndarray (m, q)
        Basis functions of those nodes at the partner point; zero for a rigid obstacle.
    g : ndarray (m,)
    equality : ndarray of bool (m,)
        Rows that hold with equality, Remark 3.3.
    """

    node: Index
    direction: Array
    partner: Index
    share: Array
    g: Array
    equality: Mask

    def matrix(self, n: int) -> sp.csr_array:
        """B (m, 2n) on node values: x components first, then y."""
        m, q = self.partner.shape
        node = np.column_stack([self.node, self.partner])
        share = np.column_stack([np.ones(m), -self.share])
        cols = np.concatenate([node, node + n], axis=1)
        vals = np.concatenate(
            [share * self.direction[:, :1], share * self.direction[:, 1:]], axis=1
        )
        rows = np.repeat(np.arange(m), 2 * (q + 1))
        B = from_triplets(vals.ravel(), rows, cols.ravel(), (m, 2 * n))
        B.eliminate_zeros()
        return B

    def select(self, rows: Index) -> Rows:
        """Some of the rows."""
        return Rows(*(getattr(self, name)[rows] for name in Rows.__annotations__))

    def repeated(self, n: int) -> Index:
        """Number (m,) of an earlier row with the same left side, or the row's own number.

        Where two contact lines meet smoothly, both ask for the row of their common node.
        """
        number = np.arange(len(self.node))
        order = np.argsort(self.node, kind="stable")
        alike = self.node[order][1:] == self.node[order][:-1]
        if not alike.any():
            return number
        B = self.matrix(n)
        for first, second in zip(order[:-1][alike], order[1:][alike], strict=True):
            if abs(B[[first]] - B[[second]]).max() <= REPEATED:
                number[second] = number[first]
        return number
