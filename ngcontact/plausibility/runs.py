"""Plausibility of a run: its data, and estimates that are round-off or rise from level to level.

Data are loads, laws, and supports that contradict.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, root_of_squares
from ..errors import warn
from ..fem import BoundaryTrace, boundary_trace, moduli_of, nearly_incompressible, warn_of_jumps
from ..mesh import curved_facets
from ..problem import MeshArrays, Problem
from ..quadrature import features_of, warn_of_data
from ..solved import Solved

AXES = "xyz"
# kappa / mu from which elements lock, by the order: at nu = 0.4545 errors of order 1 are 1.3 times
# those of nu = 0.3; each order more, which locks beside curves alone, bears 100 times that ratio. A
# shaft in its hub, four segments a quarter: at nu = 0.4999 the peak of order 2 is 18 % off, at
# 0.499999 58 %, of order 3 3 %.
LOCKING_RATIOS = (11.0, 1e3, 1e5, 1e7)
# Values of two supports at one corner, relative to the largest, that are two values.
SUPPORT_DIFFERENCE = 1e-6
# ... and to the largest of all values: below it is round-off.
VALUE_ROUND_OFF = 64 * np.finfo(float).eps
RISING_LEVELS = 2  # after the best one: at twice the unknowns each no mesh is still too coarse
EXACT_ESTIMATE = 1e-12  # relative estimate at which refinement stops: the solution is exact
# Estimate, relative to its terms, of bodies that do not deform; measured 4e-9.
RIGID_ESTIMATE = 1e-8
NOISE_LIMIT = 1e-4  # ... above which no round-off reaches
STRESS_NOISE = 100 * np.finfo(float).eps  # relative to its terms; measured 0.5 to 50 eps
RISE_FACTOR = 1.1  # over the best one, which is more than the noise of one level


@dataclass(frozen=True)
class Contradiction:
    """Two supports and a corner of theirs."""

    supports: tuple[str, str]  # names
    place: Array  # (d,), the corner, or a vertex of the common edge, a length
    message: str  # what they say there
    amount: float  # by how much they differ, a length


def contradictions(problem: Problem, mesh: ng.Mesh) -> list[Contradiction]:
    """All of Gamma_u with itself, within a boundary of the plane, too, and with guides."""
    found: list[Contradiction] = []
    seen = features_of(problem, mesh) if problem.dim == 2 else []
    supports = [one for one in seen if one.kind == "displacement"]
    for one in supports:
        for *place, amount in one.jumps.tolist():
            message = f'displacement "{one.name}" jumps by {amount:.6g} along {AXES[one.axis]}'
            found.append(Contradiction((one.name, one.name), np.array(place), message, amount))
    largest = max((one.largest for one in supports), default=0.0)
    names, guide = list(problem.displacement), problem.guide
    if len(names) + (guide is not None) > 1:
        trace = boundary_trace(mesh, 1)
        x = trace.arrays.vertices
        low, high, least, most = _extremes(problem, trace)
        known = high >= low
        low, high = (np.where(known, u, 0.0) for u in (low, high))
        size = np.abs(high)  # that of `low`, too, where the two are alike
        largest = max(largest, float(size.max()))
        for at in map(tuple, np.argwhere(high - low > SUPPORT_DIFFERENCE * size)):
            (i, u), (j, v) = sorted(((least[at], low[at]), (most[at], high[at])))
            message = f'displacement "{names[i]}" and "{names[j]}" prescribe {u:.6g} and {v:.6g} '
            message += f"along {AXES[at[0]]}"
            found.append(Contradiction((names[i], names[j]), x[at[1]], message, float(abs(u - v))))
        if guide is not None:
            facets = trace.segments(guide)
            facets = facets[known[:, trace.nodes[facets]].any(axis=(0, 2))]
            node, normal = trace.nodes[facets].ravel(), trace.exact_normal(*trace.at_nodes(facets))
            across = (normal * high[:, node].T).sum(axis=1)
            needed = np.abs(normal) > SUPPORT_DIFFERENCE
            led = np.abs(across) > SUPPORT_DIFFERENCE * size[:, node].max(axis=0, initial=0.0)
            for k in np.flatnonzero(led & (known[:, node].T | ~needed).all(axis=1)):
                name = names[most[needed[k].argmax(), node[k]]]
                message = f'displacement "{name}" leads {across[k]:.6g} across the guide "{guide}"'
                found.append(Contradiction((name, "guide"), x[node[k]], message, abs(across[k])))
    return [one for one in found if one.amount > VALUE_ROUND_OFF * largest]


def _extremes(problem: Problem, trace: BoundaryTrace) -> tuple[Array, Array, Index, Index]:
    """Least and largest prescribed values (d, nv) at vertices, or infinite, and their supports."""
    shape = problem.dim, trace.mesh.nv
    low, high = np.full(shape, np.inf), np.full(shape, -np.inf)
    least, most = np.zeros((2, *shape), dtype=np.intp)
    for number, (pattern, components) in enumerate(problem.displacement.items()):
        facet, s = trace.at_nodes(trace.segments(pattern))
        node = trace.nodes[trace.segments(pattern)].ravel()
        for axis, function in enumerate(components):
            if function is not None:
                u = trace.evaluate(function, facet, s)[:, 0]
                both = (low, least, np.minimum), (high, most, np.maximum)
                for extreme, support, further in both:
                    before = extreme[axis].copy()
                    further.at(extreme[axis], node, u)
                    support[axis, extreme[axis] != before] = number
    return low, high, least, most


def warn_of_implausible(
    problem: Problem, mesh: ng.Mesh, order: int, contradictory: Sequence[Contradiction]
) -> None:
    """Warn of elements that lock, loads nowhere, supports that contradict, laws that jump."""
    warn_of_locking(problem, mesh, order)
    warn_of_data(problem, mesh, order)
    warned: set[tuple[str, str]] = set()
    for one in contradictory:
        if one.supports not in warned:
            warned.add(one.supports)
            common = ("corner", "edge")[problem.dim - 2]
            where = "a point" if one.supports[0] == one.supports[1] else f"their {common}"
            place = ", ".join(f"{x:.6g}" for x in one.place)
            warn(
                f"{one.message} at {where} ({place}): the energy is infinite and no mesh resolves "
                "it; make them equal there"
            )
    warn_of_jumps(problem, mesh)


def warn_of_locking(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of every body that elements are too stiff for, above order 1 those with curved sides."""
    limit, ratio = LOCKING_RATIOS[order - 1], moduli_of(problem, mesh).ratio
    where = ""
    if order > 1 and (ratio > limit).any():
        where, beside = " beside curves", boundary_trace(mesh, 1).element[curved_facets(mesh)]
        ratio = np.where(np.isin(np.arange(mesh.ne), beside), ratio, 0.0)
    for name, value in nearly_incompressible(mesh, limit, ratio).items():
        warn(
            f'body "{name}" is nearly incompressible, lambda / mu = {value - 1:.3g}: elements of '
            f"order {order} lock{where}; use a higher order, or a smaller maxh"
        )


