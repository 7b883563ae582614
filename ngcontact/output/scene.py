"""Scene of a picture: style, field, curved elements as triangles, contact lines and zones."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import ngsolve as ng
import numpy as np
from scipy.spatial import KDTree

from ..arrays import Array, Index, Mask, across, distances_along, paths
from ..fem import von_mises
from ..problem import ABOUT_AN_AXIS
from ..solved import Solved, full_stress
from .nodes import Nodes, nodes_of, order_of, principal_stresses, subdivision

MAX_TRIANGLES = 200_000  # of a picture: more cannot be seen
# Of a zone's size: distance to a line of symmetry up to which both halves are one zone.
MIRROR_DISTANCE = 0.25
STRAIGHT = 1e-6  # distance from the line, relative to its length, of a straight boundary
# Displacement across a line, relative to the largest on it, that is round-off.
SYMMETRY_ROUND_OFF = 1e-6
UNITS = ("length", "stress")  # what has a unit
AXES = ("x", "y", "z")

Unit = str | tuple[str, float]
Profile = Callable[[Array], Any] | tuple[Any, Any]


@dataclass(frozen=True, eq=False)
class Style:
    """Options of `Solution.plot`, checked."""

    scale: float | None = None
    field: str | ng.CoefficientFunction = "von_mises"
    limits: tuple[float, float] | None = None
    units: Mapping[str, Unit] = dataclasses.field(default_factory=dict)
    profile: Mapping[str, Profile] = dataclasses.field(default_factory=dict)
    mesh: bool = True
    mirror: str | None = None

    def __post_init__(self) -> None:
        """Raise ``ValueError`` or ``TypeError`` where a choice is none."""
        if self.scale is not None and not np.isfinite(self.scale):
            raise ValueError(
                f"scale = {self.scale}: give a finite factor, or None to have one chosen"
            )
        if self.limits is not None and not (
            len(self.limits) == 2 and -np.inf < self.limits[0] < self.limits[1] < np.inf
        ):
            raise ValueError(f"limits = {self.limits}: give two finite numbers, the smaller first")
        for name, given, example in (
            ("units", self.units, '{"length": "mm", "stress": "MPa"}'),
            ("profile", self.profile, '{"Hertz": a function of s}'),
        ):
            if not isinstance(given, Mapping):
                raise TypeError(f"{name} = {given!r}: give a mapping, as {example}")
        for kind in self.units:
            if kind not in UNITS:
                raise ValueError(f'units: "{kind}" is none of {", ".join(UNITS)}')
            name, size = self.unit(kind)
            if not isinstance(name, str) or not (np.isfinite(size) and size > 0):
                raise ValueError(
                    f'units["{kind}"] = {self.units[kind]}: give a name, or a name and its size in '
                    'the unit of the data, as ("MPa", 1e6)'
                )
        for label, profile in self.profile.items():
            try:
                fits = callable(profile) or np.array(profile, dtype=float).shape[:-1] == (2,)
            except (TypeError, ValueError):
                fits = False
            if not fits:
                raise TypeError(
                    f'profile["{label}"]: give a function of the coordinate, or two arrays of one '
                    "length, coordinates and pressures"
                )

    def unit(self, kind: str) -> tuple[str, float]:
        """Name and size of the unit of a `kind`, "" and 1 where none is given."""
        chosen = self.units.get(kind, "")
        return (chosen, 1.0) if isinstance(chosen, str) else (chosen[0], float(chosen[1]))

    def title(self, text: str, kind: str) -> str:
        """`text` with the unit of its `kind` in brackets."""
        name, _ = self.unit(kind)
        return f"{text} [{name}]" if name else text

    def shown(self, solution: Solved) -> Field:
        """The field; raises ``ValueError`` or ``TypeError`` where it is none that can be shown."""
        field, known = self.field, fields(solution)
        if isinstance(field, ng.CoefficientFunction):
            if field.dim != 1 or field.is_complex:
                raise ValueError(
                    f"field: a function of {field.dim} components; give one real number"
                )
            return Field("field", "", field)
        choice = f"give a CoefficientFunction or one of {', '.join(known)}"
        if not isinstance(field, str):
            raise TypeError(f"field = {field!r}: {choice}")
        if field not in known:
            raise ValueError(f'field = "{field}": {choice}')
        return known[field]


class Field(NamedTuple):
    """A scalar field; its kind, by which it has a unit, is one of `UNITS`, or "" if not known."""

    label: str
    kind: str
    read: ng.CoefficientFunction
    of: Callable[[Array], Array] = np.ravel  # (k,), of nodal values (k, dim)

    def values(self, nodes: Nodes) -> Array:
        """Values (k,) at the nodes of a picture."""
        return self.of(nodes.values(self.read))


def coordinates(solution: Solved) -> tuple[str, ...]:
    """Names of the coordinates."""
    return ("r", "z") if solution.problem.model in ABOUT_AN_AXIS else AXES[: solution.mesh.dim]


def fields(solution: Solved) -> dict[str, Field]:
    """Every field by name; raises ``RuntimeError`` where the mesh was changed since."""
    x, y, *z = coordinates(solution)
    normal = "zz" if x == "x" else "hoop"
    names = [f"{x}{x}", f"{y}{y}", f"{x}{y}", normal, "yz", "xz"][: 2 * solution.mesh.dim]
    stress, move = full_stress(solution), ng.CF(tuple(solution.displacement))
    if solution.stress_free:
        stress = 0.0 * stress  # round-off has no colours

    return {
        "von_mises": Field("von Mises stress", "stress", stress, von_mises),
        **{f"stress_{a}": Field(f"stress {a}", "stress", stress[k]) for k, a in enumerate(names)},
        "largest_principal": Field(
            "largest principal stress", "stress", stress, lambda s: principal_stresses(s)[:, 0]
        ),
        "smallest_principal": Field(
            "smallest principal stress", "stress", stress, lambda s: principal_stresses(s)[:, 2]
        ),
        "mean_pressure": Field(
            "mean pressure, −tr σ/3", "stress", -(stress[0] + stress[1] + stress[3]) / 3
        ),
        "displacement": Field(
            "displacement, absolute value", "length", move, lambda u: np.linalg.norm(u, axis=1)
        ),
        **{
            f"displacement_{a}": Field(f"displacement along {a}", "length", move[k])
            for k, a in enumerate((x, y, *z))
        },
    }


class ContactPath(NamedTuple):
    """Contact points in order along a line."""

    pair: int
    rows: Index  # (k,), numbers in ``solution.points``
    s: Array  # (k,), coordinate, a length


def contact_lines(solution: Solved) -> list[ContactPath]:
    """Contact points in order along their lines.

    Their coordinate is eta, across the fixed direction xi (P2), or without one (P1) the arc
    position, a sum of chords. Both rise with the coordinate of which more changes along the line,
    whichever body is the secondary. A pair whose points lie on separate pieces of boundary gives
    several lines, one behind the other.
    """
    lines, first = list[ContactPath](), 0
    for pair, state in enumerate(solution.pairs):
        line, start = state.line, 0.0
        rows, direction = first + np.arange(len(line.node)), line.contact.direction
        first += len(rows)
        if direction is not None and len(rows):
            axis = across(np.array(direction))
            eta = line.position @ (_rising(axis) * axis)
            order = np.argsort(eta, kind="stable")
            lines.append(ContactPath(pair, rows[order], eta[order]))
        for path in paths(line.neighbours, len(rows)) if direction is None and len(rows) else ():
            path = path[:-1] if len(path) > 1 and path[0] == path[-1] else path
            path = path[:: int(_rising(np.diff(line.position[path[[0, -1]]], axis=0)[0]))]
            s = start + distances_along(line.position[path])
            lines.append(ContactPath(pair, rows[path], s))
            start = s[-1]
    return lines


def _rising(along: Array) -> float:
    """Sign that makes the larger component of `along` (2,) positive."""
    return -1.0 if along[np.argmax(np.abs(along))] < 0 else 1.0


def zones_of(solution: Solved, lines: Sequence[ContactPath]) -> list[ContactPath]:
    """Zones in contact: runs of neighbouring points in contact on one line."""
    zones = []
    for pair, rows, s in lines:
        run = np.cumsum(np.diff(solution.active[rows], prepend=False))  # odd in contact
        at = [run == k for k in range(1, run[-1] + 1, 2)]
        zones += [ContactPath(pair, rows[zone], s[zone]) for zone in at]
    return zones


class SymmetryLine(NamedTuple):
    """A straight line."""

    point: Array  # (2,)
    normal: Array  # (2,), unit vector

    def distance(self, x: Array) -> Array:
        """Signed distances (...,) of points `x` (..., 2)."""
        return np.asarray((x - self.point) @ self.normal)

    def reflected(self, x: Array) -> Array:
        """Mirror images (k, 2) of points `x` (k, 2)."""
        return np.asarray(x - 2 * self.distance(x)[:, None] * self.normal)


def symmetry_line(solution: Solved, pattern: str, place: Array, slack: float) -> SymmetryLine:
    """The line of symmetry on which a boundary lies; raises ``ValueError`` where it is none.

    To both sides of it, farther than a `slack`, there are no nodes of those at `place` (n, 2).
    """
    trace, displacement = solution.discrete.space.trace, solution.displacement
    at = trace.at_nodes(trace.segments(pattern))
    if not len(at[0]):
        names = sorted(set(solution.mesh.GetBoundaries()))
        raise ValueError(f'mirror = "{pattern}" is no boundary; there are {", ".join(names)}')
    x, u = trace.point(*at), trace.evaluate(displacement, *at)
    middle = x.mean(axis=0)
    line = SymmetryLine(middle, np.linalg.svd(x - middle, full_matrices=False)[2][1])
    if (np.abs(line.distance(x)) > slack).any():
        raise ValueError(f'mirror = "{pattern}" is not straight: give a boundary on one line')
    away = np.abs(u @ line.normal).max()
    if away > SYMMETRY_ROUND_OFF * np.abs(displacement.vec.FV().NumPy()).max():
        raise ValueError(
            f'mirror = "{pattern}" moves across its line by {away:.3g}: it is no line of symmetry'
        )
    sides = line.distance(place)
    if sides.min() < -slack and sides.max() > slack:
        raise ValueError(f'mirror = "{pattern}": bodies lie on both sides of its line')
    return line


@dataclass(frozen=True, eq=False)
class Scene:
    """The bodies as triangles and lines that follow the curved elements."""

    solution: Solved
    style: Style
    moved: Array  # (k, 2), nodes after `scale` times the displacement, lengths
    shown: Field  # what colours show
    values: Array  # (k,), of that at the nodes
    triangles: Index  # (t, 3), nodes
    edges: Index  # (e, order + 1), nodes of each element edge
    outline: Mask  # (e,), edges that bound a body
    lines: list[ContactPath]  # the contact lines
    paths: list[ContactPath]  # zones in contact on them, those of the largest force first
    zones: list[Array]  # (c, 2) each, the same points, moved
    scale: float


def picture(solution: Solved, style: Style) -> Scene:
    """Evaluate a solution for the picture."""
    shown = style.shown(solution)
    mesh = solution.mesh
    order = order_of(solution.mesh, solution.order)
    if order > 1:  # enough to look smooth on coarse meshes, no more than can be seen on fine ones
        order = int(np.clip(np.sqrt(MAX_TRIANGLES / mesh.ne), 1, 2 * order))
    nodes = nodes_of(mesh, order)
    triangles, sides = subdivision(order)
    edges = nodes.cells[:, sides].reshape(-1, order + 1)
    ends = np.sort(edges[:, [0, -1]], axis=1)
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    place, moved, scale = moved_nodes(solution, nodes, style)
    lines = contact_lines(solution)
    paths, tree = zones_of(solution, lines), KDTree(place)
    paths.sort(key=lambda zone: -float(np.abs(solution.force[zone.rows]).sum()))
    scene = Scene(
        solution=solution,
        style=style,
        moved=moved,
        shown=shown,
        values=shown.values(nodes),
        triangles=nodes.cells[:, triangles].reshape(-1, 3),
        edges=edges[first],
        outline=count == 1,
        lines=lines,
        paths=paths,
        zones=[moved[tree.query(solution.points[zone.rows])[1]] for zone in paths],
        scale=scale,
    )
    slack = STRAIGHT * float(np.ptp(place, axis=0).max())
    if solution.problem.model in ABOUT_AN_AXIS:
        line = SymmetryLine(np.zeros(2), np.array([1.0, 0.0]))
    elif style.mirror is None:
        return scene
    else:
        line = symmetry_line(solution, style.mirror, place, slack)
    return _mirrored(scene, line, np.abs(line.distance(place)) <= slack)


def _mirrored(scene: Scene, line: SymmetryLine, on_line: Mask) -> Scene:
    """A scene on both sides of a line of symmetry, where the nodes `on_line` (k,) lie."""
    inside = on_line[scene.edges].all(axis=1)
    count = len(scene.moved)
    zones = []
    for zone in scene.zones:
        near = np.abs(line.distance(zone)).min() <= MIRROR_DISTANCE * np.ptp(zone, axis=0).max()
        zones.append(np.concatenate([zone, line.reflected(zone)]) if near else zone)
    return replace(
        scene,
        moved=np.concatenate([scene.moved, line.reflected(scene.moved)]),
        values=np.tile(scene.values, 2),
        triangles=np.concatenate([scene.triangles, scene.triangles[:, ::-1] + count]),
        edges=np.concatenate([scene.edges, scene.edges + count]),
        outline=np.tile(scene.outline & ~inside, 2),
        zones=zones,
    )


def moved_nodes(solution: Solved, nodes: Nodes, style: Style) -> tuple[Array, Array, float]:
    """Places (k, d) of nodes before and (k, d) after displacement, and the factor on that."""
    d = solution.mesh.dim
    found = nodes.values(ng.CF((*(ng.x, ng.y, ng.z)[:d], *solution.displacement)))
    place, move = found[:, :d], found[:, d:]
    scale = _chosen_scale(solution, place, move) if style.scale is None else style.scale
    return place, place + scale * move, scale


def _chosen_scale(solution: Solved, place: Array, move: Array) -> float:
    """Factor 1, 2, 5, 10, ... on the displacement: seen, yet no false overlap of the bodies.

    Contact turns a gap e into `gap`; a factor s draws it as e - s (e - gap). Where nothing touches
    half of each gap stays.
    """
    size = np.ptp(place, axis=0).max()
    largest = np.linalg.norm(move, axis=1).max()
    factor = 0.04 * size / largest if largest > 0 else 1.0
    for state in solution.pairs:
        if state.line.contact.primary is None:
            continue
        overlap = -state.gap / 2
        if solution.active.any():
            zone = np.ptp(solution.points[solution.active], axis=0).max()
            overlap = np.full(len(state.gap), 0.003 * max(zone, 0.01 * size))
        initial = np.abs(state.line.gap)
        closed = initial - state.gap
        some = closed > 1e-12 * size  # others stand still or open
        factor = min(factor, ((initial + overlap)[some] / closed[some]).min(initial=np.inf))
    power = 10.0 ** np.floor(np.log10(factor))
    return float(max(1.0, *(k * power for k in (0.5, 1, 2, 5) if k * power <= factor)))
