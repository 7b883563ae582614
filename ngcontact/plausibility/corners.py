"""What is looked at before the first solve: corners at which supports contradict each other."""

from __future__ import annotations

from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..errors import warn
from ..fem import warn_of_locking
from ..mesh import cad_edges
from ..problem import Problem, numbers
from ..quadrature import SampledElements, features_of, warn_of_data, warn_of_jumps

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


def contradictions(problem: Problem, mesh: ng.Mesh) -> list[Contradiction]:
    """All of Gamma_u with itself, within a boundary, too, and with guides, by component."""
    if not problem.displacement:
        return []
    seen = [one for one in features_of(problem, mesh) if one.kind == "displacement"]
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
    view = SampledElements(mesh, 1)
    shared = _shared(problem, view)
    known: dict[tuple[int, int], tuple[str, float]] = {}
    for pattern, components in problem.displacement.items() if shared.any() else ():
        vertices, segments, s = _ends(view, pattern, shared)
        for axis, value in enumerate(components):
            if value is None or not len(vertices):
                continue
            look = view.evaluate if numbers(value) else view.look
            values = look(value, segments, s).ravel().tolist()
            for vertex, u in zip(vertices.tolist(), values, strict=True):
                name, other = known.setdefault((vertex, axis), (pattern, u))
                if abs(u - other) > APART * max(abs(other), abs(u)):
                    found.append(
                        Contradiction(
                            (name, pattern),
                            view.arrays.vertices[vertex],
                            f'displacement "{name}" and "{pattern}" prescribe {other:.6g} and '
                            f"{u:.6g} along {'xy'[axis]}",
                            abs(u - other),
                        )
                    )
    if problem.sliding is not None and known:
        found += _across_guides(str(problem.sliding), view, shared, known)
    largest = max((one.largest for one in seen), default=0.0)
    return [one for one in found if one.amount > NOISE * largest]


def _shared(problem: Problem, view: SampledElements) -> Mask:
    """Vertices at which segments of several prescribed regions, or of guides, meet."""
    guides = [str(problem.sliding)] if problem.sliding is not None else []
    at = view.inside(view.mesh.Boundaries("|".join([*problem.displacement, *guides])))
    vertex, region = view.arrays.facets[at], view.arrays.boundaries[at]
    low, high = np.full(view.mesh.nv, len(view.mesh.GetBoundaries())), np.full(view.mesh.nv, -1)
    np.minimum.at(low, vertex, region[:, None])
    np.maximum.at(high, vertex, region[:, None])
    return np.asarray(low < high)


def _ends(view: SampledElements, pattern: str, shared: Mask) -> tuple[Index, Index, Array]:
    """The `shared` vertices (k,) of boundaries, once for each segment (k,) there.

    And the places (k, 1, 1) on these, as NGSolve's parameter runs.
    """
    segments = view.inside(view.mesh.Boundaries(pattern))
    vertices = view.arrays.facets[segments]
    k, end = np.nonzero(shared[vertices])
    return vertices[k, end], segments[k], np.asarray(1.0 - end[:, None, None])


def _across_guides(
    guides: str,
    view: SampledElements,
    shared: Mask,
    known: dict[tuple[int, int], tuple[str, float]],
) -> list[Contradiction]:
    """Ends of `guides` at which `known` values, by vertex and axis, lead across them."""
    found = []
    vertices, segments, s = _ends(view, guides, shared)
    places, edges = view.arrays.vertices[vertices], cad_edges(view.mesh)
    normals = view.evaluate(ng.specialcf.normal(2), segments, s)[:, 0]
    for k, vertex in enumerate(vertices.tolist()):
        normal = normals[k]
        if edges is not None:
            [exact] = edges[view.arrays.boundaries[segments[k]]].normal(places[k : k + 1])
            normal = exact if exact @ normal > 0 else -exact
        needed = [axis for axis in (0, 1) if abs(normal[axis]) > APART]
        if all((vertex, axis) in known for axis in needed):
            name = known[vertex, needed[0]][0]
            u = [known.get((vertex, axis), ("", 0.0))[1] for axis in (0, 1)]
            across = float(normal @ u)
            if abs(across) > APART * max(map(abs, u)):
                message = f'displacement "{name}" leads {across:.6g} across the guide "{guides}"'
                found.append(Contradiction((name, "guide"), places[k], message, abs(across)))
    return found


def warn_of_contradictions(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of the first corner of each two supports."""
    told: set[tuple[str, str]] = set()
    for one in contradictions(problem, mesh):
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


def warn_of_implausible(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of elements that lock, loads that are nowhere, supports that contradict, laws that jump.

    Once, of the first mesh.
    """
    warn_of_locking(problem, mesh, order)
    warn_of_data(problem, mesh, order)
    warn_of_contradictions(problem, mesh)
    warn_of_jumps(problem, mesh)
