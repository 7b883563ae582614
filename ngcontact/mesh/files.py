"""Meshes of files: triangles with named bodies and boundaries, curved sides of second order."""

from __future__ import annotations

import io
import itertools
import os
from collections import defaultdict
from collections.abc import Iterable, Iterator
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path
from typing import Any, NamedTuple

import netgen.meshing as ngm
import netgen.occ as occ
import ngsolve as ng
import numpy as np
from scipy.interpolate import make_interp_spline

from ..arrays import Array, Index, chords, distances_along
from ..errors import warn
from ..problem import check_mesh

# Corners of the cells that are read; those of second order have middles of their sides, too.
CORNERS = {"triangle": 3, "triangle6": 3, "quad": 4, "quad8": 4, "quad9": 4, "line": 2, "line3": 2}
SOLIDS = ("tetra", "hexahedron", "wedge", "pyramid")
PLANE_EXTENT = 1e-9  # extent along z, relative to that in the plane, of a file that lies in one
# Distance of a middle from its chord, relative to this, from which a side is curved.
CURVED_DISTANCE = 1e-6
CORNER = np.deg2rad(30)  # turn of a line at which curves end
POLYGON = np.deg2rad(1)  # turn of straight sides from which they may stand for a curve
# Points of a cell at which it may fold.
LATTICE = [(i / 4, j / 4, 0) for i in range(5) for j in range(5 - i)]


class _Cells(NamedTuple):
    """Cells of one kind, k of them with c corners."""

    nodes: Index  # (k, c)
    middles: Index  # (k, c) of the sides that begin at each corner, -1 where there are none
    names: np.ndarray  # (k,) of their groups


class _Side(NamedTuple):
    """A side of a triangle on the boundary, by the numbers of nodes."""

    start: int  # the body lies to the left
    stop: int
    middle: int  # -1 where the side is straight
    name: str
    body: int


def read(path: str | os.PathLike[str]) -> ng.Mesh:
    """Mesh of a file, for `Problem`: the formats of meshio, as Gmsh's 2.2 and 4.1 or Abaqus'.

    Bodies are the named groups of cells, boundaries those of lines; outer sides without a name are
    "default". Quadrilaterals are split along their shorter diagonals. Curved sides of second order
    become smooth curves through the nodes of the file, which end where lines turn by 30 degrees;
    meshes of higher order and refinement follow them.

    Raises
    ------
    ImportError
        meshio is missing.
    FileNotFoundError, ValueError
        No such file; what does not fit: solids, other cells, bodies without a name, lines that are
        no sides, cells that overlap or are degenerate, bodies that do not lie in a plane.
    """
    try:
        import meshio
    except ImportError as error:
        raise ImportError('meshio reads files: pip install "ngcontact[files]"') from error
    source = Path(path)
    if not source.is_file():
        raise FileNotFoundError(f'there is no file "{source}"')
    said = io.StringIO()  # meshio prints, and leaves Python where it knows no format
    try:
        with redirect_stdout(said), redirect_stderr(said):
            file = meshio.read(source)
    except (Exception, SystemExit) as error:
        why = " ".join(f"{said.getvalue()} {error}".split())
        raise ValueError(
            f'"{source}" cannot be read as a mesh; meshio says: {why}. Look for an empty or cut '
            "file, cells with nodes that it does not have, and kinds of cells that meshio does not "
            "know, as CPS6 and CPE3 of Abaqus (it knows CPS3, CPS4, CPE6, S8R); Gmsh writes files "
            "that are read (-format msh41)"
        ) from error
    try:
        return _mesh_of(file)
    except ValueError as error:
        raise ValueError(f'"{source}": {error}') from error