def at_round_off(solution: Solved, estimate: float) -> bool:
    """Whether an error estimate is round-off of terms that cancel, as where bodies move rigidly.

    Where div u cancels the terms of the stress are of size kappa |grad u|. The estimate divides
    them by the root of mu, their energy by the root of kappa only.
    """
    terms = solution.discrete.space.terms(solution.displacement)
    if estimate > NOISE_LIMIT * terms:  # as nearly always
        return False
    if estimate <= RIGID_ESTIMATE * terms and solution.energy_norm <= EXACT_ESTIMATE * terms:
        return True  # nothing deforms, and the rest is the round-off of gaps
    ratio = float(solution.moduli.ratio.max())
    return estimate <= max(EXACT_ESTIMATE, STRESS_NOISE * math.sqrt(ratio)) * terms


def estimates_rise(estimates: Sequence[float]) -> bool:
    """Whether the relative error estimates of all levels rise, for several of them already.

    The last one is the worst since the best: one that falls again, as after first meshes that are
    too coarse to see their error, is on its way.
    """
    best = int(np.argmin(estimates))
    since, last = estimates[best:], estimates[-1]
    return len(since) > RISING_LEVELS and last > RISE_FACTOR * since[0] and last == max(since)


def refinement_warning(mesh: ng.Mesh, indicators: Array, estimates: Sequence[float]) -> str:
    """Message for estimates that rise, with the place of the largest of the `indicators` (ne,)."""
    view, worst = MeshArrays(mesh), int(np.argmax(indicators))
    place = ", ".join(f"{x:.4g}" for x in view.corners[worst].mean(axis=0))
    share = float((indicators[worst] / root_of_squares(indicators)) ** 2)
    rise = ", ".join(f"{estimate:.2e}" for estimate in estimates[int(np.argmin(estimates)) :])
    return (
        f"refinement does not help: the relative error estimate rises ({rise}). The largest "
        f"indicator, {share:.0%} of the squares, is near ({place}) in body "
        f'"{mesh.GetMaterials()[view.bodies[worst]]}"; usual causes are a gap or a load that jumps '
        "or is rougher than the mesh, a prescribed displacement that jumps, and a direction of "
        "contact far from the normals"
    )
