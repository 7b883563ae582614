"""Constants of the inequalities by which data that no polynomial meets enter the bound.

For every displacement v there is a rigid motion r with |v - r| <= h / pi |grad(v - r)| (Payne,
Weinberger 1960, Arch. Rational Mech. Anal. 5:286; Bebendorf 2003) on a convex T of diameter h, and

    |grad(v - r)|^2 <= (1 + 2 / beta^2) |e(v)|^2,

since the rotation omega of v - r, of mean 0, is the divergence of a z that vanishes on the boundary
with |grad z| <= |omega| / beta, and the gradient of omega consists of derivatives of e. With a ball
of radius rho about the middle of the inscribed circle, inside, and R, outside of T,

    beta >= rho / (sqrt 2 R) (1 + sqrt(1 - rho^2 / R^2))^(-1/2)

(Costabel, Dauge 2015, Arch. Rational Mech. Anal. 217:873, theorem 2.3). On an edge E opposite to P,

    |w|_E^2 = |E| / 2|T| int_T div((x - P) w^2) <= |E| / |T| (|w|^2 + d |w| |grad w|)

with the largest distance d from P.
"""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Array
from .stresses import Partition

MANDEL = np.array([1.0, 1.0, math.sqrt(2.0)])


def korn(corners: Array) -> Array:
    """Constants (n,) of |grad(v - r)| <= c |e(v)| on triangles `corners` (n, 3, 2)."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - np.roll(corners, -2, axis=1), axis=2)
    a, b = corners[:, 0] - corners[:, 2], corners[:, 1] - corners[:, 2]
    area = np.abs(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]) / 2
    round_ = sides.sum(axis=1)
    middle = (sides[:, :, None] * corners).sum(axis=1) / round_[:, None]
    rho = 2 * area / round_
    R = np.linalg.norm(corners - middle[:, None], axis=2).max(axis=1)
    ratio = rho / R
    beta = ratio / math.sqrt(2) / np.sqrt(1 + np.sqrt(1 - ratio**2))
    return np.asarray(np.sqrt(1 + 2 / beta**2))


def data_terms(partition: Partition, law: Array, inside: Array, on_edges: Array) -> Array:
    """What loads that are not met contribute to the norm on each triangle, (n,).

    Parameters
    ----------
    partition : Partition
        Of n triangles and e edges.
    law : ndarray (n, 3, 3)
        Moduli.
    inside : ndarray (n,)
        Norms of forces that are orthogonal to rigid motions.
    on_edges : ndarray (e,)
        Norms of such tractions on edges of the boundary.
    """
    loaded = np.flatnonzero((inside > 0) | (on_edges[partition.edges] > 0).any(axis=1))
    D = np.zeros(len(inside))
    if loaded.size == 0:
        return D
    corners = partition.vertices[partition.triangles[loaded]]
    least = np.linalg.eigvalsh(law[loaded] * MANDEL[:, None] * MANDEL)[:, 0]
    c = korn(corners) / np.sqrt(least)
    h, area = partition.diameters[loaded], partition.areas[loaded]
    in_body = h / math.pi
    total = in_body * inside[loaded]
    for i in range(3):
        edge = partition.edges[loaded, i]
        ends = [np.linalg.norm(corners[:, j] - corners[:, i], axis=1) for j in range(3)]
        far = np.maximum.reduce(ends)
        factor = partition.edge_lengths[edge] / area * (in_body**2 + far * in_body)
        total += np.sqrt(factor) * on_edges[edge]
    D[loaded] = c * total
    return D