def _mesh_of(file: Any) -> ng.Mesh:
    cells, lines = _cells(file)
    points = _plane(np.asarray(file.points, dtype=float), cells)
    triangles, names, middles = _triangles(points, cells)
    bodies = list(dict.fromkeys(names.tolist()))
    sides = _boundary(triangles, np.array([bodies.index(n) for n in names]), middles, lines)
    runs = list(_runs(points, sides))
    mesh = ngm.Mesh(dim=2)
    used, numbers = np.unique(triangles, return_inverse=True)
    mesh.AddPoints(np.column_stack([points[used], np.zeros(len(used))]))
    for k, body in enumerate(bodies, start=1):
        mesh.Add(ngm.FaceDescriptor(surfnr=k, domin=k, bc=k))
        mesh.SetMaterial(k, body)
        own = numbers.reshape(triangles.shape)[names == body]
        mesh.AddElements(2, k, np.ascontiguousarray(own, dtype=np.int32))
    curves: list[occ.Edge] = []
    if any(side.middle >= 0 for side in sides):
        curves, turn = _curves(points, runs)
    else:  # one region a name
        every = dict.fromkeys(side.name for side in sides)
        runs = [[side for side in sides if side.name == name] for name in every]
        turn = max((_turn(*x) for x in _smooth(points, sides, by_name=True).values()), default=0.0)
    for k, run in enumerate(runs, start=1):
        ends = np.searchsorted(used, [(side.start, side.stop) for side in run])
        mesh.AddElements(1, k, np.ascontiguousarray(ends, dtype=np.int32))
        mesh.SetBCName(k - 1, run[0].name)
        if curves:
            mesh.EdgeDescriptor(k).edgenr = k
    if curves:
        mesh.SetGeometry(occ.OCCGeometry(occ.Compound(curves), dim=2))
    found = ng.Mesh(mesh)
    check_mesh(found, 2)
    if curves:
        _check_curved(found)
        warn(
            f"sides of second order in a file turn by up to {np.rad2deg(turn):.2g} degrees where "
            "curves are taken for smooth: normals are known to about that"
        )
    elif turn > POLYGON:
        warn(
            f"straight sides of a file turn by {np.rad2deg(turn):.2g} degrees without corners: "
            "if they are to be a curve, refinement does not make it round; write the file in "
            "second order"
        )
    return found


def _cells(file: Any) -> tuple[list[_Cells], list[_Cells]]:
    """Triangles and quadrilaterals, and lines."""
    cells: list[_Cells] = []
    lines: list[_Cells] = []
    for block, names in zip(file.cells, _names(file), strict=True):
        kind, count = block.type, len(block.data)
        if kind == "vertex" or not count:
            continue
        if kind.startswith(SOLIDS):
            raise ValueError(
                f'{count} cells of kind "{kind}" are solids, and bodies that are read lie in the '
                "plane: mesh a section of them (gmsh -2); tetrahedra of format 2.2 and first order "
                "are read by ngsolve.Mesh(netgen.read_gmsh.ReadGmsh(path))"
            )
        if kind not in CORNERS:
            raise ValueError(
                f'{count} cells of kind "{kind}": triangles, quadrilaterals and lines of first or '
                "second order are read"
            )
        data, c = np.asarray(block.data, dtype=np.intp), CORNERS[kind]
        middles = np.full((count, c), -1)
        if data.shape[1] > c and c > 2:
            middles = data[:, c : 2 * c]
        (lines if c == 2 else cells).append(_Cells(data[:, :c], middles, names))
    if not cells:
        raise ValueError("there are no triangles or quadrilaterals")
    for part in cells:
        nameless = np.flatnonzero(part.names == "")
        if nameless.size:
            x, y = file.points[part.nodes[nameless[0], 0], :2]
            raise ValueError(
                f"{nameless.size} cells, one at ({x:.6g}, {y:.6g}), are of no body: give every "
                "body a name (Gmsh: a Physical Surface)"
            )
    return cells, lines


def _names(file: Any) -> list[np.ndarray]:
    """The name (k,) of the group of each cell, by blocks: of several the smallest one's, or ""."""
    found = [np.full(len(block.data), "", dtype=object) for block in file.cells]
    sets = {k: parts for k, parts in file.cell_sets.items() if not k.startswith("gmsh:")}
    if sets:
        sizes = {k: sum(0 if x is None else len(x) for x in parts) for k, parts in sets.items()}
        for name in sorted(sets, key=lambda k: -sizes[k]):
            for own, part in zip(found, sets[name], strict=True):
                if part is not None and len(part):
                    own[np.asarray(part, dtype=np.intp)] = name
        return found
    tags = file.cell_data.get("gmsh:physical", file.cell_data.get("cell_tags"))
    for block, own, tag in zip(file.cells, found, tags or (), strict=bool(tags)):
        for number, several in getattr(file, "cell_tags", {}).items():
            own[np.asarray(tag) == number] = several[0]
        for name, (number, dim) in file.field_data.items():
            if block.dim == dim:
                own[np.asarray(tag) == number] = name
    return found


