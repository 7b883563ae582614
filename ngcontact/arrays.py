"""Types of arrays, records, squares, normals, sparse arrays, Newton's method."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from functools import lru_cache
from typing import Any, TypeAlias, TypeVar

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike, NDArray
from scipy.sparse.csgraph import connected_components, depth_first_order

Array: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]
Integers: TypeAlias = NDArray[np.integer]
Columns: TypeAlias = Array | sp.csr_array  # of many rows, sparse where most would be 0

NEWTON_STEPS = 30

Record = TypeVar("Record")  # a dataclass of arrays that have a row for each of the same things
Solve = Callable[[Array], Array]
Factor = Callable[[Mask], Solve]


def power_of_two(values: Array) -> float:
    """The power of 2 below the largest in size of `values` (...,); 1 where all vanish."""
    largest = float(np.abs(values).max(initial=0.0))
    if not 0 < largest < math.inf:
        return 1.0
    return math.ldexp(1.0, max(math.frexp(largest)[1] - 1, -1000))  # its inverse is finite, too


def root_of_squares(values: Array) -> float:
    """Root of the sum of squares of `values` (...,), which may leave the range of numbers."""
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


@lru_cache
def _names(kind: type) -> list[str]:
    return [field.name for field in fields(kind)]


def by_field(record: Any) -> dict[str, Any]:
    """What a record holds, by the names of its fields."""
    kind: Any = type(record)
    return {name: getattr(record, name) for name in _names(kind)}


def rows_of(record: Record, at: Index | Mask, *names: str) -> Record:
    """The rows `at` (k,), numbers or a mask, of arrays of a record: all, or the `names` alone."""
    arrays = by_field(record)
    chosen = {name: arrays[name][at] for name in names or arrays}
    return type(record)(**arrays | chosen)


def joined(records: Sequence[Record]) -> Record:
    """The rows of all `records`, one after the other; there is at least one record."""
    if len(records) == 1:
        return records[0]
    kind: Any = type(records[0])
    columns = zip(*(by_field(record).values() for record in records), strict=True)
    stack = (sp.vstack(x, "csr") if sp.issparse(x[0]) else np.concatenate(x) for x in columns)
    return kind(*stack)


def places_of(wanted: Index, known: Index) -> Index:
    """Places (k,) of the numbers `wanted` (k,) among those that are `known` (n,), -1 where none."""
    order = np.argsort(known)
    found = order[np.minimum(np.searchsorted(known, wanted, sorter=order), len(known) - 1)]
    return np.where(known[found] == wanted, found, -1)


def paths(links: Index, count: int) -> list[Index]:
    """Each curve of `links` (l, 2), numbers (j,) of points; a closed one ends where it starts."""
    graph = from_triplets(np.ones(len(links)), links[:, 0], links[:, 1], (count, count))
    degree = np.bincount(links.ravel(), minlength=count)
    _, part = connected_components(graph, directed=False)
    # Each from one of its two ends on, or, where there is none, around and back.
    _, starts = np.unique(part[order := np.argsort(degree, kind="stable")], return_index=True)
    found = []
    for start in order[starts]:
        path = depth_first_order(graph, start, directed=False, return_predecessors=False)
        closed = degree[start] == 2 and len(path) > 2
        found.append(np.append(path, start) if closed else path)
    return found


def across(d: Array) -> Array:
    """Vectors (..., 2) turned to the left of `d` (..., 2) by a right angle."""
    turned = np.empty(d.shape, d.dtype)
    turned[..., 0], turned[..., 1] = -d[..., 1], d[..., 0]
    return turned


def chords(x: Array) -> Array:
    """Distances (n - 1,) of neighbours among the points `x` (n, d)."""
    return np.linalg.norm(np.diff(x, axis=0), axis=1)


def distances_along(x: Array) -> Array:
    """Lengths (n,) of the way along the points `x` (n, d) from the first."""
    return np.concatenate([[0.0], np.cumsum(chords(x))])


def rightward(slope: Array, other: Array | None = None) -> Array:
    """Unit normals (..., d) of a curve with `slope` (..., 2), or of a surface with two slopes.

    In space `slope` and `other` (..., 3) are those. To the right of a vector in the plane, along
    the cross product of two in space: before the slopes normals make a positively oriented basis.
    """
    normal = -across(slope) if other is None else np.cross(slope, other)
    return np.asarray(normal / np.sqrt((normal**2).sum(axis=-1, keepdims=True)))


def rotations(x: Array) -> Array:
    """Displacements (n, d, r) of points `x` (n, d) in the r unit rotations about the origin.

    Anticlockwise in the plane; about the axes x, y and z in space.
    """
    if x.shape[-1] == 2:
        return across(x)[..., None]
    return np.stack([np.cross(axis, x) for axis in np.eye(3)], axis=-1)


def newton(
    t: Array, step: Callable[[Array, Index], Array], ends: tuple[float, float], rest: float
) -> Array:
    """Parameters (k,), from `t` (k,), after each has taken t - step(t, number) again and again.

    Kept between both `ends`, until its change is no larger than `rest`. `step` answers for some of
    them, (j,), with their numbers (j,): few are left once most have arrived.
    """
    t, moving = t.copy(), np.arange(len(t))
    for _ in range(NEWTON_STEPS):
        old = t[moving]
        t[moving] = np.clip(old - step(old, moving), *ends)
        moving = moving[np.abs(t[moving] - old) > rest]
        if not moving.size:
            break
    return t


def dense(matrix: Array | sp.sparray) -> Array:
    """All entries (m, n) of a `matrix` (m, n) that may be sparse."""
    return matrix if isinstance(matrix, np.ndarray) else np.asarray(matrix.toarray())


def for_components(S: sp.csr_array, d: int) -> sp.csr_array:
    """Sparse array (d * m, d * n) that acts as `S` (m, n) on each of d components."""
    m, n = S.shape
    return sp.csr_array(
        (
            np.tile(S.data, d),
            np.concatenate([S.indices + i * n for i in range(d)]),
            np.concatenate([S.indptr[:1], *(S.indptr[1:] + i * S.nnz for i in range(d))]),
        ),
        shape=(d * m, d * n),
    )
