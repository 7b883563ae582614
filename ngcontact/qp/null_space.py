"""Null space of the stiffness: rigid motions that supports leave free. NumPy and SciPy only.

HH81 Remark 3.7. Directions that no contact row resists (lineality) are fixed by one held unknown
each, whose force vanishes under a load in equilibrium; the others are left to contact. A few
unknowns, the pins, make the factorised matrix definite for every active set and are released in
its border, so that singularity sits in a small Schur complement alone.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.linalg import qr

from ..arrays import Array, Index, Mask

FREE = 1e-8  # singular value, relative to motions of size 1, below which nothing resists


def vanishing_combinations(resisted: Array) -> Array:
    """Combinations (r, l) of the r columns of `resisted` (k, r) that vanish, in echelon form."""
    r = resisted.shape[1]
    if len(resisted) < r:
        resisted = np.pad(resisted, ((0, r - len(resisted)), (0, 0)))
    if r == 0:
        return np.zeros((0, 0))
    _, singular, directions = np.linalg.svd(resisted, full_matrices=False)
    return echelon(directions[singular <= FREE * np.sqrt(len(resisted))].T)


def echelon(vectors: Array) -> Array:
    """Columns (n, l) of the same span as `vectors` (n, l), of which l rows form the identity."""
    if vectors.shape[1] == 0:
        return vectors
    pivots = qr(vectors.T, mode="r", pivoting=True)[1][: vectors.shape[1]]
    pivots.sort()
    result = vectors @ np.linalg.inv(vectors[pivots])
    result[pivots] = np.eye(len(pivots))
    result[np.abs(result) <= FREE] = 0.0
    return result


@dataclass(frozen=True, eq=False)
class NullSpace:
    """Rigid motions in the unknowns of a quadratic program.

    Attributes
    ----------
    lineal : ndarray (n, l)
        Motions that no row resists.
    others : ndarray (n, q)
        The rest of the null space, zero at `held`.
    held : ndarray of int (l,)
        Unknowns that fix the first.
    pins : ndarray of int (q,)
        Unknowns that fix the others.
    conditions : ndarray (l, n)
        Functionals that vanish at the result, the identity on `lineal`.
    """

    lineal: Array
    others: Array
    held: Index
    pins: Index
    conditions: Array

    def resisted(self, rows: Index) -> bool:
        """Whether rows with the unknowns `rows` (k,) resist all motions that are not lineal."""
        if self.pins.size == 0:
            return True
        return vanishing_combinations(self.others[rows]).shape[1] == 0


def no_null_space(n: int) -> NullSpace:
    """The null space of a definite matrix of size n."""
    none, index = np.zeros((n, 0)), np.zeros(0, dtype=np.intp)
    return NullSpace(lineal=none, others=none, held=index, pins=index, conditions=none.T)


def pinned_null_space(
    motions: Array, combinations: Array, functionals: Array, rows: Index, fixed: Mask
) -> NullSpace:
    """Null space with well separated pins.

    Parameters
    ----------
    motions : ndarray (n, r)
        Basis of the null space, of size 1, zero at `fixed`.
    combinations : ndarray (r, l)
        Of them that no row resists.
    functionals : ndarray (l, n)
        Conditions that determine those.
    rows : ndarray of int (m,)
        Unknowns that are the values of contact rows.
    fixed : ndarray of bool (n,)
        Unknowns with given values.

    """
    free = ~fixed
    free[rows] = False
    places = np.flatnonzero(free)
    lineal = motions @ combinations
    lineal[rows] = 0.0
    held = _separated(lineal, places)
    # What completes the lineal motions, less what these contribute at the held unknowns.
    rest = motions @ np.linalg.svd(combinations, full_matrices=True)[0][:, lineal.shape[1] :]
    rest -= lineal @ np.linalg.solve(lineal[held], rest[held]) if held.size else 0.0
    rest[held] = 0.0
    pins = _separated(rest, places)
    return NullSpace(
        lineal=lineal,
        others=rest,
        held=held,
        pins=pins,
        conditions=np.asarray(np.linalg.solve(functionals @ lineal, functionals), dtype=float),
    )


def _separated(vectors: Array, places: Index) -> Index:
    """As many of the `places` as there are vectors, at which they are most independent."""
    count = vectors.shape[1]
    if count == 0:
        return np.zeros(0, dtype=np.intp)
    return places[qr(vectors[places].T, mode="r", pivoting=True)[1][:count]]
