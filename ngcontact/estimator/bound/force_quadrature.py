"""Triangles in parts, islands of a mesh of their own, on which data are looked at closely."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...problem import Problem, numbers
from ...quadrature import SampledElements, features_of, narrow_forces, where_features_are
from .cells import Cells, joined, places
from .polynomials import projected, scalars

PARTS_OF_A_SIDE = 4  # of each side
DIVISIONS = 2  # how often triangles are divided
SMOOTH_FORCE = 1e-3  # of the largest force: what polynomials miss where triangles are not divided
POLYNOMIAL_FORCE = 1e-8  # of that: what is missed of polynomials by round-off
CURVED_FACTOR = 2  # times the order of rules along curves, for polynomials in x
FINER_DEGREES = 4  # degrees by which rules on triangles are above those on their parts
LEAST_DEGREE = 3  # degree of stresses on parts: lower ones do not meet all tractions
FORCES_AT_ONCE = 100  # triangles with forces that are no numbers


@lru_cache
def pattern(thirds: bool) -> tuple[Array, Index]:
    """Vertices (p, 3) and corners (k, 3) of the equal parts of a triangle, anticlockwise.

    Vertices are barycentric. Parts at the triangle's corners are divided in `thirds` where given
    tractions may be those of no symmetric stress.
    """
    at = [(i, j) for i in range(PARTS_OF_A_SIDE + 1) for j in range(PARTS_OF_A_SIDE + 1 - i)]
    shares = np.array([(PARTS_OF_A_SIDE - i - j, i, j) for i, j in at]) / PARTS_OF_A_SIDE
    up = [[(i, j), (i + 1, j), (i, j + 1)] for i, j in at if i + j < PARTS_OF_A_SIDE]
    down = [[(i + 1, j), (i + 1, j + 1), (i, j + 1)] for i, j in at if i + j < PARTS_OF_A_SIDE - 1]
    corners = np.array([[at.index(v) for v in part] for part in up + down])
    if thirds:
        three, each = (shares[corners] == 1).any(axis=(1, 2)), np.arange(3)
        parts = np.repeat(corners[three, None], 3, axis=1)
        parts[:, each, each] = len(shares) + each[:, None]
        shares = np.concatenate([shares, shares[corners[three]].mean(axis=1)])
        corners = np.concatenate([corners[~three], parts.reshape(-1, 3)])
    return shares, corners


@dataclass(frozen=True, eq=False)
class ForceQuadrature:
    """Quadrature of body forces on n triangles, in parts where they are no polynomials.

    The rule on a triangle is that on its parts, so that resultants are the same.
    """

    thresholds: list[float]  # for each of `Problem.force`, root mean square that may be missed
    degree: int  # of the polynomials that miss it
    levels: int  # how often triangles may be divided
    lowest: int  # order of rules where they may not
    least: Index  # (n,) how often they are at least, to see narrow forces
    # (n,) how often they are balanced in parts to follow tractions and curves, whose resultants
    # have to be those on the whole: forces that are no polynomials are integrated on parts
    followed: Index
    thirds: Mask  # (n,) whether parts at corners are in thirds, as of `pattern`

    @property
    def order(self) -> int:
        """Order of the rules on triangles that are not divided."""
        return self.lowest + FINER_DEGREES * self.levels

    def divided(
        self, cells: Cells, at: Index, thirds: bool | None
    ) -> tuple[Cells, ForceQuadrature]:
        """Triangles `at` (b,) of cells in the parts of `pattern`, each with vertices of its own.

        And the rules on the parts. Where `thirds` is None each triangle is its only part.
        """
        whole = thirds is None
        shares, corners = (np.eye(3), np.arange(3)[None]) if whole else pattern(bool(thirds))
        p, k = len(shares), len(corners)
        parts = joined(
            cells.trace,
            cells.image(at, shares[:, [2, 0]])[0].reshape(-1, 2),
            (corners + p * np.arange(len(at))[:, None, None]).reshape(-1, 3),
            (shares @ cells.barycentric[at])[:, corners].reshape(-1, 3, 3),
            np.repeat(cells.parent[at], k),
        )
        least, followed = (
            np.repeat(np.maximum(x[at] - (not whole), 0), k) for x in (self.least, self.followed)
        )
        third, levels = np.repeat(self.thirds[at], k), self.levels - (not whole)
        return parts, replace(self, levels=levels, least=least, followed=followed, thirds=third)


def force_quadrature(
    problem: Problem, cells: Cells, degree: int, followed: Index
) -> ForceQuadrature:
    """The rules for stresses of a `degree`; `followed` (n,) as of `ForceQuadrature`."""
    mesh, thresholds, least = cells.trace.mesh, [], np.zeros(len(cells.triangles), dtype=np.intp)
    for pattern, F in problem.force.items():
        at = np.flatnonzero(np.array(mesh.Materials(pattern).Mask())[cells.bodies])
        thresholds.append(np.inf)
        if not numbers(F):
            middles = cells.evaluate(F, at, np.full((len(at), 2), 1 / 3))
            thresholds[-1] = SMOOTH_FORCE * float(np.linalg.norm(middles, axis=1).max(initial=0.0))
    if not all(np.isinf(thresholds)):
        least[narrow_forces(problem, mesh, cells.trace.order)[cells.parent]] = 1
        narrow = np.zeros(mesh.ne, dtype=bool)
        for one in features_of(problem, mesh):
            if one.kind == "force" and len(one.places):
                view = SampledElements(mesh, 2)
                at, feature = where_features_are(one.spots, view, np.arange(mesh.ne))
                narrow[at[view.sizes[at] > PARTS_OF_A_SIDE * one.widths[feature]]] = True
        least[narrow[cells.parent]] = DIVISIONS
    n = max(0, degree - 1 - cells.trace.model.extent)
    order = 2 * max(degree, LEAST_DEGREE) + 2
    return ForceQuadrature(thresholds, n, DIVISIONS, order, least, followed, followed > 0)


class Samples(NamedTuple):
    """A force in k triangles or parts of such, q points in each."""

    of: Index  # (k,) numbers of the triangles
    x: Array  # (k, q, 2)
    weight: Array  # (k, q)
    values: Array  # (k, q, 2)


def _samples(
    F: ng.CoefficientFunction, cells: Cells, at: Index, rules: ForceQuadrature, threshold: float
) -> Iterator[Samples]:
    """Samples in triangles `at` (b,), numbered from 0; an infinite `threshold` says: numbers."""
    axial = int(cells.trace.model.extent)
    for bent, third in np.ndindex(2, 2):
        own = np.flatnonzero((cells.curved[at] == bent) & (rules.thirds[at] == third))
        if own.size == 0:
            continue
        points = places(cells, at[own], rules.order + bent, CURVED_FACTOR * rules.order)
        weight, values = points.weight, points.evaluate(cells, F)
        rough = np.zeros(len(own), dtype=bool)
        if rules.levels and np.isfinite(threshold):
            P = scalars(rules.degree, cells.corners[at[own]], points.x)
            rest = (values - P @ projected(P, weight, values))[..., axial:]
            square = (weight * (rest**2).sum(axis=2)).sum(axis=1)
            limit = np.where(rules.followed[at[own]] > 0, POLYNOMIAL_FORCE, 1.0) * threshold
            rough = (square > limit**2 * weight.sum(axis=1)) | (rules.least[at[own]] > 0)
        if not rough.all():
            yield Samples(own[~rough], points.x[~rough], weight[~rough], values[~rough])
        if rough.any():
            parts, finer = rules.divided(cells, at[own[rough]], bool(third))
            every = np.arange(len(parts.triangles))
            whole = np.repeat(own[rough], len(every) // rough.sum())
            for inner in _samples(F, parts, every, finer, threshold):
                yield inner._replace(of=whole[inner.of])


class Projection(NamedTuple):
    """Polynomials of m coefficients near to a force F in b triangles."""

    coefficients: Array  # (b, m, 2) as of `scalars`
    missed: Array  # (b,) L2 norms of what they miss, times the measure; axially about an axis
    size: Array  # (b,) those of F
    pieces: Index  # (b,) on how many parts F is integrated


def projection(
    F: ng.CoefficientFunction,
    cells: Cells,
    at: Index,
    degree: int,
    rules: ForceQuadrature,
    threshold: float,
) -> Projection:
    """Polynomials near to a force F in triangles `at` (b,), of a `degree`."""
    if len(at) > FORCES_AT_ONCE and np.isfinite(threshold):
        some = np.array_split(at, 1 + len(at) // FORCES_AT_ONCE)
        every = (projection(F, cells, x, degree, rules, threshold) for x in some)
        return Projection(*map(np.concatenate, zip(*every, strict=True)))
    corners, b, m = cells.corners[at], len(at), (degree + 1) * (degree + 2) // 2
    samples = list(_samples(F, cells, at, rules, threshold))
    bases = [scalars(degree, corners[s.of], s.x) for s in samples]
    measures = [s.weight * cells.measure(s.x) for s in samples]
    mass, found, norms = np.zeros((b, m, m)), np.zeros((b, m, 2)), np.zeros((3, b))
    for s, P in zip(samples, bases, strict=True):
        np.add.at(mass, s.of, (P.swapaxes(1, 2) * s.weight[:, None]) @ P)
    for turn in range(3):  # without a projection, with one, with that corrected for round-off
        right = np.zeros_like(found)
        for s, P, measure in zip(samples, bases, measures, strict=True):
            rest = s.values - P @ found[s.of]
            np.add.at(right, s.of, P.swapaxes(1, 2) @ (s.weight[..., None] * rest))
            axial = rest[..., int(cells.trace.model.extent) :]
            np.add.at(norms[turn], s.of, (measure * (axial**2).sum(axis=2)).sum(axis=1))
        found = found + np.linalg.solve(mass, right) if turn < 2 else found
    count = np.bincount(np.concatenate([s.of for s in samples]), minlength=b)
    size, _, rest = np.sqrt(norms)
    return Projection(found, rest, size, count)
