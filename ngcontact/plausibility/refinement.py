"""Plausibility of refinement: estimates that are round-off, or rise from level to level."""

from __future__ import annotations

import math
from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ..arrays import Array, root_of_squares
from ..problem import MeshArrays
from ..solved import Solved

RISING_LEVELS = 2  # after the best one: at twice the unknowns each no mesh is still too coarse
EXACT_ESTIMATE = 1e-12  # relative estimate at which refinement stops: the solution is exact
# Estimate, relative to its terms, of bodies that do not deform; measured 4e-9.
RIGID_ESTIMATE = 1e-8
NOISE_LIMIT = 1e-4  # ... above which no round-off reaches
STRESS_NOISE = 100 * np.finfo(float).eps  # relative to its terms; measured 0.5 to 50 eps
RISE_FACTOR = 1.1  # over the best one, which is more than the noise of one level


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
