"""Polynomials on the reference triangle (1, 0), (0, 1), (0, 0) and on its edges, as matrices.

The coordinates of a point are its first two barycentric coordinates, those of NGSolve. Edge i lies
opposite to vertex i and runs from vertex i + 1 to vertex i + 2, modulo 3.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property, lru_cache

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ....arrays import Array
from ....lagrange import gauss

CORNERS = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])


@lru_cache
def triangle_rule(order: int) -> tuple[Array, Array]:
    """Points (q, 2) and weights (q,), of sum 1, exact for polynomials of degree `order`."""
    rule = ng.IntegrationRule(ng.TRIG, order)
    return np.array(rule.points)[:, :2], 2 * np.array(rule.weights)


def dimension(degree: int) -> int:
    """Number of polynomials up to a degree on a triangle."""
    return (degree + 1) * (degree + 2) // 2


def edge_points(edge: int, s: Array) -> Array:
    """Points (q, 2) at parameters `s` (q,) in [0, 1] of an edge."""
    first, last = CORNERS[(edge + 1) % 3], CORNERS[(edge + 2) % 3]
    return first + s[:, None] * (last - first)


def barycentric(points: Array) -> Array:
    """Barycentric coordinates (q, 3) of `points` (q, 2)."""
    return np.column_stack([points, 1 - points.sum(axis=1)])


def legendre_values(degree: int, s: Array) -> Array:
    """Values (q, d + 1) at `s` (q,) of the polynomials orthonormal on [0, 1]."""
    return np.asarray(
        legendre.legvander(2 * s - 1, degree) * np.sqrt(2 * np.arange(degree + 1) + 1)
    )


@lru_cache
def legendre_derivative(degree: int) -> Array:
    """Matrix (d + 1, d + 1): coefficients of derivatives from those of the functions."""
    size = np.sqrt(2 * np.arange(degree + 1) + 1)
    matrix = np.zeros((degree + 1, degree + 1))
    matrix[:degree] = 2 * np.array([legendre.legder(row) for row in np.eye(degree + 1)]).T
    return np.asarray(matrix * size / size[:, None])


def _powers(degree: int, points: Array) -> tuple[Array, Array, Array]:
    """Monomials (q, n) about the middle by rising degree, and their two derivatives."""
    x, y = 3 * (points - 1 / 3).T
    exponents = np.array([(d - j, j) for d in range(degree + 1) for j in range(d + 1)]).T
    a, b = exponents
    values = x[:, None] ** a * y[:, None] ** b
    along_x = 3 * a * x[:, None] ** np.maximum(a - 1, 0) * y[:, None] ** b
    along_y = 3 * b * x[:, None] ** a * y[:, None] ** np.maximum(b - 1, 0)
    return values, along_x, along_y


@dataclass(frozen=True)
class Polynomials:
    """Polynomials of a degree on the triangle, n of them, orthonormal in the mean.

    Degree by degree: the first `dimension(d)` of them span those of degree d.

    Attributes
    ----------
    degree : int
        At least 1.
    """

    degree: int

    @cached_property
    def change(self) -> Array:
        """Monomials times this matrix (n, n) are the basis; two rounds for its round-off."""
        points, weights = triangle_rule(2 * self.degree)
        values, total = _powers(self.degree, points)[0], np.eye(dimension(self.degree))
        for _ in range(2):
            change = np.linalg.inv(np.linalg.qr(np.sqrt(weights)[:, None] * values @ total)[1])
            total = total @ change
        return np.asarray(total * np.sign(np.diag(total)))

    def values(self, points: Array) -> Array:
        """Values (q, n) at `points` (q, 2)."""
        return np.asarray(_powers(self.degree, points)[0] @ self.change)

    def gradients(self, points: Array) -> Array:
        """Derivatives (2, q, n) along the two coordinates at `points` (q, 2)."""
        return np.asarray(np.stack(_powers(self.degree, points)[1:]) @ self.change)

    @cached_property
    def rule(self) -> tuple[Array, Array]:
        """Points (q, 2) and weights (q,) at which products of two of them are integrated."""
        return triangle_rule(2 * self.degree)

    @cached_property
    def at_rule(self) -> Array:
        """Values (q, n) at the rule's points."""
        return self.values(self.rule[0])

    @cached_property
    def derivatives(self) -> Array:
        """Matrices (2, m, n): coefficients of the derivatives in the m polynomials below."""
        m = dimension(self.degree - 1)
        points, weights = self.rule
        return np.asarray((self.at_rule[:, :m] * weights[:, None]).T @ self.gradients(points))

    @cached_property
    def traces(self) -> Array:
        """Matrices (3, d + 1, n): Legendre coefficients on the edges."""
        s, weights = gauss(2 * self.degree)
        on_edge = (legendre_values(self.degree, s) * weights[:, None]).T
        return np.stack([on_edge @ self.values(edge_points(i, s)) for i in range(3)])

    @cached_property
    def hats(self) -> Array:
        """Matrices (3, n, m): coefficients of the products of hats and the m polynomials below."""
        m = dimension(self.degree - 1)
        points, weights = self.rule
        moments = (self.at_rule * weights[:, None]).T
        hat = barycentric(points)
        return np.stack([moments @ (hat[:, i, None] * self.at_rule[:, :m]) for i in range(3)])


@lru_cache
def basis(degree: int) -> Polynomials:
    """The polynomials of a degree, whose matrices are made once."""
    return Polynomials(degree)


@lru_cache
def lattice(degree: int) -> Array:
    """Points (n, 2) inside the triangle that determine the polynomials of a degree."""
    steps = np.array([(i, j) for i in range(degree + 1) for j in range(degree + 1 - i)], float)
    return (steps + 1 / 3) / (degree + 1)
