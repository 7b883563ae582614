"""First meshes, with nodes at common points {C_j} of facing contact lines, HH81 (2.3), (2.10)."""

from __future__ import annotations

import re
import threading
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise, product
from numbers import Real
from typing import Any

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from netgen.meshing import MeshingParameters, NgException
from scipy.spatial import cKDTree

from ..arrays import Array, Index, Mask, across, chords, rightward
from ..problem import Contact, MeshArrays, Problem
from ..threads import one_thread
from .cad import CadEdge

# Elements along the largest extent of the geometry when no mesh size is given ...
DEFAULT_ELEMENTS = 8
# ... and that many times more on a bounded zone: contact may end anywhere on it.
BOUNDED_ZONE_FACTOR = 2

# Lengths that OCC and Netgen serve; given meshes have no such limits. Measured with discs, blocks,
# rings and splines: meshes are as at size 1 up to 4e8, from 1e9 on Netgen ignores sizes or never
# returns. OCC merges points within 1e-7; a body of twice that has no mesh, of 2e-6 it has one.
MAX_COORDINATE = 5e8  # from the origin
MIN_EXTENT = 1e-6  # extent

MESHING = threading.Lock()

Size = Callable[[Array], Array]  # largest length of an element (k,) at points (k, 2)

# Cosine between a curve's normal and the direction below which nodes go unmatched.
MIN_MATCHED_COSINE = 0.5
SAMPLE_RESOLUTION = 0.01  # of an edge: the least difference that a polygon of its samples shows
LINE_DISTANCE = 1e-6  # distance, relative to an edge, up to which two edges are one contact line
# Share of the spacing, or of a segment, within which a node yields to one beside it.
MIN_NODE_DISTANCE = 0.1
DIVISION_SAMPLES = 513  # samples on which a division is laid out
NODE_DISTANCE = 1e-9  # share of an edge up to which two nodes are one
MAX_TURN = 0.5  # largest turn (radians) of a curve along one contact segment
# Share by which a run of elements may exceed their size, not to gain one by round-off.
SIZE_SLACK = 1e-9
MAX_CLOSED_GAP = 0.1  # of the size of a segment: gaps that contact may close
# Of the size of a segment: change within half of it up to which a gap has no least.
CONSTANT_GAP_CHANGE = 1e-6
PLACE_DISTANCE = 1e-6  # of a segment: distance up to which a node lies at a place
# Of a sample's distance: from its error of 1e-5 to one of 1e-9, above round-off.
SEARCH_STEP = 2**-6
# Distance, relative to a face, up to which two faces are one: OCC's own is 1e-7.
FACE_DISTANCE = 1e-6


def _elements(x: Array, maxh: float | Size) -> Array:
    """Numbers (k - 1,) of elements between neighbours of the points `x` (k, 2)."""
    return np.asarray(chords(x) / (maxh((x[:-1] + x[1:]) / 2) if callable(maxh) else maxh))


def _segments(x: Array, y: Array, maxh: float | Size) -> Array:
    """Numbers (k,) of segments up to each of the points `x`, `y` (k, 2) of facing curves."""
    density = np.zeros(len(x) - 1)
    for points in (x, y):
        steps = np.diff(points, axis=0)
        angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
        turn = np.abs(np.gradient(angle)) if len(angle) > 1 else np.zeros(1)
        density = np.maximum(density, _elements(points, maxh))
        density = np.maximum(density, turn / MAX_TURN)
    return np.concatenate([[0.0], np.cumsum(density)])


def narrowest(t: Array, x: Array, y: Array, maxh: float, gap: Callable[[Array], Array]) -> Array:
    """Parameters (j,) between samples at `t` (k,) at which a narrow gap is least, or largest.

    `x`, `y` (k, 2) and `maxh` as in `spaced`; `gap` maps (n,) to signed distances (n,) whose
    sense is not known: bodies apart and bodies that overlap first touch at one or the other.
    """
    before, here, after = (values := gap(t))[:-2], values[1:-1], values[2:]
    bend = before - 2 * here + after
    step = np.diff(_segments(x, y, maxh))
    change = np.abs(bend) / 8 / np.maximum(step[:-1], step[1:]) ** 2  # within half a segment
    turns = (np.abs(here) <= MAX_CLOSED_GAP * maxh) & ((before - here) * (after - here) >= 0)
    place = t[1:-1][turns & (change > CONSTANT_GAP_CHANGE * maxh)]
    apart = (t[-1] - t[0]) / (len(t) - 1)
    for width in (apart, SEARCH_STEP * apart) if len(place) else ():  # vertices of parabolas
        before, here, after = (gap(place + side * width) for side in (-1, 0, 1))
        place = place + width / 2 * (before - after) / (before - 2 * here + after)
    return np.unique(place[(place > t[0]) & (place < t[-1])])


