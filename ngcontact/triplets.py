"""Sparse arrays from entries, with indices as SciPy's and NGSolve's own. NumPy and SciPy only."""

from __future__ import annotations

from typing import Any

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray


def from_triplets(
    values: NDArray[Any], rows: ArrayLike, columns: ArrayLike, shape: tuple[int, int]
) -> sp.csr_array:
    """Sparse array (m, n), its `shape`, of the `values` (k,) at `rows` and `columns` (k,), summed.

    Indices have 32 bits where they fit: sparse arrays keep the type they are given, products with
    64 bits copy the other factor's indices to 64, and SciPy's graphs before 1.16 refuse them.
    """
    largest = max(*shape, len(values))
    index = np.int32 if largest <= np.iinfo(np.int32).max else np.int64
    at = np.asarray(rows, dtype=index), np.asarray(columns, dtype=index)
    return sp.csr_array((values, at), shape=shape)


def for_both_components(S: sp.csr_array) -> sp.csr_array:
    """Sparse array (2m, 2n) that acts as `S` (m, n) on x components and on y components."""
    m, n = S.shape
    return sp.csr_array(
        (
            np.concatenate([S.data, S.data]),
            np.concatenate([S.indices, S.indices + n]),
            np.concatenate([S.indptr, S.indptr[1:] + S.nnz]),
        ),
        shape=(2 * m, 2 * n),
    )
