"""The quadratic program of a discrete contact problem, its null space, systems and optimality.

HH81 Remark 3.7. Directions that no contact row resists (lineality) are fixed by one held unknown
each, whose force vanishes under a load in equilibrium; the others are left to contact. A few
unknowns, the pins, hold motions that the active rows of the factorised matrix hardly resist, and
are released in its border, so that singularity sits in a small Schur complement alone. NumPy and
SciPy only.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
import scipy.sparse as sp
from scipy.linalg import qr
from scipy.sparse.csgraph import connected_components

from ..arrays import Array, Columns, Index, Mask, dense

NULL_SPACE_TOLERANCE = 1e-8  # singular value, of motions of size 1, below which nothing resists
CACHE_ROWS = 1 << 14  # rows that are copied at a time: the copy stays in the cache


def vanishing_combinations(resisted: Array, tolerance: float = NULL_SPACE_TOLERANCE) -> Array:
    """Combinations (r, l) of the r columns of `resisted` (k, r) that vanish, in echelon form.

    Up to the `tolerance`, in the root of the mean square of their k values.
    """
    r = resisted.shape[1]
    if len(resisted) < r:
        resisted = np.pad(resisted, ((0, r - len(resisted)), (0, 0)))
    if r == 0:
        return np.zeros((0, 0))
    _, singular, directions = np.linalg.svd(resisted, full_matrices=False)
    found = directions[singular <= tolerance * np.sqrt(len(resisted))].T
    pivots = np.sort(separated(found, np.arange(r)))
    found = found @ np.linalg.inv(found[pivots])
    found[pivots] = np.eye(len(pivots))
    found[np.abs(found) <= NULL_SPACE_TOLERANCE] = 0.0
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class NullSpace:
    """Rigid motions in the unknowns of a quadratic program."""

    lineal: Array  # (n, l) motions that no row resists
    others: Columns  # (n, q) the rest of the null space, zero at `held`
    held: Index  # (l,) unknowns that fix the first
    pins: Index  # (q,) unknowns that fix the others
    conditions: Array  # (l, n) functionals that vanish at the result, the identity on `lineal`

    def resisted(self, rows: Index) -> bool:
        """Whether rows with the unknowns `rows` (k,) resist all motions that are not lineal."""
        return self.unresisted(rows).size == 0

    def unresisted(self, rows: Index, tolerance: float = NULL_SPACE_TOLERANCE) -> Array:
        """Combinations (q, k) of `others` that rows with the unknowns `rows` (m,) do not resist."""
        return vanishing_combinations(dense(self.others[rows]), tolerance)

    def held_by(self, combinations: Array) -> Mask:
        """Pins (q,), as many as `combinations` (q, k) of `others`, that hold these."""
        at_pins, held = dense(self.others[self.pins]), np.zeros(self.pins.size, dtype=bool)
        held[separated(at_pins @ combinations, np.arange(self.pins.size))] = True
        return held


def no_null_space(n: int) -> NullSpace:
    """The null space of a definite matrix of size n."""
    none, index = np.zeros((n, 0)), np.zeros(0, dtype=np.intp)
    return NullSpace(lineal=none, others=none, held=index, pins=index, conditions=none.T)


def pinned_null_space(
    motions: Columns,
    combinations: Array,
    functionals: Array,
    rows: Index,
    fixed: Mask,
    row_share: float = 0.0,
) -> NullSpace:
    """Null space, by a basis `motions` (n, r) of size 1, with well separated pins.

    `combinations` (r, l) of the motions no row resists; `functionals` (l, n) determine these. The
    unknowns `rows` (m,) are the values of contact rows, those that are `fixed` (n,) are given.
    Of motions that move other unknowns by less than a `row_share` of them, these are pins.
    """
    share = (~fixed).astype(float)
    share[rows] *= row_share
    places, every_place = np.flatnonzero(share == 1), np.flatnonzero(share)
    lineal = motions @ combinations
    lineal[rows] = 0.0
    held = separated(lineal, places)
    # What completes the lineal motions, less what these contribute at the held unknowns.
    every, kind = np.arange(motions.shape[1]), sp.csr_array if sp.issparse(motions) else np.asarray
    rest = motions[:, np.setdiff1d(every, separated(combinations, every))]
    if held.size:
        rest = rest - kind(lineal) @ kind(np.linalg.solve(lineal[held], dense(rest[held])))
        elsewhere = np.ones((len(fixed), 1))
        elsewhere[held] = 0.0
        rest = kind(rest * elsewhere)
    pins = [held[:0]]
    for part in _apart(rest):
        moves = np.zeros(len(fixed), dtype=bool)
        moves[part.nonzero()[0]] = True
        at = every_place[moves[every_place]]
        pins.append(at[separated(share[at, None] * dense(part[at]), np.arange(at.size))])
    return NullSpace(
        lineal=lineal,
        others=rest,
        held=held,
        pins=np.concatenate(pins),
        conditions=np.asarray(np.linalg.solve(functionals @ lineal, functionals), dtype=float),
    )


def _apart(columns: Columns) -> list[Columns]:
    """Groups of sparse `columns` (n, q) that share no row with others, dense ones as they are."""
    if not sp.issparse(columns):
        return [columns]
    _, group = connected_components(abs(columns).T @ abs(columns))
    return [columns[:, group == k] for k in np.unique(group)]


def separated(vectors: Array, places: Index) -> Index:
    """Places (q,) among `places` (k,) at which the `vectors` (n, q) are most independent."""
    some = vectors[places].T
    if some.size == 0:
        return places[:0]
    return np.asarray(places[qr(some, mode="r", pivoting=True)[1][: len(some)]])


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """Minimise 1/2 y'Ky - b'y subject to R y <= g and given values of some unknowns."""

    K: sp.csr_array  # (n, n) symmetric, but for `null_space` definite where not `fixed`
    b: Array  # (n,) load
    g: Array  # (m,) bounds
    equality: Mask  # (m,) rows that hold with equality, R y = g
    fixed: Mask  # (n,) unknowns with given values
    values: Array  # (n,) the given values; only those of `fixed` unknowns are read
    # (m, n) linearly independent on the unknowns that are not `fixed`. None where row j is the unit
    # vector of unknown `unknown[j]`: an active row is then an unknown that leaves the system, and
    # every factorised matrix is a principal submatrix.
    R: sp.csr_array | None = None
    unknown: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))  # (m,)
    # Of K, only with unit rows:
    null_space: NullSpace = field(default_factory=lambda: no_null_space(0))

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal (n,) of K."""
        return np.asarray(self.K.diagonal())

    @cached_property
    def work(self) -> tuple[Array, Array]:
        """Work (q,) of the load on motions z that are not lineal, and the sum (q,) of its terms."""
        motions = self.null_space.others
        return motions.T @ self.b, abs(motions).T @ np.abs(self.b)

    def left_sides(self, y: Array) -> Array:
        """R y, (m,), for `y` (n,)."""
        return y[self.unknown] if self.R is None else np.asarray(self.R @ y)

    def pull(self, force: Array) -> Array:
        """R' force, (n,), for `force` (m,)."""
        if self.R is not None:
            return np.asarray(self.R.T @ force)
        return np.asarray(np.bincount(self.unknown, force, len(self.b)), dtype=float)


