"""Whether refinement helps: estimates that rise from level to level."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ..arrays import Array, root_of_squares
from ..problem import Triangulation

LEVELS = 3  # after the best one, from which estimates are not those of a mesh still too coarse
RISE = 1.1  # over the best one, which is more than the noise of one level


def estimates_rise(estimates: Sequence[float]) -> bool:
    """Whether the relative error estimates of all levels rise, for several of them already.

    The last one is the worst since the best: one that falls again, as after first meshes that are
    too coarse to see their error, is on its way.
    """
    best = int(np.argmin(estimates))
    since, last = estimates[best:], estimates[-1]
    return len(since) > LEVELS and last > RISE * since[0] and last == max(since)


def doubt_of_refinement(mesh: ng.Mesh, indicators: Array, estimates: Sequence[float]) -> str:
    """Message for estimates that rise, with the place of the largest of the `indicators` (ne,)."""
    view, worst = Triangulation(mesh), int(np.argmax(indicators))
    x, y = view.corners[worst].mean(axis=0)
    share = float((indicators[worst] / root_of_squares(indicators)) ** 2)
    rise = ", ".join(f"{estimate:.2e}" for estimate in estimates[int(np.argmin(estimates)) :])
    return (
        f"refinement does not help: the relative error estimate rises ({rise}). The largest "
        f"indicator, {share:.0%} of the squares, is near ({x:.4g}, {y:.4g}) in body "
        f'"{mesh.GetMaterials()[view.bodies[worst]]}"; usual causes are a gap or a load that jumps '
        "or is rougher than the mesh, a prescribed displacement that jumps, and a direction of "
        "contact far from the normals"
    )
