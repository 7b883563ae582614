"""Local refinement that keeps facing contact lines matched, HH81 (2.10), and what it would give."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index, Mask
from ..contact import nodal_line
from ..fem import BoundaryTrace, boundary_trace, unknowns_of
from ..mesh import CadEdge, copied
from ..problem import Contact, MeshArrays, Problem, bisect, move_vertices
from .marking import doerfler
from .singularities import Singularities, at_limit, settled

TOUCHING = 1e-12  # distance, relative to the geometry, up to which two vertices are at one place
ROUNDS = 12  # refinements after which a facing segment that still lags takes dual rows
BESIDE = 0.1  # barycentric coordinate: a point so far outside of an element still touches it
MARKINGS = 8  # most that one estimate is good for


def matched_vertices(trace: BoundaryTrace, contact: Contact) -> dict[int, int]:
    """Vertices of the secondary and, at the same C_j, of the primary; `trace` is of degree 1."""
    if contact.primary is None:
        return {}
    line, facing = nodal_line(trace, contact)
    end = facing & np.isin(line.partner_s, (0.0, 1.0))
    partner = trace.nodes[line.partner[end], line.partner_s[end].astype(int)]
    return dict(zip(line.node[end].tolist(), partner.tolist(), strict=True))


def _boundary_edges(mesh: ng.Mesh) -> dict[tuple[int, int], int]:
    """Element at each boundary segment, by its vertices."""
    view = MeshArrays(mesh)
    element = view.facet_elements
    ends = np.sort(view.facets, axis=1).tolist()
    return {(a, b): el for (a, b), el in zip(ends, element.tolist(), strict=True)}


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


def _edge_of_vertex(trace: BoundaryTrace, vertices: Index) -> Index:
    """Number (k,) of a CAD edge on which each of the vertices (k,) lies."""
    region = np.full(trace.space.ndof, -1)
    region[trace.nodes[:, [0, -1]]] = trace.region[:, None]
    return region[vertices]


def _on_normals(trace: BoundaryTrace, pairs: Index, xy: Array) -> tuple[Index, Array, Array]:
    """Pairs (k, 2) of vertices that are apart, and the normals of their first ones.

    Returns
    -------
    pairs : ndarray of int (k, 2)
    axis : ndarray (k, 2)
        Unit vectors across the normals.
    level : ndarray (k,)
        Coordinates of the first vertices along them.
    """
    size = np.ptp(xy, axis=0).max()
    apart = np.linalg.norm(xy[pairs[:, 0]] - xy[pairs[:, 1]], axis=1) > TOUCHING * size
    pairs = pairs[apart]
    normal = np.zeros((len(pairs), 2))
    for edge, at in _by_edge(trace, pairs[:, 0]):
        normal[at] = edge.normal(xy[pairs[at, 0]])
    axis = np.column_stack([-normal[:, 1], normal[:, 0]])
    return pairs, axis, (xy[pairs[:, 0]] * axis).sum(axis=1)


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
    pairs, xy = np.array(new), MeshArrays(trace.mesh).vertices
    if contact.direction is None:
        pairs, axis, level = _on_normals(trace, pairs, xy)
        moving: tuple[int, ...] = (1,)
    else:
        axis = np.array([-contact.direction[1], contact.direction[0]])
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
        a, b, c = (new[triangles[:, i]] for i in range(3))
        area = (b - a)[:, 0] * (c - a)[:, 1] - (b - a)[:, 1] * (c - a)[:, 0]
        turned = np.unique(triangles[area <= 0])
        if not (new[turned] != old[turned]).any():
            return new
        new = new.copy()
        new[turned] = old[turned]


class Refining:
    """A copy of a mesh that is bisected, several times if need be, before it is handed on.

    Between bisections new nodes of facing segments are as many, but not yet at common C_j.

    Parameters
    ----------
    problem : Problem
        Its contact pairs say which lines face each other.
    mesh : ng.Mesh
        Stays as it is.

    Attributes
    ----------
    mesh : ng.Mesh
        The copy, straight-sided; refined elements keep their number and have further ones behind.
    origin : ndarray of int (ne,)
        The element of the given mesh of which each of the copy's is a part.
    """

    def __init__(self, problem: Problem, mesh: ng.Mesh) -> None:
        self.problem = problem
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

        Returns
        -------
        ndarray of int (k,)
            The element of which each of the k elements is a part, by its former number.
        """
        flags, count = np.array(marked), self.mesh.ne
        matched = any(self._pairs)
        if matched:
            flags[_facing_elements(self._pairs, self._segments, flags)] = True
        for _ in range(ROUNDS):
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
        """The mesh, to be curved by the caller, with new nodes of an enlarging zone at common C_j.

        They are moved along their curves.
        """
        if any(self._pairs):
            trace = boundary_trace(self.mesh, 1)
            for contact, pair in zip(self.problem.contact, self._pairs, strict=True):
                _move_to_partners(trace, contact, pair, self._first)
        return copied(self.mesh)  # numbers only the edges that are left


def refined(problem: Problem, mesh: ng.Mesh, marked: Mask | None = None) -> ng.Mesh:
    """Refined copy of a mesh, straight-sided, with matched contact lines kept matched.

    Parameters
    ----------
    problem : Problem
        Its contact pairs tell which vertices face each other.
    mesh : ng.Mesh
        The mesh, which stays as it is.
    marked : ndarray of bool (ne,), optional
        Elements to refine; all when left out.

    Returns
    -------
    ng.Mesh
        As of `Refining.finished`. Facing segments have the same number of new nodes.
    """
    refining = Refining(problem, mesh)
    refining.bisect(np.ones(mesh.ne, dtype=bool) if marked is None else marked)
    return refining.finished()


