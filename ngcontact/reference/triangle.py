"""Lagrange interpolation on the unit triangle, in barycentric coordinates (L0, L1, L2).

Nodes are the vertices, the Gauss-Lobatto points of the edges, and the centre at order 3. Edges run
from their first to their second vertex, in NGSolve's order. Derivatives are with respect to L0
and L1, where L2 = 1 - L0 - L1. Integrals of basis functions vanish at the vertices at order 2 and
are positive at all other nodes of orders 1 to 3.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from scipy.spatial import Delaunay
from scipy.special import factorial, roots_jacobi

from ..arrays import Array, Index
from ..lagrange import gauss_lobatto

EDGES = np.array([[2, 0], [1, 2], [0, 1]])
CENTRE = np.full((1, 3), 1 / 3)
DEGREES = {3: 1, 6: 2, 10: 3}  # by the number of nodes


@lru_cache
def nodes(order: int) -> Array:
    """Barycentric coordinates (q, 3) of the nodes of a degree `order`, 1 to 3."""
    vertex, inner = np.eye(3), gauss_lobatto(order)[1:-1, None]
    edges = [(1 - inner) * vertex[i] + inner * vertex[j] for i, j in EDGES]
    return np.vstack([vertex, *edges, *([CENTRE] if order == 3 else [])])


@lru_cache
def edge_nodes(order: int) -> Index:
    """Numbers (3, order - 1) of the nodes inside each edge, from its first vertex on."""
    return np.arange(3, 3 * order).reshape(3, order - 1)


@lru_cache
def parts(order: int) -> Index:
    """Nodes (t, 3) at the corners of the t = order^2 triangles into which the nodes divide one."""
    corners = np.array([[0, 0], [1, 0], [0.5, 0.75**0.5]])  # no other division has such circles
    return Delaunay(nodes(order) @ corners).simplices


@lru_cache
def _exponents(order: int) -> Index:
    """Exponents (q, 2) of L0 and L1 in the monomials of a degree."""
    return np.array([(i, j) for i in range(order + 1) for j in range(order + 1 - i)])


def _monomials(order: int, L: Array, derivative: int | None = None) -> Array:
    """Monomials (k, q) at `L` (k, 3), or their derivatives with respect to L0 (0) or L1 (1)."""
    powers = [np.vander(x, order + 1, increasing=True) for x in L[:, :2].T]
    if derivative is not None:
        x = powers[derivative]
        powers[derivative] = np.zeros_like(x)
        powers[derivative][:, 1:] = x[:, :-1] * np.arange(1, order + 1)
    i, j = _exponents(order).T
    return np.asarray(powers[0][:, i] * powers[1][:, j])


@lru_cache
def _coefficients(order: int) -> Array:
    """Coefficients of the Lagrange polynomials in the monomials, as columns."""
    return np.asarray(np.linalg.inv(_monomials(order, nodes(order))))


def lagrange(order: int, L: Array) -> Array:
    """Values (k, q) at `L` (k, 3) of the polynomials that are 1 at one node and 0 at the others."""
    return _monomials(order, L) @ _coefficients(order)


def lagrange_gradient(order: int, L: Array) -> Array:
    """Their derivatives (k, q, 2) at `L` (k, 3)."""
    parts = [_monomials(order, L, axis) @ _coefficients(order) for axis in (0, 1)]
    return np.stack(parts, axis=-1)


@lru_cache
def bernstein(order: int) -> Array:
    """Values (q, q) of Bernstein's polynomials at the nodes, one at each node, as columns.

    They are nowhere negative, add up to 1, and are those of the edge on each edge.
    """
    L = nodes(order)
    powers = np.rint(order * L)
    ways = factorial(order) / factorial(powers).prod(axis=1)
    return np.asarray(ways * (L[:, None] ** powers).prod(axis=2))


@lru_cache
def gauss(degree: int) -> tuple[Array, Array]:
    """Points (g, 3) and weights (g,) of mean 1 in sum, exact for polynomials of a `degree`.

    Gauss's points on lines through a vertex, whose distance from it weighs (Stroud 1971).
    """
    count = degree // 2 + 1
    x, v = np.polynomial.legendre.leggauss(count)
    y, w = roots_jacobi(count, 1, 0)
    t, s = (1 + x) / 2, (1 - y) / 2  # of the way across, and from the vertex
    points = np.stack(
        [np.outer(s, t), np.outer(s, 1 - t), np.outer(1 - s, np.ones(count))], axis=-1
    )
    weights = np.outer(w, v).ravel()
    return points.reshape(-1, 3), weights / weights.sum()
