"""Oscillation: data that an equilibrated stress misses, and their largest share of the energy.

Constants of Poincare (Payne, Weinberger 1960, Arch. Rational Mech. Anal. 5:286; Bebendorf 2003), of
Korn (Costabel, Dauge 2015, Arch. Rational Mech. Anal. 217:873, theorem 2.3) and of traces are known
for each triangle; docs/bounds.md has the proof. Extrema on curves are taken over points.

Where F or P are no polynomials s balances projections of them. On a triangle T where that counts,
the stress s' nearest to sigma_h with the tractions of s on inner sides and on Gamma_u, with P and
p* on the others, and -div s' = F, is sought of a higher degree, or on parts of T, where again F and
P are met in projections. s' may stand for s on T, with what it misses itself; both have the same
resultants, for the rules on T are those on its parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from .cells import Cells
from .elements import Element, Multipliers, Stress, by_triangle, elements_of
from .force_quadrature import LEAST_DEGREE, PARTS_OF_A_SIDE, ForceQuadrature
from .polynomials import edges
from .program import dual_program
from .tractions import BoundaryData, side_rule

EQUILIBRIUM_RESIDUAL = 1e-10  # residual of equilibrium, relative to the largest stress
POINTS_ON_SIDE = 17  # points on each side
# Shares of corners in places at which the middle of both balls is sought, beside the incentre.
BALL_CENTRES = np.array([(i, j, 8 - i - j) for i in range(1, 8) for j in range(1, 8 - i)]) / 8
RAISED_DEGREES = 3  # degrees of stresses on whole triangles, as long as forces are smooth there
NEGLIGIBLE_SHARE = 0.02  # of |s - sigma_h|^2: so much may be added by data not balanced again
TRIANGLES_AT_ONCE = 200  # triangles


def oscillation_norms(cells: Cells, elements: Sequence[Element], tractions: Array) -> Array:
    """Norms D_T (n,) of a stress that balances what s misses of body forces and tractions.

    `tractions` (n, 3) are L2 norms on the sides, orthogonal to rigid motions, times the measure.

    Raises
    ------
    ValueError
        Something is missed at the axis, where the measure is 0.
    """
    forces = by_triangle(elements, [e.missed for e in elements])
    least = by_triangle(elements, [e.modulus for e in elements])
    found = np.zeros(len(forces))
    some = (forces > 0) | (tractions > 0).any(axis=1)
    for points in (2, POINTS_ON_SIDE):  # on straight sides extrema are at ends
        at = np.flatnonzero(some & (cells.curved == (points > 2)))
        known = _constants(cells, at, points)
        if (known.measure <= 0).any():
            raise ValueError(
                "no guaranteed bound is known for loads that are no polynomials at the axis; use "
                "error_estimate"
            )
        total = known.poincare * forces[at] + (known.trace * tractions[at]).sum(axis=1)
        found[at] = known.korn * total / np.sqrt(least[at] * known.measure)
    return found


class Constants(NamedTuple):
    """Constants of b triangles, for |grad w| = 1."""

    poincare: Array  # (b,)
    korn: Array  # (b,)
    trace: Array  # (b, 3)
    measure: Array  # (b,) the model's least


def _constants(cells: Cells, at: Index, points: int) -> Constants:
    """Constants of triangles `at` (b,), of which sides are looked at in that many `points`."""
    corners, t = cells.corners[at], np.linspace(0, 1, points)
    x, slope = cells.around(at[:, None], np.arange(3), t)
    normal = np.stack([slope[..., 1], -slope[..., 0]], axis=-1)
    normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
    opposite = np.linalg.norm(np.roll(corners, -1, 1) - np.roll(corners, -2, 1), axis=2)
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
    return Constants(poincare, np.sqrt(1 + 2 / beta**2), trace, measure)


@dataclass(frozen=True, eq=False)
class BalancedCells:
    """A stress on n triangles of cells, in equilibrium with what `rules` see of forces."""

    cells: Cells
    s: Stress
    rules: ForceQuadrature
    distance: Array  # (n,) |s - sigma_h|
    loads: Array  # (n,) norms of what s misses of the data


def balanced_again(
    displacement: ng.CoefficientFunction,
    given: BoundaryData,
    level: BalancedCells,
    degree: int,
    scale: float,
    allowed: float | None = None,
) -> tuple[Array, Array]:
    """Distances and loads, (n,) each as of `level`, of the better stress on each triangle.

    Stresses are of a `degree` on straight triangles; residuals are relative to the largest one,
    `scale`. Data may add what is `allowed` to B^2; by default a share of |s - sigma_h|^2.
    """
    c, D, rules = level.distance.copy(), level.loads.copy(), level.rules
    limit = NEGLIGIBLE_SHARE * float(c @ c) if allowed is None else allowed
    pieces = by_triangle(level.s.elements, [e.pieces for e in level.s.elements])
    for third in (None, False, True):  # whole triangles, their parts
        lost = (c + D) ** 2 - c**2
        order = np.argsort(lost)
        counts = np.sort(order[np.cumsum(lost[order]) > limit])
        smooth, divided = pieces < PARTS_OF_A_SIDE**2, (pieces > 1) & (rules.thirds == third)
        fits = smooth if third is None else divided
        some = counts[fits[counts]]
        for at in np.array_split(some, -(-len(some) // TRIANGLES_AT_ONCE)) if len(some) else ():
            parts, finer = rules.divided(level.cells, at, third)
            own = degree + RAISED_DEGREES if third is None else max(degree, LEAST_DEGREE)
            k = len(parts.triangles) // len(at)
            mu, elements = elements_of(given.problem, parts, displacement, own, finer)
            rule = side_rule(parts, given.breaks, np.flatnonzero(~parts.inner))
            owner = parts.owner[rule.side]
            whole = level.s.tractions(at[owner // k], rule.x, rule.normal)
            wanted = given.tractions(parts, rule, whole)
            moments = rule.moments(mu, wanted)
            free, motions = np.zeros(len(moments), dtype=bool), np.zeros((len(moments), 0))
            program = dual_program(mu, elements, free, motions, [])
            s = program.nearest(elements, moments).s
            left = residuals(parts, mu, moments - s.traction_moments()[0], scale)
            have = s.tractions(owner, rule.x, rule.normal)
            loads = oscillation_norms(parts, elements, rule.missed(parts, wanted - have, scale))
            both = s.norms()[0], loads
            if finer.levels and third is not None:
                inner, share = BalancedCells(parts, s, finer, *both), len(at) / len(counts)
                both = balanced_again(displacement, given, inner, own, scale, limit * share)
            one, two = (np.linalg.norm(z.reshape(-1, k), axis=1) for z in both)
            settled = left.reshape(-1, k).max(axis=1) <= EQUILIBRIUM_RESIDUAL
            better = settled & (one + two < c[at] + D[at])
            c[at[better]], D[at[better]] = one[better], two[better]
    return c, D


def residuals(cells: Cells, mu: Multipliers, left: Array, largest: float) -> Array:
    """The largest unbalanced moment, of `left` (d,), on the sides of each triangle, (n,).

    It is dimensionless: over the diameter of the side's owner, the measure, the `largest` stress.
    """
    middle = cells.vertices[cells.ends].mean(axis=1)
    size = cells.diameters[cells.owner] * cells.trace.model.measure(middle) * (largest or 1.0)
    force = np.maximum.reduceat(np.abs(left), mu.start[:-1])
    return np.divide(force, size, out=np.zeros_like(size), where=size > 0)[cells.sides].max(axis=1)
