"""A factorised system, and another one as a border of it. NumPy and SciPy only."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, Solve
from .quadratic_program import QuadraticProgram
from .systems import Anchor


def _row(C: sp.csr_array, i: int) -> Array:
    """Row i of a sparse matrix, dense; what SciPy does for that takes as long as a back-solve."""
    row = np.zeros(C.shape[1])
    at = slice(C.indptr[i], C.indptr[i + 1])
    row[C.indices[at]] = C.data[at]
    return row


@dataclass(eq=False)
class Base:
    """The factorised system K_0: that of one active set, with all pins held.

    Attributes
    ----------
    active : ndarray of bool (m,)
        Its active rows, none where rows are not unit rows.
    free : ndarray of bool (n,)
        Its unknowns.
    inverse : callable
        K_0^-1.
    known : ndarray (k, n)
        Solutions K_0^-1 v of the columns v that borders have had so far.
    place : dict of int to int
        Which of them belongs to an unknown, or to row j by the key ~j.
    """

    active: Mask
    free: Mask
    inverse: Solve
    known: Array
    place: dict[int, int] = field(default_factory=dict)

    def columns(self, keys: list[int], V: sp.csr_array, back_solve: Solve) -> Index:
        """Places (k,) in `known` for the columns of a border, the rows of `V` (k, n)."""
        new = [i for i, key in enumerate(keys) if key not in self.place]
        if new:
            self.place.update({keys[i]: len(self.place) + k for k, i in enumerate(new)})
            solutions = [back_solve(_row(V, i)) for i in new]
            self.known = np.vstack([self.known, *solutions])
        return np.array([self.place[key] for key in keys], dtype=np.intp)


@dataclass(frozen=True, eq=False)
class Border:
    """One system: the base with k columns V and rows V', D below; S = V' K_0^-1 V - D.

    Attributes
    ----------
    base : Base
    active : ndarray of bool (m,)
    anchor : Anchor or None
        The system.
    at : ndarray of int (r,)
        Unknowns that the base holds and the system does not: released ones, and the pins.
    rows : ndarray of int (k - r,)
        Rows that only the system holds.
    column : ndarray of int (k,)
        Places of K_0^-1 V among the known solutions of the base.
    touched : ndarray of int (t,)
        Unknowns where V is not zero.
    V : ndarray (k, t)
        Its transpose there.
    size : ndarray (k,)
        Roots of the diagonal of S.
    S : ndarray (k, k)
        The Schur complement, over these: only so can small pivots be told, as forces stand
        beside displacements.
    """

    base: Base
    active: Mask
    anchor: Anchor | None
    at: Index
    rows: Index
    column: Index
    touched: Index
    V: Array
    size: Array
    S: Array

    def serves(self, active: Mask, anchor: Anchor | None) -> bool:
        """Whether it is the system of the rows `active` (m,) and this anchor."""
        return self.anchor is anchor and np.array_equal(self.active, active)

    def largest(self, residual: Array) -> float:
        """Largest unbalanced force of `residual` (n,) that the system is to remove."""
        parts = residual[self.base.free], residual[self.at]
        return float(max(np.abs(part).max(initial=0.0) for part in parts))


def _without_border(base: Base, active: Mask, anchor: Anchor | None, none: Index) -> Border:
    """The base itself as a system; `none` (0,) are the unknowns and rows of its border."""
    V = np.zeros((0, 0))
    return Border(base, active, anchor, none, none, none, none, V, V.diagonal(), V)


def bordered(
    p: QuadraticProgram, base: Base, active: Mask, anchor: Anchor | None, back_solve: Solve
) -> Border:
    """The system of an active set as a border of the base.

    Parameters
    ----------
    p : QuadraticProgram
    base : Base
        Learns the columns that are new.
    active : ndarray of bool (m,)
    anchor : Anchor or None
    back_solve : callable
        K_0^-1 of the base, counted.
    """
    rows = np.flatnonzero(active & ~base.active)
    at = p.null_space.pins
    if p.unit_rows:
        at = np.concatenate([p.unknown[base.active & ~active], at])
    keys = np.concatenate([at, ~rows])
    if keys.size == 0:
        return _without_border(base, active, anchor, keys)
    V = sp.vstack([p.K[at], p.R[rows]], format="csr")
    column = base.columns(keys.tolist(), V, back_solve)
    touched = np.unique(V.indices)  # few of the unknowns
    dense = V[:, touched].toarray()
    D = np.zeros((len(column), len(column)))
    D[:, : at.size] = V[:, at].toarray()
    D[: at.size] = D[:, : at.size].T
    if anchor is not None:
        pins = np.arange(at.size - p.null_space.pins.size, at.size)
        D[pins, pins] += anchor.stiffness
    S = dense @ base.known[np.ix_(column, touched)].T - D
    size = np.sqrt(np.abs(np.diagonal(S)))
    size = np.where(size > 0, size, 1.0)
    return Border(
        base=base,
        active=active,
        anchor=anchor,
        at=at,
        rows=rows,
        column=column,
        touched=touched,
        V=dense,
        size=size,
        S=S / np.outer(size, size),
    )