def _plane(points: Array, cells: list[_Cells]) -> Array:
    """Points (n, 2) of a file whose cells lie in a plane z = const."""
    used = points[np.unique(np.concatenate([part.nodes.ravel() for part in cells]))]
    if not np.isfinite(used).all():
        raise ValueError(f"{(~np.isfinite(used)).sum()} coordinates of nodes are no numbers")
    if used.shape[1] > 2 and np.ptp(used[:, 2]) > PLANE_EXTENT * np.ptp(used[:, :2], axis=0).max():
        low, high = used[:, 2].min(), used[:, 2].max()
        raise ValueError(f"bodies do not lie in a plane: z is from {low:.6g} to {high:.6g}")
    return points[:, :2]


def _triangles(
    points: Array, cells: list[_Cells]
) -> tuple[Index, np.ndarray, dict[tuple[int, int], int]]:
    """Corners (n, 3), anticlockwise, and names (n,); middles of curved sides by their ends."""
    corners, names, middles = [], [], dict[tuple[int, int], int]()
    for part in cells:
        a, b, m = part.nodes, np.roll(part.nodes, -1, axis=1), part.middles
        off = np.abs(points[m] - (points[a] + points[b]) / 2).max(axis=2)
        bent = (m >= 0) & (off > CURVED_DISTANCE * np.abs(points[b] - points[a]).max(axis=2))
        for x, y, z in zip(a[bent].tolist(), b[bent].tolist(), m[bent].tolist(), strict=True):
            middles[min(x, y), max(x, y)] = z
        if a.shape[1] == 4:
            one, other = np.linalg.norm(points[a[:, 2:]] - points[a[:, :2]], axis=2).T
            a = np.where((other < one)[:, None], b, a)
            a = np.concatenate([a[:, [0, 1, 2]], a[:, [0, 2, 3]]])
        corners.append(a)
        names.append(np.resize(part.names, len(a)))
    found = np.concatenate(corners)
    edge = points[found[:, 1:]] - points[found[:, :1]]
    clockwise = edge[:, 0, 0] * edge[:, 1, 1] < edge[:, 0, 1] * edge[:, 1, 0]
    found[clockwise] = found[clockwise, ::-1]
    return found, np.concatenate(names), middles


def _boundary(
    triangles: Index, body: Index, middles: dict[tuple[int, int], int], lines: list[_Cells]
) -> list[_Side]:
    """Outer sides, and those inside that have a name, each once."""
    known: dict[tuple[int, int], list[tuple[int, int, int]]] = defaultdict(list)
    for own, corner in zip(body.tolist(), triangles.tolist(), strict=True):
        for a, b in zip(corner, corner[1:] + corner[:1], strict=True):
            known[min(a, b), max(a, b)].append((a, b, own))
    several = sum(len(x) > 2 or len({a for a, *_ in x}) < len(x) for x in known.values())
    if several:
        raise ValueError(
            f"cells overlap on {several} sides, or occur twice: every cell belongs to one body"
        )
    named: dict[tuple[int, int], str] = {}
    for part in lines:
        for (a, b), name in zip(part.nodes.tolist(), part.names.tolist(), strict=True):
            if name:
                if (min(a, b), max(a, b)) not in known:
                    raise ValueError(f'a line of "{name}" is no side of a cell')
                named[min(a, b), max(a, b)] = name
    return [
        _Side(*at[0][:2], middles.get(key, -1), named.get(key, "default"), at[0][2])
        for key, at in known.items()
        if len(at) == 1 or key in named
    ]


def _tangents(points: Array, side: _Side) -> Array:
    """Unit tangents (2, 2) at the start and at the stop of a side."""
    a, b = points[side.start], points[side.stop]
    m = points[side.middle] if side.middle >= 0 else (a + b) / 2
    found = np.array([4 * m - 3 * a - b, a + 3 * b - 4 * m])
    return found / np.linalg.norm(found, axis=1)[:, None]


