"""Liftings w of what the discrete displacement misses on Gamma_u and on Gamma_K.

On the triangle at an edge, between the edge (t = 0) and the opposite vertex (t = 1), r(s) on the
edge is continued by r(s) (1 - t)^m, with the best m. It vanishes on both other edges.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ....arrays import Array, Index
from ....lagrange import gauss, gauss_lobatto
from ..data import Discrete, edge_places, legendre_derivative, legendre_values

DEGREE = 16  # of the polynomials that stand for prescribed displacements and gaps on a segment
LEAST_POWER = 1.0
POINTS = 12  # of quadrature from an edge to the opposite vertex
PARTS = ("t", "weight", "value", "slope")
MERIDIAN = np.array([0, 1, 3])  # components of rr, zz, hoop, rz without the hoop


@dataclass(frozen=True, eq=False)
class EdgeField:
    """A displacement on k segments, at q points each, without its values at their ends.

    Attributes
    ----------
    edge : ndarray of int (k,)
        Their edges, see `Partition.edge_of_segment`, in whose direction the parameter runs.
    t, weight : ndarray (k, q)
        Parameters on the segments, in [0, 1], and weights of quadrature.
    value, slope : ndarray (k, q, 2)
        The displacement, over strain times length, and its derivative with respect to t.
    """

    edge: Index
    t: Array
    weight: Array
    value: Array
    slope: Array

    def scaled(self, share: Array) -> EdgeField:
        """The field times `share` (k,)."""
        share = share[:, None, None]
        return replace(self, value=share * self.value, slope=share * self.slope)


def samples() -> Array:
    """Parameters (d + 1,) at which functions on a segment are looked at, ends included."""
    return gauss_lobatto(DEGREE)


def coefficients(values: Array) -> Array:
    """Legendre coefficients (k, d + 1) of functions with `values` (k, d + 1) there; or vectors."""
    inverse = np.linalg.inv(legendre_values(DEGREE, samples()))
    return np.einsum("ij,kj...->ki...", inverse, values)


def derivative(c: Array) -> Array:
    """Coefficients (k, d + 1) of derivatives of functions from their own, `c` (k, d + 1)."""
    return np.einsum("ij,kj...->ki...", legendre_derivative(DEGREE), c)


def at_points(c: Array, t: Array) -> Array:
    """Values (k, q) of functions with coefficients `c` (k, d + 1) at `t` (k, q); or vectors."""
    values = legendre_values(DEGREE, t.ravel()).reshape(*t.shape, DEGREE + 1)
    return np.einsum("kqi,ki...->kq...", values, c)


def panels(*functions: Array) -> tuple[Array, Array]:
    """Points (k, q) and weights (k, q) on segments cut where functions change their sign.

    Each of the `functions` (k, d + 1) are their coefficients. Cuts that a segment lacks are at its
    end.
    """
    rule, w = gauss(2 * DEGREE)
    grid = np.linspace(0, 1, 8 * DEGREE + 1)
    every = np.stack(functions, axis=1).reshape(-1, DEGREE + 1)
    values = every @ legendre_values(DEGREE, grid).T
    row, column = np.nonzero(values[:, 1:] * values[:, :-1] < 0)
    slope = every @ legendre_derivative(DEGREE).T
    low, high = grid[column], grid[column + 1]
    a, b = values[row, column], values[row, column + 1]
    t = low + (high - low) * a / (a - b)
    for _ in range(4):  # Newton, from within 1 / 128
        f = (legendre_values(DEGREE, t) * every[row]).sum(axis=1)
        df = (legendre_values(DEGREE, t) * slope[row]).sum(axis=1)
        t = np.clip(t - f / np.where(df == 0, 1.0, df), low, high)
    row //= len(functions)
    count = np.bincount(row, minlength=len(functions[0]))
    cuts = np.ones((len(count), int(count.max(initial=0)) + 2))
    cuts[:, 0] = 0.0
    place = np.arange(len(row)) - np.concatenate([[0], np.cumsum(count)[:-1]])[row]
    cuts[row, 1 + place] = t
    length = np.diff(np.sort(cuts, axis=1), axis=1)
    points = np.sort(cuts, axis=1)[:, :-1, None] + length[:, :, None] * rule
    return points.reshape(len(count), -1), (length[:, :, None] * w).reshape(len(count), -1)


def by_segment(field: EdgeField, segment: Index) -> EdgeField:
    """A field given on pieces of segments `segment` (k,) as one on the whole of each, in order."""
    kept, first, number = np.unique(segment, return_index=True, return_inverse=True)
    if len(kept) == len(segment):
        return EdgeField(*(getattr(field, name)[first] for name in ("edge", *PARTS)))
    order = np.argsort(number, kind="stable")
    count = np.bincount(number)
    place = np.arange(len(number)) - np.concatenate([[0], np.cumsum(count)[:-1]])[number[order]]
    q = field.t.shape[1]

    def merged(values: Array) -> Array:
        result = np.zeros((len(kept), int(count.max()), *values.shape[1:]))
        result[number[order], place] = values[order]
        return result.reshape(len(kept), int(count.max()) * q, *values.shape[2:])

    return EdgeField(field.edge[first], *(merged(getattr(field, name)) for name in PARTS))


def norms(discrete: Discrete, field: EdgeField) -> Array:
    """Energy norms (k,) of the liftings into the elements beside the segments, with the best m.

    On curved edges the continuation is from the curve to the opposite vertex; from segments of
    several edges it is to that of the first, into the triangle that it makes with all of them.
    """
    share = discrete.partition.shares[field.edge][:, None]
    field = replace(
        field,
        t=field.t / share,
        weight=field.weight / share,
        slope=field.slope * share[:, :, None],
    )
    triangle, opposite = (x[field.edge] for x in discrete.partition.owner)
    if discrete.balance.extent:
        return _norms_about_axis(discrete, field)
    along, inwards, weight = towards(discrete, triangle, opposite, field.edge, field.t)
    first, second = strain_of(field.slope, along), strain_of(field.value, inwards)
    C, weight = discrete.law[triangle], field.weight * weight

    def product(a: Array, b: Array) -> Array:
        return np.einsum("kq,kqi,kij,kqj->k", weight, a, C, b, optimize=True)

    # 1 / m |first - m second|^2 is least at m = |first| / |second|.
    one, mixed, two = product(first, first), product(first, second), product(second, second)
    ratio = np.sqrt(np.divide(one, two, out=np.ones_like(one), where=two > 0))
    m = np.maximum(ratio, LEAST_POWER)
    square = (one / m - 2 * mixed + m * two) / 2
    return np.sqrt(np.maximum(square, 0.0) * most_of_law(discrete, triangle))


def most_of_law(discrete: Discrete, triangle: Index) -> Array:
    """Factors (k,) by which laws exceed those in the middle of triangles `triangle` (k,)."""
    if discrete.rough is None:
        return np.ones(len(triangle))
    number = discrete.rough.number[triangle]
    return np.where(number >= 0, discrete.rough.most[number], 1.0)


def towards(
    discrete: Discrete, triangle: Index, opposite: Index, edge: Index, t: Array
) -> tuple[Array, Array, Array]:
    """Gradients along edges, times 1 - t, and from them; twice the area per parameter.

    Parameters
    ----------
    discrete : Discrete
    triangle, opposite, edge : ndarray of int (k,)
        Triangles, which of their vertices lies opposite, and the edge there.
    t : ndarray (k, q)
        Places on the edge.

    Returns
    -------
    ndarray (k, q, 2), (k, q, 2), (k, q)
    """
    partition = discrete.partition
    apex = partition.vertices[partition.triangles[triangle, opposite]]
    x, dx = edge_places(partition, edge, discrete.curves, t)
    inverse = np.linalg.inv(np.stack([dx, apex[:, None] - x], axis=3))
    return inverse[:, :, 0], inverse[:, :, 1], 1 / np.abs(np.linalg.det(inverse))


def strain_of(r: Array, gradient: Array) -> Array:
    """Voigt strains (k, q, 3) of products of vectors `r` (k, q, 2) and `gradient` (k, q, 2)."""
    return np.stack(
        [
            r[..., 0] * gradient[..., 0],
            r[..., 1] * gradient[..., 1],
            r[..., 0] * gradient[..., 1] + r[..., 1] * gradient[..., 0],
        ],
        axis=-1,
    )


def _norms_about_axis(discrete: Discrete, field: EdgeField) -> Array:
    """The same (k,) about an axis, where the hoop strain w_r / r is another part."""
    triangle, opposite = (x[field.edge] for x in discrete.partition.owner)
    partition, balance = discrete.partition, discrete.balance
    along, inwards, weight = towards(discrete, triangle, opposite, field.edge, field.t)
    weight = field.weight * weight
    apex = partition.vertices[partition.triangles[triangle, opposite]]
    x, _ = edge_places(partition, field.edge, discrete.curves, field.t)
    first, second = strain_of(field.slope, along), strain_of(field.value, inwards)
    law = discrete.law[triangle]
    C = law[:, MERIDIAN[:, None], MERIDIAN]
    # The best m of the plane: the hoop strain matters but near the axis.
    at_edge = weight * balance.measure(x)

    def product(a: Array, b: Array) -> Array:
        return np.einsum("kq,kqi,kij,kqj->k", at_edge, a, C, b, optimize=True)

    one, two = product(first, first), product(second, second)
    ratio = np.sqrt(np.divide(one, two, out=np.ones_like(one), where=two > 0))
    m = np.maximum(ratio, LEAST_POWER)
    rule, w = gauss(2 * POINTS)
    t = 1 - rule ** (1 / (2 * m[:, None]))  # (1 - t)^(2 m - 1) dt is even in these
    square = np.zeros(len(m))
    for j in range(len(rule)):
        place = x + t[:, j, None, None] * (apex[:, None] - x)
        radius = place[..., 0]
        e = np.zeros((*first.shape[:2], 4))
        e[..., MERIDIAN] = first - m[:, None, None] * second
        e[..., 2] = (1 - t[:, j, None]) * field.value[..., 0] / np.where(radius > 0, radius, 1.0)
        share = weight * balance.measure(place) * w[j] / (2 * m[:, None])
        square += np.einsum("kq,kqi,kij,kqj->k", share, e, law, e, optimize=True)
    return np.sqrt(square * most_of_law(discrete, triangle))