def spaced(t: Array, x: Array, y: Array, maxh: float | Size, places: Array) -> Array:
    """Parameters (n,) of nodes between samples at `t` (k,), the first and the last included.

    `x` and `y` (k, 2) are the points there, and those that they see on the other curve; segments
    are no longer than `maxh` on either and turn by `MAX_TURN` at most. Nodes lie at the parameters
    `places` (j,), but for those beside an end or another one.
    """
    total = _segments(x, y, maxh)

    def even(start: float, stop: float) -> Array:
        count = max(1, int(np.ceil((stop - start) * (1 - SIZE_SLACK))))
        return np.linspace(start, stop, count + 1)

    marks = even(0, total[-1])
    stops = np.interp(places, t, total)
    stops = stops[(stops > MIN_NODE_DISTANCE) & (stops < total[-1] - MIN_NODE_DISTANCE)]
    stops = stops[np.diff(stops, prepend=0.0) > MIN_NODE_DISTANCE]
    if (np.abs(stops[:, None] - marks).min(axis=1) > PLACE_DISTANCE).any():
        bounds = [0.0, *stops.tolist(), total[-1]]
        marks = np.unique(np.concatenate([even(*part) for part in pairwise(bounds)]))
    return np.interp(marks, total, t)


@dataclass(eq=False)
class Edge:
    """A CAD edge with the nodes that contact requires."""

    shape: occ.TopoDS_Shape  # the edge of the geometry
    curve: CadEdge  # the same as a curve
    maxh: float  # largest element size along it, a length
    size: Size | None = None  # ... where it varies, and `maxh` is infinite
    # Parameters (j,) of the nodes on each part that faces another line; first those of parts with a
    # narrowest place, whose nodes stay.
    runs: list[Array] = field(default_factory=list)

    def partition(self) -> list[float]:
        """Interior nodes as fractions of the parameter interval, between runs filled up evenly."""
        start, stop = self.curve.start, self.curve.stop
        runs = [(nodes - start) / (stop - start) for nodes in self.runs]
        nodes = np.array([0.0, 1.0])
        for run in runs:  # without nodes of later ones that would leave slivers of an edge
            spacing = np.diff(np.sort(run)).min(initial=1.0)
            distance = np.abs(run[:, None] - nodes).min(axis=1)
            nodes = np.concatenate([nodes, run[distance > MIN_NODE_DISTANCE * spacing]])
        nodes = np.sort(nodes)
        inside = nodes[1:][np.diff(nodes) > NODE_DISTANCE][:-1]
        result = inside.tolist()
        t = np.linspace(start, stop, DIVISION_SAMPLES)
        x = self.curve.point(t)
        arc = np.concatenate([[0.0], np.cumsum(_elements(x, self.maxh))])
        if self.size is not None:  # nothing else bounds the turn of long segments
            arc = _segments(x, x, self.size)
        grid = (t - start) / (stop - start)
        for low, high in pairwise([0.0, *inside.tolist(), 1.0]):
            if not any(run.min() < (low + high) / 2 < run.max() for run in runs):
                s0, s1 = np.interp([low, high], grid, arc)
                count = int(np.ceil((s1 - s0) * (1 - SIZE_SLACK)))
                fill = np.interp(np.linspace(s0, s1, count + 1)[1:-1], arc, grid)
                result.extend(fill.tolist())
        return sorted(result)


def _named(edges: list[Edge], pattern: str) -> list[Edge]:
    """Edges whose name matches."""
    return [edge for edge in edges if re.fullmatch(pattern, edge.curve.name)]


