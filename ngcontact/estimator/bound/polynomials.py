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

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index

CORNERS = np.array([[0.0, 1.0], [0.0, 0.0], [1.0, 0.0]])  # their (a, b)
DERIVATIVES = (0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)  # orders by (a, b)


@lru_cache
def products(degree: int) -> tuple[Index, Index]:
    """Degrees, (m,) each, in both coordinates of the products up to a total degree.

    They rise in the first one, along the base: where that is short, second derivatives along it
    are large, and the first products have none.
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


def derivatives(
    degree: int, local: Array, orders: Sequence[tuple[int, int]], least: int = 0
) -> Array:
    """Derivatives (..., n, m) at `local` (..., 2), by 2 a and 2 b, as often as n `orders` say.

    Of the m `products` of a total degree of `least` or more.
    """
    i, j = (x[np.add(*products(degree)) >= least] for x in products(degree))
    values = []  # by coordinate and order
    for x, numbers in ((2 * local[..., 0] - 1, i), (2 * local[..., 1] - 1, j)):
        P = legendre.legvander(x, degree)
        own = (P[..., : max(degree - n, 0) + 1] @ _slopes(degree, n) for n in range(3))
        values.append([f[..., numbers] for f in own])
    return np.stack([values[0][n] * values[1][m] for n, m in orders], axis=-2)


@lru_cache
def _slopes(degree: int, n: int) -> Array:
    """Legendre's coefficients (k, degree + 1) of n-th derivatives of Legendre's polynomials."""
    return np.asarray(legendre.legder(np.eye(degree + 1), n))


def scales(corners: Array) -> tuple[Array, Array]:
    """Middle (b, 1, 2) of the extents of `corners` (b, 3, 2), and half the larger (b, 1, 1)."""
    low, high = corners.min(axis=1, keepdims=True), corners.max(axis=1, keepdims=True)
    return (low + high) / 2, (high - low).max(axis=2, keepdims=True) / 2


def stresses(
    degree: int, corners: Array, local: Array, axial: bool, on_axis: bool = False
) -> tuple[Array, Array]:
    """Basis of the stresses of a degree: A (b, 1, c, k) times P (b, q, k, m) or (q, k, m).

    Their c components are xx, yy, xy or rr, zz, hoop, rz; coefficients have units of stress. About
    an axis (`axial`) the degree is that of T, and it vanishes `on_axis` if a side lies there.
    Points of triangles `corners` (b, 3, 2) are given by (a, b), `local` (b, q, 2), or (q, 2) where
    these are the same for all; in the plane P is, too: second derivatives of Airy's function.
    """
    _, size = scales(corners)
    E = edges(corners) / (2 * size)
    if not axial:  # psi_bb p p' - psi_ab (p q' + q p') + psi_aa q q', p and q the columns of E
        (px, qx), (py, qy) = E.transpose(1, 2, 0)
        rows = [px * px, -2 * px * qx, qx * qx], [py * py, -2 * py * qy, qy * qy]
        airy = np.array([*rows, [px * py, -(px * qy + py * qx), qx * qy]]).transpose(2, 0, 1)
        airy /= np.linalg.det(E)[:, None, None] ** 2
        return airy[:, None], derivatives(degree + 2, local, DERIVATIVES[:2:-1], 2)
    (a_r, a_z), (b_r, b_z) = np.linalg.inv(E).transpose(1, 2, 0)[..., None, None]
    r = (corners[:, 1:2, 0] + (local @ edges(corners)[:, 0, :, None])[..., 0]) / size[:, 0]
    k, r = int(on_axis), r[..., None]  # T_rr = r^k f, chi = r^(2 k) g
    f, f_a, f_b = np.moveaxis(derivatives(degree - k, local, DERIVATIVES[:3]), -2, 0)
    table = derivatives(degree + 1 - 2 * k, local, DERIVATIVES, 1 - k)
    g, g_a, g_b, g_aa, g_ab, g_bb = np.moveaxis(table, -2, 0)
    n, found = f.shape[-1], np.zeros((*r.shape[:2], 4, f.shape[-1] + g.shape[-1]))
    found[:, :, 0, :n] = r ** (k - 1) * f
    found[:, :, 2, :n] = k * f + r**k * (a_r * f_a + b_r * f_b)
    found[:, :, 1, n:] = -(r ** (2 * k - 1)) * (a_r * g_a + b_r * g_b)
    if k:
        found[:, :, 1, n:] -= 2 * g
    found[:, :, 2, n:] = r ** (2 * k) * (a_z**2 * g_aa + 2 * a_z * b_z * g_ab + b_z**2 * g_bb)
    found[:, :, 3, n:] = r ** (2 * k - 1) * (a_z * g_a + b_z * g_b)
    return np.eye(4)[None, None], found


def scalars(degree: int, corners: Array, x: Array) -> Array:
    """Polynomials (b, q, m) of a degree on triangles of `corners` (b, 3, 2), at `x` (b, q, 2)."""
    middle, size = scales(corners)
    X = (x - middle) / size
    i, j = products(degree)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    return np.asarray(a[..., i] * b[..., j])


def balancing(degree: int, corners: Array, x: Array, force: Array, axial: bool) -> Array:
    """Stress (b, q, c) at `x` (b, q, 2) whose divergence is minus a polynomial force.

    `force` (b, m, 2) are the coefficients of the force as of `scalars`, for a `degree` and
    `corners` (b, 3, 2). About an axis only the axial part counts: s_zz = - int F_z dz.
    """
    found = np.zeros((*x.shape[:2], 3 + axial))
    if force.any():
        _, size = scales(corners)
        c = np.einsum("cnm,bmc->bnc", _antiderivatives(degree), force)
        found[..., axial:2] = -size * (scalars(degree + 1, corners, x) @ c)[..., axial:]  # (3.5)
    return found


@lru_cache
def _antiderivatives(degree: int) -> Array:
    """Antiderivatives (2, k, m) of the m `products` by both coordinates; k are of a degree more."""
    (i, j), (p, q) = products(degree), products(degree + 1)
    up, p, q = legendre.legint(np.eye(degree + 1)), p[:, None], q[:, None]
    return np.stack([up[p, i] * (q == j), up[q, j] * (p == i)])
