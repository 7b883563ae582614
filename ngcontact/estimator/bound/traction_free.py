"""Stresses without tractions that balance a force without resultants, on a triangle or its parts.

With x = x_1 + E (a, b) and a stress t^ of (a, b), t = E t^ E' is symmetric, has the divergence
E div t^ and the tractions E t^ n^. So one solve on the reference triangle serves all triangles: of
the stresses of a degree, polynomials on n^2 equal parts, the least one in the mean square with
-div t^ = f^ on the parts, continuous tractions between them, and none on the triangle's sides.
"""

from __future__ import annotations

from functools import lru_cache

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...lagrange import gauss
from .polynomials import CORNERS, derivatives, products

DIVISION = 4  # parts of each side
HALF = 0.5**0.5  # of xy in orthonormal stresses
NO_CONDITION = 1e-10  # singular value, relative to the largest, of conditions that others imply


@lru_cache
def parts(n: int) -> tuple[Array, Array]:
    """The n^2 equal parts of the reference triangle: origins (n^2, 2) and scales (n^2,), +-1 / n.

    Its point (a, b) is the origin plus the scale times (a, b) of the part.
    """
    up = [(i, j, 1) for i in range(n) for j in range(n - i)]
    down = [(i + 1, j + 1, -1) for i in range(n - 1) for j in range(n - 1 - i)]
    found = np.array(up + down) / n
    return found[:, :2], found[:, 2]


@lru_cache
def composite(depth: int, order: int) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,) on a triangle that is divided `depth` times, part by part."""
    if depth == 0:
        rule = ng.IntegrationRule(ng.TRIG, order)
        return np.array(rule.points)[:, :2], np.array(rule.weights)
    (origin, scale), (x, w) = parts(DIVISION), composite(depth - 1, order)
    every = origin[:, None] + scale[:, None, None] * x
    return every.reshape(-1, 2), np.tile(w * scale[0] ** 2, len(origin))


def basis(degree: int, local: Array) -> Array:
    """Polynomials (..., m) of a degree at `local` (..., 2)."""
    return derivatives(degree, local, [(0, 0)])[..., 0, :]


def up_to(degree: int, of: int) -> Index:
    """Numbers (k,) of the polynomials of a `degree` among those of the degree `of`."""
    return np.flatnonzero(np.add(*products(of)) <= degree)


@lru_cache
def fit(degree: int, depth: int, order: int) -> Array:
    """Coefficients (m, q) of the nearest polynomials from values at the points of `composite`."""
    x, w = composite(depth, order)
    root = np.sqrt(w)[:, None]
    return np.asarray(np.linalg.pinv(root * basis(degree, x)) * root.T)


@lru_cache
def restriction(n: int, degree: int) -> Array:
    """Matrices (k, m, m) to the coefficients on k = n^2 parts from those on the triangle."""
    (origin, scale), (x, _) = parts(n), composite(0, 2 * degree)
    values = basis(degree, origin[:, None] + scale[:, None, None] * x)
    return np.asarray(fit(degree, 0, 2 * degree) @ values)


@lru_cache
def balancing_stress(n: int, force_degree: int, degree: int) -> Array:
    """Matrix (k, m, 3, k, j, 2) to t^, xx, yy, xy, from f^ of a `force_degree` on k = n^2 parts.

    To m coefficients of a `degree` on each from j; f^ is without resultants.
    """
    T, test, divergence, tractions = _conditions(n, degree)
    every, x = np.arange(n**2), composite(0, 2 * degree)[0]
    work = -test @ basis(force_degree, x)
    force = np.zeros((n**2, len(test), 2, n**2, work.shape[1], 2))
    for c in range(2):
        force[every, :, c, every, :, c] = work
    right = force.reshape(len(divergence), -1)
    u, size, v = np.linalg.svd(np.vstack([divergence, tractions]), full_matrices=False)
    some = size > NO_CONDITION * size[0]
    t = v[some].T @ ((u[: len(right), some].T @ right) / size[some, None])
    return _coefficients(T, t).reshape(n**2, len(T), 3, *force.shape[3:])


@lru_cache
def free_stress(degree: int) -> Array:
    """Coefficients (m, 3, r) of all t^ on the triangle without tractions and divergence."""
    T, _, *conditions = _conditions(1, degree)
    _, size, v = np.linalg.svd(np.vstack(conditions))
    rank = int((size > NO_CONDITION * size[0]).sum())
    return _coefficients(T, v[rank:].T)[0]


def _coefficients(T: Array, t: Array) -> Array:
    """Coefficients (n^2, m, 3, r) of `basis` from those (n^2 m 3, r) of orthonormal stresses."""
    parts_of = t.reshape(-1, len(T), 3, t.shape[1]) * np.array([1, 1, HALF])[:, None]
    return np.einsum("km,pmvr->pkvr", T, parts_of)


def _conditions(n: int, degree: int) -> tuple[Array, Array, Array, Array]:
    """Orthonormal polynomials T (m, m) of a `degree` from `basis`, those tested with (l, q).

    And rows over the coefficients of stresses (n^2 m 3), in which xy counts twice: the divergence
    on each part, moments (n^2, l, 2), and tractions on the sides, once where two parts share one.
    """
    (origin, scale), (x, w), every = parts(n), composite(0, 2 * degree), np.arange(n**2)
    T, lower = (
        np.linalg.inv(np.linalg.qr(np.sqrt(w)[:, None] * basis(k, x), mode="r"))
        for k in (degree, degree - 1)
    )
    test = (basis(degree - 1, x) @ lower).T * w
    by = 2 * derivatives(degree, x, [(1, 0), (0, 1)]) @ T
    own = np.tensordot(test, _times(by[:, 0], by[:, 1]), 1)
    divergence = np.zeros((n**2, *own.shape[:2], n**2, *own.shape[2:]))
    divergence[every, :, :, every] = own / scale[:, None, None, None, None]
    t, _ = gauss(2 * degree)
    tractions: dict[tuple[int, ...], Array] = {}
    for i, j in np.ndindex(n**2, 3):
        ends = origin[i] + scale[i] * CORNERS[[j - 2, j - 1]]
        ends = ends[np.lexsort(ends.T)]
        x = ends[0] + t[:, None] * (ends[1] - ends[0])
        f = basis(degree, (x - origin[i]) / scale[i]) @ T
        normal = np.sign(scale[i]) * (CORNERS[j - 1] - CORNERS[j - 2])[::-1] * [1, -1]
        middle = tuple(np.round(n * ends.sum(axis=0)).astype(int))
        rows = tractions.setdefault(middle, np.zeros((len(t), 2, n**2, *own.shape[2:])))
        rows[:, :, i] += _times(normal[0] * f, normal[1] * f)
    size = n**2 * own[0, 0].size
    every_side = np.concatenate(list(tractions.values()))
    return T, test, divergence.reshape(-1, size), every_side.reshape(-1, size)


def _times(x: Array, y: Array) -> Array:
    """Products (q, 2, m, 3) of stresses with a vector, or nabla: its components times functions."""
    none = np.zeros_like(x)
    rows = [x, none, HALF * y], [none, y, HALF * x]
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=1)