@dataclass(frozen=True, eq=False)
class Iterate:
    """Solution of a quadratic program, in any consistent units.

    Attributes
    ----------
    u : ndarray (n,)
        Minimiser.
    force : ndarray (m,)
        Multipliers of the rows R u <= g, not negative.
    multiplier : ndarray (k,)
        Multipliers of the equations E u = e, of either sign.
    active : ndarray of bool (m,)
        Rows that hold with equality.
    steps : list of int
        Changes of the active set after each linear system; the last one is 0.
    factorizations : int
        Number of factorisations.
    back_solves : int
        Number of back-solves; V-cycles of large problems without factorisation count as such.
    """

    u: Array
    force: Array
    active: Mask
    steps: list[int]
    multiplier: Array = field(default_factory=lambda: np.zeros(0))
    factorizations: int = 0
    back_solves: int = 0


def terms(A: sp.csr_array, x: Array) -> Array:
    """|A| |x| (m,), the size of the terms of A x for `x` (n,).

    A second matrix of the size of `A` (m, n) is not made.
    """
    starts, x = range(0, A.shape[0], CACHE_ROWS), np.abs(x)
    return np.concatenate([np.zeros(0), *(abs(A[k : k + CACHE_ROWS]) @ x for k in starts)])


def kkt_residuals(program: QuadraticProgram, minimiser: Iterate) -> dict[str, float]:
    """Dimensionless residuals of the Karush-Kuhn-Tucker conditions, see `Solution.residuals`.

    Of a program with unit rows.
    """
    p, y, force, active = program, minimiser.u, minimiser.force, minimiser.active
    gap = p.g - y[p.unknown]
    residual = p.b - p.K @ y - p.pull(force)
    sizes = (p.b, terms(p.K, y), force)
    load = max(np.abs(x).max(initial=0.0) for x in sizes)
    length = max(np.abs(y).max(initial=0.0), np.abs(p.g[active]).max(initial=0.0))
    largest = np.abs(force).max(initial=0.0)
    one_sided = force[~p.equality]

    def over(value: float, scale: float) -> float:
        return float(value / scale) if value > 0 else 0.0

    return {
        "equilibrium": over(np.abs(residual[~p.fixed]).max(initial=0.0), load),
        "penetration": over(-gap.min(initial=0.0), length),
        "tension": over(-one_sided.min(initial=0.0), largest),
        "complementarity": float(np.abs(force / (largest or 1.0) * (gap / (length or 1.0))).sum()),
    }


class SingularError(ArithmeticError):
    """A factorised matrix does not solve its system: some motion meets no resistance."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """What holds the q pins, so that every system is definite.

    Proximal terms stiffness / 2 (y - at)^2; an infinite stiffness prescribes y = at.
    """

    stiffness: Array  # (q,) force per displacement
    at: Array  # (q,) values of the pins from which they pull

    @property
    def rigid(self) -> Mask:
        """Pins (q,) whose values are prescribed."""
        return np.isinf(self.stiffness)

    def pull(self, y: Array) -> Array:
        """Force (q,) of the proximal terms on pins with the values `y` (q,)."""
        return np.where(self.rigid, 0.0, self.stiffness) * (y - self.at)


def prescribing(pins: Mask, anchor: Anchor | None = None) -> Anchor | None:
    """An anchor that prescribes 0 at `pins` (q,), too; None of none."""
    if not pins.any():
        return anchor
    if anchor is None:
        anchor = Anchor(np.zeros(pins.size), np.zeros(pins.size))
    return replace(anchor, stiffness=np.where(pins, np.inf, anchor.stiffness))
