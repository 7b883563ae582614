"""The body of revolution of an axisymmetric solution, for ParaView."""

from __future__ import annotations

import math
import os
from pathlib import Path
from typing import TYPE_CHECKING

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index
from ..fem import von_mises
from ..problem import ABOUT_AN_AXIS
from ..solved import Solved
from .files import check_path, replacing
from .vtk import full_stress, name_pairs, neighbour_tree, nodes_of, subdivision, write_data

if TYPE_CHECKING:
    import pyvista

STEP = 6.0  # degrees between two sections, at most
VTK_WEDGE = 13


def write_revolved(path: str | os.PathLike[str], solution: Solved, angle: float = 270.0) -> Path:
    """Bodies of revolution as ``.vtu``, the surface of contact beside it: ``<stem>_contact.vtp``.

    The meridian section is turned by `angle` degrees about z.

    Wedges between sections of linear triangles, order^2 of them for each element. Point data:
    ``displacement`` (three components), ``stress`` (rr, zz, hoop, rz), ``von_mises``. Cell data:
    ``body``, whose names are the field data ``body_names``. Contact is on quadrilaterals between
    contact points: ``pressure``, ``gap``, ``active``, ``pair``, and the ``traction`` on the
    secondary (three components). Any consistent units. Returns the path.

    Raises ``ValueError`` for a plane model and for an angle outside (0, 360], and ``ValueError`` or
    ``OSError`` as `check_path` does, before any work.
    """
    if solution.problem.model not in ABOUT_AN_AXIS:
        raise ValueError(
            f'model "{solution.problem.model}": a body of revolution has model="axisymmetric"'
        )
    if not 0 < angle <= 360:
        raise ValueError(f"angle = {angle}: give degrees above 0, at most 360")
    target = check_path(path, ".vtu")
    beside = check_path(target.with_name(f"{target.stem}_contact.vtp"), ".vtp")
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    with replacing(target, beside) as drafts:
        write_data(vtkXMLUnstructuredGridWriter(), _grid(solution, float(angle)), drafts[0])
        write_data(vtkXMLPolyDataWriter(), _surface(solution, float(angle)), drafts[1])
    return target


def _sections(angle: float) -> tuple[Array, Index, Index]:
    """Angles (t,) of the sections in radians; first and last (s,) of the s steps between them."""
    steps = max(3, math.ceil(angle / STEP))
    count = steps if angle == 360 else steps + 1
    turns = np.deg2rad(angle) / steps * np.arange(count)
    return turns, np.arange(steps), (np.arange(steps) + 1) % count


def _grid(solution: Solved, angle: float) -> pyvista.UnstructuredGrid:
    """The wedges with their fields."""
    import pyvista

    components = full_stress(solution)
    order = max(solution.mesh.GetCurveOrder(), solution.order)
    nodes = nodes_of(solution.mesh, order)
    triangles = nodes.cells[:, subdivision(order)[0]].reshape(-1, 3)
    turns, start, stop = _sections(angle)
    place, u = nodes.values(ng.CF((ng.x, ng.y))), solution.displacement
    count, sections = len(place), len(turns)
    first = count * start[:, None, None] + triangles
    second = count * stop[:, None, None] + triangles
    wedges: Index = np.concatenate([second, first], axis=2).reshape(-1, 6)
    cells = np.column_stack([np.full(len(wedges), 6), wedges]).ravel()
    kinds = np.full(len(wedges), VTK_WEDGE, dtype=np.uint8)
    grid = pyvista.UnstructuredGrid(cells, kinds, _turned(place, turns))
    grid.point_data["displacement"] = _turned(nodes.values(ng.CF((u[0], u[1]))), turns)
    rr, zz, rz, hoop = nodes.values(components).T
    grid.point_data["stress"] = np.tile(np.column_stack([rr, zz, hoop, rz]), (sections, 1))
    for k, component in enumerate(("rr", "zz", "hoop", "rz")):
        grid.GetPointData().GetAbstractArray("stress").SetComponentName(k, component)
    grid.point_data["von_mises"] = np.tile(von_mises(np.column_stack([rr, zz, rz, hoop])), sections)
    grid.cell_data["body"] = np.tile(np.repeat(nodes.body, order**2), len(start))
    grid.field_data["body_names"] = list(nodes.names)
    return grid


def _surface(solution: Solved, angle: float) -> pyvista.PolyData:
    """Quadrilaterals between neighbouring contact points of each pair, turned."""
    import pyvista

    points = np.asarray(solution.points, dtype=float).reshape(-1, 2)
    turns, start, stop = _sections(angle)
    ends = [np.zeros((0, 2), dtype=np.intp)]
    for pair in np.unique(solution.pair):
        rows = np.flatnonzero(solution.pair == pair)
        tree = neighbour_tree(points[rows]).tocoo()
        ends.append(np.column_stack([rows[tree.row], rows[tree.col]]))
    i, j = np.concatenate(ends).T
    first, last = len(points) * start[:, None], len(points) * stop[:, None]
    quads = np.stack([first + i, first + j, last + j, last + i], axis=2).reshape(-1, 4)
    if len(quads) == 0:
        data = pyvista.PolyData()
    else:
        faces = np.column_stack([np.full(len(quads), 4), quads]).ravel()
        data = pyvista.PolyData(_turned(points, turns), faces=faces)
        for name in ("pressure", "gap", "active", "pair"):
            kind = np.int32 if name in ("active", "pair") else float
            data.point_data[name] = np.tile(np.asarray(getattr(solution, name), kind), len(turns))
        traction = -np.asarray(solution.pressure)[:, None] * solution.direction
        data.point_data["traction"] = _turned(traction, turns)
    name_pairs(data, solution)
    return data


def _turned(vectors: Array, turns: Array) -> Array:
    """Vectors (r, z) (k, 2) about z by the angles `turns` (t,) in radians: (t k, 3)."""
    r, z = vectors.T
    x, y = np.outer(np.cos(turns), r), np.outer(np.sin(turns), r)
    return np.stack([x, y, np.tile(z, (len(turns), 1))], axis=2).reshape(-1, 3)
