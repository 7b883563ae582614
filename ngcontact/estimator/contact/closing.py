"""What it costs to move a boundary: gaps and misses of data as energies."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Index
from ..terms import ScaledSolution

BUMP = 2.0  # |w| |d_s w| over the largest w^2; 1 at least, 1.2 to 1.7 of hats, Gauss's, parabolas


def closing_energy(
    solution: ScaledSolution,
    where: tuple[Index, Array, Array],
    stiffness: Array,
    w: Array,
    *,
    or_more: bool = False,
) -> Array:
    """Energy (k,) of a displacement `w` (k,) of the boundary, without a unit: c |w|^2 h / l.

    l is the element's diameter h, or where it is shorter the length |w| / |d_s w| in which w
    changes on the segment: |w| |d_s w| bounds the square of w in H^(1/2). Of a w that jumps it is
    infinite; where more than w does as well it is at most that of a bump as high as w.

    Parameters
    ----------
    solution : ScaledSolution
        In units of its own.
    where : tuple of ndarray (k,), (k,), (k, 2)
        Segments, weights of the quadrature and positions of the points, in order along segments.
    stiffness : ndarray (k,)
        c, a modulus over h.
    w : ndarray (k,)
        The displacement.
    or_more : bool
        Whether a larger displacement closes the gap as well.
    """
    segment, weight, position = where
    change = np.diff(w) ** 2 * (segment[1:] == segment[:-1])
    if not change.any():
        return stiffness * w**2
    size = len(solution.boundary.region)
    apart = np.linalg.norm(np.diff(position, axis=0), axis=1)
    # Points coincide to round-off at a jump.
    steep = np.divide(change, apart, out=np.zeros_like(change), where=apart > 0)
    steep *= solution.boundary.model.measure(position[1:])
    square, rise = (
        np.bincount(at, x, size) for at, x in ((segment, weight * w**2), (segment[1:], steep))
    )
    seen = np.bincount(segment[1:], apart * (segment[1:] == segment[:-1]), size)
    whole = solution.boundary.lengths(np.arange(size))
    sloping = rise * whole / np.where(seen > 0, seen, np.inf)
    h = solution.diameter[solution.boundary.element]
    ratio = np.divide(sloping, square, out=np.zeros(size), where=square > 0)
    times = h * np.sqrt(ratio)
    if or_more:
        most = np.zeros(size)
        np.maximum.at(most, segment, solution.boundary.model.measure(position) * w**2)
        times = np.minimum(
            times, BUMP * h * np.divide(most, square, out=np.zeros(size), where=square > 0)
        )
    return stiffness * w**2 * np.maximum(times, 1)[segment]
