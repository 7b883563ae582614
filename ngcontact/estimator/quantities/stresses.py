"""The largest von Mises stress, with an estimated bar, and corners where it is infinite.

At the tip of a wedge it is infinite where the angle is larger than a critical one, which the
conditions on both sides determine (Williams 1952): 180 degrees where both are free or both are
held, 90 where one is guided and the other is free, held or guided, arcsin ((kappa + 1) / 4)^(1/2)
where one is held and the other is free. In contact without friction both bodies count: a corner
that presses on a line is one of 270 degrees in all. Of other moduli it is infinite at smaller
angles, too. Under a uniform pressure a side that is guided does not turn, and one that faces the
end of contact by more than 90 degrees turns by a logarithm: the pressure is infinite there, unless
the guide is a line of symmetry of both bodies.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask, across
from ...contact import ContactState
from ...fem import BoundaryTrace, boundary_corners, prescribed_components, von_mises
from ...problem import Elastic, MeshArrays, Problem, body_mask
from ..residual import Estimated
from .table import Quantity, Singular, error_of_largest

POINT_DISTANCE = 1e-9  # distance, relative to an element, at which points of two elements are one
FREE, GUIDED, HELD, PRESSED = range(4)  # what is on a side of a corner
STRAIGHT_TURN = 0.05  # turn, radians, below which an angle is one of 180 degrees
CORNER_REACH = 0.1  # of the way to the next corner, how far from a corner its stress counts
CORNER_DISTANCE = 1e-6  # of a segment, distance at which two corners meet
# Error over the largest difference in an element to the equilibrated stress, and over that between
# elements, a part of which counts: chosen on 113 random scenes, orders 1 to 4.
MISES_FACTOR, JUMP_FACTOR = 1.1, 0.5
STRESS_SHARE = 0.5  # of the largest stress: elements with less do not hold the true largest one
DIVISIONS, CONSTANT = 6, 3  # of sides, where stresses are looked at; those of order 1 are constant


def singular_corners(
    problem: Problem, trace: BoundaryTrace, pairs: Sequence[ContactState]
) -> Singular:
    """Corners of all bodies at which the stress is infinite, by angles and conditions."""
    corners, kind = boundary_corners(trace), _conditions(problem, trace)
    sides, angle = kind[corners.sides], corners.angle
    corner = (np.abs(angle - np.pi) > STRAIGHT_TURN) | (sides[:, 0] != sides[:, 1])
    first, second = corners.sides[corner].T
    sides, angle = sides[corner].T, angle[corner]
    place, body = trace.arrays.vertices[corners.vertex[corner]], trace.body[first]
    h = np.maximum(trace.lengths(first), trace.lengths(second))
    closed, rigid = _closed(pairs, place, h)
    low, high = np.sort(np.where((sides == PRESSED) & ~closed, FREE, sides), axis=0)
    critical = np.full(len(place), np.pi)
    critical[(high == GUIDED) | ((low == GUIDED) & (high == HELD))] = np.pi / 2
    clamped = (low == FREE) & (high == HELD)
    critical[clamped] = _clamped_angles(problem, trace)[body[clamped]]
    # Angle of what faces each corner: 180 degrees of a line, 90 stand for a rigid one.
    facing = np.where(rigid, np.pi / 2, np.pi)
    for i in range(len(place)):
        met = np.linalg.norm(place - place[i], axis=1) <= CORNER_DISTANCE * h[i]
        facing[i] = next(iter(angle[met & (body != body[i])]), facing[i])
    edge = (high == PRESSED) & ((low == FREE) | ((low == PRESSED) & (facing == np.pi)))
    critical[edge] = (np.pi - facing)[edge]
    uneven = edge & ~rigid & _turned_apart(problem, trace, place, body, np.array([angle, facing]))
    guided = (high == PRESSED) & (low == GUIDED) & ~rigid & (facing > np.pi / 2 + STRAIGHT_TURN)
    for i in np.flatnonzero(guided).tolist():
        [side] = trace.curve[[first[i] if kind[first[i]] == GUIDED else second[i]]]
        along = (side[-1] - side[0]) / np.linalg.norm(side[-1] - side[0])
        beside = np.abs((place - place[i]) @ across(along)) > CORNER_DISTANCE * h[i]
        ends = (body != body[i]) & (high == PRESSED) & (low == GUIDED) & ~beside
        uneven[i] = not ends.any()
    straight = (low == high) & (np.abs(angle - np.pi) <= STRAIGHT_TURN)  # nothing changes
    found = ~straight & ((angle > critical + STRAIGHT_TURN) | uneven)
    size = float(np.ptp(trace.curve, axis=(0, 1)).max())
    away = np.linalg.norm(place[found, None] - place, axis=2)
    way = np.where(away > CORNER_DISTANCE * size, away, size).min(axis=1, initial=size)
    return Singular(place[found] + 0.0, CORNER_REACH * way, (high == PRESSED)[found])


def _conditions(problem: Problem, trace: BoundaryTrace) -> Index:
    """Condition on each segment (k,): `FREE`, `GUIDED`, `HELD` or `PRESSED`."""
    segments = np.arange(len(trace.region))
    kind = np.full(len(segments), FREE)
    for pair in problem.contact:
        kind[trace.lies_on(segments, pair.secondary, pair.primary)] = PRESSED
    given = prescribed_components(problem, trace)
    kind[trace.lies_on(segments, problem.guide) | given.any(axis=0) | trace.on_axis] = GUIDED
    kind[given.all(axis=0)] = HELD
    return kind


def _closed(pairs: Sequence[ContactState], place: Array, h: Array) -> tuple[Mask, Mask]:
    """Masks of the vertices at `place` (v, 2): in contact, and in contact with a rigid obstacle."""
    closed, rigid = np.zeros(len(place), dtype=bool), np.zeros(len(place), dtype=bool)
    for pair in pairs:
        line, active = pair.line, pair.in_contact
        if not len(active):
            continue
        facing = line.position + line.gap[:, None] * line.direction
        for points in (line.position, facing):
            away = np.linalg.norm(place[:, None] - points, axis=2)
            met = active[away.argmin(axis=1)] & (away.min(axis=1) <= h)
            closed |= met
            rigid |= met & (line.contact.primary is None)
    return closed, rigid


def _turned_apart(
    problem: Problem, trace: BoundaryTrace, place: Array, body: Index, angles: Array
) -> Mask:
    """Mask (v,) of ends of contact at which a uniform pressure would turn both wedges apart.

    It turns a wedge of angle a with one free side by log r / (E (tan a - a)), E that of the model;
    where the sum of both is negative the pressure is infinite (Dundurs and Lee 1972). `angles`
    (2, v) are those of both.
    """
    outer = np.flatnonzero(~trace.inner)
    middle = trace.point(outer, np.full(len(outer), 0.5))
    # 1 / E of each body, (1 - nu^2) / E in plane strain; 1 of all where one is no such number.
    compliance = np.full(len(trace.mesh.GetMaterials()), np.nan)
    for name, law in problem.materials.items():
        if isinstance(law, Elastic) and isinstance(law.E, float | int):
            nu = law.nu if isinstance(law.nu, float | int) else np.nan
            square = 0.0 if problem.model == "plane stress" else nu**2
            compliance[body_mask(trace.mesh, name)] = (1 - square) / law.E
    if not np.isfinite(compliance).all():
        compliance[:] = 1.0
    result = np.zeros(len(place), dtype=bool)
    for i, (x, (a, b)) in enumerate(zip(place, angles.T, strict=True)):
        others = trace.body[outer] != body[i]
        if others.any() and a < np.pi and b <= np.pi:
            nearest = np.linalg.norm(middle[others] - x, axis=1).argmin()
            one, two = compliance[body[i]], compliance[trace.body[outer[others][nearest]]]
            turn = one / (np.tan(a) - a) + two / (np.tan(b) - b)
            result[i] = turn < -STRAIGHT_TURN / 2 * (one + two)
    return result


def _clamped_angles(problem: Problem, trace: BoundaryTrace) -> Array:
    """Angle by body beyond which one held and one free side make the stress infinite."""
    critical = np.full(len(trace.mesh.GetMaterials()), np.pi / 4)  # the least, of nu = 1 / 2
    for name, law in problem.materials.items():
        if isinstance(law, Elastic) and isinstance(law.nu, float | int):
            nu = law.nu
            kappa = (3 - nu) / (1 + nu) if problem.model == "plane stress" else 3 - 4 * nu
            critical[body_mask(trace.mesh, name)] = np.arcsin(np.sqrt(min((kappa + 1) / 4, 1.0)))
    return critical


def largest_von_mises(
    solution: Estimated,
    equilibrated: Callable[[Index, Array, Mask], Array] | None,
    corners: Singular,
) -> Quantity:
    """The largest on a lattice, away from corners.

    `equilibrated` has that stress, if known, (k * n, c) in elements (k,) at n places (n, 2) of
    each, and 0 where it is not to be known (k, n).
    """
    name, mesh = "von Mises", solution.mesh
    singular = corners.distinct(np.ones(len(corners.places), dtype=bool))
    m = CONSTANT if solution.order == 1 else DIVISIONS
    steps = [(i / m, j / m) for i in range(m + 1) for j in range(m + 1 - i) if 3 * i != m or i != j]
    places = np.array([(1 / 3, 1 / 3), *steps])
    n = len(places)
    rule = ng.IntegrationRule([(x, y, 0) for x, y in places.tolist()], [1 / n] * n)
    points = mesh.MapToAllElements(rule, ng.VOL)
    read = solution.stress, solution.out_of_plane_stress, ng.CF((ng.x, ng.y))
    s, normal, xy = (np.asarray(f(points)) for f in read)
    stress = np.hstack([s.reshape(-1, 4)[:, [0, 3, 1]], normal.reshape(-1, 1)])
    mises, away = von_mises(stress), ~singular.near(xy)
    if not away.any():
        return Quantity(name, np.nan, singular=singular)
    at = int(np.where(away, mises, -np.inf).argmax())
    value, place = float(mises[at]), xy[at]
    alone = equilibrated is None and mesh.ne == 1  # nothing to compare with
    if solution.relative_error_estimate > 1 or alone:
        return Quantity(name, value, place=place, singular=singular)
    high = np.asarray(np.where(away, mises, 0.0).reshape(-1, n).max(axis=1) >= STRESS_SHARE * value)
    some, boundary = np.repeat(high, n), solution.discrete.space.trace
    off = _jumps(boundary.arrays, high, xy, mises)
    if equilibrated is not None:
        known = ~boundary.model.on_axis(xy)[some]  # there r = 0 divides
        own = stress[some]
        found = equilibrated(np.flatnonzero(high), places, known.reshape(-1, n))
        other = found[:, [0, 1, -1, 2]]
        if found.shape[1] == 3:  # out of the plane: nu times the trace, or 0
            trace, now = own[:, :2].sum(axis=1).reshape(-1, n), other[:, :2].sum(axis=1)
            square = (trace**2).sum(axis=1)
            ratio = (trace * own[:, 3].reshape(-1, n)).sum(axis=1) / np.where(square, square, 1.0)
            other[:, 3] = own[:, 3] + (now - trace.ravel()) * np.repeat(ratio, n)
        apart = np.where(known, np.abs(von_mises(other) - mises[some]), 0.0)
        off = np.maximum(JUMP_FACTOR * off, apart)
    off = MISES_FACTOR * np.repeat(off.reshape(-1, n).max(axis=1), n)
    # The largest may lie between the last point that counts and the next one, at the reach.
    xy = xy[some]
    size = np.ptp(xy.reshape(-1, n, 2), axis=1).max(axis=1)
    counts = ~singular.near(xy, np.repeat(size / m, n))
    error = error_of_largest(value, mises[some][counts], off[counts])
    return Quantity(name, value, error, "estimated", place, singular=singular)


def _jumps(view: MeshArrays, some: Mask, points: Array, mises: Array) -> Array:
    """Differences (k * n,) of `mises` at equal points of a body, in k elements: `some` (ne,).

    There are n of the `points` (ne * n, 2) in each element.
    """
    beside = np.isin(view.elements, view.elements[some]).any(axis=1)
    n = len(points) // len(some)
    points, mises = (x[np.repeat(beside, n)] for x in (points, mises))
    least = POINT_DISTANCE * float(np.ptp(view.corners, axis=1).max(axis=1).min())
    key = np.round(points / least).astype(np.int64)
    key = np.column_stack([key, np.repeat(view.pieces[view.elements[beside, 0]], n)])
    order = np.lexsort(key.T)
    first = np.append(True, (np.diff(key[order], axis=0) != 0).any(axis=1))
    start, found = np.flatnonzero(first), np.empty(len(mises))
    low, high = (f.reduceat(mises[order], start) for f in (np.minimum, np.maximum))
    found[order] = (high - low)[np.cumsum(first) - 1]
    return found.reshape(-1, n)[some[beside]].ravel()
