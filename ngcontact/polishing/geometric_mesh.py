"""Meshes graded geometrically towards singular points: layers of elements of one ratio of sizes.

Towards a point at which the solution is like r^a, polynomials of degree p on layers whose sizes
fall by a constant ratio converge exponentially in p, if the number of layers grows with p (Gui,
Babuska 1986, Numer. Math. 49:577; Schwab 1998, p- and hp-Finite Element Methods, 4.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import netgen.meshing as ngm
import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask, chords
from ..contact import ContactState, by_line, contact_line, faced_vertices
from ..discrete import carried_active_set
from ..fem import boundary_trace, model_of
from ..mesh import CadEdge, cad_edges, graded_mesh, opposite
from ..problem import Contact, MeshArrays, Problem

# Ratios of the sizes of layers: (2^(1/2) - 1)^2 = 0.17 is best for energies in the limit (Gui,
# Babuska), a larger one up to order 10 on two to four triangles a layer (measured: a tenth of the
# error), and for the singular coefficient, which shows where contact ends.
CORNER_RATIO = 0.25
END_RATIO = 0.4
END_SIZE = 0.45  # of the contact up to its middle, which elements at its end may have
SIZE_GROWTH = 0.8  # of sizes, over the distance from the ends
MAX_SIZE = 0.5  # of the extent of the bodies


@dataclass(frozen=True)
class EndOfContact:
    """A vertex at which contact ends, away from corners."""

    pair: int  # number of the pair
    vertex: int  # of the secondary
    closed: int  # the next vertex on the side in contact, before any layers
    opened: int  # and on the other side


@dataclass(frozen=True, eq=False)
class GeometricMesh:
    """A plane mesh as arrays, whose ends of contact can be moved and be given layers."""

    source: ng.Mesh  # with the geometry and the names of regions
    contacts: Sequence[Contact]
    vertices: Array  # (nv, 2)
    triangles: Index  # (ne, 3), anticlockwise
    bodies: Index  # (ne,), material region numbers
    segments: Index  # (k, 2), vertices of the segments of the boundary
    boundaries: Index  # (k,), boundary region numbers
    pair: Index  # (k,), the contact pair whose secondary a segment belongs to, -1 for none
    closed: Mask  # (k,), those of secondaries that are in contact
    partner: Index  # (nv,), vertex that faces one of a secondary, -1 for none

    @cached_property
    def edges(self) -> list[CadEdge]:
        """CAD edges by boundary region number."""
        return cad_edges(self.source) or []

    @cached_property
    def ends(self) -> list[EndOfContact]:
        """Vertices between a segment in contact and an open one of the same CAD edge."""
        found = []
        own = np.flatnonzero(self.pair >= 0)
        for vertex in np.unique(self.segments[own]).tolist():
            at = own[(self.segments[own] == vertex).any(axis=1)]
            if len(at) == 2 and self.closed[at].sum() == 1 and np.ptp(self.boundaries[at]) == 0:
                inner, outer = at if self.closed[at[0]] else at[::-1]
                beside = (int(self.segments[k].sum()) - vertex for k in (inner, outer))
                found.append(EndOfContact(int(self.pair[inner]), vertex, *beside))
        return found

    def _between(self, one: int, other: int) -> int:
        """Number of the segment between two vertices, -1 where there is none."""
        found = np.flatnonzero(np.isin(self.segments, (one, other)).all(axis=1))
        return int(found[0]) if len(found) else -1

    def _facing(self, vertex: int, far: int, places: Array) -> Array | None:
        """Points (k, 2) that face `places` (k, 2) between two vertices; None where nothing does."""
        there = self._between(int(self.partner[vertex]), int(self.partner[far]))
        if there < 0:
            return None
        own = self._between(vertex, far)
        edge, facing = (self.edges[int(self.boundaries[k])] for k in (own, there))
        slope = edge.derivative(edge.project(places))
        return opposite(self.contacts[int(self.pair[own])], places, slope, facing)[1]

    def moved(self, end: EndOfContact, distance: float) -> GeometricMesh:
        """The mesh with an end of contact, and what faces it, moved outwards by a `distance`."""
        vertices = self.vertices.copy()
        edge = self.edges[int(self.boundaries[self._between(end.vertex, end.closed)])]
        outwards = vertices[end.opened] - vertices[end.vertex]
        tangent = edge.derivative(edge.project(vertices[[end.vertex]]))[0]
        tangent *= np.sign(tangent @ outwards) / np.linalg.norm(tangent)
        near = vertices[[end.vertex]] + distance * tangent
        vertices[end.vertex] = edge.point(edge.project(near))[0]
        met = self._facing(end.vertex, end.closed, vertices[[end.vertex]])
        if met is not None:
            vertices[self.partner[end.vertex]] = met[0]
        return replace(self, vertices=vertices)

    def with_layers(self, vertex: int, ratio: float, count: int) -> GeometricMesh:
        """The mesh with layers more at a vertex and at the one that faces it, face to face."""
        mesh, new = self._cut(vertex, ratio, count, {})
        facing = int(self.partner[vertex])
        if facing < 0:
            return mesh
        own = (self.segments == vertex).any(axis=1) & (self.pair >= 0)
        places, partner = dict[int, Array](), list[tuple[Index, int]]()
        for far in (self.segments[own].sum(axis=1) - vertex).tolist():
            met = self._facing(vertex, far, mesh.vertices[new[far]])
            if met is not None:
                places[int(self.partner[far])] = met
                partner.append((new[far], int(self.partner[far])))
        mesh, beyond = mesh._cut(facing, ratio, count, places)
        for one, far in partner:
            mesh.partner[one] = beyond[far]
        return mesh

    def _cut(
        self, vertex: int, ratio: float, count: int, known: dict[int, Array]
    ) -> tuple[GeometricMesh, dict[int, Index]]:
        """The mesh with all sides at a vertex cut, and the new vertices by the sides' far ends.

        Each triangle there has `count` layers of two triangles in place of all but its tip. New
        vertices (count,), inwards, of `known` far ends lie where those say.
        """
        at, corner = np.nonzero(self.triangles == vertex)
        a, b = (self.triangles[at, (corner + k) % 3] for k in (1, 2))
        far, middle = np.unique(np.concatenate([a, b])), self.vertices[vertex]
        scale = ratio ** np.arange(1, count + 1)
        x = middle + scale[:, None] * (self.vertices[far] - middle)[:, None]
        side = np.flatnonzero((self.segments == vertex).any(axis=1))
        ends = np.searchsorted(far, self.segments[side].sum(axis=1) - vertex)
        for k, boundary in zip(ends.tolist(), self.boundaries[side].tolist(), strict=True):
            edge = self.edges[boundary]
            x[k] = edge.point(edge.project(x[k]))
        for end, points in known.items():
            x[np.searchsorted(far, end)] = points
        new = len(self.vertices) + np.arange(len(far) * count).reshape(len(far), count)
        ray = np.column_stack([far, new])  # from the far end inwards
        ray_a, ray_b = (ray[np.searchsorted(far, end)] for end in (a, b))
        parts = [
            (np.full(len(at), vertex), ray_a[:, -1], ray_b[:, -1]),
            (ray_a[:, 1:], ray_a[:, :-1], ray_b[:, :-1]),
            (ray_a[:, 1:], ray_b[:, :-1], ray_b[:, 1:]),
        ]
        triangles = [np.stack(part, axis=-1).reshape(-1, 3) for part in parts]
        body = self.bodies[at]
        at_vertex, segments = self.segments[side] == vertex, self.segments.copy()
        segments[side] = np.where(at_vertex, vertex, ray[ends, -1:])
        outer = np.where(at_vertex[:, None], ray[ends, 1:, None], ray[ends, :-1, None])
        others = np.repeat(side, count)
        mesh = replace(
            self,
            vertices=np.concatenate([self.vertices, x.reshape(-1, 2)]),
            triangles=np.concatenate([np.delete(self.triangles, at, axis=0), *triangles]),
            bodies=np.concatenate([np.delete(self.bodies, at), body, np.repeat(body, 2 * count)]),
            segments=np.concatenate([segments, outer.reshape(-1, 2)]),
            boundaries=np.concatenate([self.boundaries, self.boundaries[others]]),
            pair=np.concatenate([self.pair, self.pair[others]]),
            closed=np.concatenate([self.closed, self.closed[others]]),
            partner=np.concatenate([self.partner, np.full(new.size, -1)]),
        )
        return mesh, dict(zip(far.tolist(), new, strict=True))

    def mesh(self, degree: int) -> ng.Mesh:
        """NGSolve's mesh, curved to a `degree`; its segments come in the same order."""
        old, new = self.source.ngmesh, ngm.Mesh(dim=2)
        new.SetGeometry(old.GetGeometry())
        new.AddPoints(np.column_stack([self.vertices, np.zeros(len(self.vertices))]))
        for number, descriptor in enumerate(old.FaceDescriptors()):
            new.Add(descriptor)
            new.SetMaterial(number + 1, self.source.GetMaterials()[number])
        for descriptor in old.EdgeDescriptors():
            new.Add(descriptor)
        for ends, boundary in zip(self.segments.tolist(), self.boundaries.tolist(), strict=True):
            new.Add(ngm.Element1D([k + 1 for k in ends], index=boundary + 1))
        for corners, body in zip(self.triangles.tolist(), self.bodies.tolist(), strict=True):
            new.Add(ngm.Element2D(body + 1, [k + 1 for k in corners]))
        for number, name in enumerate(self.source.GetBoundaries()):
            new.SetBCName(number, name)
        mesh = ng.Mesh(new)
        if not all(edge.straight for edge in self.edges):
            mesh.Curve(degree)
        return mesh


