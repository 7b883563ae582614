"""Stresses that are polynomials on a triangle, symmetric, in equilibrium without loads.

In the plane they are those of Airy's stress function psi: (xx, yy, xy) = (psi_yy, psi_xx, -psi_xy).
About an axis T = r s is a polynomial: with T_rr and a stress function chi

    T_rz = chi_z,  T_zz = -chi_r,  hoop = (T_rr)_r + (T_rz)_z,

so that the axial equation holds, and the radial one says what the hoop stress is. On a triangle
with a side on the axis T vanishes there, T_rr = r f and chi = r^2 eta. Polynomials are products of
Legendre's in the coordinates of each triangle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from math import comb

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index

SECOND = (2, 0), (1, 1), (0, 2)  # derivatives by (a, b)


@lru_cache
def products(degree: int) -> tuple[Index, Index]:
    """Degrees, (m,) each, in both coordinates of the products up to a total degree.

    They rise in the first, along the base. Where that is short, second derivatives along it are
    large: products of degree 0 and 1 have none, nor have their combinations with earlier ones.
    """
    i, j = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)]).T
    return i, j


def legendre_table(degree: int, X: Array) -> list[Array]:
    """Legendre's polynomials and two derivatives, (..., degree + 1) each, at `X` (...,).

    `X` is from -1 to 1.
    """
    P: Array = np.asarray(legendre.legvander(X, degree))
    tables: list[Array] = [P]
    for _ in range(2):
        D = np.zeros((degree + 1, degree + 1))
        for n in range(degree):  # P'_(n+1) = (2 n + 1) P_n + P'_(n-1)
            D[n + 1] = D[n - 1] if n else 0.0
            D[n + 1, n] += 2 * n + 1
        tables.append(np.asarray(tables[-1] @ D.T))
    return tables


@dataclass(frozen=True, eq=False)
class Frame:
    """Coordinates of b triangles.

    Attributes
    ----------
    corner : ndarray (b, 2)
        Corner 1, lengths.
    edges : ndarray (b, 2, 2)
        Columns: the base from there to corner 2, the edge to corner 0; x = corner + edges (a, b).
    size : ndarray (b,)
        Half the larger extent along the axes x and y, lengths.
    centre : ndarray (b, 2)
        Middle of both extents, lengths.
    """

    corner: Array
    edges: Array
    size: Array
    centre: Array

    def __getitem__(self, at: Index | slice) -> Frame:
        """Those of some of the triangles."""
        return Frame(self.corner[at], self.edges[at], self.size[at], self.centre[at])

    def local(self, x: Array) -> Array:
        """Coordinates (a, b), shape (b, q, 2), of points `x` (b, q, 2)."""
        away = (x - self.corner[:, None]).transpose(0, 2, 1)
        return np.asarray(np.linalg.solve(self.edges, away).transpose(0, 2, 1))

    @property
    def rates(self) -> tuple[Array, Array]:
        """Derivatives (b, 2) of 2 (a, b) along each of the axes, times `size`."""
        rates = 2 * self.size[:, None, None] * np.linalg.inv(self.edges)
        return rates[..., 0], rates[..., 1]

    @property
    def airy(self) -> Array:
        """Matrices (b, 3, 3) from `bending` of a function psi to its stress (xx, yy, xy)."""
        x, y = self.rates
        return np.stack([_second(y, y), _second(x, x), -_second(x, y)], axis=1)

    def scaled(self, x: Array) -> Array:
        """Coordinates (b, q, 2) along the axes, up to 1 in size, of points `x` (b, q, 2)."""
        return np.asarray((x - self.centre[:, None]) / self.size[:, None, None])


def in_frame(local: Array) -> Array:
    """`Frame.local`, (q, 2), of places `local` (q, 2): their shares of corners 1 and 2."""
    return np.column_stack([local[:, 1], 1 - local.sum(axis=1)])


def frame_of(corners: Array) -> Frame:
    """The frame of triangles with `corners` (b, 3, 2), lengths."""
    edges = np.stack([corners[:, 2] - corners[:, 1], corners[:, 0] - corners[:, 1]], axis=-1)
    centre = (corners.max(axis=1) + corners.min(axis=1)) / 2
    return Frame(corners[:, 1], edges, np.ptp(corners, axis=1).max(axis=1) / 2, centre)


def _second(p: Array, q: Array) -> Array:
    """Second derivatives along two axes as sums (b, 3) of those by (aa, ab, bb)."""
    mixed = p[:, 0] * q[:, 1] + p[:, 1] * q[:, 0]
    return np.stack([p[:, 0] * q[:, 0], mixed, p[:, 1] * q[:, 1]], axis=-1)


def derivatives(degree: int, local: Array, *orders: tuple[int, int]) -> list[Array]:
    """Derivatives of the k `products` at `local` (..., 2), (..., k) each.

    By 2 a and by 2 b as often as `orders` say.
    """
    i, j = products(degree)
    a, b = (legendre_table(degree, 2 * local[..., c] - 1) for c in (0, 1))
    return [a[n][..., i] * b[m][..., j] for n, m in orders]


def bending(degree: int, local: Array) -> Array:
    """Second derivatives (..., 3, m) by (aa, ab, bb) of stress functions, at `local` (..., 2).

    `Frame.airy` makes of them a basis of the stresses of a degree in the plane, of units of stress.
    """
    psi = orthonormal(degree + 2, 2)
    return np.stack([part @ psi for part in derivatives(degree + 2, local, *SECOND)], axis=-2)


def airy_stress(degree: int, frame: Frame, local: Array, c: Array) -> Array:
    """Stress (b, q, 3) in the plane with coefficients `c` (b, m), units of stress.

    `local` (b, q, 2) are `Frame.local` of its places, or (q, 2) where these are the same for all.
    """
    if local.ndim == 2:
        H = bending(degree, local)
        second = (c @ H.reshape(-1, H.shape[-1]).T).reshape(len(c), -1, 3)
    else:
        psi = (c @ orthonormal(degree + 2, 2).T)[..., None]
        parts = derivatives(degree + 2, local, *SECOND)
        second = np.concatenate([part @ psi for part in parts], axis=-1)
    return np.asarray(second @ frame.airy.transpose(0, 2, 1))


def stresses(
    degree: int, frame: Frame, x: Array, local: Array, axial: bool, on_axis: bool = False
) -> Array:
    """Basis (b, q, c, m) of the stresses of a degree.

    Their c components are xx, yy, xy or rr, zz, hoop, rz; coefficients have units of stress. About
    an axis (`axial`) the degree is that of T, and it vanishes `on_axis` if a side lies there.

    Parameters
    ----------
    x, local : ndarray (b, q, 2)
        Points, and their `Frame.local`, which may be (q, 2) where it is the same for all.
    """
    if not axial:
        return np.asarray(frame.airy[:, None] @ bending(degree, local))
    r = x[..., :1] / frame.size[:, None, None]
    by_r, by_z = frame.rates
    zz = _second(by_z, by_z)

    def derived(degree: int, order: int) -> tuple[Array, Array, Array, Array]:
        """Functions `orthonormal` in an order, and what they are derived by r, z, zz."""
        combined = orthonormal(degree, order)
        f, *parts = (
            part @ combined for part in derivatives(degree, local, (0, 0), (1, 0), (0, 1), *SECOND)
        )
        f = np.broadcast_to(f, (*x.shape[:2], combined.shape[1]))
        return f, _along(by_r, parts[:2]), _along(by_z, parts[:2]), _along(zz, parts[2:])

    highest = degree - 1 if on_axis else degree + 1
    if on_axis:  # T_rr = r f, chi = r^2 f
        f, f_r, f_z, f_zz = derived(highest, 0)
        none = np.zeros_like(f)
        free = [f, none, f + r * f_r, none]
        bent = [none, -(2 * f + r * f_r), r**2 * f_zz, r * f_z]
    else:
        f, f_r, *_ = derived(degree, 0)
        _, chi_r, chi_z, chi_zz = derived(highest, 1)
        none, still = np.zeros_like(f), np.zeros_like(chi_r)
        free = [f / r, none, f_r, none]
        bent = [still, -chi_r / r, chi_zz, chi_z / r]
    return np.concatenate([np.stack(free, axis=2), np.stack(bent, axis=2)], axis=-1)


def _along(rates: Array, parts: Sequence[Array]) -> Array:
    """Sum (b, q, m) of n derivatives (..., q, m) times `rates` (b, n)."""
    terms = [rate[:, None, None] * part for rate, part in zip(rates.T, parts, strict=True)]
    return np.asarray(sum(terms))


@lru_cache
def orthonormal(degree: int, order: int) -> Array:
    """Combinations (k, m) of the k `products` whose derivatives of an `order` are orthonormal.

    On the triangle of reference; those without such derivatives are left out.
    """
    rule = ng.IntegrationRule(ng.TRIG, 2 * degree)
    X, w = 2 * np.array(rule.points)[:, :2] - 1, np.array(rule.weights)
    a, b = (legendre_table(degree, X[:, c]) for c in (0, 1))
    i, j = products(degree)
    rows = [
        np.sqrt(w * comb(order, n))[:, None] * a[order - n][:, i] * b[n][:, j]
        for n in range(order + 1)
    ]
    some = i + j >= order
    R = np.linalg.qr(np.concatenate(rows)[:, some], mode="r")
    found = np.zeros((len(i), len(R)))
    found[some] = np.linalg.inv(R)
    return found


def projected(degree: int, frame: Frame, x: Array, weight: Array, values: Array) -> Array:
    """Coefficients (b, m, d) of the nearest polynomials of a degree to `values` (b, q, d).

    In the mean square at quadrature points `x` (b, q, 2) with `weight` (b, q).
    """
    P = scalars(degree, frame, x)
    weighted = P.transpose(0, 2, 1) * weight[:, None]
    mass = weighted @ P
    found = np.linalg.solve(mass, weighted @ values)
    return np.asarray(found + np.linalg.solve(mass, weighted @ (values - P @ found)))


def scalars(degree: int, frame: Frame, x: Array) -> Array:
    """The polynomials (b, q, m) of `projected` at points `x` (b, q, 2)."""
    X = frame.scaled(x)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    i, j = products(degree)
    return np.asarray(a[..., i] * b[..., j])


def balancing(degree: int, frame: Frame, x: Array, force: Array, axial: bool) -> Array:
    """Stress (b, q, c) at `x` (b, q, 2) whose divergence is minus a polynomial force.

    `force` (b, m, 2) are the coefficients of the force as of `projected`, for a `degree`. About an
    axis only the axial part counts: s_zz = - int F_z dz.
    """
    X = frame.scaled(x)
    i, j = products(degree)
    a, b = (legendre.legvander(X[..., c], degree) for c in (0, 1))
    up = np.zeros((degree + 1, degree + 2))  # integrals of Legendre's polynomials
    up[0, 1] = 1.0
    for n in range(1, degree + 1):
        up[n, n + 1], up[n, n - 1] = 1 / (2 * n + 1), -1 / (2 * n + 1)
    ia, ib = (legendre.legvander(X[..., c], degree + 1) @ up.T for c in (0, 1))
    along_x = np.einsum("bqm,bm->bq", ia[..., i] * b[..., j], force[..., 0])
    along_y = np.einsum("bqm,bm->bq", a[..., i] * ib[..., j], force[..., 1])
    none = np.zeros_like(along_x)
    parts = [none, along_y, none, none] if axial else [along_x, along_y, none]  # (3.5)
    return -np.stack(parts, axis=2) * frame.size[:, None, None]
