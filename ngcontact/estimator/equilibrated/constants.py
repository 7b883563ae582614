"""Constants of the inequalities by which data that no polynomial meets enter the bound.

For every displacement v there is a rigid motion r with |v - r| <= h / pi |grad(v - r)| (Payne,
Weinberger 1960, Arch. Rational Mech. Anal. 5:286; Bebendorf 2003) on a convex T of diameter h, and

    |grad(v - r)|^2 <= (1 + 2 / beta^2) |e(v)|^2,

since the rotation omega of v - r, of mean 0, is the divergence of a z that vanishes on the boundary
with |grad z| <= |omega| / beta, and the gradient of omega consists of derivatives of e. With a ball
of radius rho, with respect to which T is star-shaped, and one of R about the same place around T,

    beta >= rho / (sqrt 2 R) (1 + sqrt(1 - rho^2 / R^2))^(-1/2)

(Costabel, Dauge 2015, Arch. Rational Mech. Anal. 217:873, theorem 2.3). On an edge E opposite to P,

    min_E (x - P).n |w|_E^2 <= int_T div((x - P) w^2) <= 2 |w|^2 + 2 d |w| |grad w|

with the largest distance d from P. On a curved T the first inequality is that of the straight
triangle, of which T is the image under D: |w| <= h / pi max |D| (max det D / min det D)^(1/2)
|grad w|. Extrema on curves are taken over points.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Array, Index
from .data import MANDEL, PLACES, Discrete, edge_places

MIDDLES = 12  # degree of the lattice of places at which the middle of both balls is sought


@dataclass(frozen=True, eq=False)
class _Shapes:
    """Triangles, b of them: constants of Poincare and Korn, and of traces on edges.

    `poincare` and `korn` (b,), `trace` (b, 3): of squares, for |grad w| = 1.
    """

    poincare: Array
    korn: Array
    trace: Array


def _shapes(discrete: Discrete, at: Index) -> _Shapes:
    partition = discrete.partition
    corners = partition.vertices[partition.triangles[at]]
    edges = partition.edges[at]
    t = np.broadcast_to(np.linspace(0, 1, PLACES), (3 * len(at), PLACES))
    x, dx = edge_places(partition, edges.ravel(), discrete.curves, t)
    x, dx = x.reshape(len(at), 3, PLACES, 2), dx.reshape(len(at), 3, PLACES, 2)
    normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    outward = (normal * partition.normals[at][:, :, None]).sum(axis=-1).mean(axis=-1)
    normal *= np.sign(outward)[:, :, None, None]
    ratio, middle = _star(corners, x, normal)
    ratio = np.maximum(ratio, np.finfo(float).tiny)
    beta = ratio / math.sqrt(2) / np.sqrt(1 + np.sqrt(1 - ratio**2))
    poincare = partition.diameters[at] / math.pi
    several = np.zeros(len(at), dtype=bool)
    if discrete.rough is not None:
        number = discrete.rough.number[at]
        poincare = poincare * np.where(number >= 0, discrete.rough.distortion[number], 1.0)
        several = (discrete.curves.number[edges] >= 0).sum(axis=1) > 1
    # P is the opposite vertex, through which the other edges run; the middle if these are curved.
    centre = np.where(several[:, None, None], middle[:, None], corners)
    away = x - centre[:, :, None]
    least = (away * normal).sum(axis=-1).min(axis=-1)
    far = np.linalg.norm(away, axis=-1).max(axis=-1)
    p = poincare[:, None]
    return _Shapes(poincare, np.sqrt(1 + 2 / beta**2), 2 * (p**2 + far * p) / least)


def _star(corners: Array, x: Array, normal: Array) -> tuple[Array, Array]:
    """Largest rho / R (b,) of triangles, and the middle (b, 2) of these two balls.

    Of all middles looked at, that of the inscribed circle and a lattice; `x` and `normal`
    (b, 3, q, 2) are places on the edges.
    """
    opposite = np.linalg.norm(np.roll(corners, -1, 1) - np.roll(corners, -2, 1), axis=2)
    shares = [opposite / opposite.sum(axis=1, keepdims=True)]
    steps = [(i, j) for i in range(1, MIDDLES) for j in range(1, MIDDLES - i)]
    for i, j in steps:
        share = np.array([i, j, MIDDLES - i - j]) / MIDDLES
        shares.append(np.tile(share, (len(corners), 1)))
    best, middle = np.full(len(corners), -np.inf), np.zeros((len(corners), 2))
    for share in shares:
        tried = np.einsum("bi,bic->bc", share, corners)
        away = x - tried[:, None, None]
        rho = (away * normal).sum(axis=-1).min(axis=(1, 2))
        ratio = rho / np.linalg.norm(away, axis=-1).max(axis=(1, 2))
        better = ratio > best
        best[better], middle[better] = ratio[better], tried[better]
    return best, middle


def data_terms(discrete: Discrete, inside: Array, on_edges: Array) -> Array:
    """What loads that are not met contribute to the norm on each triangle, (n,).

    Parameters
    ----------
    discrete : Discrete
        On n triangles with e edges.
    inside : ndarray (n,)
        Norms of forces that are orthogonal to rigid motions.
    on_edges : ndarray (e,)
        Norms of such tractions on edges of the boundary.
    """
    edges = discrete.partition.edges
    loaded = np.flatnonzero((inside > 0) | (on_edges[edges] > 0).any(axis=1))
    D = np.zeros(len(inside))
    if loaded.size == 0:
        return D
    mandel = MANDEL[discrete.law.shape[1]]
    least = np.linalg.eigvalsh(discrete.law[loaded] * mandel[:, None] * mandel)[:, 0]
    if discrete.rough is not None:
        number = discrete.rough.number[loaded]
        least = np.where(number >= 0, discrete.rough.least[number], least)
    shapes = _shapes(discrete, loaded)
    total = shapes.poincare * inside[loaded]
    total = total + (np.sqrt(shapes.trace) * on_edges[edges[loaded]]).sum(axis=1)
    D[loaded] = shapes.korn * total / np.sqrt(least * discrete.least_measure(loaded))
    return D
