"""Pressure, ends, size and approach of one contact, with estimated bars."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask, distances_along
from ...contact import ContactState
from ...fem import Bodies, BoundaryTrace, connected_bodies, prescribed_components
from ...lagrange import gauss
from ...solved import Solved
from ..residual import Estimated
from .table import Quantity, Singular, error_of_largest

LOAD_ROUND_OFF = 1e-9  # part of the largest load that is none
# Error of pressures over the largest difference on a segment to p*, and to the discrete stress:
# chosen on 113 random scenes, orders 1 to 4.
STAR_FACTOR, STRESS_FACTOR, LONE_STRESS_FACTOR = 2.0, 1.0, 2.0  # the last where there is no p*
# Of the distance of points, part of the bar of an end: chosen on 80 random scenes.
END_STEP_SHARE = 0.3
# Relative errors of the lengths of curves of a degree over powers of half their turn: on arcs of 10
# to 30 degrees .17 to .175, .053 to .054, .0145 to .0156, .0033 to .0034.
ARC_LENGTH_ERRORS = {1: (0.18, 2), 2: (0.055, 4), 3: (0.016, 4), 4: (0.0035, 6)}
HELD_POINT_FACTOR = 1.5  # of the pressure beside: measured 0.98 to 1.05 at a clamped end
SAMPLES = np.linspace(0, 1, 17)  # where pressures are looked at on a segment
CORNER_RANGE = 0.05  # of a line's extent, how far from it corners count


def peak_of(
    solution: Estimated, pair: ContactState, star: Array | None, corners: Singular
) -> Quantity:
    """The largest pressure, away from infinite ones; `star` (n,) is p* at the nodes, if known."""
    name, line, pressure = "peak pressure", pair.line, pair.pressure
    boundary, rows = solution.discrete.space.trace, line.rows
    singular = corners.distinct(_on_line(corners, line.position))
    corners = corners.distinct(corners.pressed)
    away = ~corners.near(line.position)
    if not (pair.active & away).any():
        return Quantity(name, np.nan if pair.active.any() else 0.0, singular=singular)
    at = int(np.where(away, pressure, -np.inf).argmax())
    peak, place = float(pressure[at]), line.position[at]
    if solution.relative_error_estimate > 1:
        return Quantity(name, peak, place=place, singular=singular)
    factor = LONE_STRESS_FACTOR if star is None else STRESS_FACTOR
    off = factor * _off_stress(pair, boundary, solution.stress)
    if star is not None:
        off = np.maximum(off, STAR_FACTOR * _off_star(pair, star))
    segment, s = boundary.at_places(line.segments, SAMPLES)
    values, errors = (line.on_segments(x, 0.0) for x in (pressure, off))
    samples = (values.repeat(len(SAMPLES), axis=0) * boundary.shapes(segment, s)).sum(axis=1)
    errors = errors.max(axis=1).repeat(len(SAMPLES))
    # The peak is on segments with a point in contact, or beside such.
    touched = rows[pair.touched]
    near = np.isin(rows, touched[touched >= 0]).any(axis=1)
    # The largest may lie between the last sample that counts and the next one, at the reach.
    step = boundary.lengths(segment) / (len(SAMPLES) - 1)
    counts = ~corners.near(boundary.point(segment, s), step) & np.repeat(near, len(SAMPLES))
    error = error_of_largest(peak, samples[counts], errors[counts])
    return Quantity(name, peak, error, "estimated", place, singular=singular)


def _on_line(corners: Singular, points: Array) -> Mask:
    """Those corners (k,) at which bodies press on each other, on the line through `points`."""
    if not len(points):
        return np.zeros(len(corners.places), dtype=bool)
    away = np.linalg.norm(corners.places[:, None] - points, axis=2).min(axis=1)
    near = away <= CORNER_RANGE * np.ptp(points, axis=0).max()
    return np.asarray(near & corners.pressed)


def _off_star(pair: ContactState, star: Array) -> Array:
    """Differences (m,) of pressures to p* at contact points, the larger of two."""
    rows, result = pair.line.rows, np.zeros(len(pair.force) + 1)
    off = star.reshape(rows.shape) - pair.line.on_segments(pair.pressure, 0.0)
    np.maximum.at(result, rows, np.abs(off))
    return result[:-1]


def _off_stress(
    pair: ContactState, boundary: BoundaryTrace, stress: ng.CoefficientFunction
) -> Array:
    """Differences (m,) of pressures to the discrete stress of the secondary, the larger of two."""
    point, result = pair.line.rows.ravel(), np.zeros(len(pair.force))
    segment, s = boundary.at_nodes(pair.line.segments)
    segment, s, point = segment[point >= 0], s[point >= 0], point[point >= 0]
    if len(point):
        d, normal = pair.line.direction[point], boundary.normal(segment, s)
        along = (boundary.traction(stress, segment, s) * d).sum(axis=1)
        along /= np.abs((normal * d).sum(axis=1))
        np.maximum.at(result, point, np.abs(along + pair.pressure[point]))
    return result


def ends_of(pair: ContactState) -> list[Quantity]:
    """Ends of contact, by the coordinate along which it extends; bars are lengths of the line."""
    line, ends = pair.line, pair.transitions
    axis = int(np.ptp(line.position[pair.active], axis=0).argmax()) if pair.active.any() else 0
    name = f"end of contact, {'xy'[axis]}"
    return [
        Quantity(name, float(x[axis]), _error_of_end(pair, k), "estimated", x)
        for k, x in enumerate(ends.position)
    ]


def _error_of_end(pair: ContactState, number: int) -> float:
    """Error of an end of contact: by secants, and a part of the step there.

    Near the end gap^(2/3) outside and p^2 inside are smooth in the length along the line. Where the
    line through the first two of either vanishes elsewhere, the discrete end is as uncertain; where
    there are no two, or beyond the zone, the zone is. Where contact only opens for a way, as beside
    a corner that is closed, it is no more than that way, which hardly any points resolve: there all
    of the step counts.
    """
    x, ends = pair.line.position, pair.transitions
    closed, opened = ends.closed[number], ends.opened[number]
    step = float(np.linalg.norm(x[opened[0]] - x[closed[0]]))
    if step == 0 or not pair.active[closed[0]]:  # both sides of a corner
        return 0.0

    inside = distances_along(x[closed]) + ends.beyond[number]
    outside = step + distances_along(x[opened]) - ends.beyond[number]
    gap, squares = np.maximum(pair.gap[opened], 0.0) ** (2 / 3), pair.pressure[closed] ** 2
    zone, way, found = max(float(inside[-1]), step), 0.0, []
    if any(other[0] == opened[-1] for k, other in enumerate(ends.opened) if k != number):
        way = zone = min(zone, step + float(distances_along(x[opened])[-1]))
    for t, y in ((outside, gap), (inside, squares)):
        line = len(t) > 1 and y[0] != y[1]
        zero = abs(t[0] - y[0] * (t[1] - t[0]) / (y[1] - y[0])) if line else zone
        found.append(min(float(zero), zone))
    return max(max(found) + END_STEP_SHARE * step, min(max(found) + step, way))


def area_in_contact(pair: ContactState, boundary: BoundaryTrace) -> tuple[float, float]:
    """Length of the line in contact, area about an axis, and its estimated error.

    Each interval between two points in contact counts, and what is left of the way to an end of
    contact. Beside points that supports hold half of the way counts, with a bar of that size.
    Intervals beside the open side of a corner inside the contact count, with a bar of their size:
    contact opens there over a part of them. Of segments that face the other body in part what faces
    counts, by the weights of the points in contact; its bar is all of it where some are open, and
    with `rows="nodal"` up to all of these segments: nodes alone do not tell what faces. A curve of
    degree 1 is shorter than its arc by the square of half of its turn over 6, others by what
    `ARC_LENGTH_ERRORS` tells.
    """
    line, ends, carries = pair.line, pair.transitions, pair.line.rows >= 0
    if not pair.active.any():
        return 0.0, 0.0
    active, closed = (line.on_segments(x, False) for x in (pair.active, pair.in_contact))
    places, (t, w) = boundary.places(line.segments), gauss(boundary.geometry_order + 2)
    width = np.diff(places, axis=1)
    s = places[:, :-1, None] + width[:, :, None] * t
    ds = boundary.surface_element(np.repeat(line.segments, s[0].size), s.ravel())
    sizes = width * (ds.reshape(s.shape) @ w)
    one, other = closed[:, :-1], closed[:, 1:]
    whole = one & other & line.faces[:, None]
    opened = whole & ~(active[:, :-1] & active[:, 1:])
    held = ((one & ~carries[:, 1:]) | (other & ~carries[:, :-1])) & line.faces[:, None]
    half = 0.5 * float(sizes[held].sum())
    part = np.flatnonzero(closed.any(axis=1) & ~line.faces)
    covered = line.covered[part] * (sizes[part].sum(1) / line.shares[part].sum(1))[:, None]
    touched = covered * closed[part]
    if line.contact.rows == "nodal":
        missing = max(float(touched.sum()), float(sizes[part].sum() - touched.sum()))
    else:
        missing = float(covered[(touched < covered).any(axis=1)].sum())
    area = float(sizes[whole].sum()) + half + float(touched.sum())
    error = half + float(sizes[opened].sum()) + missing
    if count := len(ends.position):
        measure = boundary.model.measure(ends.position)
        errors = np.array([_error_of_end(pair, k) for k in range(count)])
        area += float((ends.beyond * measure).sum())
        error += float((errors * measure).sum())
    normals = [boundary.exact_normal(line.segments, np.full(len(sizes), end)) for end in (0.0, 1.0)]
    # Higher ones are closer:
    known = min(boundary.geometry_order, max(ARC_LENGTH_ERRORS))
    factor, power = ARC_LENGTH_ERRORS[known]
    bent = factor * (np.linalg.norm(normals[1] - normals[0], axis=1) / 2) ** power
    return max(area, 0.0), error + float((sizes.sum(axis=1) * bent).sum())


def held_point_force(pair: ContactState, boundary: BoundaryTrace) -> float:
    """Size of the force at held points in contact, which no row has, and so of an error."""
    line = pair.line
    held = (line.rows < 0) & line.faces[:, None]
    beside = np.abs(line.on_segments(pair.pressure, 0.0)).max(axis=1)
    some = np.flatnonzero(held.any(axis=1) & (beside > 0))
    if not len(some):
        return 0.0
    t, w = gauss(boundary.order + boundary.geometry_order + 1)
    segment, s = boundary.at_places(line.segments[some], t)
    share = boundary.shapes(segment, s) * boundary.surface_element(segment, s)[:, None]
    share = np.abs(np.einsum("kgi,g->ki", share.reshape(len(some), len(t), -1), w))
    return HELD_POINT_FACTOR * float(((share * held[some]).sum(axis=1) * beside[some]).sum())


def direction_of(solution: Solved, pair: int) -> tuple[Array, str]:
    """Unit vector (2,) along which the force of a pair is given, and what it is.

    The axis of revolution; the pair's direction; that of the loads on the secondary's body, or of
    those on the primary's; that in which prescribed displacements press the bodies together; that
    of the force itself. On a part of a symmetric model the force also has a component that a guide
    takes: a direction across the force, or nearly so, is passed by.
    """
    space, force, line = (
        solution.discrete.space,
        solution.contact_force(pair),
        solution.pairs[pair].line,
    )
    size = float(np.linalg.norm(force))
    candidates = [(np.array([0.0, 1.0]), "the axis")] * space.trace.model.extent
    if line.contact.direction is not None:
        candidates.append((np.array(line.contact.direction), "the pair's direction"))
    bodies = connected_bodies(space.trace)
    loads = space.f.reshape(2, -1)[:, : len(bodies.of_vertex)]
    moved = np.zeros(2)
    for sign, body in _sides(solution.pairs[pair], bodies):
        load = loads[:, bodies.of_vertex == body].sum(axis=1)
        if np.linalg.norm(load) > LOAD_ROUND_OFF * float(np.abs(loads).sum()):
            candidates.append((load, "the load"))
        moved += sign * np.nan_to_num(_held(solution, bodies, body))
    candidates.append((moved, "the prescribed displacement"))
    for vector, name in candidates:
        length = float(np.linalg.norm(vector))
        if length > 0 and abs(vector @ force) >= 0.5 * length * size:
            e = vector / length
            return (e if e @ force >= 0 else -e), name
    return (force / size if size > 0 else np.array([1.0, 0.0])), "itself"


def approach_of(solution: Solved, state: ContactState) -> tuple[Array, Array]:
    """Vector (2,) by which the bodies of a pair approach, and sizes (2,) of its free part."""
    trace = solution.discrete.space.trace
    bodies, total, free = connected_bodies(trace), np.zeros(2), np.zeros(2)
    for sign, body in _sides(state, bodies):
        held = _held(solution, bodies, body)
        outer = np.flatnonzero((bodies.of_segment == body) & ~trace.inner)
        mean = _boundary_mean(solution, outer)
        total += sign * np.where(np.isnan(held), mean, held)
        free += np.where(np.isnan(held), np.abs(mean), 0.0)
    return total, free


def _sides(state: ContactState, bodies: Bodies) -> list[tuple[float, int]]:
    """Sign 1 and the body of the secondary, -1 and that of the primary if there is one."""
    chosen = ((1.0, state.line.segments), (-1.0, state.line.facing))
    return [(sign, int(bodies.of_segment[s[0]])) for sign, s in chosen if len(s)]


def _held(solution: Solved, bodies: Bodies, body: int) -> Array:
    """Mean (2,) over a body's supports of what they prescribe, NaN where nothing is."""
    problem, trace = solution.problem, solution.discrete.space.trace
    result = np.full(2, np.nan)
    for axis, given in enumerate(prescribed_components(problem, trace)):
        at = np.flatnonzero(given & (bodies.of_segment == body))
        if len(at):
            result[axis] = _boundary_mean(solution, at)[axis]
    return result


def _boundary_mean(solution: Solved, segments: Index) -> Array:
    """Mean displacement (2,) on `segments` (k,), weighted as the model weighs lengths."""
    trace = solution.discrete.space.trace
    t, w = gauss(trace.order + 2 * trace.geometry_order)
    places = trace.at_places(segments, t)
    weights = trace.surface_element(*places) * np.tile(w, len(segments))
    return np.asarray((weights @ trace.evaluate(solution.displacement, *places)) / weights.sum())
