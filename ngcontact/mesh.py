"""First meshes whose nodes on facing contact lines match, HH81 (2.3), (2.10)."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from .cad import CadEdge, cad_edges
from .problem import Contact, Problem

Array = NDArray[np.float64]

COARSE = 8  # elements along the largest extent of the geometry when no mesh size is given ...
FINER = 2  # ... and that many times more on a bounded zone: contact may end anywhere on it
TURN = 0.5  # largest turn (radians) of a curve along one contact segment
STEEPEST = 0.5  # cosine between a curve's normal and the direction below which nodes go unmatched
NEARER = 0.01  # of an edge: what a polygon of its samples tells apart
COINCIDENT = 1e-6  # distance, relative to an edge, up to which two edges are one contact line
CLOSE = 0.1  # share of the spacing within which a later pair's node yields to one already there
FINE = 513  # samples on which a division is laid out

# OCC's projections know absolute lengths: points within 1e-7 of the end of an arc go to that end,
# on other curves 1e-10 over the speed counts as met. On edges of extent SMALLEST that changes no
# more than 1e-8 of it as long as elements keep their shape.
SMALLEST = 1e-2  # extent of an edge; measured: all but arcs of circles are wrong from 2e-3
SHORTEST = 1e-6  # a segment of a curved edge; measured: elements of order 4 turn over at 5e-7
SHORTEST_ON_SMALL = 1e-5  # ... of a smaller arc; measured: middles displaced from 5e-6, order 4


@dataclass(eq=False)
class _Edge:
    """A CAD edge with the nodes that contact asks for."""

    shape: occ.TopoDS_Shape
    curve: CadEdge
    maxh: float

    def __post_init__(self) -> None:
        self.runs: list[Array] = []

    def partition(self) -> list[float]:
        """Interior nodes as fractions of the parameter interval, between runs filled up evenly."""
        start, stop = self.curve.start, self.curve.stop
        runs = [(nodes - start) / (stop - start) for nodes in self.runs]
        nodes = np.sort(_apart(runs))
        apart = 1e-9
        inside = nodes[(nodes > apart) & (nodes < 1 - apart)]
        inside = inside[np.diff(inside, prepend=-1.0) > apart]
        result = inside.tolist()
        t, x, _ = self.curve.samples(FINE)
        arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(x, axis=0), axis=1))])
        grid = (t - start) / (stop - start)
        for low, high in pairwise([0.0, *inside.tolist(), 1.0]):
            if not any(run.min() < (low + high) / 2 < run.max() for run in runs):
                s0, s1 = np.interp([low, high], grid, arc)
                count = int(np.ceil((s1 - s0) / self.maxh * (1 - 1e-9)))
                fill = np.interp(np.linspace(s0, s1, count + 1)[1:-1], arc, grid)
                result.extend(fill.tolist())
        return sorted(result)


def _apart(runs: list[Array]) -> Array:
    """Nodes of all runs, without those of later ones that would leave slivers of an edge."""
    nodes = runs[0]
    for run in runs[1:]:
        spacing = np.diff(np.sort(run)).min(initial=1.0)
        distance = np.abs(run[:, None] - nodes).min(axis=1)
        nodes = np.concatenate([nodes, run[distance > CLOSE * spacing]])
    return nodes


def _require_complete(mesh: ng.Mesh) -> None:
    """Raise where Netgen, which only prints a message, left a part of a body without elements."""
    corners = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(np.int64)
    sides = np.sort(corners[:, [[0, 1], [1, 2], [2, 0]]].reshape(-1, 2), axis=1)
    rim = np.sort(mesh.ngmesh.Elements1D().NumPy()["nodes"][:, :2].astype(np.int64), axis=1)
    side, rim = (x @ np.array([mesh.nv + 1, 1]) for x in (sides, rim))
    known, count = np.unique(side, return_counts=True)
    missing = np.setxor1d(known[count == 1], rim[~np.isin(rim, known[count > 1])])
    if missing.size:
        raise ValueError(
            f"Netgen left holes in the mesh, with {missing.size} sides; choose another maxh, or "
            "name the parts of an edge that belong to several contact pairs apart"
        )


def _named(edges: list[_Edge], pattern: str) -> list[_Edge]:
    """Edges whose name matches."""
    return [edge for edge in edges if re.fullmatch(pattern, edge.curve.name)]


def _bounded_zones(edges: list[_Edge], problem: Problem) -> list[_Edge]:
    """Edges of bounded zones, which touch all along and may come apart anywhere."""
    pairs = [pair for pair in problem.contact if pair.direction is None and not pair.bilateral]
    lines = {line for pair in pairs for line in (pair.secondary, pair.primary) if line}
    return [edge for edge in edges if any(_named([edge], line) for line in lines)]


def _facing_runs(faces: NDArray[np.bool_], stops: NDArray[np.intp]) -> Iterator[slice]:
    """Longest runs of neighbouring samples that face the other curve, cut at `stops`."""
    bounds = np.flatnonzero(np.diff(np.concatenate([[False], faces, [False]]).astype(int)))
    for first, last in bounds.reshape(-1, 2):
        inside = stops[(stops > first) & (stops < last - 1)]
        for start, stop in pairwise([first, *inside.tolist(), last - 1]):
            if stop > start:
                yield slice(start, stop + 1)


def _nearest_crossing(samples: Array, x: Array, across: Array, along: Array) -> Array:
    """Points (k, 2) where a polyline crosses the lines through `x` (k, 2), the nearest of each."""
    height = samples @ across - (x @ across)[:, None]
    low, high = height[:, :-1], height[:, 1:]
    share = np.clip(np.divide(low, low - high, out=np.zeros_like(low), where=low != high), 0, 1)
    points = samples[:-1] + share[..., None] * np.diff(samples, axis=0)
    distance = np.abs((points - x[:, None]) @ along)
    # Lines that the polyline just misses are left to Newton's method from its nearest end.
    miss = np.where(low * high <= 0, 0.0, np.minimum(np.abs(low), np.abs(high)))
    best = np.lexsort((distance, miss), axis=1)[:, 0]
    return points[np.arange(len(x)), best]


def _opposite(contact: Contact, x: Array, other: CadEdge) -> tuple[Array, Array]:
    """Parameters on `other` opposite to points `x` (NaN where there are none), and the points."""
    if contact.direction is None:
        t = other.project(x)
        distance = np.linalg.norm(other.point(t) - x, axis=1)
        t = np.where(distance <= COINCIDENT * other.size, t, np.nan)
    else:
        dx, dy = contact.direction
        across = np.array([-dy, dx])
        _, samples, _ = other.samples()
        near = _nearest_crossing(samples, x, across, np.array([dx, dy]))
        t = other.level(across, x @ across, near)
    return t, other.point(np.where(np.isnan(t), other.start, t))


def _behind(contact: Contact, x: Array, y: Array, edges: list[_Edge]) -> NDArray[np.bool_]:
    """Whether another point of `edges` lies between `x` (k, 2) and the points `y` they see.

    On a far side of the own body, as behind the middle of a disc.
    """
    behind = np.zeros(len(x), dtype=bool)
    if contact.direction is None:
        return behind
    dx, dy = contact.direction
    across, along = np.array([-dy, dx]), np.array([dx, dy])
    distance = np.abs((y - x) @ along)
    for edge in edges:
        _, samples, _ = edge.curve.samples()
        nearest = _nearest_crossing(samples, y, across, along)
        close = NEARER * edge.curve.size
        met = np.abs((nearest - y) @ across) <= close
        behind |= met & (np.abs((y - nearest) @ along) < distance - close)
    return behind


def _divide(contact: Contact, secondary: _Edge, primary: _Edge, beside: list[_Edge]) -> None:
    """Lay a common division {C_j} on the parts of two edges that face each other.

    `beside` are all edges of the secondary, this one included.
    """
    t, _, _ = secondary.curve.samples(FINE)
    ends = primary.curve.point(np.array([primary.curve.start, primary.curve.stop]))
    ends, _ = _opposite(contact, ends, secondary.curve)
    ends = ends[~np.isnan(ends)]  # where the facing parts end inside the secondary
    apart = np.abs(t[:, None] - ends).min(axis=1, initial=np.inf)
    t = np.sort(np.concatenate([t[apart > (t[1] - t[0]) / 2], ends]))
    x, slope = secondary.curve.point(t), secondary.curve.derivative(t)
    other, y = _opposite(contact, x, primary.curve)
    faces = ~np.isnan(other)
    faces &= ~_behind(contact, x, y, beside)
    if contact.direction is not None:
        slope_there = primary.curve.derivative(np.where(faces, other, primary.curve.start))
        for tangent in (slope, slope_there):
            across = tangent @ np.array([-contact.direction[1], contact.direction[0]])
            faces &= np.abs(across) >= STEEPEST * np.linalg.norm(tangent, axis=1)
    maxh = min(secondary.maxh, primary.maxh)
    for run in _facing_runs(faces, np.searchsorted(t, np.sort(ends))):
        density = np.zeros(np.count_nonzero(faces[run]) - 1)
        for points in (x[run], y[run]):
            steps = np.diff(points, axis=0)
            angle = np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))
            turn = np.abs(np.gradient(angle)) if len(angle) > 1 else np.zeros(1)
            density = np.maximum(density, np.linalg.norm(steps, axis=1) / maxh)
            density = np.maximum(density, turn / TURN)
        total = np.concatenate([[0.0], np.cumsum(density)])
        count = max(1, int(np.ceil(total[-1] * (1 - 1e-9))))
        nodes = np.interp(np.linspace(0, total[-1], count + 1), total, t[run])
        there, _ = _opposite(contact, secondary.curve.point(nodes), primary.curve)
        met = ~np.isnan(there)
        if met.any():
            secondary.runs.append(nodes[met])
            primary.runs.append(there[met])


def first_mesh(problem: Problem, maxh: float | None = None) -> ng.Mesh:
    """Mesh of the problem's geometry with matching nodes on facing contact lines.

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
        contains solids; Netgen failed to fill a body.
    """
    if isinstance(problem.geometry, ng.Mesh):
        if maxh is not None:
            raise ValueError(f"maxh={maxh} has no effect: the geometry is a Mesh; leave maxh out")
        return problem.geometry
    shape = problem.geometry.shape
    if shape.solids:
        raise ValueError("the geometry contains solids; bodies are faces in the plane z = 0")
    low, high = shape.bounding_box
    extent = max(high.x - low.x, high.y - low.y)
    finer = FINER if maxh is None else 1
    maxh = extent / COARSE if maxh is None else maxh
    if isinstance(maxh, bool) or not isinstance(maxh, int | float | np.number):
        raise TypeError(f"maxh={maxh!r} is not a number; give a length like {extent / COARSE:g}")
    if not (np.isfinite(maxh) and maxh > 0):
        raise ValueError(f"maxh={maxh} must be positive and finite, like {extent / COARSE:g}")
    edges = [
        _Edge(edge, CadEdge(edge), min(maxh, edge.maxh))
        for edge in shape.edges
        if edge.partition is None  # a division the user has not fixed
    ]
    for edge in (zones := _bounded_zones(edges, problem)):
        edge.maxh = min(edge.maxh, maxh / finer)
    for contact in problem.contact:
        if contact.primary is not None:
            sides = _named(edges, contact.secondary)
            for secondary, primary in product(sides, _named(edges, contact.primary)):
                _divide(contact, secondary, primary, sides)
    placed = [edge for edge in edges if edge.runs]
    sizes = [edge.shape.maxh for edge in zones]
    try:
        for edge in placed:
            edge.shape.partition = edge.partition()
        for edge in zones:
            edge.shape.maxh = edge.maxh
        mesh = ng.Mesh(occ.OCCGeometry(shape, dim=2).GenerateMesh(maxh=maxh))
    finally:
        for edge in placed:  # the geometry is the user's
            edge.shape.partition = None
        for edge, size in zip(zones, sizes, strict=True):
            edge.shape.maxh = size
    _require_complete(mesh)
    return mesh


def check_curves(mesh: ng.Mesh) -> None:
    """Raise if curved edges are too small for OCC to curve the elements beside them.

    Raises
    ------
    ValueError
        Names the edge and its length; another unit of length mends it.
    """
    edges = cad_edges(mesh) or []
    xy = np.array(mesh.ngmesh.Coordinates())[:, :2]
    segments = mesh.ngmesh.Elements1D().NumPy()
    ends = xy[segments["nodes"][:, :2].astype(np.intp) - 1]
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1)
    for number, edge in enumerate(edges):
        if edge.straight:
            continue
        small = edge.size < SMALLEST
        limit = SHORTEST_ON_SMALL if small else SHORTEST
        shortest = float(length[segments["index"] == number + 1].min(initial=np.inf))
        if shortest < limit or (small and not edge.uniform):
            raise ValueError(
                f'the curved edge "{edge.name}" has the extent {edge.size:g} and segments of '
                f"{shortest:g}, on which the geometry kernel loses digits; choose a smaller unit "
                f"of length: curved edges of {SMALLEST:g} and more may have segments down to "
                f"{SHORTEST:g}"
            )