def _turn(one: Array, other: Array) -> float:
    """Angle between unit vectors (2,)."""
    return float(np.arctan2(abs(one[0] * other[1] - one[1] * other[0]), one @ other))


def _runs(points: Array, sides: list[_Side]) -> Iterator[list[_Side]]:
    """Sides one after the other that are one curve, or one straight line, of one name and body."""
    starts = defaultdict(list)
    for k, side in enumerate(sides):
        starts[side.name, side.body, side.start].append(k)
    following: dict[int, int] = {}
    for k, side in enumerate(sides):
        after = starts[side.name, side.body, side.stop]
        if len(after) == 1 and (side.middle >= 0) == (sides[after[0]].middle >= 0):
            turn = _turn(_tangents(points, side)[1], _tangents(points, sides[after[0]])[0])
            if turn < (CORNER if side.middle >= 0 else CURVED_DISTANCE):
                following[k] = after[0]
    left = dict.fromkeys([k for k in range(len(sides)) if k not in set(following.values())])
    left |= dict.fromkeys(range(len(sides)))  # ends of curves first, then closed ones
    while left:
        at, run = next(iter(left)), []
        while at in left:
            del left[at]
            run.append(sides[at])
            at = following.get(at, -1)
        yield run


def _smooth(
    points: Array, sides: Iterable[_Side], *, by_name: bool
) -> dict[tuple[int, str], list[Array]]:
    """Both tangents (2,) at nodes where two sides, of one name, turn by less than a corner."""
    at: dict[tuple[int, str], list[Array]] = defaultdict(list)
    for side in sides:
        for node, tangent in zip((side.start, side.stop), _tangents(points, side), strict=True):
            at[node, side.name if by_name else ""].append(tangent)
    return {k: x for k, x in at.items() if len(x) == 2 and _turn(*x) < CORNER}


def _curves(points: Array, runs: list[list[_Side]]) -> tuple[list[occ.Edge], float]:
    """An edge of a drawing for each run, and the largest turn (radians) where they are smooth."""
    pairs = _smooth(points, itertools.chain(*runs), by_name=False)
    smooth, largest, found = {node: x for (node, _), x in pairs.items()}, 0.0, []
    for run in runs:
        nodes = [run[0].start] + [n for s in run for n in (s.middle, s.stop) if n >= 0]
        x = points[nodes]
        if run[0].middle < 0:
            edge = occ.Segment(*(occ.Pnt(*p, 0) for p in x[[0, -1]]))
        else:
            largest = max([largest, *(_turn(*smooth[s.stop]) for s in run if s.stop in smooth)])
            closed = nodes[0] == nodes[-1] and nodes[0] in smooth
            t = distances_along(x)
            slope = make_interp_spline(
                t, x, min(5, len(x) - 1), bc_type="periodic" if closed else None
            )(t, 1)
            for k in () if closed else (0, -1):  # it goes on in another curve, or a straight line
                slope[k] = np.sum(smooth.get(nodes[k], [slope[k]]), axis=0)
            # The kernel compares the lengths of tangents with `tol`, and uses their directions.
            step = float(chords(x).min())
            slope *= step / np.linalg.norm(slope, axis=1)[:, None]
            edge = occ.SplineInterpolation(
                [occ.Pnt(*p, 0) for p in x],
                tol=CURVED_DISTANCE * step,
                tangents={k: occ.Vec(*t, 0) for k, t in enumerate(slope)},
            )
        edge.name = run[0].name
        found.append(edge)
    return found, largest


def _check_curved(mesh: ng.Mesh) -> None:
    """Refuse elements that their curved sides fold."""
    curved = ng.Mesh(mesh.ngmesh.Copy())
    curved.Curve(2)
    points = curved.MapToAllElements(ng.IntegrationRule(LATTICE, [1 / 30] * 15), ng.VOL)
    bad = ng.Det(ng.specialcf.JacobianMatrix(2, 2))(points).ravel() <= 0
    if bad.any():
        x, y = ng.CF((ng.x, ng.y))(points[bad][:1])[0]
        raise ValueError(f"curved sides fold a cell near ({x:.6g}, {y:.6g}): mesh it finer there")
