"""Files for ParaView: curved bodies with fields at nodes, bodies of revolution, contact points."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index
from ..estimator import Estimated
from ..fem import von_mises
from ..problem import ABOUT_AN_AXIS
from ..solved import Solved
from .files import check_path, replacing
from .nodes import Nodes, full_stress, neighbour_tree, nodes_of, subdivision

if TYPE_CHECKING:
    import pyvista

PLANE = ("xx", "yy", "xy", "zz")  # components of a stress, as `full_stress` orders them
MERIDIAN = ("rr", "zz", "rz", "hoop")
VTK_CELL = {1: 5, 2: 22}  # VTK_TRIANGLE, VTK_QUADRATIC_TRIANGLE
VTK_LAGRANGE_TRIANGLE = 69  # every higher order
VTK_WEDGE = 13
SECTION_ANGLE = 6.0  # degrees between two sections of a body of revolution, at most


def write_solution(path: str | os.PathLike[str], solution: Estimated) -> Path:
    """Bodies of a solution as ``.vtu``, contact points beside it as ``<stem>_contact.vtp``.

    The cells are Lagrange triangles of the order of the geometry or of the displacement,
    whichever is higher. Point data: ``displacement``, ``stress`` (xx, yy, xy and zz, the one
    normal to the plane; of bodies of revolution rr, zz, rz and hoop; means inside each body),
    ``hoop_stress`` of bodies of revolution, and ``von_mises``, made of ``stress``. Cell data:
    ``body``, whose names are the field data ``body_names``, and ``indicators`` if they have
    been computed already.
    Contact points: ``pressure``, ``gap``, ``force``, ``active``, ``pair``, and the ``traction`` on
    the secondary, a vector. Field data of both files: the names by number of the pair in
    ``pair_names``, ``secondary_names``, ``primary_names``. Any consistent units. Returns the path.
    A file appears complete or not at all. Raises ``ValueError`` and ``OSError`` as `check_path`
    does, before any work.
    """
    return _write_both(path, lambda: (_bodies(solution), _contact_points(solution)))


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
    steps = max(3, math.ceil(angle / SECTION_ANGLE))
    count = steps if angle == 360 else steps + 1
    turns = np.deg2rad(float(angle)) / steps * np.arange(count)
    between = np.arange(steps), (np.arange(steps) + 1) % count
    return _write_both(
        path, lambda: (_wedges(solution, turns, between), _surface(solution, turns, between))
    )


def _write_both(
    path: str | os.PathLike[str], made: Callable[[], tuple[pyvista.DataSet, pyvista.DataSet]]
) -> Path:
    """Write bodies and contact, `made` once the paths are known to be writable."""
    target = check_path(path, ".vtu")
    beside = check_path(target.with_name(f"{target.stem}_contact.vtp"), ".vtp")
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    with replacing(target, beside) as drafts:
        writers = vtkXMLUnstructuredGridWriter(), vtkXMLPolyDataWriter()
        for writer, data, draft in zip(writers, made(), drafts, strict=True):
            _write_data(writer, data, draft)
    return target


def write_series(
    path: str | os.PathLike[str],
    solutions: Iterable[Estimated],
    times: Iterable[float] | None = None,
) -> Path:
    """Solutions, one per level or load, as a ``.pvd`` for ParaView.

    Beside it the files of `write_solution`: ``<stem>_000.vtu``, ``<stem>_000_contact.vtp``, and
    so on. `solutions` may be a generator: the ``.pvd`` lists those written so far. `times` are
    increasing numbers, such as loads, one for each; when left out 0, 1, 2, ...

    Raises ``ValueError`` if there is no solution, or not one time for each, and ``TypeError`` if a
    time is no number; otherwise as `check_path`, before any work.
    """
    target = check_path(path, ".pvd")
    clock = None if times is None else iter(_increasing(times))
    root = ET.Element("VTKFile", type="Collection", version="1.0", byte_order="LittleEndian")
    collection = ET.SubElement(root, "Collection")
    for level, solution in enumerate(solutions):
        time = float(level) if clock is None else next(clock, None)
        if time is None:
            raise ValueError(f"times has {level} entries, fewer than there are solutions")
        stem = f"{target.stem}_{level:03d}"
        write_solution(target.with_name(f"{stem}.vtu"), solution)
        for part, name in enumerate((f"{stem}.vtu", f"{stem}_contact.vtp")):
            entry = {"timestep": f"{time:.17g}", "group": "", "part": str(part), "file": name}
            ET.SubElement(collection, "DataSet", entry)
        ET.indent(root)
        with replacing(target) as (draft,):
            ET.ElementTree(root).write(draft, encoding="utf-8", xml_declaration=True)
    if len(collection) == 0:
        raise ValueError(f"no solution to write to {str(target)!r}: the series is empty")
    if clock is not None and (left := len(list(clock))):
        raise ValueError(f"times has {left} entries more than there are solutions: give as many")
    return target


def _increasing(times: Iterable[float]) -> list[float]:
    """Finite increasing numbers."""
    values = list(times)
    for before, time in zip([None, *values], values, strict=False):
        if isinstance(time, bool) or not isinstance(time, int | float | np.number):
            raise TypeError(f"times hold {time!r}: give numbers")
        if not np.isfinite(time) or (before is not None and not time > before):
            raise ValueError(f"times hold {time} after {before}: give finite, increasing numbers")
    return [float(time) for time in values]


def _nodal_values(solution: Solved) -> tuple[int, Nodes, Array]:
    """Order and nodes of the cells; place, displacement and stress there, (k, 2 + 2 + 4)."""
    order = max(solution.mesh.GetCurveOrder(), solution.order)
    nodes, u = nodes_of(solution.mesh, order), solution.displacement
    return order, nodes, nodes.values(ng.CF((ng.x, ng.y, u[0], u[1], full_stress(solution))))


def _bodies(solution: Estimated) -> pyvista.UnstructuredGrid:
    """Both bodies with their fields as a VTK grid."""
    import pyvista

    order, nodes, values = _nodal_values(solution)
    count, size = nodes.cells.shape
    cells = np.column_stack([np.full(count, size), nodes.cells]).ravel()
    kinds = np.full(count, VTK_CELL.get(order, VTK_LAGRANGE_TRIANGLE), dtype=np.uint8)
    grid = pyvista.UnstructuredGrid(cells, kinds, _in_space(values[:, :2]))
    grid.point_data["displacement"] = _in_space(values[:, 2:4])
    about_an_axis = solution.problem.model in ABOUT_AN_AXIS
    _add_stress(grid, values[:, 4:], MERIDIAN if about_an_axis else PLANE)
    if about_an_axis:
        grid.point_data["hoop_stress"] = values[:, 7]
    grid.point_data["von_mises"] = von_mises(values[:, 4:])
    grid.cell_data["body"] = nodes.body
    grid.field_data["body_names"] = list(nodes.names)
    _name_pairs(grid, solution)
    if solution.estimated:
        grid.cell_data["indicators"] = np.asarray(solution.indicators, dtype=float)
    return grid


def _wedges(
    solution: Solved, turns: Array, between: tuple[Index, Index]
) -> pyvista.UnstructuredGrid:
    """Bodies turned by the angles `turns` (t,), with wedges `between` sections of two numbers."""
    import pyvista

    order, nodes, values = _nodal_values(solution)
    triangles = nodes.cells[:, subdivision(order)[0]].reshape(-1, 3)
    first, second = (len(values) * at[:, None, None] + triangles for at in between)
    wedges: Index = np.concatenate([second, first], axis=2).reshape(-1, 6)
    cells = np.column_stack([np.full(len(wedges), 6), wedges]).ravel()
    kinds = np.full(len(wedges), VTK_WEDGE, dtype=np.uint8)
    grid = pyvista.UnstructuredGrid(cells, kinds, _turned(values[:, :2], turns))
    grid.point_data["displacement"] = _turned(values[:, 2:4], turns)
    rr, zz, rz, hoop = values[:, 4:].T
    stress = np.tile(np.column_stack([rr, zz, hoop, rz]), (len(turns), 1))
    _add_stress(grid, stress, ("rr", "zz", "hoop", "rz"))
    grid.point_data["von_mises"] = np.tile(von_mises(values[:, 4:]), len(turns))
    grid.cell_data["body"] = np.tile(np.repeat(nodes.body, order**2), len(between[0]))
    grid.field_data["body_names"] = list(nodes.names)
    return grid


def _add_stress(grid: pyvista.UnstructuredGrid, stress: Array, names: tuple[str, ...]) -> None:
    """Point data ``stress`` (k, 4) with the `names` of its components."""
    grid.point_data["stress"] = stress
    for k, component in enumerate(names):
        grid.GetPointData().GetAbstractArray("stress").SetComponentName(k, component)


def _in_space(vectors: Array) -> Array:
    """Vectors (k, 2) with a third component 0."""
    return np.column_stack([vectors, np.zeros(len(vectors))])


def _turned(vectors: Array, turns: Array) -> Array:
    """Vectors (r, z) (k, 2) about z by the angles `turns` (t,) in radians: (t k, 3)."""
    r, z = vectors.T
    x, y = np.outer(np.cos(turns), r), np.outer(np.sin(turns), r)
    return np.stack([x, y, np.tile(z, (len(turns), 1))], axis=2).reshape(-1, 3)


def _neighbours(solution: Solved) -> Index:
    """Numbers (l, 2) of contact points that are neighbours in a pair."""
    links = [np.zeros((0, 2), dtype=np.intp)]
    for pair in np.unique(solution.pair):
        rows = np.flatnonzero(solution.pair == pair)
        tree = neighbour_tree(solution.points[rows]).tocoo()
        links.append(np.column_stack([rows[tree.row], rows[tree.col]]))
    return np.concatenate(links)


def _contact_points(solution: Solved) -> pyvista.PolyData:
    """Contact points as VTK vertices, neighbours of a pair joined by lines."""
    import pyvista

    points, data = solution.points, pyvista.PolyData()
    if len(points):
        links = _neighbours(solution)
        data = pyvista.PolyData(
            _in_space(points),
            verts=np.column_stack([np.ones(len(points), int), np.arange(len(points))]).ravel(),
            lines=np.column_stack([np.full(len(links), 2), links]).ravel(),
        )
        _add_contact(data, solution, ("pressure", "gap", "force", "active", "pair"))
        traction = -solution.pressure[:, None] * solution.direction
        data.point_data["traction"] = _in_space(traction)
    _name_pairs(data, solution)
    return data


def _surface(solution: Solved, turns: Array, between: tuple[Index, Index]) -> pyvista.PolyData:
    """Quadrilaterals between neighbouring contact points of each pair, turned."""
    import pyvista

    points, data = solution.points, pyvista.PolyData()
    (i, j), (first, last) = _neighbours(solution).T, (len(points) * at[:, None] for at in between)
    quads = np.stack([first + i, first + j, last + j, last + i], axis=2).reshape(-1, 4)
    if len(quads):
        faces = np.column_stack([np.full(len(quads), 4), quads]).ravel()
        data = pyvista.PolyData(_turned(points, turns), faces=faces)
        _add_contact(data, solution, ("pressure", "gap", "active", "pair"), len(turns))
        traction = -solution.pressure[:, None] * solution.direction
        data.point_data["traction"] = _turned(traction, turns)
    _name_pairs(data, solution)
    return data


def _add_contact(
    data: pyvista.PolyData, solution: Solved, names: tuple[str, ...], times: int = 1
) -> None:
    """Members of a solution at its contact points, so many `times`."""
    for name in names:
        kind = np.int32 if name in ("active", "pair") else float
        data.point_data[name] = np.tile(np.asarray(getattr(solution, name), kind), times)


def _name_pairs(data: pyvista.DataSet, solution: Solved) -> None:
    """Names of the pairs as field data, in the order of their numbers."""
    contact = solution.problem.contact
    if contact:  # VTK has no empty list of strings
        sides = [(pair.secondary, pair.primary or "rigid obstacle") for pair in contact]
        data.field_data["pair_names"] = [" with ".join(names) for names in sides]
        data.field_data["secondary_names"] = [secondary for secondary, _ in sides]
        data.field_data["primary_names"] = [primary for _, primary in sides]


def _write_data(writer: Any, data: pyvista.DataSet, path: Path) -> None:
    """Write a data set with a VTK XML writer; VTK raises nothing, and prints in colours."""
    from vtkmodules.vtkCommonCore import vtkObject

    writer.SetFileName(str(path))
    writer.SetInputData(data)
    display = vtkObject.GetGlobalWarningDisplay()
    vtkObject.SetGlobalWarningDisplay(0)
    try:
        written = writer.Write()
    finally:
        vtkObject.SetGlobalWarningDisplay(display)
    # Before VTK 9.7 a full disk shows in the code alone, a file that cannot be opened in neither.
    if not written or writer.GetErrorCode() or not path.exists():
        raise OSError(f"VTK could not write {str(path)!r} (disk full?)")
