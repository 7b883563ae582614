"""Local refinement that keeps facing contact lines matched, HH81 (2.10)."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import Any

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, across, places_of
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


def matched_vertices(trace: BoundaryTrace, contact: Contact) -> Index:
    """Vertices (2, nv) of the primary at the C_j of the secondary's, and the reverse; -1 elsewhere.

    `trace` is of degree 1.
    """
    partner = np.full((2, trace.mesh.nv), -1)
    if contact.primary is not None:
        line, facing = nodal_line(trace, contact)
        vertex = faced_vertices(trace, line, facing)
        met = vertex >= 0
        partner[0, line.node[met]], partner[1, vertex[met]] = vertex[met], line.node[met]
    return partner


def _of_primaries(contacts: Iterable[Contact]) -> list[Contact]:
    """Contact of each primary along one direction with all its secondaries, as if one pair."""
    secondaries: dict[Any, list[str]] = defaultdict(list)
    for contact in contacts:
        if contact.primary is not None:
            secondaries[contact.primary, contact.direction].append(contact.secondary)
    return [Contact("|".join(names), *sides) for sides, names in secondaries.items()]


def _by_edge(trace: BoundaryTrace, vertices: Index) -> Iterator[tuple[CadEdge, Index]]:
    """CAD edges on which the vertices (k,) lie, each with the numbers of those."""
    region = np.full(trace.space.ndof, -1)
    region[trace.nodes[:, [0, -1]]] = trace.region[:, None]
    for number in np.unique(region[vertices]):
        yield (trace.edges or [])[number], np.flatnonzero(region[vertices] == number)


def _move_to_partners(trace: BoundaryTrace, contact: Contact, pairs: Index) -> None:
    """Move pairs (k, 2) of new vertices along their exact curves until they face each other.

    Along a fixed direction both go to their mean eta; along normals, across a clearance or an
    overlap, the one of the primary goes to the normal of the other.
    """
    if trace.edges is None or not len(pairs):
        return
    mesh = MeshArrays(trace.mesh)
    xy = mesh.vertices
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
    """The `new` positions (nv, 2), in place the `old` ones (nv, 2) at triangles they turn over."""
    triangles = MeshArrays(mesh).elements
    while True:
        a, b, c = np.moveaxis(new[triangles], 1, 0)
        turned = np.unique(triangles[(across(b - a) * (c - a)).sum(axis=1) <= 0])
        if not (new[turned] != old[turned]).any():
            return new
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
        self._paired = _of_primaries(problem.contact)
        # (2 p, nv), of each of p primaries what `matched_vertices` answers
        self._partner = np.zeros((0, mesh.nv), dtype=np.intp)
        if self._paired:
            trace = boundary_trace(mesh, 1)
            self._partner = np.concatenate([matched_vertices(trace, one) for one in self._paired])
        self._first = mesh.nv
        self._characteristic = mesh.nv - mesh.nedge + mesh.ne
        self._curved = mesh.GetCurveOrder() > 1

    def unknowns(self, order: int, element: str) -> int:
        """Number of unknowns of the displacement, as `fem.unknowns` of the finished mesh."""
        now = self.mesh
        edges = now.nv + now.ne - self._characteristic  # Euler; NGSolve counts those of a copy only
        extra = now.GetNE(ng.BND) if element == "physical" and self._curved else 0
        return unknowns_of(order, now.nv + extra, edges, now.ne)

    def _facing(self, ends: Index, among: Index) -> Index:
        """Numbers (2 p, k) of pairs of vertices `among` (n, 2) that face `ends` (k, 2), or -1."""
        keys, there = MeshArrays(self.mesh).keys, self._partner[:, ends]
        found = places_of(keys(there).ravel(), keys(among)).reshape(there.shape[:2])
        return np.where((there >= 0).all(axis=2), found, -1)

    def _elements_facing(self, ends: Index) -> Index:
        """Elements (j,) at segments that face those with the `ends` (k, 2)."""
        view = MeshArrays(self.mesh)
        facing = self._facing(ends, view.facets)
        return view.facet_elements[facing[facing >= 0]]

    def _match(self) -> Index:
        """Match the vertices made since on facing segments; elements (j,) at segments that lag."""
        made = MeshArrays(self.mesh).facets
        made = np.unique(made[made >= self._first])
        each = [self.mesh.GetParentVertices(v) for v in made.tolist()]
        parents = np.array(each, dtype=np.intp).reshape(-1, 2)
        more = self.mesh.nv - self._partner.shape[1]
        self._partner = np.pad(self._partner, ((0, 0), (0, more)), constant_values=-1)
        while True:  # those on halves of segments once the middles are matched
            facing = self._facing(parents, parents)
            partner = np.where(facing >= 0, made[facing], -1)
            if np.array_equal(self._partner[:, made], partner):
                return self._elements_facing(parents)
            self._partner[:, made] = partner

    def bisect(self, marked: Mask) -> Index:
        """Refine the elements `marked` (ne,), and what keeps contact lines matched.

        Returns the element (k,) of which each of the k elements is a part, by its former number.
        """
        flags, view = np.array(marked), MeshArrays(self.mesh)
        count, matched = self.mesh.ne, (self._partner >= 0).any()
        if matched:  # marked late, they cost a round
            flags[self._elements_facing(view.facets[flags[view.facet_elements]])] = True
        for _ in range(MATCHING_ROUNDS):
            bisect(self.mesh, flags)
            if not matched or not len(lagging := self._match()):
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
        if (self._partner >= 0).any():
            trace = boundary_trace(self.mesh, 1)
            for contact, partner in zip(self._paired, self._partner[::2], strict=True):
                pairs = np.column_stack([np.arange(len(partner)), partner])[partner >= 0]
                _move_to_partners(trace, contact, pairs[(pairs >= self._first).any(axis=1)])
        return copied(self.mesh)  # numbers only the edges that are left


def refined(problem: Problem, mesh: ng.Mesh, marked: Mask | None = None) -> ng.Mesh:
    """Refined copy of a mesh, of elements `marked` (ne,) or all; straight, with lines matched."""
    refining = Refining(problem, mesh)
    refining.bisect(np.ones(mesh.ne, dtype=bool) if marked is None else marked)
    return refining.finished()
