"""Local refinement that keeps facing contact lines matched, HH81 (2.10)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, across
from ..contact import faced_vertices, nodal_line
from ..fem import BoundaryTrace, boundary_trace, unknowns_of
from ..mesh import CadEdge, copied
from ..problem import Contact, MeshArrays, Problem, bisect, move_vertices

# Distance, relative to the geometry, up to which two vertices are at one place.
VERTEX_DISTANCE = 1e-12
MATCHING_ROUNDS = 12  # refinements after which a facing segment that still lags takes dual rows


@dataclass(frozen=True, eq=False)
class RefinementTree:
    """The first mesh of a sequence, and its elements that those of a later one are parts of."""

    mesh: ng.Mesh
    element: Index  # (ne,), an element of it for each of the later ones


def matched_vertices(trace: BoundaryTrace, contact: Contact) -> dict[int, int]:
    """Vertices of the secondary and, at the same C_j, of the primary; `trace` is of degree 1."""
    if contact.primary is None:
        return {}
    line, facing = nodal_line(trace, contact)
    vertex = faced_vertices(trace, line, facing)
    met = vertex >= 0
    return dict(zip(line.node[met].tolist(), vertex[met].tolist(), strict=True))


def _boundary_edges(mesh: ng.Mesh) -> dict[tuple[int, int], int]:
    """Element at each boundary segment, by its vertices."""
    view = MeshArrays(mesh)
    ends = np.sort(view.facets, axis=1).tolist()
    return {(a, b): el for (a, b), el in zip(ends, view.facet_elements.tolist(), strict=True)}


def _children(mesh: ng.Mesh, first: int) -> dict[tuple[int, int], int]:
    """New vertex on each bisected boundary segment, by the segment's vertices."""
    ends = MeshArrays(mesh).facets
    parents = ((v, mesh.GetParentVertices(v)) for v in np.unique(ends[ends >= first]).tolist())
    return {(min(a, b), max(a, b)): v for v, (a, b) in parents}


def _facing_elements(
    pairs: list[dict[int, int]], segments: dict[tuple[int, int], int], flags: Mask
) -> list[int]:
    """Elements at segments that face those of flagged elements: marked late, they cost a round."""
    found = []
    for pair in pairs:
        for here in (pair, {b: a for a, b in pair.items()}):
            for (a, b), element in segments.items():
                if a in here and b in here and flags[element]:
                    facing = min(here[a], here[b]), max(here[a], here[b])
                    found.extend([segments[facing]] if facing in segments else [])
    return found


def _match_children(
    pairs: dict[int, int],
    children: dict[tuple[int, int], int],
    segments: dict[tuple[int, int], int],
) -> list[int]:
    """Add to `pairs` the new vertices on facing segments; elements at segments that lag."""
    back = {b: a for a, b in pairs.items()}
    lagging = []
    for (a, b), child in sorted(children.items(), key=lambda item: item[1]):
        for here, there in ((pairs, back), (back, pairs)):
            if a in here and b in here and child not in here:
                key = (min(here[a], here[b]), max(here[a], here[b]))
                if key in children:
                    here[child], there[children[key]] = children[key], child
                elif key in segments:
                    lagging.append(segments[key])
    return lagging


def _by_edge(trace: BoundaryTrace, vertices: Index) -> Iterator[tuple[CadEdge, Index]]:
    """CAD edges on which the vertices (k,) lie, each with the numbers of those."""
    region = np.full(trace.space.ndof, -1)
    region[trace.nodes[:, [0, -1]]] = trace.region[:, None]
    for number in np.unique(region[vertices]):
        yield (trace.edges or [])[number], np.flatnonzero(region[vertices] == number)


def _move_to_partners(
    trace: BoundaryTrace, contact: Contact, matched: dict[int, int], first: int
) -> None:
    """Move new pairs of vertices along their exact curves until they face each other.

    Along a fixed direction both go to their mean eta; along normals, across a clearance or an
    overlap, the one of the primary goes to the normal of the other.
    """
    new = [(a, b) for a, b in matched.items() if a >= first or b >= first]
    if trace.edges is None or not new:
        return
    mesh = MeshArrays(trace.mesh)
    pairs, xy = np.array(new), mesh.vertices
    if contact.direction is None:
        apart = np.linalg.norm(xy[pairs[:, 0]] - xy[pairs[:, 1]], axis=1)
        pairs = pairs[apart > VERTEX_DISTANCE * mesh.extent]
        normal = np.zeros((len(pairs), 2))
        for edge, at in _by_edge(trace, pairs[:, 0]):
            normal[at] = edge.normal_at(edge.project(xy[pairs[at, 0]]))
        axis = across(normal)
        level = (xy[pairs[:, 0]] * axis).sum(axis=1)
        moving: tuple[int, ...] = (1,)
    else:
        axis = across(np.array(contact.direction))
        level = (xy[pairs] @ axis).mean(axis=1)  # C_j of (2.10)
        moving = (0, 1)
    moved = xy.copy()
    for side in moving:
        for edge, at in _by_edge(trace, pairs[:, side]):
            v = pairs[at, side]
            t = edge.level(axis if axis.ndim == 1 else axis[at], level[at], xy[v])
            reached = ~np.isnan(t)
            moved[v[reached]] = edge.point(t[reached])
    move_vertices(trace.mesh, _without_inversion(trace.mesh, xy, moved))


