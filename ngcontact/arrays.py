"""Types of arrays, squares that stay in the range of numbers, normals, sparse arrays."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]
Integers: TypeAlias = NDArray[np.integer]


Solve = Callable[[Array], Array]
Factor = Callable[[Mask], Solve]


def power_of_two(values: Array) -> float:
    """The power of 2 below the largest in size of `values` (...,); 1 where all vanish."""
    largest = float(np.abs(values).max(initial=0.0))
    if not 0 < largest < math.inf:
        return 1.0
    return math.ldexp(1.0, max(math.frexp(largest)[1] - 1, -1000))  # its inverse is finite, too


def root_of_squares(values: Array) -> float:
    """Root of the sum of squares of `values` (...,), in their unit.

    The squares may be too large or too small for a float.
    """
    unit = power_of_two(values)
    return unit * float(np.sqrt(((values / unit) ** 2).sum()))


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


def across(d: Array) -> Array:
    """Vectors (..., 2) turned to the left of `d` (..., 2) by a right angle."""
    return np.stack([-d[..., 1], d[..., 0]], axis=-1)


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
