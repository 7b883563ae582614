"""Oscillation: data that an equilibrated stress misses, and their largest share of the energy.

Constants of Poincare (Payne, Weinberger 1960, Arch. Rational Mech. Anal. 5:286; Bebendorf 2003), of
Korn (Costabel, Dauge 2015, Arch. Rational Mech. Anal. 217:873, theorem 2.3) and of traces are known
for each triangle; docs/bounds.md has the proof. Extrema on curves are taken over points.
"""

from __future__ import annotations

import math

import numpy as np

from ...arrays import Array, Index
from .cells import Cells
from .elements import Multipliers
from .polynomials import edges

EQUILIBRIUM_RESIDUAL = 1e-10  # residual of equilibrium, relative to the largest stress
POINTS_ON_SIDE = 17  # points on each side
# Shares of corners in places at which the middle of both balls is sought, beside the incentre.
BALL_CENTRES = np.array([(i, j, 8 - i - j) for i in range(1, 8) for j in range(1, 8 - i)]) / 8


def oscillation_norms(cells: Cells, forces: Array, moduli: Array, tractions: Array) -> Array:
    """Norms D_T (n,) of a stress that balances what s misses of body forces and tractions.

    `forces` (n,) and `tractions` (n, 3) are L2 norms, on the sides, orthogonal to rigid motions,
    times the measure; `moduli` (n,) are as of `Element.modulus`. Infinite where something is missed
    at the axis, where the measure is 0.
    """
    found = np.zeros(len(forces))
    some = (forces > 0) | (tractions > 0).any(axis=1)
    for points in (2, POINTS_ON_SIDE):  # on straight sides extrema are at ends
        at = np.flatnonzero(some & (cells.curved == (points > 2)))
        poincare, trace, korn, measure = _constants(cells, at, points)
        total = korn * (poincare * forces[at] + (trace * tractions[at]).sum(axis=1))
        size = np.sqrt(moduli[at] * measure)
        found[at] = np.divide(total, size, out=np.full(len(at), np.inf), where=size > 0)
    return found


def _constants(cells: Cells, at: Index, points: int) -> tuple[Array, ...]:
    """Constants of triangles `at` (b,), of which sides are looked at in that many `points`.

    For |grad w| = 1, of Poincare (b,) and traces (b, 3); of Korn (b,); the least measure (b,).
    """
    corners, t = cells.corners[at], np.linspace(0, 1, points)
    x, slope = cells.around(at[:, None], np.arange(3), t)
    normal = np.stack([slope[..., 1], -slope[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    opposite = cells.lengths[cells.sides[at]]
    ratio, tiny = np.zeros(len(at)), np.finfo(float).tiny
    for share in [opposite / opposite.sum(axis=1, keepdims=True), *BALL_CENTRES]:
        away = x - (share[..., None] * corners).sum(axis=1)[:, None, None]
        rho = (away * normal).sum(axis=-1).min(axis=(1, 2))
        ratio = np.maximum(ratio, rho / np.linalg.norm(away, axis=-1).max(axis=(1, 2)))
    ratio = np.maximum(ratio, tiny)
    beta = ratio / math.sqrt(2) / np.sqrt(1 + np.sqrt(1 - ratio**2))
    # The map of the straight triangle: its derivatives D depend on t alone.
    D = cells.image(at, np.column_stack([t, 0 * t]))[1] @ np.linalg.inv(edges(corners))[:, None]
    size, det = np.linalg.norm(D, 2, axis=(2, 3)).max(axis=1), np.linalg.det(D)
    distortion = size * np.sqrt(det.max(axis=1) / np.maximum(det.min(axis=1), tiny))
    poincare = cells.diameters[at] / math.pi * distortion
    away = x - corners[:, :, None]
    least = np.maximum((away * normal).sum(axis=-1).min(axis=-1), tiny)
    far, p = np.linalg.norm(away, axis=-1).max(axis=-1), poincare[:, None]
    measure = cells.trace.model.measure(x.reshape(-1, 2)).reshape(len(at), 3 * points).min(axis=1)
    trace = np.sqrt(2 * (p**2 + far * p) / least)
    return poincare, trace, np.sqrt(1 + 2 / beta**2), measure


def residuals(cells: Cells, mu: Multipliers, left: Array, largest: float) -> Array:
    """The largest unbalanced moment, of `left` (d,), on the sides of each triangle, (n,).

    It is dimensionless: over the diameter of the side's owner, the measure, the `largest` stress.
    """
    middle = cells.vertices[cells.ends].mean(axis=1)
    size = cells.diameters[cells.owner] * cells.trace.model.measure(middle) * (largest or 1.0)
    force = np.maximum.reduceat(np.abs(left), mu.start[:-1])
    return np.divide(force, size, out=np.zeros_like(size), where=size > 0)[cells.sides].max(axis=1)
