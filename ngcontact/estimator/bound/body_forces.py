"""Body forces on triangles as polynomials: on parts of triangles where they are none."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...problem import Problem, numbers
from ...quadrature import SampledElements, features_of, narrow_forces, where_features_are
from .cells import Cells, places
from .polynomials import projected, scalars
from .traction_free import DIVISION, basis, composite, fit

DIVISIONS = 2  # how often triangles are divided
PART_ORDER = 6  # of the rules on parts
SMOOTH_FORCE = 1e-4  # of the largest force: what polynomials miss where triangles are not divided
PART_DEGREE = 3  # of polynomials on parts
FORCES_AT_ONCE = 100  # triangles with forces that are no numbers


@dataclass(frozen=True, eq=False)
class ForceRules:
    """How body forces are integrated on n triangles: on parts where they are no polynomials."""

    thresholds: dict[ng.CoefficientFunction, float]  # root mean square that may be missed, by force
    degree: int  # of the polynomials that miss it on whole triangles
    least: Index  # (n,) how often triangles are divided at least, to see narrow forces


def force_rules(problem: Problem, cells: Cells, degree: int) -> ForceRules:
    """The rules for polynomials of a `degree` on whole triangles."""
    mesh, least = cells.trace.mesh, np.zeros(len(cells.triangles), dtype=np.intp)
    thresholds = {}
    for pattern, F in problem.force.items():
        at = np.flatnonzero(np.array(mesh.Materials(pattern).Mask())[cells.bodies])
        thresholds[F] = np.inf
        if not numbers(F):
            middles = cells.evaluate(F, at, np.full((len(at), 2), 1 / 3))
            thresholds[F] = SMOOTH_FORCE * float(np.linalg.norm(middles, axis=1).max(initial=0.0))
    if not all(np.isinf(x) for x in thresholds.values()):
        least[cells.curved | narrow_forces(problem, mesh, cells.trace.order)[cells.parent]] = 1
        narrow = np.zeros(mesh.ne, dtype=bool)
        for one in features_of(problem, mesh):
            if one.kind == "force" and len(one.places):
                view = SampledElements(mesh, 2)
                at, feature = where_features_are(one.spots, view, np.arange(mesh.ne))
                narrow[at[view.sizes[at] > DIVISION * one.widths[feature]]] = True
        least[narrow[cells.parent]] = DIVISIONS
    return ForceRules(thresholds, degree, least)


class Projection(NamedTuple):
    """Polynomials of m coefficients near to a force F in b triangles."""

    coefficients: Array  # (b, m, 2) as of `scalars`
    missed: Array  # (b,) L2 norms of what they miss, times the measure; axially about an axis
    size: Array  # (b,) those of F
    depth: Index  # (b,) how often triangles are divided to integrate F


def projection(
    F: ng.CoefficientFunction, cells: Cells, at: Index, degree: int, rules: ForceRules
) -> Projection:
    """Polynomials near to a force F in triangles `at` (b,), all straight or all curved."""
    if len(at) > FORCES_AT_ONCE and np.isfinite(rules.thresholds[F]):
        some = np.array_split(at, 1 + len(at) // FORCES_AT_ONCE)
        every = (projection(F, cells, x, degree, rules) for x in some)
        return Projection(*map(np.concatenate, zip(*every, strict=True)))
    found = np.zeros((len(at), (degree + 1) * (degree + 2) // 2, 2))
    norms, depths, left = np.zeros((2, len(at))), rules.least[at].copy(), np.arange(len(at))
    axial = int(cells.trace.model.extent)
    for depth in range(DIVISIONS + 1):
        own = left[depths[left] == depth]
        if own.size == 0:
            continue
        points = places(cells, at[own], PART_ORDER if depth else 2 * rules.degree + 2, depth)
        values, x, weight = points.evaluate(cells, F), points.x, points.weight
        if depth < DIVISIONS and not cells.curved[at[0]]:
            rough = _rough(values, depth, rules.degree, rules.thresholds[F])
            depths[own[rough]] += 1
            own, values, x, weight = (each[~rough] for each in (own, values, x, weight))
        P = scalars(degree, cells.corners[at[own]], x)
        found[own] = projected(P, weight, values)
        weight = (weight * cells.measure(x))[..., None]
        for k, f in enumerate((values, values - P @ found[own])):
            norms[k, own] = np.sqrt((weight * f[..., axial:] ** 2).sum(axis=(1, 2)))
    return Projection(found, norms[1], norms[0], depths)


def _rough(values: Array, depth: int, degree: int, threshold: float) -> Mask:
    """Where forces (b, q, 2) at points on parts miss polynomials on some part by a threshold."""
    order = PART_ORDER if depth else 2 * degree + 2
    x, w = composite(0, order)
    k = PART_DEGREE if depth else degree
    own = values.reshape(len(values), -1, len(w), 2)
    rest = own - basis(k, x) @ (fit(k, 0, order) @ own)
    square = 2 * (rest**2).sum(axis=3) @ w
    return np.asarray((square > threshold**2).any(axis=1))