def _facing_runs(faces: Mask, stops: Index) -> Iterator[slice]:
    """Longest runs of neighbouring samples that face the other curve, cut at `stops`."""
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], faces, [False]]).astype(int)))
    for first, last in bounds.reshape(-1, 2):
        inside = stops[(stops > first) & (stops < last - 1)]
        for start, stop in pairwise([first, *inside.tolist(), last - 1]):
            if stop > start:
                yield slice(start, stop + 1)


def _nearest_crossing(samples: Array, x: Array, along: Array) -> Array:
    """Points (k, 2) where a polyline meets lines `along` (2,) through `x` (k, 2), the nearest."""
    height = samples @ across(along) - (x @ across(along))[:, None]
    low, high = height[:, :-1], height[:, 1:]
    share = np.clip(np.divide(low, low - high, out=np.zeros_like(low), where=low != high), 0, 1)
    points = samples[:-1] + share[..., None] * np.diff(samples, axis=0)
    distance = np.abs((points - x[:, None]) @ along)
    # Lines that the polyline just misses are left to Newton's method from its nearest end.
    miss = np.where(low * high <= 0, 0.0, np.minimum(np.abs(low), np.abs(high)))
    best = np.lexsort((distance, miss), axis=1)[:, 0]
    return points[np.arange(len(x)), best]


def _near(secondary: CadEdge, facing: list[Edge]) -> list[Edge]:
    """The edges of `facing` that may be the nearest to some point of a curve."""
    x, found = secondary.samples, []
    samples = [edge.curve.samples for edge in facing]
    reach = cKDTree(np.concatenate(samples)).query(x)[0]
    reach += 2 * chords(x).max()  # more than the distance at any point
    for edge, there in zip(facing, samples, strict=True):
        step = chords(there).max()  # a curve leaves the box of its samples by no more
        low, high = there.min(axis=0) - step, there.max(axis=0) + step
        apart = np.linalg.norm(np.maximum(np.maximum(low - x, x - high), 0.0), axis=1)
        if (apart <= reach).any():
            found.append(edge)
    return found


def _nearest_of(x: Array, edge: CadEdge, others: list[Edge]) -> Mask:
    """Whether no other edge is nearer to the points `x` (k, 2) than `edge`."""

    def distance(to: CadEdge) -> Array:
        return np.linalg.norm(to.point(to.project(x)) - x, axis=1)

    own = distance(edge) - LINE_DISTANCE * edge.size
    there = [distance(other.curve) for other in others if other.curve is not edge]
    return np.all([own <= x for x in there], axis=0)


def opposite(contact: Contact, x: Array, slope: Array, other: CadEdge) -> tuple[Array, Array]:
    """Parameters (k,) on `other` opposite to points `x` (k, 2), or NaN, and those points (k, 2).

    Without a direction on the normals of the curve through `x`, whose tangents are `slope` (k, 2).
    """
    if contact.direction is None:
        t = other.project(x)
        apart = np.linalg.norm(other.point(t) - x, axis=1) > LINE_DISTANCE * other.size
        if contact.gap is None and apart.any():  # clearance or interference: along the normals
            beside, far = across(rightward(slope[apart])), x[apart]
            t[apart] = other.level(beside, (far * beside).sum(axis=1), far)
        else:
            t[apart] = np.nan  # (2.3): common nodes
    else:
        along = np.array(contact.direction)
        near, eta = _nearest_crossing(other.samples, x, along), across(along)
        t = other.level(eta, x @ eta, near)  # (2.10): A_j and B_j at the same C_j
    return t, other.point(np.where(np.isnan(t), other.start, t))


def _behind(contact: Contact, x: Array, y: Array, edges: list[Edge]) -> Mask:
    """Whether one of `edges` lies between `x` (k, 2) and the `y` they see, as a far side may."""
    behind = np.zeros(len(x), dtype=bool)
    if contact.direction is None:
        return behind
    along = np.array(contact.direction)
    distance = np.abs((y - x) @ along)
    for edge in edges:
        nearest = _nearest_crossing(edge.curve.samples, y, along)
        close = SAMPLE_RESOLUTION * edge.curve.size
        met = np.abs((nearest - y) @ across(along)) <= close
        behind |= met & (np.abs((y - nearest) @ along) < distance - close)
    return behind


