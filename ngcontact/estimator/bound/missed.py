"""What an equilibrated stress misses of its data, and how much of the energy that can be.

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

import numpy as np

from ...arrays import Array, Index
from .cells import Cells

SEEN = 17  # points on each side
MIDDLES = 8  # degree of the lattice of places at which the middle of both balls is sought


def data_norms(cells: Cells, forces: Array, tractions: Array, least: Array) -> Array:
    """Norm (n,) of a stress that does the work of what is missed.

    Parameters
    ----------
    forces : ndarray (n,)
        L2 norms of body forces orthogonal to rigid motions, times the measure.
    tractions : ndarray (n, 3)
        The same of tractions on the sides.
    least : ndarray (n,)
        Smallest eigenvalue of C in Mandel's scaling.

    Raises
    ------
    ValueError
        Something is missed at the axis, where the measure is 0.
    """
    found = np.zeros(len(forces))
    at = np.flatnonzero((forces > 0) | (tractions > 0).any(axis=1))
    if at.size:
        poincare, korn, trace, measure = _constants(cells, at)
        if (measure <= 0).any():
            raise ValueError(
                "no guaranteed bound is known for loads that are no polynomials at the axis; use "
                "error_estimate"
            )
        total = poincare * forces[at] + (np.sqrt(trace) * tractions[at]).sum(axis=1)
        found[at] = korn * total / np.sqrt(least[at] * measure)
    return found


def _constants(cells: Cells, at: Index) -> tuple[Array, Array, Array, Array]:
    """Of Poincare and Korn (b,), of traces (b, 3), squares for |grad w| = 1; least measure (b,)."""
    corners, t = cells.corners[at], np.linspace(0, 1, SEEN)
    x = np.empty((len(at), 3, SEEN, 2))
    normal = np.empty_like(x)
    for i in range(3):
        own = np.where(cells.backward[at, i, None], 1 - t, t)
        side = np.repeat(cells.sides[at, i], SEEN)
        place, slope = (z.reshape(len(at), SEEN, 2) for z in cells.points(side, own.ravel()))
        slope = np.where(cells.backward[at, i, None, None], -slope, slope)
        x[:, i] = place
        normal[:, i] = np.stack([slope[..., 1], -slope[..., 0]], axis=-1)
    slope = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    best = np.zeros(len(at))
    opposite = np.linalg.norm(np.roll(corners, -1, 1) - np.roll(corners, -2, 1), axis=2)
    shares = [opposite / opposite.sum(axis=1, keepdims=True)]
    m = MIDDLES
    shares += [
        np.broadcast_to(np.array([i, j, m - i - j]) / m, (len(at), 3))
        for i in range(1, m)
        for j in range(1, m - i)
    ]
    for share in shares:
        away = x - np.einsum("bi,bic->bc", share, corners)[:, None, None]
        rho = (away * normal).sum(axis=-1).min(axis=(1, 2))
        best = np.maximum(best, rho / np.linalg.norm(away, axis=-1).max(axis=(1, 2)))
    best = np.maximum(best, np.finfo(float).tiny)
    beta = best / math.sqrt(2) / np.sqrt(1 + np.sqrt(1 - best**2))
    poincare = cells.diameters[at] / math.pi * _distortion(cells, at, x, slope)
    away = x - corners[:, :, None]
    least = np.maximum((away * normal).sum(axis=-1).min(axis=-1), np.finfo(float).tiny)
    far = np.linalg.norm(away, axis=-1).max(axis=-1)
    p = poincare[:, None]
    measure = cells.trace.model.measure(x.reshape(-1, 2)).reshape(len(at), -1).min(axis=1)
    return poincare, np.sqrt(1 + 2 / beta**2), 2 * (p**2 + far * p) / least, measure


def _distortion(cells: Cells, at: Index, x: Array, slope: Array) -> Array:
    """Max |D| (max det D / min det D)^(1/2) (b,) of the map of straight triangles; 1 on those."""
    found, bent = np.ones(len(at)), np.flatnonzero(cells.curved[at])
    if bent.size:
        corners = cells.corners[at[bent]]
        away, along = x[bent, 0] - corners[:, None, 0], slope[bent, 0]
        chord = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 1]], axis=-1)
        t = np.linspace(0, 1, SEEN)
        # away = D (straight away), along = D chord: D depends on t alone.
        straight = np.empty((len(bent), SEEN, 2, 2))
        straight[..., 0] = chord[:, None, :, 0] + t[:, None] * chord[:, None, :, 1]
        straight[..., 1] = chord[:, None, :, 1]
        D = np.stack([away, along], axis=-1) @ np.linalg.inv(straight)
        size, det = np.linalg.norm(D, 2, axis=(2, 3)).max(axis=1), np.linalg.det(D)
        found[bent] = size * np.sqrt(det.max(axis=1) / np.maximum(det.min(axis=1), 1e-300))
    return found
