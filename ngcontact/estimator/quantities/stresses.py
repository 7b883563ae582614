"""The largest von Mises stress, with an estimated bar."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array, Mask
from ...output import von_mises
from ...problem import Triangulation, body_of_vertex
from ..bound import EquilibratedStress
from .singular import Singular
from .table import Quantity, unknown

SAME = 1e-9  # distance, relative to an element, at which points of two elements are one
NEAR_PEAK = 0.9  # share of the largest from which stresses count for it
MISES = 1.2  # error of the largest over the largest difference near it, measured: at most 1.0

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
    near = (mises >= NEAR_PEAK * value) & away
    beside = np.repeat(near.reshape(-1, n).any(axis=1), n) & away
    error, most = _largest_jump(mesh, xy, mises, beside), value
    if equilibrated is not None:
        every = np.repeat(np.arange(mesh.ne), n)
        whole = equilibrated.values(every, np.tile(LATTICE, (mesh.ne, 1)))
        other, around = whole[:, [0, 1, -1]], whole[:, 2:-1]
        # Out of a plane the stress follows that in it: nu times the trace, or 0.
        trace = (values[:, 0] + values[:, 1]).reshape(-1, n)
        square = (trace**2).sum(axis=1)
        ratio = (trace * normal.reshape(-1, n)).sum(axis=1) / np.where(square > 0, square, 1.0)
        known = np.isfinite(other).all(axis=1)  # it divides by r, 0 on the axis
        other = np.where(known[:, None], other, 0.0)
        change = (other[:, :2] - values[:, :2]).sum(axis=1) * np.repeat(ratio, n)
        out = around if around.size else normal + change[:, None]
        proved = von_mises(np.hstack([other, np.where(known[:, None], out, 0.0)]))
        error = max(error, float(np.abs(proved - mises)[beside & known].max(initial=0.0)))
        most = max(most, float(proved[away & known].max(initial=0.0)))
    elif mesh.ne == 1:  # nothing to compare with
        return unknown("von Mises", value, place, corners.distinct)
    if relative > 1 or corners.near(place[None], reach=2.0)[0]:
        return unknown("von Mises", value, place, corners.distinct)
    error = MISES * max(error, most - value)
    return Quantity("von Mises", value, error, "estimated", place, infinite=corners.distinct)


def _largest_jump(mesh: ng.Mesh, points: Array, mises: Array, near: Mask) -> float:
    """Largest difference of `mises` (k,) at equal ones of the `points` (k, 2) of one body.

    Of those of which one is `near` (k,).
    """
    view = Triangulation(mesh)
    body = body_of_vertex(mesh)[view.triangles[:, 0]]
    size = np.ptp(view.corners, axis=1).max(axis=1)
    elements = np.unique(np.flatnonzero(near) // len(LATTICE))
    least = SAME * float(size[elements].min())
    key = np.round(points / least).astype(np.int64)
    key = np.column_stack([key, np.repeat(body, len(LATTICE))])
    _, number = np.unique(key, axis=0, return_inverse=True)
    number = number.ravel()
    low, high = (np.full(number.max() + 1, x) for x in (np.inf, -np.inf))
    np.minimum.at(low, number, mises)
    np.maximum.at(high, number, mises)
    return float((high - low)[number[near]].max())