def _ends_between(contact: Contact, secondary: CadEdge, primary: CadEdge) -> Array:
    """Parameters on the secondary at which parts end that face the primary."""
    at = np.array([primary.start, primary.stop])
    x = primary.point(at)
    ends, _ = opposite(contact, x, primary.derivative(at), secondary)
    met = ~np.isnan(ends)
    if contact.direction is None and met.any():
        ends[met] = secondary.project(x[met])  # its normal there passes the end of the primary
    return np.unique(ends[met])  # both are one point of a closed curve


def _on(curve: CadEdge, points: Array, t: Array) -> Array:
    """Parameters (j,) of those `points` (k, 2) that lie on a curve, between samples at `t` (q,)."""
    at = curve.project(points)
    off = np.linalg.norm(curve.point(at) - points, axis=1)
    inside = (off <= LINE_DISTANCE * curve.size) & (at > t[0]) & (at < t[-1])
    return np.unique(at[inside])


def _divide(
    contact: Contact,
    secondary: Edge,
    primary: Edge,
    beside: list[Edge],
    facing: list[Edge],
    fixed: Array,
) -> None:
    """Lay a common division {C_j} on the parts of two edges that face each other.

    `beside` are all edges of the secondary, `facing` those of the primary that may be the nearest,
    these two included. Where sizes vary nodes lie at the points `fixed` (k, 2), else where gaps
    are narrowest.
    """
    t = np.linspace(secondary.curve.start, secondary.curve.stop, DIVISION_SAMPLES)
    ends = _ends_between(contact, secondary.curve, primary.curve)
    apart = np.abs(t[:, None] - ends).min(axis=1, initial=np.inf)
    t = np.sort(np.concatenate([t[apart > (t[1] - t[0]) / 2], ends]))
    x, slope = secondary.curve.point(t), secondary.curve.derivative(t)
    other, y = opposite(contact, x, slope, primary.curve)
    faces = ~np.isnan(other)
    if contact.direction is None and len(facing) > 1:
        faces &= _nearest_of(x, primary.curve, facing)
    faces &= ~_behind(contact, x, y, beside)
    if contact.direction is not None:
        slope_there = primary.curve.derivative(np.where(faces, other, primary.curve.start))
        for tangent in (slope, slope_there):
            cosine = np.abs(tangent @ across(np.array(contact.direction)))
            faces &= cosine >= MIN_MATCHED_COSINE * np.linalg.norm(tangent, axis=1)

    def gap(t: Array) -> Array:
        """Signed distances (k,) to the points opposite to `t` (k,), NaN where there are none."""
        x, slope = secondary.curve.point(t), secondary.curve.derivative(t)
        there, y = opposite(contact, x, slope, primary.curve)
        along = rightward(slope) if contact.direction is None else np.array(contact.direction)
        return np.where(np.isnan(there), np.nan, ((y - x) * along).sum(axis=1))

    maxh = min(secondary.maxh, primary.maxh)
    sliver = MIN_NODE_DISTANCE * min(maxh, secondary.curve.size, primary.curve.size)
    for run in _facing_runs(faces, np.searchsorted(t, np.sort(ends))):
        if chords(x[run]).sum() < sliver:
            continue  # beside the vertex of one edge, which faces near that of another
        if secondary.size is None:
            places = narrowest(t[run], x[run], y[run], maxh, gap)
        else:
            places = _on(secondary.curve, fixed, t[run])
        nodes = spaced(t[run], x[run], y[run], secondary.size or maxh, places)
        at_nodes = secondary.curve.point(nodes), secondary.curve.derivative(nodes)
        there, _ = opposite(contact, *at_nodes, primary.curve)
        met = ~np.isnan(there)
        if met.any():
            for edge, found in ((secondary, nodes[met]), (primary, there[met])):
                edge.runs.insert(0 if places.size else len(edge.runs), found)


def divided(problem: Problem, shape: occ.TopoDS_Shape, maxh: float, finer: float) -> list[Edge]:
    """Edges whose division the user has not fixed, with their sizes and the nodes of contact."""
    edges = [
        Edge(edge, CadEdge(edge), min(maxh, edge.maxh))
        for edge in shape.edges
        if edge.partition is None
    ]
    for contact in problem.contact:
        if contact.direction is None and not contact.bilateral:  # may come apart anywhere
            for line in contact.sides:
                for edge in _named(edges, line):
                    edge.maxh = min(edge.maxh, finer)
    _divide_facing(problem, edges, np.zeros((0, 2)))
    return edges