def _without_inversion(mesh: ng.Mesh, old: Array, new: Array) -> Array:
    """The new positions, but the old ones at triangles they would turn over."""
    triangles = MeshArrays(mesh).elements
    while True:
        a, b, c = np.moveaxis(new[triangles], 1, 0)
        turned = np.unique(triangles[(across(b - a) * (c - a)).sum(axis=1) <= 0])
        if not (new[turned] != old[turned]).any():
            return new
        new = new.copy()
        new[turned] = old[turned]


class Refining:
    """A copy of a mesh that is bisected, several times if need be, before it is handed on.

    Its `mesh` is straight-sided; refined elements keep their number and have further ones behind,
    and each is a part of the element `origin` (ne,) of the given mesh, which stays as it is.
    Between bisections new nodes of facing segments, which the pairs of the problem tell, are as
    many, but not yet at common C_j.
    """

    def __init__(self, problem: Problem, mesh: ng.Mesh) -> None:
        self.problem, self.given = problem, mesh
        self.mesh = copied(mesh)
        self.origin = np.arange(mesh.ne)
        paired = any(contact.primary is not None for contact in problem.contact)
        trace = boundary_trace(mesh, 1) if paired else None
        self._pairs = [matched_vertices(trace, contact) for contact in problem.contact if trace]
        self._segments = _boundary_edges(self.mesh) if any(self._pairs) else {}
        self._first = mesh.nv
        self._characteristic = mesh.nv - mesh.nedge + mesh.ne
        self._curved = mesh.GetCurveOrder() > 1

    def unknowns(self, order: int, element: str) -> int:
        """Number of unknowns of the displacement, as `fem.unknowns` of the finished mesh."""
        now = self.mesh
        edges = now.nv + now.ne - self._characteristic  # Euler; NGSolve counts those of a copy only
        extra = now.GetNE(ng.BND) if element == "physical" and self._curved else 0
        return unknowns_of(order, now.nv + extra, edges, now.ne)

    def bisect(self, marked: Mask) -> Index:
        """Refine the elements `marked` (ne,), and what keeps contact lines matched.

        Returns the element (k,) of which each of the k elements is a part, by its former number.
        """
        flags, count = np.array(marked), self.mesh.ne
        matched = any(self._pairs)
        if matched:
            flags[_facing_elements(self._pairs, self._segments, flags)] = True
        for _ in range(MATCHING_ROUNDS):
            bisect(self.mesh, flags)
            if not matched:
                break
            self._segments, children = _boundary_edges(self.mesh), _children(self.mesh, self._first)
            matching = (_match_children(pair, children, self._segments) for pair in self._pairs)
            lagging = [element for elements in matching for element in elements]
            if not lagging:
                break
            flags = np.zeros(self.mesh.ne, dtype=bool)
            flags[lagging] = True
        parent = np.arange(self.mesh.ne)
        new = (self.mesh.GetParentElement(ng.ElementId(ng.VOL, i)).nr for i in parent[count:])
        parent[count:] = np.fromiter(new, dtype=np.intp, count=len(parent) - count)
        while (parent >= count).any():  # parts of parts
            parent = parent[parent]
        self.origin = self.origin[parent]
        return parent

    def finished(self) -> ng.Mesh:
        """The mesh, to be curved by the caller, with new nodes moved along curves to common C_j."""
        if any(self._pairs):
            trace = boundary_trace(self.mesh, 1)
            for contact, pair in zip(self.problem.contact, self._pairs, strict=True):
                _move_to_partners(trace, contact, pair, self._first)
        return copied(self.mesh)  # numbers only the edges that are left


def refined(problem: Problem, mesh: ng.Mesh, marked: Mask | None = None) -> ng.Mesh:
    """Refined copy of a mesh, of elements `marked` (ne,) or all; straight, with lines matched."""
    refining = Refining(problem, mesh)
    refining.bisect(np.ones(mesh.ne, dtype=bool) if marked is None else marked)
    return refining.finished()
