"""Sparse symmetric matrices that NGSolve and SciPy share, and their factorisation."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from pyngcore import Array_D_S, Array_I_S

from ..arrays import Array, Factor, Index, Mask, Solve, from_triplets
from ..threads import one_thread

# Unknowns up to which one thread factorises sooner than NGSolve has started others and they have
# found their work: that takes 25 ms of processor time, 10 000 unknowns of order 3 on one thread 33.
ONE_THREAD = 10_000
MULTIPLIED_ENTRIES = 60_000  # of a matrix, up to which T'AT costs no more than the change to it
MAX_CHANGE = 0.4  # entries that contact rows change, relative to those of the matrix


class _View:
    """Buffer of NGSolve's memory; arrays made of it keep the owner alive, NGSolve's do not."""

    def __init__(self, view: Any, owner: ng.BaseMatrix) -> None:
        self.__array_interface__ = np.asarray(view).__array_interface__
        self.owner = owner


def shared(matrix: ng.BaseMatrix) -> sp.csr_array:
    """A matrix (m, n) for SciPy, in the memory of NGSolve's: no values and columns are copied."""
    values, columns, starts = (np.asarray(_View(x, matrix)) for x in matrix.CSR())
    if len(values) <= np.iinfo(columns.dtype).max:  # SciPy has both of one type, or copies
        starts = starts.astype(columns.dtype)
    return sp.csr_array((values, columns, starts), (matrix.height, matrix.width))


def reversed_order(matrix: ng.BaseMatrix) -> ng.BaseMatrix:
    """A copy of a matrix (n, n) in which rows and columns are in reverse order."""
    there = matrix.CreateMatrix()
    values, columns, starts = (np.asarray(x) for x in there.CSR())
    columns[:] = matrix.height - 1 - columns[::-1].copy()
    values[:], starts[:] = values[::-1].copy(), len(values) - starts[::-1].copy()
    return there


def _from_entries(
    row: Index, column: Index, values: Array, shape: tuple[int, int], some: Mask | None = None
) -> Any:
    """NGSolve's matrix (m, n), its `shape`, of `values` (k,) at `row` and `column` (k,), summed.

    Of all or `some` (k,) of them.
    """
    entries, size = [], len(row) if some is None else np.count_nonzero(some)
    # NumPy arrays as arguments would be converted entry by entry, at ten times the price.
    for kind, x in ((Array_I_S, row), (Array_I_S, column), (Array_D_S, values)):
        entries.append(kind(size))
        if some is None:
            entries[-1].NumPy()[:] = x
        else:
            np.compress(some, x, out=entries[-1].NumPy())
    return ng.la.SparseMatrixd.CreateFromCOO(*entries, *shape)


def _rows(K: sp.csr_array) -> Index:
    """Row (k,) of each entry."""
    return np.repeat(np.arange(K.shape[0], dtype=np.int32), np.diff(K.indptr))


def summed(blocks: Sequence[tuple[Index, Index, Array]], shape: tuple[int, int]) -> sp.csr_array:
    """SciPy's matrix (m, n), its `shape`, a sum: dense `blocks` (b, i), (b, j) and (b, i, j).

    They are rows, columns and values, of b of one shape, or of one without b.
    """
    size, end = sum(values.size for *_, values in blocks), 0
    row, column, entries = np.empty(size, np.int32), np.empty(size, np.int32), np.empty(size)
    for at, across, values in blocks:
        start, end = end, end + values.size
        row[start:end] = np.repeat(at.astype(np.int32), across.shape[-1], axis=-1).ravel()
        column[start:end] = np.tile(across.astype(np.int32), at.shape[-1]).ravel()
        entries[start:end] = values.ravel()
    return from_triplets(entries, row, column, shape)


def handed_over(K: sp.sparray) -> ng.BaseMatrix:
    """A copy of the SciPy matrix `K` (m, n) for NGSolve."""
    K = K.tocsr()
    return _from_entries(_rows(K), K.indices, K.data, K.shape)


