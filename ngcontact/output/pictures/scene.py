"""What a picture shows of a solution: curved elements as triangles, lines of contact points."""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np
from scipy.sparse.csgraph import connected_components, dijkstra
from scipy.spatial import KDTree

from ...arrays import Array, Index, Mask
from ...problem import ABOUT_AN_AXIS, on_axis
from ..nodes import full_stress, neighbour_tree, nodes_of, subdivision, von_mises
from ..solution_data import SolutionData

MOST_TRIANGLES = 200_000  # of a picture: more cannot be seen


@dataclass(frozen=True, eq=False)
class Scene:
    """What is drawn of the bodies: triangles and lines that follow the curved elements.

    Attributes
    ----------
    moved : ndarray (k, 2)
        Nodes after `scale` times the displacement, lengths.
    stress : ndarray (k,)
        Von Mises stress there, a force per area.
    triangles : ndarray of int (t, 3)
        Nodes of each triangle.
    edges : ndarray of int (e, order + 1)
        Nodes of each element edge.
    outline : ndarray of bool (e,)
        Edges that bound a body.
    zone : ndarray (c, 2)
        The points in contact, moved as the nodes are.
    scale : float
        Factor of the displacement.
    axes : tuple of str
        Names of the coordinates.
    """

    moved: Array
    stress: Array
    triangles: Index
    edges: Index
    outline: Mask
    zone: Array
    scale: float
    axes: tuple[str, str] = ("x", "y")


def contact_lines(solution: SolutionData) -> list[tuple[int, Index, Array]]:
    """Contact points in order along their lines: (pair, rows, coordinate) for every line.

    Of the k points of each line `rows` (k,) index ``solution.points``, and the coordinate (k,) is a
    length: eta, across the fixed direction xi
    (P2), or without one (P1) the arc position, a sum of chords. A pair whose points lie on
    separate pieces of boundary gives several lines, one behind the other.
    """
    lines = []
    for pair in np.unique(solution.pair).tolist():
        rows = np.flatnonzero(solution.pair == pair)
        points = solution.points[rows]
        direction = solution.problem.contact[pair].direction
        if direction is None:
            lines += [(pair, rows[order], s) for order, s in _arcs(points)]
        else:
            dx, dy = np.asarray(direction, dtype=float) / np.hypot(*direction)
            eta = points @ (-dy, dx)
            order = np.argsort(eta, kind="stable")
            lines.append((pair, rows[order], eta[order]))
    return lines


def _arcs(points: Array) -> list[tuple[Index, Array]]:
    """Order and arc position of points on curves: walks along the tree of neighbours."""
    tree = neighbour_tree(points)
    count, piece = connected_components(tree, directed=False)
    arcs: list[tuple[Index, Array]] = []
    start = 0.0
    for k in range(count):
        members = np.flatnonzero(piece == k)
        s = dijkstra(tree, directed=False, indices=members[0])[members]
        s = dijkstra(tree, directed=False, indices=members[np.argmax(s)])[members]
        s = start + (s.max() - s if s[0] > s[-1] else s)  # run as the points are numbered
        order = np.argsort(s, kind="stable")
        arcs.append((members[order], s[order]))
        start = s.max()
    return arcs


def picture(solution: SolutionData, scale: float | None) -> Scene:
    """Evaluate a solution for the picture."""
    mesh, u = solution.mesh, solution.displacement
    order = max(mesh.GetCurveOrder(), solution.order)
    if order > 1:  # enough to look smooth on coarse meshes, no more than can be seen on fine ones
        order = int(np.clip(np.sqrt(MOST_TRIANGLES / mesh.ne), 1, 2 * order))
    nodes = nodes_of(mesh, order)
    triangles, sides = subdivision(order)
    edges = nodes.cells[:, sides].reshape(-1, order + 1)
    ends = np.sort(edges[:, [0, -1]], axis=1)
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    place = nodes.values(ng.CF((ng.x, ng.y)))
    move = nodes.values(ng.CF((u[0], u[1])))
    active = solution.points[solution.active]
    at = KDTree(place).query(active)[1].astype(int)
    if scale is None:
        body = np.empty(len(place), dtype=np.intp)
        body[nodes.cells] = nodes.body[:, None]
        scale = _chosen_scale(solution, place, move, body)
    scene = Scene(
        moved=place + scale * move,
        stress=von_mises(nodes.values(full_stress(solution))),
        triangles=nodes.cells[:, triangles].reshape(-1, 3),
        edges=edges[first],
        outline=count == 1,
        zone=place[at] + scale * move[at],
        scale=scale,
    )
    return mirrored(scene, place) if solution.problem.model in ABOUT_AN_AXIS else scene


def mirrored(scene: Scene, place: Array) -> Scene:
    """A meridian section on both sides of its axis; `place` (k, 2) are its nodes before."""
    inside = on_axis(place)[scene.edges].all(axis=1)
    count, other = len(scene.moved), np.array([-1.0, 1.0])
    return replace(
        scene,
        moved=np.concatenate([scene.moved, scene.moved * other]),
        stress=np.tile(scene.stress, 2),
        triangles=np.concatenate([scene.triangles, scene.triangles[:, ::-1] + count]),
        edges=np.concatenate([scene.edges, scene.edges + count]),
        outline=np.tile(scene.outline & ~inside, 2),
        zone=np.concatenate([scene.zone, scene.zone * other]),
        axes=("r", "z"),
    )


def _chosen_scale(solution: SolutionData, place: Array, move: Array, body: Index) -> float:
    """Factor 1, 2, 5, 10, ... on the displacement: seen, yet no false overlap of the bodies.

    Contact turns a gap e into `gap`; a factor s draws it as e - s (e - gap). For e, the distance
    to the nearest node of another body errs on the side of a smaller factor.
    """
    size = np.ptp(place, axis=0).max()
    largest = np.linalg.norm(move, axis=1).max()
    factor = 0.04 * size / largest if largest > 0 else 1.0
    points, gap = solution.points, solution.gap
    if solution.active.any() and np.ptp(body) > 0:
        overlap = 0.003 * max(np.ptp(points[solution.active], axis=0).max(), 0.01 * size)
        own = body[KDTree(place).query(points)[1]]
        for k in np.unique(own):
            initial = KDTree(place[body != k]).query(points[own == k])[0]
            closed = np.maximum(initial - gap[own == k], 1e-12 * size)
            factor = min(factor, ((initial + overlap) / closed).min())
    power = 10.0 ** np.floor(np.log10(factor))
    return float(max(1.0, *(k * power for k in (0.5, 1, 2, 5) if k * power <= factor)))


def close_up(scene: Scene) -> tuple[Array, Array] | None:
    """Corners (2,) each of a close-up of the zone in contact; None if the picture shows it."""
    if len(scene.zone) == 0:
        return None
    size = np.ptp(scene.moved, axis=0).max()
    low, high = scene.zone.min(axis=0), scene.zone.max(axis=0)
    half = max(0.9 * (high - low).max(), 0.02 * size)
    middle = (low + high) / 2
    # At the rim of the picture, as on a symmetry plane, the window moves inwards.
    inner, outer = scene.moved.min(axis=0) + 0.95 * half, scene.moved.max(axis=0) - 0.95 * half
    middle = np.where(inner < outer, np.clip(middle, inner, outer), middle)
    return (middle - half, middle + half) if half < 0.2 * size else None
