"""The largest von Mises stress, with an estimated bar."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...output import von_mises
from ..equilibrated import EquilibratedStress
from .table import Quantity

SAME = 1e-9  # distance, relative to an element, at which points of two elements are one

# Where stresses are looked at in the unit triangle: its middle, then sixths of its sides.
SIXTHS = [(i / 6, j / 6) for i in range(7) for j in range(7 - i) if (i, j) != (2, 2)]
LATTICE = np.array([(1 / 3, 1 / 3), *SIXTHS])


def largest_von_mises(
    mesh: ng.Mesh,
    stresses: tuple[ng.CoefficientFunction, ng.CoefficientFunction],
    equilibrated: EquilibratedStress | None,
) -> Quantity:
    """The largest one on a lattice over all elements, their sides and vertices included.

    `stresses` are that in the plane, (2, 2), and that normal to it.
    """
    n = len(LATTICE)
    rule = ng.IntegrationRule([(x, y, 0) for x, y in LATTICE.tolist()], [1 / n] * n)
    points = mesh.MapToAllElements(rule, ng.VOL)
    (s, z), xy = stresses, np.asarray(ng.CF((ng.x, ng.y))(points))
    values = np.asarray(s(points)).reshape(-1, 4)[:, [0, 3, 1]]
    normal = np.asarray(z(points)).reshape(-1, 1)
    mises = von_mises(np.hstack([values, normal]))
    at = int(mises.argmax())
    element = at // n
    own = slice(element * n, (element + 1) * n)
    same = _same(xy, xy[own], xy[at])
    error = float(np.ptp(mises[same]))
    if equilibrated is None:
        jumps = [np.ptp(mises[_same(xy, xy[own], x)]) for x in xy[own]]
        error = float(max(error, *jumps))
    else:
        other = equilibrated.at_middles()[equilibrated.element == element]
        # Out of a plane the stress follows that in it: nu times the trace, or 0.
        first = element * n  # the lattice begins with the middle
        trace = values[first, 0] + values[first, 1]
        ratio = normal[first, 0] / trace if trace != 0 else 0.0
        across = ratio * (other[:, :1] + other[:, 1:2]) if other.shape[1] == 3 else other[:, 3:]
        off = np.abs(von_mises(np.hstack([other[:, :3], across])) - mises[first]).max()
        error = max(error, float(off))
    if equilibrated is None and mesh.ne == 1:  # nothing to compare with
        return Quantity("largest von Mises", float(mises[at]), np.nan, "none", xy[at])
    return Quantity("largest von Mises", float(mises[at]), error, "estimated", xy[at])


def _same(points: Array, element: Array, x: Array) -> Array:
    """Which of all `points` (k, 2) lie where `x` (2,) does in an `element` with points (n, 2)."""
    size = np.ptp(element, axis=0).max()
    return np.asarray(np.linalg.norm(points - x, axis=1) <= SAME * size)