def lower_half(K: sp.csr_array) -> ng.BaseMatrix:
    """Lower half of the symmetric `K` (n, n) for NGSolve: what its Cholesky factorisation reads."""
    row = _rows(K)
    return _from_entries(row, K.indices, K.data, K.shape, K.indices <= row)


def congruent(matrix: ng.BaseMatrix, T: sp.csr_array) -> tuple[sp.csr_array, ng.BaseMatrix | None]:
    """Matrix T'AT (k, k) of the unknowns y of u = T y, for SciPy and for NGSolve.

    A (n, n) is the `matrix`. `T` (n, k) is the identity but for nodes on the boundary: of a large
    matrix only the change is multiplied and handed over, a small part of the whole. Where it is
    not, as where many bodies meet, NGSolve gets none: see `cholesky_of_closed_rows`.
    """
    # element="physical" has fewer node values than edge unknowns
    if matrix.nze <= MULTIPLIED_ENTRIES or T.shape[0] != T.shape[1]:
        right = handed_over(T)
        product = right.CreateTranspose() @ (matrix @ right)
        return shared(product), product
    A = shared(matrix)
    change = change_of_basis(A, T)
    if change.nnz > MAX_CHANGE * A.nnz:
        return A + change, None
    total = _changed(matrix, change)
    return shared(total), total


def _changed(matrix: ng.BaseMatrix, change: sp.csr_array) -> ng.BaseMatrix:
    """The sum of a matrix and a `change` (n, n), for NGSolve."""
    return (matrix + handed_over(change)).CreateSparseMatrix() if change.nnz else matrix


def change_of_basis(A: sp.csr_array, T: sp.csr_array) -> sp.csr_array:
    """Change T'AT - A, (n, n), of a symmetric `A` (n, n).

    `T` (n, n) is the identity but for a few rows.
    """
    D = T - sp.eye_array(A.shape[0], format="csr")
    part = D.T.tocsr() @ A  # D'A: as A is symmetric, AD is its transpose
    return (part @ T + part.T).tocsr()


def inverse_of(matrix: ng.BaseMatrix, free: ng.BitArray) -> ng.BaseMatrix:
    """Sparse Cholesky factorisation of the `free` unknowns of a matrix of which the lower half is.

    Small ones on one thread, to the last bit the same on any machine, but for a caller's threads.
    """
    if free.NumSet() > ONE_THREAD:
        return matrix.Inverse(free, inverse="sparsecholesky")
    with one_thread():
        return matrix.Inverse(free, inverse="sparsecholesky")


def cholesky(matrix: ng.BaseMatrix) -> Factor:
    """NGSolve's sparse Cholesky factorisation as what `bordered_systems` asks for."""
    right, solution = matrix.CreateColVector(), matrix.CreateRowVector()
    b_here, found = (vector.FV().NumPy() for vector in (right, solution))

    def factor(free: Mask) -> Solve:
        inverse = inverse_of(matrix, ng.BitArray(free))

        def solve(b: Array) -> Array:
            b_here[:] = b
            solution.data = inverse * right
            return np.array(found)

        return solve

    return factor


def cholesky_of_closed_rows(
    matrix: ng.BaseMatrix, basis: sp.csr_array, T: sp.csr_array, links: sp.csr_array
) -> Factor:
    """The same of T'(basis' A basis)T, in which contact rows that are open fill no entries.

    A (n, n) is the `matrix`, `basis` (n, k) and `T` (k, k) lead from the unknowns y to its own, and
    `links` (k, k) are what rows contain of other unknowns. With z = y less these at the free
    unknowns, y = S z, the matrix of z is sparser.
    """
    A = shared(matrix)

    def factor(free: Mask) -> Solve:
        S = sp.eye_array(len(free), format="csr") + sp.diags_array(free.astype(float)) @ links
        part = T @ S
        part.eliminate_zeros()  # what cancels
        solve = cholesky(_changed(matrix, change_of_basis(A, basis @ part)))(free)
        return lambda b: np.asarray(S @ solve(S.T @ b))

    return factor