def _divide_facing(problem: Problem, edges: list[Edge], fixed: Array) -> None:
    """Lay common divisions on the parts of all pairs' edges that face; `fixed` as in `_divide`."""
    for contact in problem.contact:
        if contact.primary is not None:
            sides = _named(edges, contact.secondary)
            facing = _named(edges, contact.primary)
            for secondary in sides:
                near = facing
                if contact.direction is None and len(facing) > 1:  # the nearest one counts
                    near = _near(secondary.curve, facing)
                for primary in near:
                    _divide(contact, secondary, primary, sides, near, fixed)


def _coincide(one: occ.TopoDS_Shape, other: occ.TopoDS_Shape) -> bool:
    """Whether two faces have the same area, vertices, centres of edges and their own."""
    if abs(one.mass - other.mass) > FACE_DISTANCE * one.mass:
        return False
    marks = []
    for face in (one, other):
        edges = [edge.center for edge in face.edges]
        points = [*(vertex.p for vertex in face.vertices), *edges, face.center]
        marks.append(np.array([(p.x, p.y, p.z) for p in points]))
    apart = np.linalg.norm(marks[0][:, None] - marks[1], axis=2)
    farthest = max(apart.min(axis=0).max(), apart.min(axis=1).max())
    return bool(farthest <= FACE_DISTANCE * one.mass**0.5)


def identify_coinciding_faces(problem: Problem, shape: occ.TopoDS_Shape) -> None:
    """Let Netgen divide faces of contact pairs alike where they lie on each other.

    The shape remembers it, by a name for each two of its faces; to say it again changes nothing.
    """
    here = occ.gp_Trsf.Translation(occ.gp_Vec(0, 0, 0))
    faces = list(shape.faces)
    for contact in problem.contact:
        if contact.primary is None:
            continue
        sides = [
            {i for i, face in enumerate(faces) if re.fullmatch(pattern, face.name or "")}
            for pattern in (contact.primary, contact.secondary)
        ]
        for i, j in sorted({(min(both), max(both)) for both in product(*sides)}):
            if _coincide(faces[i], faces[j]):
                name, kind = f"ngcontact {i} {j}", occ.IdentificationType.PERIODIC
                faces[i].Identify(faces[j], name, kind, here)


def _require_complete(mesh: ng.Mesh, problem: Problem) -> None:
    """Raise where Netgen, which only prints a message, left a part of a body without elements."""
    view = MeshArrays(mesh)
    rim = view.keys(view.facets)
    known, count = np.unique(view.keys(view.sides), return_counts=True)
    missing = np.setxor1d(known[count == 1], rim[~np.isin(rim, known[count > 1])])
    if missing.size:
        pairs = [f"contact {k} of {p.named()}" for k, p in enumerate(problem.contact)]
        free = [name for name, p in zip(pairs, problem.contact, strict=True) if not p.direction]
        right = f"if two bodies bulge towards each other give {' and '.join(free)} a direction; "
        raise ValueError(
            f"Netgen left holes in the mesh, with {missing.size} sides; {right if free else ''}"
            "choose another maxh, or name the parts of an edge that belong to several contact "
            "pairs apart"
        )


def _generated(shape: occ.TopoDS_Shape, edges: list[Edge], **options: Any) -> ng.Mesh:
    """Netgen's mesh, by its `options`; the geometry, which is the user's, is left as it was."""
    sizes = [edge.shape.maxh for edge in edges]
    try:
        for edge in edges:
            edge.shape.maxh = edge.maxh
            if edge.runs or edge.size is not None:
                edge.shape.partition = edge.partition()
        return ng.Mesh(occ.OCCGeometry(shape, dim=2).GenerateMesh(**options))
    finally:
        for edge, size in zip(edges, sizes, strict=True):
            edge.shape.maxh, edge.shape.partition = size, None


