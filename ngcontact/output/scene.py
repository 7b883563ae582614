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
from ..contact import neighbours
from ..fem import von_mises
from ..problem import ABOUT_AN_AXIS, MeshArrays
from ..solved import Solved, full_stress
from .nodes import Nodes, nodes_of, principal_stresses, subdivision

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
        if not isinstance(self.units, Mapping):
            raise TypeError(
                f'units = {self.units!r}: give a mapping, as {{"length": "mm", "stress": "MPa"}}'
            )
        for kind in self.units:
            if kind not in UNITS:
                raise ValueError(f'units: "{kind}" is none of {", ".join(UNITS)}')
            name, size = self.unit(kind)
            if not isinstance(name, str) or not (np.isfinite(size) and size > 0):
                raise ValueError(
                    f'units["{kind}"] = {self.units[kind]}: give a name, or a name and its size in '
                    'the unit of the data, as ("MPa", 1e6)'
                )
        if not isinstance(self.profile, Mapping):
            raise TypeError(
                f'profile = {self.profile!r}: give a mapping, as {{"Hertz": a function of s}}'
            )
        for label, profile in self.profile.items():
            if callable(profile):
                continue
            try:
                one, other = (np.asarray(values, dtype=float) for values in profile)
                fits = one.ndim == 1 and one.shape == other.shape
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
            return Field("field", "", field, lambda values: values[:, 0])
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
    of: Callable[[Array], Array]  # (k,), of nodal values (k, dim)

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

    def component(number: int) -> Callable[[Array], Array]:
        return lambda values: np.asarray(values[:, number])

    stresses: dict[str, tuple[str, Callable[[Array], Array]]] = {
        "von_mises": ("von Mises stress", von_mises),
        **{f"stress_{a}": (f"stress {a}", component(k)) for k, a in enumerate(names)},
        "largest_principal": ("largest principal stress", lambda s: principal_stresses(s)[:, 0]),
        "smallest_principal": ("smallest principal stress", lambda s: principal_stresses(s)[:, 2]),
        "mean_pressure": ("mean pressure, −tr σ/3", lambda s: -s[:, [0, 1, 3]].sum(axis=1) / 3),
    }
    moves: dict[str, tuple[str, Callable[[Array], Array]]] = {
        "displacement": ("displacement, absolute value", lambda u: np.linalg.norm(u, axis=1)),
        **{
            f"displacement_{a}": (f"displacement along {a}", component(k))
            for k, a in enumerate((x, y, *z))
        },
    }
    found = {name: Field(label, "stress", stress, of) for name, (label, of) in stresses.items()}
    return found | {name: Field(label, "length", move, of) for name, (label, of) in moves.items()}


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
        for path in paths(neighbours(line), len(rows)) if direction is None and len(rows) else ():
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


@dataclass(frozen=True, eq=False)
class SymmetryLine:
    """A straight line."""

    point: Array  # (2,)
    normal: Array  # (2,), unit vector
    slack: float  # distance up to which points lie on it, a length

    def distance(self, x: Array) -> Array:
        """Signed distances (...,) of points `x` (..., 2)."""
        return np.asarray((x - self.point) @ self.normal)

    def reflected(self, x: Array) -> Array:
        """Mirror images (k, 2) of points `x` (k, 2)."""
        return np.asarray(x - 2 * self.distance(x)[:, None] * self.normal)


def symmetry_line(mesh: ng.Mesh, displacement: ng.GridFunction, pattern: str) -> SymmetryLine:
    """The line of symmetry on which a boundary lies; raises ``ValueError`` where it is none."""
    region = mesh.Boundaries(pattern)
    if not any(region.Mask()):
        names = sorted(set(mesh.GetBoundaries()))
        raise ValueError(f'mirror = "{pattern}" is no boundary; there are {", ".join(names)}')
    rule = ng.IntegrationRule([(0.0, 0, 0), (0.5, 0, 0), (1.0, 0, 0)], [0.0] * 3)
    read = ng.CF((ng.x, ng.y, *displacement))(mesh.MapToAllElements(rule, region))
    found = np.asarray(read, dtype=float).reshape(-1, 4)
    x, u = found[:, :2], found[:, 2:]
    middle = x.mean(axis=0)
    _, _, axes = np.linalg.svd(x - middle, full_matrices=False)
    vertices = MeshArrays(mesh).vertices
    line = SymmetryLine(middle, axes[1], STRAIGHT * float(np.ptp(vertices, axis=0).max()))
    if (np.abs(line.distance(x)) > line.slack).any():
        raise ValueError(f'mirror = "{pattern}" is not straight: give a boundary on one line')
    away = np.abs(u @ line.normal).max()
    if away > SYMMETRY_ROUND_OFF * np.abs(displacement.vec.FV().NumPy()).max():
        raise ValueError(
            f'mirror = "{pattern}" moves across its line by {away:.3g}: it is no line of symmetry'
        )
    sides = line.distance(vertices)
    if (sides > line.slack).any() and (sides < -line.slack).any():
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
    zones: list[Array]  # (c, 2) each, points in contact, moved; those of the largest force first
    scale: float

    def areas(self) -> Array:
        """Areas (t,) of the triangles."""
        corners = self.moved[self.triangles]
        return np.abs(np.linalg.det(corners[:, 1:] - corners[:, :1])) / 2


