"""Stresses that are polynomials on a triangle, symmetric, in equilibrium without loads.

In the plane they are those of Airy's stress function psi: (xx, yy, xy) = (psi_yy, psi_xx, -psi_xy).
About an axis T = r s is a polynomial: with T_rr and a stress function chi

    T_rz = chi_z,  T_zz = -chi_r,  hoop = (T_rr)_r + (T_rz)_z,

so that the axial equation holds, and the radial one says what the hoop stress is. On a triangle
with a side on the axis T vanishes there, T_rr = r f and chi = r^2 f. Polynomials are products of
Legendre's in the coordinates (a, b) of each triangle, x = corner 1 + a base + b (corner 0 - corner
1): the shares of corners 2 and 0.
"""

from __future__ import annotations

from functools import lru_cache
from math import comb

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index

CORNERS = np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]])  # their (a, b)
DERIVATIVES = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)  # orders by (a, b)
AIRY = np.array([[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])  # of psi_xx, psi_xy, psi_yy


@lru_cache
def products(degree: int) -> tuple[Index, Index]:
    """Degrees, (m,) each, in both coordinates of the products up to a total degree.

    They rise in the first, along the base. Where that is short, second derivatives along it are
    large: products of degree 0 and 1 have none, nor have their combinations with earlier ones.
    """
    i, j = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]).T
    return i, j


def edges(corners: Array) -> Array:
    """Columns (b, 2, 2), lengths: x = corner 1 + edges (a, b), of triangles `corners` (b, 3, 2)."""
    return np.stack([corners[:, 2] - corners[:, 1], corners[:, 0] - corners[:, 1]], axis=-1)


def coordinates(corners: Array, x: Array) -> Array:
    """(a, b), shape (b, q, 2), of points `x` (b, q, 2) in triangles `corners` (b, 3, 2)."""
    away = (x - corners[:, 1:2]).transpose(0, 2, 1)
    return np.asarray(np.linalg.solve(edges(corners), away).transpose(0, 2, 1))


def derivatives(degree: int, local: Array, *orders: tuple[int, int]) -> Array:
    """Derivatives (..., n, m) of the m `products` at `local` (..., 2), by 2 a and 2 b.

    As often as each of the n `orders` says.
    """
    i, j = products(degree)
    found = []
    for order in orders:
        values = [
            legendre.legvander(2 * local[..., c] - 1, max(degree - n, 0))
            @ legendre.legder(np.eye(degree + 1), n)
            for c, n in enumerate(order)
        ]
        found.append(values[0][..., i] * values[1][..., j])
    return np.stack(found, axis=-2)


@lru_cache
def orthonormal(degree: int, order: int) -> Array:
    """Combinations (k, m) of the k `products` whose derivatives of an `order` are orthonormal.

    On the triangle of reference; those without such derivatives are left out.
    """
    rule = ng.IntegrationRule(ng.TRIG, 2 * degree)
    every = [(order - n, n) for n in range(order + 1)]
    rows = derivatives(degree, np.array(rule.points)[:, :2], *every)
    scale = np.sqrt(np.outer(rule.weights, [comb(order, n) for n in range(order + 1)]))
    i, j = products(degree)
    some = i + j >= order
    R = np.linalg.qr((scale[..., None] * rows).reshape(-1, len(i))[:, some], mode="r")
    found = np.zeros((len(i), len(R)))
    found[some] = np.linalg.inv(R)
    return found


def scales(corners: Array) -> tuple[Array, Array]:
    """Middle (b, 1, 2) of the extents of `corners` (b, 3, 2), and half the larger (b, 1, 1)."""
    low, high = corners.min(axis=1, keepdims=True), corners.max(axis=1, keepdims=True)
    return (low + high) / 2, (high - low).max(axis=2, keepdims=True) / 2


def _rates(corners: Array) -> Array:
    """Matrices (b, 6, 6) from `DERIVATIVES` by (2 a, 2 b) to those by x and y, times `scales`."""
    _, size = scales(corners)
    by = 2 * size * np.linalg.inv(edges(corners))  # (b, 2, 2): a, b by x, y
    found = np.zeros((len(corners), 6, 6))
    found[:, 0, 0] = 1.0
    found[:, 1:3, 1:3] = by.transpose(0, 2, 1)
    for row, (p, q) in zip((3, 4, 5), ((0, 0), (0, 1), (1, 1)), strict=True):
        found[:, row, 3] = by[:, 0, p] * by[:, 0, q]
        found[:, row, 4] = by[:, 0, p] * by[:, 1, q] + by[:, 1, p] * by[:, 0, q]
        found[:, row, 5] = by[:, 1, p] * by[:, 1, q]
    return found