def isolated(state: ContactState) -> Mask:
    """Ends (k,) of contact of a pair that are not at corners of its line."""
    return ~np.isin(state.transitions.inner, state.line.twins)


def coarse_mesh(problem: Problem, pairs: Sequence[ContactState], extent: float) -> GeometricMesh:
    """Coarse mesh with vertices at the ends of contact of a solution, in contact where that is."""
    places, sizes = [], []
    for state in pairs:
        ends, x = state.transitions, state.line.position
        for k in np.flatnonzero(isolated(state)):
            others, reach = np.concatenate([ends.inner, ends.outer]), []
            for run in (ends.closed[k], ends.opened[k]):  # half of those that another end follows
                halves = 1 + (np.count_nonzero(others == run[-1]) > (len(run) == 1))
                reach.append(float(chords(x[run]).sum()) / halves + float(ends.beyond[k]))
            places.append(ends.position[k])
            sizes.append(END_SIZE * min(reach))
    fixed, least = np.array(places), np.array(sizes)

    def size(x: Array) -> Array:
        distance = np.linalg.norm(x[:, None] - fixed, axis=2)
        return np.minimum((least + SIZE_GROWTH * distance).min(axis=1), MAX_SIZE * extent)

    mesh = graded_mesh(problem, size, fixed)
    view, trace = MeshArrays(mesh), boundary_trace(mesh, 2, model_of(problem))
    lines = [contact_line(trace, contact) for contact in problem.contact]
    pair, closed = np.full(len(view.facets), -1), np.zeros(len(view.facets), dtype=bool)
    partner = np.full(mesh.nv, -1)
    active = by_line(lines, carried_active_set(lines, pairs))
    for number, (line, own) in enumerate(zip(lines, active, strict=True)):
        middle = line.rows[:, 1]
        new = (middle >= 0) & (pair[line.segments] < 0)  # to earlier pairs those of both
        met = line.segments[new]
        pair[met], closed[met] = number, own[middle[new]]
        faced = faced_vertices(trace, line, line.partner >= 0)
        at = (faced >= 0) & (line.node < mesh.nv)
        partner[line.node[at]] = faced[at]
    return GeometricMesh(
        source=mesh,
        contacts=[line.contact for line in lines],
        vertices=view.vertices,
        triangles=view.elements,
        bodies=view.bodies,
        segments=view.facets,
        boundaries=view.boundaries,
        pair=pair,
        closed=closed,
        partner=partner,
    )