def picture(solution: Solved, style: Style) -> Scene:
    """Evaluate a solution for the picture."""
    shown = style.shown(solution)
    mesh = solution.mesh
    order = max(mesh.GetCurveOrder(), solution.order)
    if order > 1:  # enough to look smooth on coarse meshes, no more than can be seen on fine ones
        order = int(np.clip(np.sqrt(MAX_TRIANGLES / mesh.ne), 1, 2 * order))
    nodes = nodes_of(mesh, order)
    triangles, sides = subdivision(order)
    edges = nodes.cells[:, sides].reshape(-1, order + 1)
    ends = np.sort(edges[:, [0, -1]], axis=1)
    _, first, count = np.unique(ends, axis=0, return_index=True, return_counts=True)
    place, moved, scale = moved_nodes(solution, nodes, style)
    zones = [zone.rows for zone in zones_of(solution, contact_lines(solution))]
    zones.sort(key=lambda rows: -float(np.abs(solution.force[rows]).sum()))
    tree = KDTree(place)
    at = [tree.query(solution.points[rows])[1].astype(int) for rows in zones]
    scene = Scene(
        solution=solution,
        style=style,
        moved=moved,
        shown=shown,
        values=shown.values(nodes),
        triangles=nodes.cells[:, triangles].reshape(-1, 3),
        edges=edges[first],
        outline=count == 1,
        zones=[moved[zone] for zone in at],
        scale=scale,
    )
    if solution.problem.model in ABOUT_AN_AXIS:
        slack = STRAIGHT * float(np.abs(place).max(initial=0.0))
        return _mirrored(scene, SymmetryLine(np.zeros(2), np.array([1.0, 0.0]), slack), place)
    if style.mirror is None:
        return scene
    return _mirrored(scene, symmetry_line(mesh, solution.displacement, style.mirror), place)


def _mirrored(scene: Scene, line: SymmetryLine, place: Array) -> Scene:
    """A scene on both sides of a line of symmetry; `place` (k, 2) are its nodes before."""
    inside = (np.abs(line.distance(place)) <= line.slack)[scene.edges].all(axis=1)
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
    place, move, scale = found[:, :d], found[:, d:], style.scale
    if scale is None:
        body = np.empty(len(place), dtype=np.intp)
        body[nodes.cells] = nodes.body[:, None]
        scale = _chosen_scale(solution, place, move, body)
    return place, place + scale * move, scale


def _chosen_scale(solution: Solved, place: Array, move: Array, body: Index) -> float:
    """Factor 1, 2, 5, 10, ... on the displacement: seen, yet no false overlap of the bodies.

    Contact turns a gap e into `gap`; a factor s draws it as e - s (e - gap). For e, the distance
    to the nearest node of another body errs on the side of a smaller factor. Where nothing touches
    half of each gap stays.
    """
    size = np.ptp(place, axis=0).max()
    largest = np.linalg.norm(move, axis=1).max()
    factor = 0.04 * size / largest if largest > 0 else 1.0
    points, gap = solution.points, solution.gap
    if len(points) and np.ptp(body) > 0:
        overlap = -gap / 2
        if solution.active.any():
            zone = np.ptp(points[solution.active], axis=0).max()
            overlap = np.full(len(gap), 0.003 * max(zone, 0.01 * size))
        own = body[KDTree(place).query(points)[1]]
        for k in np.unique(own):
            initial = KDTree(place[body != k]).query(points[own == k])[0]
            closed = np.maximum(initial - gap[own == k], 1e-12 * size)
            factor = min(factor, ((initial + overlap[own == k]) / closed).min())
    power = 10.0 ** np.floor(np.log10(factor))
    return float(max(1.0, *(k * power for k in (0.5, 1, 2, 5) if k * power <= factor)))
