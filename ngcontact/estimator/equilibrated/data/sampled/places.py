"""Points in triangles, curved ones, too, and what polynomials in x are there."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .....arrays import Array, Index
from ..partition import Partition
from ..polynomials import basis


@dataclass(frozen=True, eq=False)
class Places:
    """Quadrature at q points in each of b triangles, for n polynomials in x.

    Attributes
    ----------
    place : ndarray (b, q, 2)
        The points.
    weight : ndarray (b, q)
        Weights over the straight area.
    values : ndarray (b, q, n)
        Of the polynomials.
    slopes : ndarray (b, q, 2, n)
        Their derivatives along the straight triangle's reference coordinates.
    hats : ndarray (q, 3)
        Hats of the corners.
    gradients : ndarray (b, q, 3, 2)
        Gradients of these.
    distortion : ndarray (b,)
        Factor of Poincare's constant of the straight triangle.
    """

    place: Array
    weight: Array
    values: Array
    slopes: Array
    hats: Array
    gradients: Array
    distortion: Array


def places_in(
    partition: Partition, at: Index, quadrature: tuple[Array, Array], degree: int
) -> Places:
    """What is in the points of `quadrature`, their places and weights, in triangles `at` (b,).

    Parameters
    ----------
    partition, degree
        All triangles, and the degree of the polynomials.
    at : ndarray of int (b,)
        Triangles.
    quadrature : tuple of ndarray (q, 2), (q,)
        Points of the reference triangle, and weights.
    """
    rule, w = quadrature
    jacobian = partition.jacobians(at, rule)
    x = partition.places(at, rule)
    origin = partition.vertices[partition.triangles[at, 2]]
    flat = np.einsum("bij,bqj->bqi", partition.inverses[at], x - origin[:, None])
    weight = w * np.linalg.det(jacobian) / (2 * partition.areas[at][:, None])
    inverse = np.linalg.inv(jacobian)
    gradients = np.concatenate([inverse, -inverse.sum(axis=2, keepdims=True)], axis=2)
    values = basis(degree).values(flat.reshape(-1, 2)).reshape(*x.shape[:2], -1)
    slopes = basis(degree).gradients(flat.reshape(-1, 2)).reshape(2, *x.shape[:2], -1)
    hats = np.column_stack([rule, 1 - rule.sum(axis=1)])
    # |w|^2 <= max det (h / pi)^2 |grad of w in the straight triangle|^2, which is at most
    # max |D|^2 / min det |grad w|^2.
    D = jacobian @ partition.inverses[at][:, None]
    det, largest = np.linalg.det(D), np.linalg.norm(D, ord=2, axis=(2, 3)).max(axis=1)
    distortion = largest * np.sqrt(det.max(axis=1) / det.min(axis=1))
    return Places(x, weight, values, slopes.transpose(1, 2, 0, 3), hats, gradients, distortion)
