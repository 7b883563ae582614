"""Oscillation: data that an equilibrated stress misses, and their largest share of the energy.

Constants of Poincare (Payne, Weinberger 1960, Arch. Rational Mech. Anal. 5:286; Bebendorf 2003), of
Korn (Costabel, Dauge 2015, Arch. Rational Mech. Anal. 217:873, theorem 2.3) and of traces are known
for each triangle; docs/bounds.md has the proof. Extrema on curves are taken over points.

Where F is no polynomial s balances a projection. On a straight triangle T where that counts,
the stress t of `traction_free` balances more of F: on the whole of T, or on parts of it and of
these. s + t stands for s on T, with what it misses itself; both have the same resultants, for the
rules on T are those on its parts.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index
from ...fem import elastic_strain
from ...problem import Problem
from .body_forces import PART_DEGREE, PART_ORDER
from .cells import Cells, Places, located
from .elements import Element, Multipliers, Stress, by_triangle, compliance_at
from .polynomials import edges, scalars
from .traction_free import (
    DIVISION,
    balancing_stress,
    basis,
    composite,
    fit,
    free_stress,
    parts,
    restriction,
    up_to,
)

EQUILIBRIUM_RESIDUAL = 1e-10  # residual of equilibrium, relative to the largest stress
POINTS_ON_SIDE = 17  # points on each side
# Shares of corners in places at which the middle of both balls is sought, beside the incentre.
BALL_CENTRES = np.array([(i, j, 8 - i - j) for i in range(1, 8) for j in range(1, 8 - i)]) / 8
RAISED_DEGREES = 3  # above the order of displacements: forces on whole triangles
NEGLIGIBLE_SHARE = 0.02  # of |s - sigma_h|^2: so much may be added by data not balanced again
TRIANGLES_AT_ONCE = 200  # triangles


class Oscillation(NamedTuple):
    """Norms of the stress that balances what a stress misses of the data of n triangles."""

    unit: Array  # (n,) that for a body force of norm 1, times the measure
    forces: Array  # (n,) for what is missed of body forces
    tractions: Array  # (n,) for what is missed of tractions


def oscillation_norms(cells: Cells, elements: Sequence[Element], tractions: Array) -> Oscillation:
    """Norms D_T of a stress that balances what s misses of body forces and tractions.

    `tractions` (n, 3) are L2 norms on the sides, orthogonal to rigid motions, times the measure.

    Raises
    ------
    ValueError
        Something is missed at the axis, where the measure is 0.
    """
    forces = by_triangle(elements, [e.missed for e in elements])
    least = by_triangle(elements, [e.modulus for e in elements])
    unit, of_tractions = np.zeros((2, len(forces)))
    some = (forces > 0) | (tractions > 0).any(axis=1)
    for points in (2, POINTS_ON_SIDE):  # on straight sides extrema are at ends
        at = np.flatnonzero(some & (cells.curved == (points > 2)))
        known = _constants(cells, at, points)
        if (known.measure <= 0).any():
            raise ValueError(
                "no guaranteed bound is known for loads that are no polynomials at the axis; use "
                "error_estimate"
            )
        scale = known.korn / np.sqrt(least[at] * known.measure)
        unit[at] = known.poincare * scale
        of_tractions[at] = (known.trace * tractions[at]).sum(axis=1) * scale
    return Oscillation(unit, unit * forces, of_tractions)


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


class Division(NamedTuple):
    """Triangles in n^2 parts, and polynomials on these."""

    n: int
    degree: int  # of stresses
    force_degree: int  # of forces that they balance
    order: int  # of the rule for forces


class Parts(NamedTuple):
    """b triangles, or parts of such, with polynomials of m coefficients."""

    at: Index  # (b,) the triangles that they are parts of
    origin: Array  # (b, 2) places (a, b) of their own (0, 0) in these
    scale: Array  # (b,) of their (a, b)
    stress: Array  # (b, m, 3)
    force: Array  # (b, m, 2) what the stress balances

    def some(self, which: Index) -> Parts:
        """Those `which` (r,) alone."""
        return Parts(**{name: x[which] for name, x in self._asdict().items()})

    def edges(self, cells: Cells) -> Array:
        """E (b, 2, 2), lengths, of their own (a, b)."""
        return edges(cells.corners[self.at]) * self.scale[:, None, None]

    def places(self, cells: Cells, x: Array, w: Array) -> Places:
        """Places of a rule with points `x` (q, 2) and weights `w` (q,) in each."""
        local = self.origin[:, None] + self.scale[:, None, None] * x
        found = located(cells, self.at, local, w)
        return replace(found, weight=found.weight * self.scale[:, None] ** 2)


@dataclass(frozen=True, eq=False)
class Remainders:
    """What polynomials miss of a body force on straight triangles of the plane, balanced."""

    problem: Problem
    cells: Cells
    displacement: ng.CoefficientFunction  # u_h
    element: Element  # the triangles
    s: Stress
    unit: Array  # (n,) as of `Oscillation`

    def whole(self, at: Index, degree: int) -> Parts:
        """Triangles `at` (b,) with s and what it balances, polynomials of a `degree`."""
        e, rule = self.element, composite(0, 2 * degree)
        zero, one = np.zeros((len(at), 2)), np.ones(len(at))
        found = Parts(at, zero, one, np.empty(0), np.empty(0))
        x, take = found.places(self.cells, *rule).x, fit(degree, 0, 2 * degree)
        some = e.among(at)[1]
        force = scalars(e.force_degree, e.corners[some], x) @ e.force[some]
        return found._replace(stress=take @ self.s.values(at, x), force=take @ force)

    def norms(self, whole: Parts, own: Division, depth: int, limit: float) -> tuple[Array, Array]:
        """|s + t - sigma_h| and D_T (b,) each, with t as of `Division`.

        Forces are integrated on triangles that are divided `depth` times. What D_T add to the
        squared norms beyond a `limit` is balanced on parts of parts.
        """
        b, inner = len(whole.at), depth - (own.n > 1)
        part, missed = self.balanced(whole, own, inner)
        loads = self.unit[part.at] * np.abs(part.scale) * missed
        distance = self.distances(part, own)
        again = that_count(distance, loads, limit) if inner else np.zeros(0, dtype=np.intp)
        if again.size:
            both = self.norms(part.some(again), own, inner, limit)
            better = both[0] + both[1] < distance[again] + loads[again]
            for old, new in zip((distance, loads), both, strict=True):
                old[again[better]] = new[better]
        one, two = (np.linalg.norm(x.reshape(b, -1), axis=1) for x in (distance, loads))
        return one, two

    def balanced(self, whole: Parts, own: Division, inner: int) -> tuple[Parts, Array]:
        """The parts with s + t and what it balances, and norms (k,) of what that misses of F.

        Forces are integrated on parts that are divided `inner` times.
        """
        b, m, (origin, scale) = len(whole.at), own.degree, parts(own.n)
        k, take = b * len(scale), restriction(own.n, m)
        part = Parts(
            np.repeat(whole.at, len(scale)),
            (whole.origin[:, None] + whole.scale[:, None, None] * origin).reshape(-1, 2),
            (whole.scale[:, None] * scale).ravel(),
            (take @ whole.stress[:, None]).reshape(k, -1, 3),
            (take @ whole.force[:, None]).reshape(k, -1, 2),
        )
        rule, E = composite(inner, own.order), whole.edges(self.cells)
        points = part.places(self.cells, *rule)
        P, F = basis(m, rule[0]), points.evaluate(self.cells, self.element.source)
        rest = fit(own.force_degree, inner, own.order) @ (F - P @ part.force)
        on_reference = (rest.reshape(b, -1, 2) @ np.linalg.inv(E).swapaxes(1, 2)).reshape(b, -1)
        by_force = balancing_stress(own.n, own.force_degree, m).reshape(-1, on_reference.shape[1])
        t = mapped(E, (on_reference @ by_force.T).reshape(b, -1, 3)).reshape(k, -1, 3)
        part.force[:, up_to(own.force_degree, m)] += rest
        part.stress[:] += t
        square = ((F - P @ part.force) ** 2).sum(axis=2)
        return part, np.sqrt((points.weight * square).sum(axis=1))

    def distances(self, part: Parts, own: Division) -> Array:
        """Distances (b,) of stresses from that of u_h, on whole triangles of the nearest ones.

        They differ by stresses without tractions and divergence.
        """
        m, rule = own.degree, composite(0, 2 * own.degree)
        points, P = part.places(self.cells, *rule), basis(m, rule[0])
        compliance = compliance_at(self.problem, self.cells, points)
        strain = points.evaluate(self.cells, elastic_strain(self.problem, self.displacement))
        strain -= (compliance @ (P @ part.stress)[..., None])[..., 0]
        if own.n == 1:
            free = np.moveaxis(free_stress(m), 2, 0).reshape(-1, 3)
            free = mapped(part.edges(self.cells), free).reshape(len(strain), -1, *P.T.shape[:1], 3)
            free = P @ free  # (b, r, q, 3)
            strains = (compliance[:, None] @ free[..., None])[..., 0]
            weighted = (points.weight[:, None, :, None] * free).reshape(*free.shape[:2], -1)
            products = weighted @ strains.reshape(weighted.shape).swapaxes(1, 2)
            c = np.linalg.solve(products, weighted @ strain.reshape(len(strain), -1, 1))
            strain -= (c[..., None] * strains).sum(axis=1)
        square = ((np.linalg.inv(compliance) @ strain[..., None])[..., 0] * strain).sum(axis=2)
        return np.asarray(np.sqrt((points.weight * square).sum(axis=1)))


def mapped(E: Array, t: Array) -> Array:
    """Stresses E t E' (b, j, 3) by edges `E` (b, 2, 2) from `t` (b, j, 3) or (j, 3)."""
    E = E[:, None]
    t = E @ t[..., np.array([[0, 2], [2, 1]])] @ E.swapaxes(2, 3)
    return np.asarray(t[..., [0, 1, 0], [0, 1, 1]])