def stresses(
    degree: int, corners: Array, local: Array, axial: bool, on_axis: bool = False
) -> Array:
    """Basis (b, q, c, m) of the stresses of a degree.

    Their c components are xx, yy, xy or rr, zz, hoop, rz; coefficients have units of stress. About
    an axis (`axial`) the degree is that of T, and it vanishes `on_axis` if a side lies there.

    Parameters
    ----------
    corners : ndarray (b, 3, 2)
    local : ndarray (b, q, 2)
        Points by (a, b), or (q, 2) where these are the same for all.
    """
    rates = _rates(corners)
    if not axial:
        psi = derivatives(degree + 2, local, *DERIVATIVES[3:]) @ orthonormal(degree + 2, 2)
        return np.asarray((AIRY @ rates[:, 3:, 3:])[:, None] @ psi)

    def derived(degree: int, order: int) -> Array:
        """Functions `orthonormal` in an order, by r, z, rr, rz, zz: (6, b, q, m)."""
        table = derivatives(degree, local, *DERIVATIVES) @ orthonormal(degree, order)
        return np.moveaxis(rates[:, None] @ table, 2, 0)

    _, size = scales(corners)
    r = (corners[:, 1:2, :1] + local @ edges(corners)[:, 0, :, None]) / size
    if on_axis:  # T_rr = r f, chi = r^2 f
        f, f_r, f_z, _, _, f_zz = derived(degree - 1, 0)
        none = np.zeros_like(f)
        free = [f, none, f + r * f_r, none]
        bent = [none, -(2 * f + r * f_r), r**2 * f_zz, r * f_z]
    else:
        f, f_r, *_ = derived(degree, 0)
        chi, chi_r, chi_z, _, _, chi_zz = derived(degree + 1, 1)
        none, still = np.zeros_like(f), np.zeros_like(chi)
        free = [f / r, none, f_r, none]
        bent = [still, -chi_r / r, chi_zz, chi_z / r]
    return np.concatenate([np.stack(free, axis=2), np.stack(bent, axis=2)], axis=-1)


def scalars(degree: int, corners: Array, x: Array) -> Array:
    """Polynomials (b, q, m) of a degree on triangles of `corners` (b, 3, 2), at `x` (b, q, 2)."""
    middle, size = scales(corners)
    X = (x - middle) / size
    i, j = products(degree)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    return np.asarray(a[..., i] * b[..., j])


def projected(P: Array, weight: Array, values: Array) -> Array:
    """Coefficients (b, m, d) of the polynomials `P` (b, q, m) that are nearest to `values`.

    In the mean square at q points with `weight` (b, q), where F has `values` (b, q, d).
    """
    weighted = P.transpose(0, 2, 1) * weight[:, None]
    mass = weighted @ P
    found = np.linalg.solve(mass, weighted @ values)
    return np.asarray(found + np.linalg.solve(mass, weighted @ (values - P @ found)))


def balancing(degree: int, corners: Array, x: Array, force: Array, axial: bool) -> Array:
    """Stress (b, q, c) at `x` (b, q, 2) whose divergence is minus a polynomial force.

    `force` (b, m, 2) are the coefficients of the force as of `scalars`, for a `degree` and
    `corners` (b, 3, 2). About an axis only the axial part counts: s_zz = - int F_z dz.
    """
    middle, size = scales(corners)
    X = (x - middle) / size
    i, j = products(degree)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    up = legendre.legint(np.eye(degree + 1))
    ia, ib = (legendre.legvander(X[..., c], degree + 1) @ up for c in (0, 1))
    along_x = (ia[..., i] * b[..., j]) @ force[..., :1]
    along_y = (a[..., i] * ib[..., j]) @ force[..., 1:]
    none = np.zeros_like(along_x)
    parts = [none, along_y, none, none] if axial else [along_x, along_y, none]  # (3.5)
    return np.asarray(-size * np.concatenate(parts, axis=2))
