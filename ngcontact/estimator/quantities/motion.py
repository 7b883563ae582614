"""How far two bodies approach, and along which direction their force is told."""

from __future__ import annotations

import numpy as np

from ...arrays import Array, Index
from ...contact import ContactState
from ...fem import Bodies, connected_bodies
from ...lagrange import gauss
from ..bound import Solved

NONE = 1e-9  # part of the largest load that is none


def direction_of(solution: Solved, pair: int, state: ContactState) -> tuple[Array, str]:
    """Unit vector (2,) along which the force of a pair is told, and what it is.

    The axis of revolution; the pair's direction; that of the loads on the secondary's body, or of
    those on the primary's; that in which prescribed displacements press the bodies together; that
    of the force itself. On a part of a symmetric model the force also has a component that a guide
    takes: a direction across the force, or nearly so, is passed by.
    """
    force = solution.contact_force(pair)
    size = float(np.linalg.norm(force))
    candidates = [(np.array([0.0, 1.0]), "the axis")] * solution.discrete.space.trace.model.extent
    if state.line.contact.direction is not None:
        candidates.append((np.array(state.line.contact.direction), "the pair's direction"))
    bodies = connected_bodies(solution.discrete.space.trace)
    sides = _sides(state, bodies)
    vertices = len(bodies.of_vertex)
    loads = solution.discrete.space.f.reshape(2, -1)[:, :vertices]
    largest = float(np.abs(loads).sum())
    for body in sides:
        load = loads[:, bodies.of_vertex == body].sum(axis=1)
        if np.linalg.norm(load) > NONE * largest:
            candidates.append((load, "the load"))
    moved = [_held(solution, bodies, body) for body in sides]
    relative = np.nan_to_num(moved[0]) - (np.nan_to_num(moved[1]) if len(moved) > 1 else 0.0)
    candidates.append((relative, "the prescribed displacement"))
    for vector, name in candidates:
        length = float(np.linalg.norm(vector))
        if length > 0 and abs(vector @ force) >= 0.5 * length * size:
            e = vector / length
            return (e if e @ force >= 0 else -e), name
    return (force / size if size > 0 else np.array([1.0, 0.0])), "itself"


def approach_of(solution: Solved, state: ContactState, e: Array) -> tuple[float, float]:
    """How far the bodies of a pair approach along `e` (2,), and the part of it that is not given.

    Each body moves by the mean of what its supports prescribe along e, or, where none does, by the
    mean of its displacement; a rigid obstacle stays.
    """
    bodies = connected_bodies(solution.discrete.space.trace)
    total, free = np.zeros(2), np.zeros(2)
    for sign, body in zip((1.0, -1.0), _sides(state, bodies), strict=False):
        held = _held(solution, bodies, body)
        mean = _mean(solution, bodies, body)
        total += sign * np.where(np.isnan(held), mean, held)
        free += np.where(np.isnan(held), np.abs(mean), 0.0)
    return abs(float(total @ e)), float(free @ np.abs(e))


def _sides(state: ContactState, bodies: Bodies) -> list[int]:
    """Numbers of the bodies of the secondary and, if there is one, of the primary."""
    chosen = [state.line.segments, state.line.facing]
    return [int(bodies.of_segment[s[0]]) for s in chosen if len(s)]


def _held(solution: Solved, bodies: Bodies, body: int) -> Array:
    """Mean (2,) over a body's supports of what they prescribe, NaN where nothing is."""
    problem, trace = solution.problem, solution.discrete.space.trace
    own = np.flatnonzero(bodies.of_segment == body)
    result = np.full(2, np.nan)
    for axis in (0, 1):
        given = [name for name, u in problem.displacement.items() if u[axis] is not None]
        at = own[trace.lies_on(own, *given)]
        if len(at):
            result[axis] = _boundary_mean(solution, at)[axis]
    return result


def _mean(solution: Solved, bodies: Bodies, body: int) -> Array:
    """Mean displacement (2,) of a body's boundary."""
    inner = solution.discrete.space.trace.inner
    return _boundary_mean(solution, np.flatnonzero((bodies.of_segment == body) & ~inner))


def _boundary_mean(solution: Solved, segments: Index) -> Array:
    """Mean displacement (2,) on `segments` (k,), weighted as the model weighs lengths."""
    trace = solution.discrete.space.trace
    t, w = gauss(trace.order + 2 * trace.geometry_order)
    at, s = np.repeat(segments, len(t)), np.tile(t, len(segments))
    size = np.linalg.norm(trace.derivative(at, s), axis=1) * trace.measure(at, s)
    u = trace.evaluate(solution.displacement, at, s)
    weights = size * np.tile(w, len(segments))
    return np.asarray((weights @ u) / weights.sum())
