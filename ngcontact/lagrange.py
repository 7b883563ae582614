"""Lagrange interpolation at Gauss-Lobatto points of the unit segment.

Those of the weight 1, and of a weight that vanishes at one end, where a segment of a body of
revolution meets its axis: `axis` is 0, or -1 for the weight s and 1 for the weight 1 - s.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.polynomial import legendre, polynomial
from scipy.special import comb, roots_jacobi

from .arrays import Array, Index

COEFFICIENT_ROUND_OFF = 1e-12  # of coefficients in Bernstein's basis, relative to values
HALVINGS = 54  # of [-1, 1], to the last bit


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
    """Points (k, 2) at `s` (k,) of segments `segment` (k,) of `curve` (q, p + 1, 2).

    That is given by its points at the Gauss-Lobatto parameters.
    """
    return (lagrange(curve.shape[1] - 1, s)[:, None] @ curve[segment])[:, 0]


def slope(curve: Array, segment: Index, s: Array) -> Array:
    """Derivatives (k, 2) of the same with respect to s.

    At `s` (k,) of the curves `segment` (k,) among those through the points `curve` (n, p + 1, 2).
    """
    return (lagrange_derivative(curve.shape[1] - 1, s)[:, None] @ curve[segment])[:, 0]


@lru_cache
def _slopes(order: int) -> Array:
    """Coefficients of these derivatives in Legendre's polynomials, as columns."""
    return np.asarray(2 * legendre.legder(_coefficients(order)))


@lru_cache
def _to_bernstein(order: int) -> Array:
    """Matrix (order + 1, order + 1) from values at Gauss-Lobatto points to Bernstein's basis."""
    s, k = gauss_lobatto(order)[:, None], np.arange(order + 1)
    return np.asarray(np.linalg.inv(comb(order, k) * s**k * (1 - s) ** (order - k)))


def zeros(order: int, values: Array) -> tuple[Index, Array]:
    """All places in [0, 1] where polynomials change their sign: numbers (r,), parameters (r,).

    Of degree `order` from 1, by their `values` (k, order + 1) at its Gauss-Lobatto points. Where
    coefficients in Bernstein's basis have one sign there is none.
    """
    coefficients = values @ _to_bernstein(order).T
    bound = COEFFICIENT_ROUND_OFF * np.abs(values).max(axis=1, initial=0.0)
    low, high = coefficients.min(axis=1), coefficients.max(axis=1)
    some = np.flatnonzero((low <= bound) & (high >= -bound))
    if not some.size:
        return some, np.zeros(0)
    number, s = _zeros(order, values[some])
    return some[number], s


def _zeros(order: int, values: Array) -> tuple[Index, Array]:
    """The same of polynomials that may have some.

    Between the zeros of its derivative a polynomial is monotone, so that halving finds them all,
    from the linear derivative upwards.
    """
    powers = np.vander(2 * gauss_lobatto(order) - 1, increasing=True)
    coefficients = np.linalg.solve(powers, values.T).T
    ends = np.tile([-1.0, 1.0], (len(values), 1))
    edges = ends
    for degree in range(1, order + 1):
        derivative = polynomial.polyder(coefficients, order - degree, axis=1).T[..., None]
        low, high = edges[:, :-1], edges[:, 1:]
        below = polynomial.polyval(low, derivative, tensor=False) < 0
        changes = below != (polynomial.polyval(high, derivative, tensor=False) < 0)
        for _ in range(HALVINGS if changes.any() else 0):
            middle = (low + high) / 2
            left = changes & (below == (polynomial.polyval(middle, derivative, tensor=False) < 0))
            low, high = np.where(left, middle, low), np.where(left, high, middle)
        edges = np.column_stack([ends[:, :1], np.where(changes, low, high), ends[:, 1:]])
        edges = np.sort(edges, axis=1)
    number, place = np.nonzero(changes)
    return number, (1 + low[number, place]) / 2


@lru_cache
def gauss_derivative(order: int) -> Array:
    """Matrix (k, k) from values at the k points of `gauss` to the derivatives there.

    Of the polynomial through them, on [0, 1].
    """
    points = 2 * gauss(order)[0] - 1
    degree = len(points) - 1
    derivatives = 2 * legendre.legder(np.eye(degree + 1))  # of Legendre's polynomials
    slopes = _legendre(points, max(degree - 1, 0)) @ derivatives
    return np.asarray(slopes @ np.linalg.inv(_legendre(points, degree)))
