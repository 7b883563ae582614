"""What is read off nodal forces and gaps, in the same way for every engine.

The choices are those that came closest to the references on both common problems.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from drivers.benchmark.scenes.problems import Common

Array = NDArray[np.float64]

# Integrals of the shape functions over one segment of unit length, nodes from left to right.
WEIGHTS = {1: np.array([1, 1]) / 2, 2: np.array([1, 4, 1]) / 6}
WINDOW = 0.3  # of the contact zone, on which the pressure is taken for a parabola
OPEN = 6  # open nodes that find the end of contact


@dataclass(frozen=True)
class Reading:
    """Contact quantities, as in `problems.Reference`."""

    force: float
    peak: float
    half_width: float


def read(common: Common, x: Array, force: Array, gap: Array, order: int) -> Reading:
    """Reading of nodal forces and gaps (m,) at nodes x (m,), in order from 0."""
    return Reading(
        force=common.parts * float(force.sum()),
        peak=peak(x, force, order),
        half_width=contact_end(x, force, gap),
    )


def weights(x: Array, order: int) -> Array:
    """Length (m,) that each node stands for: integral of its shape function over x."""
    result = np.zeros(len(x))
    for k, weight in enumerate(WEIGHTS[order]):
        result[k : len(x) - order + k : order] += weight * (x[order::order] - x[:-order:order])
    return result


def peak(x: Array, force: Array, order: int) -> float:
    """Pressure at x = 0 from nodal forces.

    Force over weight there for order 2. That is off by a percent for order 1, whose first nodes
    oscillate: an even parabola through the nodes within 0.3 of the zone is 10 times better.
    """
    pressure, weight = force / weights(x, order), weights(x, order)
    last = np.flatnonzero(force > 0)[-1]
    count = min(last + 1, max(3, int(np.searchsorted(x, WINDOW * x[last]))))
    if order == 2 or count < 2:
        return float(pressure[0])
    # Unlike pressures, forces carry over to the neighbours what one node has too much of.
    _, value = np.polyfit(x[:count] ** 2, pressure[:count], 1, w=np.sqrt(weight[:count]))
    return float(value)


def contact_end(x: Array, force: Array, gap: Array) -> float:
    """End of contact, found inside elements: gap^(2/3) is smooth with a simple zero there."""
    last = int(np.flatnonzero(force > 0)[-1])
    near = slice(last + 1, last + 1 + OPEN)
    middle = float(x[last : last + 2].mean())
    opening = np.cbrt(np.maximum(gap[near], 0) ** 2)
    if len(opening) < 2:
        return middle
    zeros = np.roots(np.polyfit(x[near] - middle, opening, min(2, len(opening) - 1)))
    zeros = zeros[np.isreal(zeros)].real
    return middle + float(min(zeros, key=abs, default=0.0))
