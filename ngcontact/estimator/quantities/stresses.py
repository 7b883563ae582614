"""The largest von Mises stress, with an estimated bar."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array
from ...fem import von_mises
from ...problem import Triangulation, body_of_vertex
from ..bound import EquilibratedStress
from .singular import Singular
from .table import Quantity, error_of_largest, unknown

SAME = 1e-9  # distance, relative to an element, at which points of two elements are one
# Error over the largest difference in an element to the equilibrated stress, and over that between
# elements, a part of which counts: chosen on 113 random scenes, orders 1 to 4.
MISES, OF_JUMP = 1.1, 0.5

# Where stresses are looked at in the unit triangle: its middle, then sixths of its sides.
SIXTHS = [(i / 6, j / 6) for i in range(7) for j in range(7 - i) if (i, j) != (2, 2)]
LATTICE = np.array([(1 / 3, 1 / 3), *SIXTHS])


def largest_von_mises(
    mesh: ng.Mesh,
    stresses: tuple[ng.CoefficientFunction, ng.CoefficientFunction],
    equilibrated: EquilibratedStress | None,
    corners: Singular,
    relative: float,
) -> Quantity:
    """The largest one on a lattice over all elements, away from corners of infinite stress.

    `stresses` are that in the plane, (2, 2), and that normal to it; `relative` is the estimated
    error of the displacement.
    """
    n = len(LATTICE)
    rule = ng.IntegrationRule([(x, y, 0) for x, y in LATTICE.tolist()], [1 / n] * n)
    points = mesh.MapToAllElements(rule, ng.VOL)
    (s, z), xy = stresses, np.asarray(ng.CF((ng.x, ng.y))(points))
    values = np.asarray(s(points)).reshape(-1, 4)[:, [0, 3, 1]]
    normal = np.asarray(z(points)).reshape(-1, 1)
    mises = von_mises(np.hstack([values, normal]))
    away = ~corners.near(xy)
    if not away.any():
        return unknown("von Mises", np.nan, infinite=corners.distinct)
    at = int(np.where(away, mises, -np.inf).argmax())
    value, place = float(mises[at]), xy[at]
    if relative > 1 or (equilibrated is None and mesh.ne == 1):  # nothing to compare with
        return unknown("von Mises", value, place, corners.distinct)
    off = _jumps(mesh, xy, mises)
    if equilibrated is not None:
        every = np.repeat(np.arange(mesh.ne), n)
        whole = equilibrated.values(every, np.tile(LATTICE, (mesh.ne, 1)))
        other, around = whole[:, [0, 1, -1]], whole[:, 2:-1]
        # Out of a plane the stress follows that in it: nu times the trace, or 0.
        trace = (values[:, 0] + values[:, 1]).reshape(-1, n)
        square = (trace**2).sum(axis=1)
        ratio = (trace * normal.reshape(-1, n)).sum(axis=1) / np.where(square > 0, square, 1.0)
        known = np.asarray(np.isfinite(other).all(axis=1))  # it divides by r, 0 on the axis
        other = np.where(known[:, None], other, 0.0)
        change = (other[:, :2] - values[:, :2]).sum(axis=1) * np.repeat(ratio, n)
        out = around if around.size else normal + change[:, None]
        proved = von_mises(np.hstack([other, np.where(known[:, None], out, 0.0)]))
        off = np.maximum(OF_JUMP * off, np.where(known, np.abs(proved - mises), 0.0))
    off = MISES * np.repeat(off.reshape(-1, n).max(axis=1), n)
    error = error_of_largest(value, mises[away], off[away])
    return Quantity("von Mises", value, error, "estimated", place, infinite=corners.distinct)


def _jumps(mesh: ng.Mesh, points: Array, mises: Array) -> Array:
    """Differences (k,) of `mises` (k,) at equal ones of the `points` (k, 2) of one body."""
    view = Triangulation(mesh)
    body = body_of_vertex(mesh)[view.triangles[:, 0]]
    least = SAME * float(np.ptp(view.corners, axis=1).max(axis=1).min())
    key = np.round(points / least).astype(np.int64)
    key = np.column_stack([key, np.repeat(body, len(LATTICE))])
    order = np.lexsort(key.T)
    first = np.append(True, (np.diff(key[order], axis=0) != 0).any(axis=1))
    start, found = np.flatnonzero(first), np.empty(len(mises))
    low, high = (f.reduceat(mises[order], start) for f in (np.minimum, np.maximum))
    found[order] = (high - low)[np.cumsum(first) - 1]
    return found