def that_count(distance: Array, loads: Array, limit: float) -> Index:
    """Numbers (r,) of the largest `loads` (n,), without which a `limit` holds.

    It is what loads may add to the squares of each `distance` (n,), all together.
    """
    lost = (distance + loads) ** 2 - distance**2
    order = np.argsort(lost)
    return np.sort(order[np.cumsum(lost[order]) > limit])


def balanced_again(
    problem: Problem,
    cells: Cells,
    displacement: ng.CoefficientFunction,
    s: Stress,
    missed: Oscillation,
) -> tuple[Array, Array]:
    """Distances from sigma_h, and D_T, (n,) each, of s + t with t as of `traction_free`.

    On straight triangles of the plane where forces count, and the better one of s and s + t.
    """
    distance, _ = s.norms()
    loads = missed.forces.copy()
    limit = NEGLIGIBLE_SHARE * float(distance @ distance)
    counts = that_count(distance, loads + missed.tractions, limit)
    counts = counts[~cells.curved[counts] & (loads[counts] > 0)]
    p = cells.trace.order
    for e in s.elements if cells.trace.model.extent == 0 else ():
        view = Remainders(problem, cells, displacement, e, s, missed.unit)
        mine, some = e.among(counts)
        for depth in np.unique(e.depth[some]).tolist():
            m = p + RAISED_DEGREES
            own = Division(1, m + 2, m, 2 * m + 2)
            if depth:
                own = Division(DIVISION, max(p + 1, PART_DEGREE + 2), PART_DEGREE, PART_ORDER)
            every = counts[mine[e.depth[some] == depth]]
            for at in np.array_split(every, -(-len(every) // TRIANGLES_AT_ONCE)):
                whole = view.whole(at, own.degree)
                one, two = view.norms(whole, own, depth, limit * len(at) / len(counts))
                better = one + two < distance[at] + loads[at]
                distance[at[better]], loads[at[better]] = one[better], two[better]
    return distance, loads + missed.tractions


def residuals(cells: Cells, mu: Multipliers, left: Array, largest: float) -> Array:
    """The largest unbalanced moment, of `left` (d,), on the sides of each triangle, (n,).

    It is dimensionless: over the diameter of the side's owner, the measure, the `largest` stress.
    """
    middle = cells.vertices[cells.ends].mean(axis=1)
    size = cells.diameters[cells.owner] * cells.trace.model.measure(middle) * (largest or 1.0)
    force = np.maximum.reduceat(np.abs(left), mu.start[:-1])
    return np.divide(force, size, out=np.zeros_like(size), where=size > 0)[cells.sides].max(axis=1)
