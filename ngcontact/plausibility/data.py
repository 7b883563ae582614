"""Plausibility of data before the first solve: loads, laws, supports that contradict."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..errors import warn
from ..fem import boundary_trace, warn_of_jumps, warn_of_locking
from ..mesh import cad_edges
from ..problem import MeshArrays, Problem, numbers
from ..quadrature import SampledElements, features_of, warn_of_data

# Values of two supports at one corner, relative to the largest, that are two values.
SUPPORT_DIFFERENCE = 1e-6
# ... and to the largest of all values: below it is round-off.
VALUE_ROUND_OFF = 64 * np.finfo(float).eps


@dataclass(frozen=True)
class Contradiction:
    """Two supports and a corner of theirs."""

    supports: tuple[str, str]  # names
    place: Array  # (d,), the corner, or a vertex of the common edge, a length
    message: str  # what they say there
    amount: float  # by how much they differ, a length


def contradictions(problem: Problem, mesh: ng.Mesh) -> list[Contradiction]:
    """All of Gamma_u with itself, within a boundary, too, and with guides, by component."""
    if problem.dim == 3:
        return _of_solids(problem, mesh)
    found = []
    seen = [one for one in features_of(problem, mesh) if one.kind == "displacement"]
    for one in seen:
        for *place, amount in one.jumps.tolist():
            message = f'displacement "{one.name}" jumps by {amount:.6g} along {"xy"[one.axis]}'
            found.append(Contradiction((one.name, one.name), np.array(place), message, amount))
    view = SampledElements(mesh, 1)
    shared = _shared(problem, view)
    known: dict[tuple[int, int], tuple[str, float]] = {}  # support and value by vertex and axis
    for pattern, components in problem.displacement.items():
        ends = _Ends(view, pattern, shared)
        for axis, value in enumerate(components):
            if value is None or not len(ends.vertices):
                continue
            values = ends.values(value, view.evaluate if numbers(value) else view.sample)
            for vertex, u in zip(ends.vertices.tolist(), values[:, 0].tolist(), strict=True):
                name, other = known.setdefault((vertex, axis), (pattern, u))
                if abs(u - other) > SUPPORT_DIFFERENCE * max(abs(other), abs(u)):
                    message = (
                        f'displacement "{name}" and "{pattern}" prescribe {other:.6g} and {u:.6g} '
                        f"along {'xy'[axis]}"
                    )
                    place, amount = view.arrays.vertices[vertex], abs(u - other)
                    found.append(Contradiction((name, pattern), place, message, amount))
    if problem.sliding is not None and known:
        found += _across_guides(str(problem.sliding), view, shared, known)
    largest = max((one.largest for one in seen), default=0.0)
    return [one for one in found if one.amount > VALUE_ROUND_OFF * largest]


def _of_solids(problem: Problem, mesh: ng.Mesh) -> list[Contradiction]:
    """Values at vertices of solids: of two facets there the least and the largest one."""
    trace, found = boundary_trace(mesh, 1), []
    n, names = mesh.nv, np.array(mesh.GetBoundaries())
    low, high = np.full((3, n), np.inf), np.full((3, n), -np.inf)
    least, most = np.zeros((2, 3, n), dtype=np.intp)  # the regions that prescribe these
    for pattern, components in problem.displacement.items():
        facet, s = trace.at_nodes(trace.segments(pattern))
        node = trace.nodes[trace.segments(pattern)].ravel()
        for axis, function in enumerate(components):
            if function is not None:
                u = trace.evaluate(function, facet, s)[:, 0]
                for extreme, region, sign in ((low, least, -1), (high, most, 1)):
                    order = np.argsort(sign * u, kind="stable")  # the last one counts
                    at, value = node[order], u[order]
                    beyond = sign * value > sign * extreme[axis, at]
                    extreme[axis, at[beyond]] = value[beyond]
                    region[axis, at[beyond]] = trace.region[facet[order[beyond]]]
    known = high >= low
    low, high = (np.where(known, x, 0.0) for x in (low, high))
    scale = np.maximum(np.abs(low), np.abs(high))
    x = MeshArrays(mesh).vertices
    for axis, vertex in np.argwhere(high - low > SUPPORT_DIFFERENCE * scale):
        one, other = (names[region[axis, vertex]] for region in (least, most))
        a, b = low[axis, vertex], high[axis, vertex]
        message = f'displacement "{one}" and "{other}" prescribe {a:.6g} and {b:.6g}'
        message += f" along {'xyz'[axis]}"
        found.append(Contradiction((one, other), x[vertex], message, float(b - a)))
    if problem.sliding is not None:
        number, normal = trace.guide(str(problem.sliding))
        node = trace.nodes[trace.segments(str(problem.sliding))].ravel()
        across = (normal[number] * high[:, node].T).sum(axis=1)
        led = ((np.abs(normal[number]) <= SUPPORT_DIFFERENCE) | known[:, node].T).all(axis=1)
        for k in np.flatnonzero(
            led & (np.abs(across) > SUPPORT_DIFFERENCE * scale[:, node].max(axis=0))
        ):
            name = names[most[np.argmax(np.abs(normal[number[k]])), node[k]]]
            message = f'displacement "{name}" leads {across[k]:.6g} across the guide '
            message += f'"{problem.sliding}"'
            found.append(Contradiction((name, "guide"), x[node[k]], message, abs(across[k])))
    return [one for one in found if one.amount > VALUE_ROUND_OFF * scale.max()]


def _shared(problem: Problem, view: SampledElements) -> Mask:
    """Vertices at which segments of several prescribed regions, or of guides, meet."""
    guides = [str(problem.sliding)] if problem.sliding is not None else []
    at = view.inside(view.mesh.Boundaries("|".join([*problem.displacement, *guides])))
    vertex, region = view.ends[at], view.arrays.boundaries[at]
    low, high = np.full(view.mesh.nv, len(view.mesh.GetBoundaries())), np.full(view.mesh.nv, -1)
    np.minimum.at(low, vertex, region[:, None])
    np.maximum.at(high, vertex, region[:, None])
    return np.asarray(low < high)


class _Ends:
    """Ends of segments of a boundary at `shared` vertices (nv,), k of them."""

    def __init__(self, view: SampledElements, pattern: str, shared: Mask) -> None:
        segments = view.inside(view.mesh.Boundaries(pattern))
        at, end = np.nonzero(shared[view.ends[segments]])
        self.segments = segments[at]  # (k,)
        self.vertices = view.ends[self.segments, end]  # (k,)
        self._places = np.asarray(1.0 - end[:, None, None], dtype=float)  # as NGSolve runs

    def values(self, function: ng.CoefficientFunction, evaluate: Callable[..., Array]) -> Array:
        """Values of a function there, (k, c)."""
        return evaluate(function, self.segments, self._places)[:, 0]


def _across_guides(
    guides: str,
    view: SampledElements,
    shared: Mask,
    known: dict[tuple[int, int], tuple[str, float]],
) -> list[Contradiction]:
    """Ends of `guides` at which `known` values, by vertex and axis, lead across them."""
    found = []
    ends, edges = _Ends(view, guides, shared), cad_edges(view.mesh)
    places = view.arrays.vertices[ends.vertices]
    normals = ends.values(ng.specialcf.normal(2), view.evaluate)
    for k, vertex in enumerate(ends.vertices.tolist()):
        normal = normals[k]
        if edges is not None:
            [exact] = edges[view.arrays.boundaries[ends.segments[k]]].normal(places[k : k + 1])
            normal = exact if exact @ normal > 0 else -exact
        needed = [axis for axis in (0, 1) if abs(normal[axis]) > SUPPORT_DIFFERENCE]
        if all((vertex, axis) in known for axis in needed):
            name = known[vertex, needed[0]][0]
            u = [known.get((vertex, axis), ("", 0.0))[1] for axis in (0, 1)]
            across = float(normal @ u)
            if abs(across) > SUPPORT_DIFFERENCE * max(map(abs, u)):
                message = f'displacement "{name}" leads {across:.6g} across the guide "{guides}"'
                found.append(Contradiction((name, "guide"), places[k], message, abs(across)))
    return found


def warn_of_implausible(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of elements that lock, loads that are nowhere, supports that contradict, laws that jump.

    Once, of the first mesh; of supports at the first corner of each two.
    """
    warn_of_locking(problem, mesh, order)
    warn_of_data(problem, mesh, order)
    warned: set[tuple[str, str]] = set()
    for one in contradictions(problem, mesh):
        if one.supports not in warned:
            warned.add(one.supports)
            common = ("corner", "edge")[problem.dim - 2]
            where = "a point" if one.supports[0] == one.supports[1] else f"their {common}"
            place = ", ".join(f"{x:.6g}" for x in one.place)
            warn(
                f"{one.message} at {where} ({place}): the energy is infinite and no mesh resolves "
                "it; make them equal there"
            )
    warn_of_jumps(problem, mesh)