def areas(corners: Array) -> Array:
    """Areas (k,) of triangles with the `corners` (k, 3, 2)."""
    first, second = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2


def depths(corners: Array, places: Array) -> Array:
    """Least barycentric coordinate of points in triangles, negative outside.

    Parameters
    ----------
    corners : ndarray (n, 3, 2) or (n, 1, 3, 2)
        Lengths.
    places : ndarray (n, 2) or (k, 2)

    Returns
    -------
    ndarray (n,) or (n, k)
    """
    origin = corners[..., 0, :]
    first, second, to = corners[..., 1, :] - origin, corners[..., 2, :] - origin, places - origin
    whole = first[..., 0] * second[..., 1] - first[..., 1] * second[..., 0]
    along = (to[..., 0] * second[..., 1] - to[..., 1] * second[..., 0]) / whole
    across = (first[..., 0] * to[..., 1] - first[..., 1] * to[..., 0]) / whole
    return np.asarray(np.minimum(np.minimum(along, across), 1 - along - across))


def touching(corners: Array, places: Array) -> Mask:
    """Whether triangles with `corners` (n, 3, 2) touch points `places` (k, 2), (n, k)."""
    return depths(corners[:, None], places) >= -BESIDE


@dataclass(frozen=True, eq=False)
class Forecast:
    """Squared indicators of a mesh that has not been solved on.

    On an element of area a on which the solution is smooth, eta_T^2 ~ a^(p+1): the square of
    |D^(p+1) u| times h^(2p) times the area. On one that touches a singular point it falls by that
    point's power of the area. Parts of an element share its square by that.

    Attributes
    ----------
    corners : ndarray (ne, 3, 2)
        Of the elements, lengths.
    squares : ndarray (ne,)
        Squared indicators, in shares of the sum of those that were estimated.
    order : int
        Degree p of the displacement.
    singular : Singularities
        Where it is not smooth.
    """

    corners: Array
    squares: Array
    order: int
    singular: Singularities

    @property
    def error(self) -> float:
        """The error, over the one that was estimated."""
        return float(np.sqrt(self.squares.sum()))

    def after(self, corners: Array, parent: Index) -> Forecast:
        """On elements with `corners` (k, 3, 2), each of them a part of a `parent` (k,)."""
        area = areas(corners)
        share = np.minimum(area / areas(self.corners)[parent], 1.0)
        power = np.full(len(parent), self.order + 1.0)
        new = np.flatnonzero(share < 1)
        at = touching(corners[new], self.singular.places)
        powers = np.where(at, self.singular.powers, np.inf).min(axis=1, initial=np.inf)
        power[new] = np.minimum(powers, self.order + 1)
        squares = self.squares[parent] * share**power
        return replace(self, corners=corners, squares=squares)

    def marked(self, theta: float, share: float) -> Mask:
        """Elements (ne,) to refine: Doerfler's, and those in which contact ends.

        Of these the ones larger than the `share` of their contact line, as by `at_ends`.
        """
        marked = doerfler(np.sqrt(self.squares), theta)
        ends = np.isfinite(self.singular.extents)
        sizes = np.sqrt(2 * areas(self.corners))  # the legs, if two are equal at a right angle
        large = np.flatnonzero(sizes > share * self.singular.extents[ends].min(initial=np.inf))
        at = touching(self.corners[large], self.singular.places[ends])
        limits = share * self.singular.extents[ends]
        marked[large] |= (at & (sizes[large, None] > limits)).any(axis=1)
        return marked


@dataclass(frozen=True)
class Aim:
    """How far a level is planned: until it has so many `unknowns`, or so small an error.

    Attributes
    ----------
    unknowns : float
        From which it is enough.
    most : float
        That it must not exceed.
    error : float
        Over the one that was estimated, from which it is enough.
    theta, ending : float
        Doerfler's share, and the size of elements at ends of contact over their line per error.
    markings : float
        Most that the forecast is good for.
    """

    unknowns: float
    most: float
    error: float
    theta: float
    ending: float
    markings: float = MARKINGS


def planned(
    problem: Problem,
    mesh: ng.Mesh,
    marked: Mask,
    forecast: Forecast,
    aim: Aim,
    element: str,
) -> tuple[ng.Mesh, float, Index]:
    """The next level's mesh, straight-sided, the error that is forecast on it, and parents (k,).

    These are the elements of `mesh` of which its own are parts. The elements `marked` (ne,) are
    refined, then again and again those that the forecast marks. Elements at unresolvable corners
    count no more once they are small, as in `settled`.
    """
    refining, marks, forecasts = Refining(problem, mesh), [marked], [forecast]
    while True:
        parent = refining.bisect(marks[-1])
        forecast = forecasts[-1].after(MeshArrays(refining.mesh).corners, parent)
        small = settled(refining.mesh, forecast.singular.unresolvable)
        forecasts.append(replace(forecast, squares=np.where(small, 0.0, forecast.squares)))
        unknowns, error = refining.unknowns(forecast.order, element), forecasts[-1].error
        if unknowns > aim.most and len(marks) > 1:  # one too many: again without it
            refining = Refining(problem, mesh)
            for again in marks[:-1]:
                refining.bisect(again)
            return refining.finished(), forecasts[-2].error, refining.origin
        if unknowns >= aim.unknowns or error <= aim.error or len(marks) >= aim.markings:
            return refining.finished(), error, refining.origin
        limit = at_limit(refining.mesh, mesh.GetCurveOrder())
        marks.append(forecasts[-1].marked(aim.theta, aim.ending * error) & ~limit)
        if not marks[-1].any():
            return refining.finished(), error, refining.origin
