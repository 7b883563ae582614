"""Body forces on the triangles: what stresses of degree k balance, what is balanced inside each.

Where forces are not smooth, triangles are looked at in `PARTS`^2 equal parts.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from .conditions import DATA_BONUS, HIGHER
from .partition import Partition, of_body
from .polynomials import barycentric, basis, dimension, triangle_rule

PARTS = 4  # of each side
PART_DEGREE = 2  # of forces on the parts
SMOOTH = 1e-3  # of the largest force, what may be missed without a look at parts


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
    parted : ndarray of int (c,)
        Triangles in parts.
    parts : ndarray (c, p, 2, i)
        What all these polynomials miss: coefficients of polynomials of degree `PART_DEGREE`.
    """

    hatted: Array
    higher: Array
    missed: Array
    parted: Index
    parts: Array

    def but_on(self, at: Index, missed: Array) -> Forces:
        """With other norms `missed` (j,) on triangles `at` (j,), where nothing else is balanced."""
        higher, norms, parts = self.higher.copy(), self.missed.copy(), self.parts.copy()
        higher[at], norms[at], parts[np.isin(self.parted, at)] = 0.0, missed, 0.0
        return replace(self, higher=higher, missed=norms, parts=parts)


def forces_on(
    loads: Mapping[str, ng.CoefficientFunction],
    partition: Partition,
    region: Index,
    degree: int,
    unit: float,
) -> Forces:
    """Look at `loads` over `unit`, by body; `region` (n,) are the bodies, `degree` is k."""
    n, low, high = len(partition.triangles), dimension(degree - 1), degree - 1 + HIGHER
    whole = np.zeros((n, 3, 2, dimension(high)))
    missed, largest = np.zeros(n), np.zeros(n)
    order = 2 * degree + DATA_BONUS
    rule, weights = triangle_rule(order)
    parted, parts = [np.zeros(0, dtype=np.intp)], []
    i = dimension(PART_DEGREE)
    parts.append(np.zeros((0, len(part_corners()), 2, i)))
    for pattern, F in loads.items():  # (3.5)
        at = of_body(partition.mesh, pattern, region)
        f = partition.evaluate(F, at, rule) / unit
        whole[at], rest = _projected(f, rule, weights, high)
        mean = np.einsum("q,nqc->n", weights, rest**2)
        largest = np.einsum("q,nqc->n", weights, f**2)
        missed[at] = np.sqrt(partition.areas[at] * mean)
        rough = mean > SMOOTH**2 * largest.max(initial=0.0)
        if not rough.any():
            continue
        at = at[rough]
        points, w = _rule_on_parts(order)
        f = partition.evaluate(F, at, points.reshape(-1, 2)) / unit
        whole[at], rest = _projected(f, points.reshape(-1, 2), np.tile(w, len(points)), high)
        values = basis(PART_DEGREE).values(triangle_rule(order)[0])
        rest = rest.reshape(len(at), *points.shape[:2], 2)
        c = np.einsum("q,qi,npqc->npci", w * len(points), values, rest)
        rest -= np.einsum("qi,npci->npqc", values, c)
        mean = np.einsum("q,npqc->n", w, rest**2)
        missed[at] = np.sqrt(partition.areas[at] * mean) / PARTS
        parted.append(at)
        parts.append(c)
    return Forces(
        hatted=whole[..., :low],
        higher=whole[..., low:].sum(axis=1),
        missed=missed,
        parted=np.concatenate(parted),
        parts=np.concatenate(parts),
    )


def _projected(f: Array, points: Array, weights: Array, degree: int) -> tuple[Array, Array]:
    """Hats times `f` (n, q, 2), (n, 3, 2, j) up to a degree, and what f has beyond, (n, q, 2)."""
    values = basis(degree).values(points)
    hats = barycentric(points)
    c = np.einsum("q,qa,qi,nqc->naci", weights, hats, values, f, optimize=True)
    return c, f - np.einsum("qi,nci->nqc", values, c.sum(axis=1))
