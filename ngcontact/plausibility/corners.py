"""Corners at which supports contradict each other: no displacement of finite energy has both."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..errors import warn
from ..fem import BoundaryTrace, boundary_trace
from ..problem import Problem
from ..quadrature import Features, View, features_of, looked, numbers

APART = 1e-6  # values of two supports at one corner, relative to the largest, that are two values
NOISE = 64 * np.finfo(float).eps  # ... and to the largest of all values: below it is round-off


@dataclass(frozen=True)
class Contradiction:
    """Two supports and a corner of theirs.

    Attributes
    ----------
    supports : tuple of str
        Names.
    place : ndarray (2,)
        The corner, a length.
    message : str
        What they say there.
    amount : float
        By how much they differ, a length.
    """

    supports: tuple[str, str]
    place: Array
    message: str
    amount: float


def contradictions(problem: Problem, trace: BoundaryTrace) -> list[Contradiction]:
    """All of Gamma_u with itself, within a boundary, too, and with guides, by component.

    `trace` is that of order 1.
    """
    if not problem.displacement:
        return []
    seen, shared = _prescribed(problem, trace.mesh), _shared(problem, trace.mesh)
    known: dict[tuple[int, int], tuple[str, float]] = {}
    found = [
        Contradiction(
            (one.name, one.name),
            np.array(place),
            f'displacement "{one.name}" jumps by {amount:.6g} along {"xy"[one.axis]}',
            amount,
        )
        for one in seen
        for *place, amount in one.jumps.tolist()
    ]
    for pattern, components in problem.displacement.items():
        segment, s = trace.at_nodes(trace.segments(pattern))
        node = trace.nodes[segment, np.round(s).astype(int)]
        segment, s, node = segment[shared[node]], s[shared[node]], node[shared[node]].tolist()
        for axis, value in enumerate(components):
            if value is None or not len(segment):
                continue
            points = trace.mesh_points(segment, s)
            values = (
                value(points).ravel() if numbers(value) else looked(value, points).ravel()
            ).tolist()
            for k, (vertex, u) in enumerate(zip(node, values, strict=True)):
                name, other = known.setdefault((vertex, axis), (pattern, u))
                if abs(u - other) > APART * max(abs(other), abs(u)):
                    found.append(
                        Contradiction(
                            (name, pattern),
                            trace.point(segment[k : k + 1], s[k : k + 1])[0],
                            f'displacement "{name}" and "{pattern}" prescribe {other:.6g} and '
                            f"{u:.6g} along {'xy'[axis]}",
                            abs(u - other),
                        )
                    )
    found += _across_guides(problem, trace, known)
    largest = max((one.largest for one in seen), default=0.0)
    return [one for one in found if one.amount > NOISE * largest]


def _prescribed(problem: Problem, mesh: ng.Mesh) -> list[Features]:
    """What was seen of displacements given as functions."""
    return [one for one in features_of(problem, mesh) if one.kind == "displacement"]


def _shared(problem: Problem, mesh: ng.Mesh) -> Mask:
    """Vertices at which segments of several prescribed regions, or of guides, meet."""
    guides = [str(problem.sliding)] if problem.sliding is not None else []
    view, pattern = View(mesh, 1), "|".join([*problem.displacement, *guides])
    at = view.inside(mesh.Boundaries(pattern))
    vertex, region = view.arrays.segments[at], view.arrays.boundaries[at]
    low, high = np.full(mesh.nv, len(mesh.GetBoundaries())), np.full(mesh.nv, -1)
    np.minimum.at(low, vertex, region[:, None])
    np.maximum.at(high, vertex, region[:, None])
    return np.asarray(low < high)


def _across_guides(
    problem: Problem, trace: BoundaryTrace, known: dict[tuple[int, int], tuple[str, float]]
) -> list[Contradiction]:
    """Ends of guides at which `known` values, by vertex and axis, lead across them."""
    if problem.sliding is None:
        return []
    found = []
    segment, s = trace.at_nodes(trace.segments(str(problem.sliding)))
    node = trace.nodes[segment, np.round(s).astype(int)].tolist()
    place, normals = trace.point(segment, s), trace.exact_normal(segment, s)
    for vertex, x, normal in zip(node, place, normals, strict=True):
        needed = [axis for axis in (0, 1) if abs(normal[axis]) > APART]
        if all((vertex, axis) in known for axis in needed):
            name = known[vertex, needed[0]][0]
            u = [known.get((vertex, axis), ("", 0.0))[1] for axis in (0, 1)]
            across = float(normal @ u)
            if abs(across) > APART * max(map(abs, u)):
                message = f'displacement "{name}" leads {across:.6g} across the guide'
                message += f' "{problem.sliding}"'
                found.append(Contradiction((name, "guide"), x, message, abs(across)))
    return found


def warn_of_contradictions(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of the first corner of each two supports."""
    told: set[tuple[str, str]] = set()
    possible = bool(problem.displacement) and (
        any(len(one.jumps) for one in _prescribed(problem, mesh)) or _shared(problem, mesh).any()
    )
    for one in contradictions(problem, boundary_trace(mesh, 1)) if possible else ():
        if one.supports not in told:
            told.add(one.supports)
            x, y = one.place
            warn(
                f"{one.message} at {_place(one)} ({x:.6g}, {y:.6g}): the energy is infinite and no "
                "mesh resolves it; make them equal there"
            )


def _place(one: Contradiction) -> str:
    """What is at the place of a contradiction."""
    return "a point" if one.supports[0] == one.supports[1] else "their corner"
