"""Lagrange interpolation at Gauss-Lobatto points of the unit segment.

Those of the weight 1, and of a weight that vanishes at one end, where a segment of a body of
revolution meets its axis: `axis` is 0, or -1 for the weight s and 1 for the weight 1 - s.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre
from scipy.special import roots_jacobi

from .arrays import Array, Index

END_ROUND_OFF = 1e-12  # of places beyond the ends
EIGENVALUE_DISTANCE = 1e-3  # of a zero from its eigenvalue at most, up to degree 8 1e-5


@lru_cache
def gauss_lobatto(order: int, axis: int = 0) -> Array:
    """Gauss-Lobatto points (order + 1,) of a degree `order` from 1 on [0, 1], ends included.

    Inside lie the zeros of the derivative of Legendre's polynomial of that degree, of the weight s
    those of the Jacobi polynomial (1, 2) of one degree less. The integrals of the weight times the
    Lagrange polynomials are positive at every degree, and by them polynomials of degree 2 order - 1
    are integrated exactly.
    """
    if axis and order > 1:
        inner = (1 + np.sort(roots_jacobi(order - 1, 1, 2)[0])) / 2
        return np.concatenate([[0.0], inner if axis < 0 else 1 - inner[::-1], [1.0]])
    interior = legendre.Legendre.basis(order).deriv().roots()
    return np.concatenate([[0.0], (1 + np.sort(interior.real)) / 2, [1.0]])


@lru_cache
def gauss(order: int) -> tuple[Array, Array]:
    """Gauss points (k,) and weights (k,) on [0, 1], exact for polynomials of degree `order`."""
    points, weights = legendre.leggauss(order // 2 + 1)
    return (1 + points) / 2, weights / 2


def _legendre(x: Array, degree: int) -> Array:
    """Values (k, degree + 1) of Legendre's polynomials at `x` (k,), without checks of input."""
    values = np.empty((degree + 1, len(x)))
    values[0], values[1:2] = 1.0, x
    for n in range(2, degree + 1):
        values[n] = (values[n - 1] * x * (2 * n - 1) - values[n - 2] * (n - 1)) / n
    return values.T


@lru_cache
def _coefficients(order: int, axis: int = 0) -> Array:
    """Coefficients of the Lagrange polynomials in Legendre's of 2s - 1, as columns."""
    return np.asarray(np.linalg.inv(_legendre(2 * gauss_lobatto(order, axis) - 1, order)))


def lagrange(order: int, s: Array, axis: int = 0) -> Array:
    """Values (k, order + 1) at `s` (k,) of the polynomials that are 1 at one Gauss-Lobatto point.

    Column i is 1 at point i and 0 at the others. At those points the rows are unit vectors exactly.
    """
    s = np.array(s, ndmin=1)
    values: Array = _legendre(2 * s - 1, order) @ _coefficients(order, axis)
    place, node = (s[:, None] == gauss_lobatto(order, axis)).nonzero()
    values[place] = 0.0
    values[place, node] = 1.0
    return values


def lagrange_derivative(order: int, s: Array) -> Array:
    """Derivatives (k, order + 1) of the polynomials of `lagrange` at parameters `s` (k,)."""
    return np.asarray(_legendre(2 * np.array(s, ndmin=1) - 1, order - 1) @ _slopes(order))


def at(curve: Array, segment: Index, s: Array) -> Array:
    """Points (k, 2) at `s` (k,) of segments `segment` (k,) of `curve` (q, p + 1, 2), by nodes."""
    return (lagrange(curve.shape[1] - 1, s)[:, None] @ curve[segment])[:, 0]


def slope(curve: Array, segment: Index, s: Array) -> Array:
    """Derivatives (k, 2) of the same, at `s` (k,) of `segment` (k,) of `curve` (q, p + 1, 2)."""
    return (lagrange_derivative(curve.shape[1] - 1, s)[:, None] @ curve[segment])[:, 0]


@lru_cache
def _slopes(order: int) -> Array:
    """Coefficients of these derivatives in Legendre's polynomials, as columns."""
    return np.asarray(2 * legendre.legder(_coefficients(order)))


def zeros(order: int, values: Array) -> tuple[Index, Array]:
    """All places in [0, 1] where polynomials vanish: numbers (r,), parameters (r,).

    Of degree `order` from 1, by their `values` (k, order + 1) at its Gauss-Lobatto points. They are
    eigenvalues 1 / (s - s_0) of companion matrices of c_0 y^p + c_1 y^(p - 1) + ..., where c are
    the coefficients in powers of s - s_0: c_0, the value at the node s_0, is the largest there is.
    Powers lose digits, which Newton's method finds again.
    """
    nodes, first = gauss_lobatto(order), np.abs(values).argmax(axis=1)
    powers = (nodes - nodes[:, None])[..., None] ** np.arange(order + 1)
    c = (np.linalg.inv(powers)[first] @ values[..., None])[..., 0]
    companion = np.tile(np.eye(order, k=-1), (len(c), 1, 1))
    np.divide(-c[:, 1:], c[:, :1], out=companion[:, 0], where=c[:, :1] != 0)
    y = np.linalg.eigvals(companion)
    real = np.isreal(y) & (y != 0)
    s = nodes[first, None] + np.divide(1.0, y.real, out=np.full(y.shape, np.inf), where=real)
    s = np.sort(np.where(np.abs(s - 0.5) <= 0.5 + EIGENVALUE_DISTANCE, s, np.inf), axis=1)
    number, place = np.isfinite(s).nonzero()
    s = s[number, place]
    for _ in range(2):
        value = (lagrange(order, s) * values[number]).sum(axis=1)
        rate = (lagrange_derivative(order, s) * values[number]).sum(axis=1)
        s = s - np.divide(value, rate, out=np.zeros_like(s), where=rate != 0)
    inside = np.abs(s - 0.5) <= 0.5 + END_ROUND_OFF
    return number[inside], s[inside].clip(0, 1)


@lru_cache
def gauss_derivative(order: int) -> Array:
    """Matrix (k, k) from values of polynomials at the k points of `gauss` to derivatives there."""
    points = 2 * gauss(order)[0] - 1
    degree = len(points) - 1
    derivatives = 2 * legendre.legder(np.eye(degree + 1))  # of Legendre's polynomials
    slopes = _legendre(points, max(degree - 1, 0)) @ derivatives
    return np.asarray(slopes @ np.linalg.inv(_legendre(points, degree)))
