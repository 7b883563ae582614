"""Body forces on the triangles: what stresses of degree k balance, what is balanced inside each.

Where forces are not smooth, triangles are looked at in `PARTS`^2 equal parts, and where these do
not suffice, in as many parts of each of them; so are those with features that points of a whole
triangle may not see.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask
from .conditions import DATA_BONUS, HIGHER
from .partition import Partition, of_body
from .polynomials import CORNERS, barycentric, basis, dimension, triangle_rule

PARTS = 4  # of each side
PART_DEGREE = 2  # of forces on the parts
SMOOTH = 1e-3  # of the largest force, what may be missed without a look at parts
FINEST = 400  # triangles that are looked at in parts of parts, at most
LEFT = 0.005  # share of the squares of what is missed that may be on other triangles
AT_ONCE = 20  # of these
FINE_ORDER = 8  # of the quadrature on parts of parts


@lru_cache
def part_corners() -> Array:
    """Corners (p, 3, 2) of the parts of the reference triangle, anticlockwise."""
    m = PARTS
    steps = [(i, j) for i in range(m) for j in range(m - i)]
    up = [[(i + 1, j), (i, j + 1), (i, j)] for i, j in steps]
    down = [[(i, j + 1), (i + 1, j), (i + 1, j + 1)] for i, j in steps if i + j < m - 1]
    return np.array(up + down, dtype=float) / m


@lru_cache
def _rule_on_parts(order: int) -> tuple[Array, Array]:
    """Points (p, q, 2) and weights (q,) of the rule of an order on all parts."""
    points, weights = triangle_rule(order)
    return barycentric(points) @ part_corners(), weights / len(part_corners())


@dataclass(frozen=True, eq=False)
class Parts:
    """Forces on the parts of c cells, which are triangles or parts of them.

    Attributes
    ----------
    at : ndarray of int (c,)
        The triangles.
    corners : ndarray (c, 3, 2)
        Corners of the cells in the reference triangle.
    values : ndarray (c, p, 2, i)
        Coefficients of polynomials of degree `PART_DEGREE` on each part.
    """

    at: Index
    corners: Array
    values: Array

    @property
    def sides(self) -> Array:
        """Columns (c, 2, 2) of the affine maps from the reference triangle to the cells."""
        x = self.corners
        return np.stack([x[:, 0] - x[:, 2], x[:, 1] - x[:, 2]], axis=2)

    def but_on(self, at: Index) -> Parts:
        """Those of other triangles than `at` (j,)."""
        kept = ~np.isin(self.at, at)
        return Parts(self.at[kept], self.corners[kept], self.values[kept])


@dataclass(frozen=True, eq=False)
class Forces:
    """Body forces on n triangles, over stress and length.

    Attributes
    ----------
    hatted : ndarray (n, 3, 2, j)
        Hats times forces, coefficients of polynomials of degree k - 1.
    higher : ndarray (n, 2, l)
        Forces, coefficients of polynomials of degree k to k - 1 + `HIGHER`.
    missed : ndarray (n,)
        Norms of what is missed by these, and by the parts, there over their number on a side.
    parts : tuple of Parts
        What all these polynomials miss on parts of triangles, and those on parts of parts.
    """

    hatted: Array
    higher: Array
    missed: Array
    parts: tuple[Parts, ...]

    def but_on(self, at: Index, missed: Array) -> Forces:
        """With other norms `missed` (j,) on triangles `at` (j,), where nothing else is balanced."""
        higher, norms = self.higher.copy(), self.missed.copy()
        higher[at], norms[at] = 0.0, missed
        parts = tuple(parts.but_on(at) for parts in self.parts)
        return replace(self, higher=higher, missed=norms, parts=parts)


def forces_on(
    loads: Mapping[str, ng.CoefficientFunction],
    partition: Partition,
    region: Index,
    degree: int,
    unit: float,
    narrow: Mask,
) -> Forces:
    """Look at `loads` over `unit`, by body; `region` (n,) are the bodies, `degree` is k.

    On the `narrow` (n,) triangles loads have features that quadrature may miss.
    """
    n, low, high = len(partition.triangles), dimension(degree - 1), degree - 1 + HIGHER
    whole = np.zeros((n, 3, 2, dimension(high)))
    missed = np.zeros(n)
    order = 2 * degree + DATA_BONUS
    rule, weights = triangle_rule(order)
    parts: list[Parts] = []
    for pattern, F in loads.items():  # (3.5)
        at = of_body(partition.mesh, pattern, region)
        f = partition.evaluate(F, at, rule) / unit
        whole[at], rest = _projected(f, rule, weights, high)
        mean = np.einsum("q,nqc->n", weights, rest**2)
        largest = np.einsum("q,nqc->n", weights, f**2).max(initial=0.0)
        missed[at] = np.sqrt(partition.areas[at] * mean)
        at = at[(mean > SMOOTH**2 * largest) | narrow[at]]
        if at.size == 0:
            continue
        points, w = _rule_on_parts(order)
        f = partition.evaluate(F, at, points.reshape(-1, 2)) / unit
        whole[at], rest = _projected(f, points.reshape(-1, 2), np.tile(w, len(points)), high)
        rest = rest.reshape(len(at), *points.shape[:2], 2)
        c, rest = _on_parts(rest, triangle_rule(order)[0], w)
        mean = np.einsum("q,npqc->n", w, rest**2)
        missed[at] = np.sqrt(partition.areas[at] * mean) / PARTS
        rough = np.argsort(-missed[at])
        before = np.cumsum(missed[at[rough]] ** 2) - missed[at[rough]] ** 2
        rough = rough[before <= (1 - LEFT) * (missed[at] ** 2).sum()]
        rough = rough[(mean[rough] > SMOOTH**2 * largest) & ~narrow[at[rough]]]
        rough = np.concatenate([np.flatnonzero(narrow[at]), rough])[:FINEST]
        for start in range(0, len(rough), AT_ONCE):
            some = rough[start : start + AT_ONCE]
            fine = partition, F, at[some], unit, high
            whole[at[some]], c[some], missed[at[some]], finer = _twice_divided(*fine)
            parts.append(finer)
        parts.append(Parts(at, np.tile(CORNERS, (len(at), 1, 1)), c))
    return Forces(
        hatted=whole[..., :low],
        higher=whole[..., low:].sum(axis=1),
        missed=missed,
        parts=tuple(parts),
    )


def _on_parts(rest: Array, points: Array, w: Array) -> tuple[Array, Array]:
    """Polynomials (n, p, 2, i) near `rest` (n, p, q, 2) on p parts, and what is left of it.

    At `points` (q, 2) of each part, with weights `w` (q,) of sum 1 / p.
    """
    values = basis(PART_DEGREE).values(points)
    c = np.einsum("q,qi,npqc->npci", w * rest.shape[1], values, rest)
    return c, rest - np.einsum("qi,npci->npqc", values, c)


def _twice_divided(
    partition: Partition, F: ng.CoefficientFunction, at: Index, unit: float, high: int
) -> tuple[Array, Array, Array, Parts]:
    """Forces `F` over `unit` on triangles `at` (b,) in parts of parts.

    Returns
    -------
    whole, c : ndarray (b, 3, 2, j), (b, p, 2, i)
        Hats times forces up to degree `high`, and what these miss on the parts.
    missed : ndarray (b,)
        Norms of what is missed by all, over the number of parts of parts on a side.
    finer : Parts
        What both miss on the parts of the parts.
    """
    corners, (rule, _) = part_corners(), triangle_rule(FINE_ORDER)
    fine, w = _rule_on_parts(FINE_ORDER)
    fine, p, b = fine.reshape(-1, 2), len(corners), len(at)
    in_part = np.tile(w, p) / p
    points = (barycentric(fine) @ corners).reshape(-1, 2)
    f = partition.evaluate(F, at, points) / unit
    whole, rest = _projected(f, points, np.tile(in_part, p), high)
    c, rest = _on_parts(rest.reshape(b, p, -1, 2), fine, in_part)
    finer, rest = _on_parts(rest.reshape(b * p, p, -1, 2), rule, w)
    mean = np.einsum("q,npqc->n", w, rest**2).reshape(b, p).mean(axis=1)
    missed = np.sqrt(partition.areas[at] * mean) / PARTS**2
    return whole, c, missed, Parts(np.repeat(at, p), np.tile(corners, (b, 1, 1)), finer)


def _projected(f: Array, points: Array, weights: Array, degree: int) -> tuple[Array, Array]:
    """Hats times `f` (n, q, 2), (n, 3, 2, j) up to a degree, and what f has beyond, (n, q, 2)."""
    values = basis(degree).values(points)
    hats = barycentric(points)
    c = np.einsum("q,qa,qi,nqc->naci", weights, hats, values, f, optimize=True)
    return c, f - np.einsum("qi,nci->nqc", values, c.sum(axis=1))
