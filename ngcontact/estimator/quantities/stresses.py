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
HALF = 0.5  # of the largest stress: elements with less do not hold the true largest one

PARTS, CONSTANT = 6, 3  # of sides, where stresses are looked at; those of order 1 are constant


def lattice(order: int) -> Array:
    """Places (n, 2) in the unit triangle for stresses of displacements of an `order`."""
    m = CONSTANT if order == 1 else PARTS
    steps = [(i / m, j / m) for i in range(m + 1) for j in range(m + 1 - i) if 3 * i != m or i != j]
    return np.array([(1 / 3, 1 / 3), *steps])


def largest_von_mises(
    mesh: ng.Mesh,
    order: int,
    stresses: tuple[ng.CoefficientFunction, ng.CoefficientFunction],
    equilibrated: EquilibratedStress | None,
    corners: Singular,
    relative: float,
) -> Quantity:
    """The largest one on a lattice over all elements, away from corners of infinite stress.

    `stresses` are that in the plane, (2, 2), and that normal to it; `relative` is the estimated
    error of the displacement.
    """
    places = lattice(order)
    n = len(places)
    rule = ng.IntegrationRule([(x, y, 0) for x, y in places.tolist()], [1 / n] * n)
    points = mesh.MapToAllElements(rule, ng.VOL)
    s, normal, xy = (np.asarray(f(points)) for f in (*stresses, ng.CF((ng.x, ng.y))))
    stress = np.hstack([s.reshape(-1, 4)[:, [0, 3, 1]], normal.reshape(-1, 1)])
    mises, away = von_mises(stress), ~corners.near(xy)
    if not away.any():
        return unknown("von Mises", np.nan, infinite=corners.distinct)
    at = int(np.where(away, mises, -np.inf).argmax())
    value, place = float(mises[at]), xy[at]
    if relative > 1 or (equilibrated is None and mesh.ne == 1):  # nothing to compare with
        return unknown("von Mises", value, place, corners.distinct)
    high = np.asarray(np.where(away, mises, 0.0).reshape(-1, n).max(axis=1) >= HALF * value)
    some = np.repeat(high, n)
    off = _jumps(mesh, xy, mises, n)[some]
    if equilibrated is not None:
        element = np.flatnonzero(high)
        whole = equilibrated.values(np.repeat(element, n), np.tile(places, (len(element), 1)))
        known = np.asarray(np.isfinite(whole).all(axis=1))  # it divides by r, 0 on the axis
        whole = np.where(known[:, None], whole, 0.0)
        other, own = whole[:, [0, 1, -1, 2]], stress[some]
        if whole.shape[1] == 3:  # out of the plane: nu times the trace, or 0
            trace, now = own[:, :2].sum(axis=1).reshape(-1, n), other[:, :2].sum(axis=1)
            square = (trace**2).sum(axis=1)
            ratio = (trace * own[:, 3].reshape(-1, n)).sum(axis=1) / np.where(square, square, 1.0)
            other[:, 3] = own[:, 3] + (now - trace.ravel()) * np.repeat(ratio, n)
        apart = np.where(known, np.abs(von_mises(other) - mises[some]), 0.0)
        off = np.maximum(OF_JUMP * off, apart)
    off = MISES * np.repeat(off.reshape(-1, n).max(axis=1), n)
    error = error_of_largest(value, mises[some & away], off[away[some]])
    return Quantity("von Mises", value, error, "estimated", place, infinite=corners.distinct)


def _jumps(mesh: ng.Mesh, points: Array, mises: Array, n: int) -> Array:
    """Differences (k,) of `mises` (k,) at equal ones of the `points` (k, 2) of a body, n by n."""
    view = Triangulation(mesh)
    body = body_of_vertex(mesh)[view.triangles[:, 0]]
    least = SAME * float(np.ptp(view.corners, axis=1).max(axis=1).min())
    key = np.round(points / least).astype(np.int64)
    key = np.column_stack([key, np.repeat(body, n)])
    order = np.lexsort(key.T)
    first = np.append(True, (np.diff(key[order], axis=0) != 0).any(axis=1))
    start, found = np.flatnonzero(first), np.empty(len(mises))
    low, high = (f.reduceat(mises[order], start) for f in (np.minimum, np.maximum))
    found[order] = (high - low)[np.cumsum(first) - 1]
    return found