def first_mesh(problem: Problem, maxh: float | None = None) -> ng.Mesh:
    """Mesh of the problem's geometry with matching nodes on facing lines, or coinciding faces.

    Parameters
    ----------
    problem : Problem
        A Mesh as its geometry is returned as it is.
    maxh : float, optional
        Largest element size, a length; when left out an eighth of the largest extent, half of that
        on bounded contact zones.

    Raises
    ------
    ValueError, TypeError
        `maxh` is not a positive finite number, or given for a geometry that is a Mesh; the geometry
        has lengths beyond what the kernel and Netgen mesh; Netgen failed to fill a body.
    """
    if isinstance(problem.geometry, ng.Mesh):
        if maxh is not None:
            raise ValueError(f"maxh={maxh} has no effect: the geometry is a Mesh; leave maxh out")
        return problem.geometry
    shape = problem.geometry.shape
    if problem.dim == 3:  # OCC's box of curved faces is another one before, and so were sizes
        shape.MakeTriangulation()
    low, high = (np.array([x.x, x.y, x.z]) for x in shape.bounding_box)
    extent, far = float((high - low).max()), float(np.abs([low, high]).max())
    if not (extent >= MIN_EXTENT and far <= MAX_COORDINATE):
        raise ValueError(
            f"the geometry has the extent {extent:g} and reaches {far:g} from the origin: the "
            f"geometry kernel and Netgen mesh extents from {MIN_EXTENT:g} and places up to "
            f"{MAX_COORDINATE:g}; choose another unit of length, or another origin"
        )
    finer = BOUNDED_ZONE_FACTOR if maxh is None else 1
    maxh = extent / DEFAULT_ELEMENTS if maxh is None else maxh
    right = f"give a length like {extent / DEFAULT_ELEMENTS:g}"
    if isinstance(maxh, bool) or not isinstance(maxh, Real):
        raise TypeError(f"maxh={maxh!r} is not a number; {right}")
    if not 0 < maxh < np.inf:
        raise ValueError(f"maxh={maxh} is not positive and finite; {right}")
    maxh = float(maxh)
    if problem.dim == 3:
        # Netgen would start and end threads over and over: two bodies of 500 tetrahedra took .07 s
        # so, beside other programs 2.4 s of processor time; with one thread they take .05 s.
        with MESHING, one_thread():
            identify_coinciding_faces(problem, shape)
            try:
                mesh = ng.Mesh(occ.OCCGeometry(shape).GenerateMesh(maxh=maxh))
            except NgException as error:
                raise ValueError(
                    f"Netgen makes no mesh of these solids ({error}): draw them by "
                    "OCCGeometry(shape), as dim=2 turns faces inside out, or choose another maxh"
                ) from error
    else:
        with MESHING:  # sizes and divisions are set on the shape, which others may mesh, too
            edges = divided(problem, shape, maxh, maxh / finer)
            mesh = _generated(shape, edges, maxh=maxh)
    _require_complete(mesh, problem)
    return mesh


def graded_mesh(problem: Problem, size: Size, places: Array) -> ng.Mesh:
    """Mesh of a plane problem's geometry with sizes that vary, matched on facing lines.

    The `size` is the largest length (k,) of the sides of elements on edges at points (k, 2); inside
    of bodies elements grow from there. Nodes lie at the `places` (k, 2) on secondary contact lines,
    and at what faces them.

    Raises
    ------
    ValueError
        Netgen failed to fill a body.
    """
    shape = problem.geometry.shape
    with MESHING:
        free = (edge for edge in shape.edges if edge.partition is None)
        edges = [Edge(edge, CadEdge(edge), np.inf, size) for edge in free]
        _divide_facing(problem, edges, places)
        for contact in problem.contact:
            for edge in _named(edges, contact.secondary) if contact.primary is None else ():
                t = np.linspace(edge.curve.start, edge.curve.stop, DIVISION_SAMPLES)
                x = edge.curve.point(t)
                edge.runs.append(spaced(t, x, x, size, _on(edge.curve, places, t)))
        parameters = MeshingParameters()
        for edge in edges:  # what partitions ask for, elements inside of bodies do not know
            share = np.array([0.0, *edge.partition(), 1.0])
            x = edge.curve.point(edge.curve.start + share * (edge.curve.stop - edge.curve.start))
            middle, length = (x[:-1] + x[1:]) / 2, chords(x)
            for (a, b), h in zip(middle.tolist(), length.tolist(), strict=True):
                parameters.RestrictH(a, b, 0.0, h)
        mesh = _generated(shape, edges, mp=parameters)
    _require_complete(mesh, problem)
    return mesh
