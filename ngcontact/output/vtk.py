"""Files for ParaView: curved bodies with fields at nodes, bodies of revolution, contact points."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Index
from ..estimator import Estimated
from ..fem import von_mises
from ..problem import ABOUT_AN_AXIS
from ..solved import Solved, full_stress
from .files import check_path, replacing, several
from .nodes import in_space, nodes_of, order_of, sized, through
from .surface import contact_surface

if TYPE_CHECKING:
    import pyvista

# Components of a stress, as `full_stress` orders them.
PLANE: tuple[str, ...] = ("xx", "yy", "xy", "zz")
MERIDIAN: tuple[str, ...] = ("rr", "zz", "rz", "hoop")
SOLID = ("xx", "yy", "zz", "xy", "yz", "xz")  # as VTK orders those of a symmetric tensor
SECTION_ANGLE = 6.0  # degrees between two sections of a body of revolution, at most


def write_solution(
    path: str | os.PathLike[str], solution: Estimated, angle: float | None = None
) -> Path:
    """Bodies of a solution as ``.vtu``, contact points beside it as ``<stem>_contact.vtp``.

    The cells are Lagrange triangles or tetrahedra of the order of the geometry or of the
    displacement, whichever is higher. Point data: ``displacement``, ``stress`` (xx, yy, xy and zz,
    the one normal to the plane; of bodies of revolution rr, zz, rz and hoop; of solids xx, yy, zz,
    xy, yz and xz; means inside each body), ``hoop_stress`` of bodies of revolution, and
    ``von_mises``, made of ``stress``. Cell data: ``body``, whose names are the field data
    ``body_names``, and ``indicators`` if they have been computed already.
    Contact points: ``pressure``, ``gap``, ``force``, ``active``, ``pair``, and the ``traction`` on
    the secondary, a vector. Those of solids are joined by triangles, some corners of which are no
    contact points: ``contact_point`` is 0 there, as are force and traction; pressure and gap are
    means of those beside, or 0 and NaN where the surface faces nothing. Field data of both files:
    the names by number of the pair in ``pair_names``, ``secondary_names``, ``primary_names``. Any
    consistent units. Returns the path.
    A file appears complete or not at all. Raises ``ValueError`` and ``OSError`` as `check_path`
    does, before any work. Of the `angle` of a body of revolution see `write_revolved`.
    """
    target = check_path(path, ".vtu")
    beside = check_path(target.with_name(f"{target.stem}_contact.vtp"), ".vtp")
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkFiltersGeometry import vtkGeometryFilter
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    writers = vtkXMLUnstructuredGridWriter(), vtkXMLPolyDataWriter()
    bodies, contact = _bodies(solution, angle is not None), _contact(solution)
    if angle is not None:
        contact.point_data.pop("force", None)  # of a ring
        contact.verts = np.zeros(0, dtype=np.intp)
        bodies = _revolved(bodies, angle)
        contact = through(vtkGeometryFilter(), _revolved(contact, angle))
    with replacing(target, beside) as drafts:
        for writer, data, draft in zip(writers, (bodies, contact), drafts, strict=True):
            writer.SetFileName(str(draft))
            writer.SetInputData(data)
            display = vtkObject.GetGlobalWarningDisplay()  # VTK raises nothing, and prints
            vtkObject.SetGlobalWarningDisplay(0)
            try:
                written = writer.Write()
            finally:
                vtkObject.SetGlobalWarningDisplay(display)
            # Before VTK 9.7 a full disk shows in the code alone, a file that cannot be opened in
            # neither.
            if not written or writer.GetErrorCode() or not draft.exists():
                raise OSError(f"VTK could not write {str(draft)!r} (disk full?)")
    return target


def write_revolved(path: str | os.PathLike[str], solution: Estimated, angle: float = 270.0) -> Path:
    """Bodies of revolution as ``.vtu``, the surface of contact beside it: ``<stem>_contact.vtp``.

    The meridian section is turned by `angle` degrees about z.

    Wedges between sections of linear triangles, order^2 of them for each element, and contact on
    quadrilaterals between contact points, with the data of `write_solution` but forces; vectors
    have three components. Returns the path.

    Raises ``ValueError`` for a plane model and for an angle outside (0, 360], and ``ValueError`` or
    ``OSError`` as `check_path` does, before any work.
    """
    if solution.problem.model not in ABOUT_AN_AXIS:
        raise ValueError(
            f'model "{solution.problem.model}": a body of revolution has model="axisymmetric"'
        )
    if not 0 < angle <= 360:
        raise ValueError(f"angle = {angle}: give degrees above 0, at most 360")
    return write_solution(path, solution, float(angle))


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
    clock = None
    if times is not None:
        values = np.array(list(times))
        if values.dtype.kind not in "iuf":
            raise TypeError(f"times = {values.tolist()}: give numbers")
        if not (np.isfinite(values).all() and (np.diff(values) > 0).all()):
            raise ValueError(f"times = {values.tolist()}: give finite, increasing numbers")
        clock = iter(values.tolist())
    root = ET.Element("VTKFile", type="Collection", version="1.0", byte_order="LittleEndian")
    collection = ET.SubElement(root, "Collection")
    for level, solution in enumerate(several(solutions)):
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


def _bodies(solution: Estimated, linear: bool) -> pyvista.UnstructuredGrid:
    """Bodies with their fields: curved elements, or `linear` triangles in their place."""
    d, nodes = solution.mesh.dim, nodes_of(solution.mesh, order_of(solution.mesh, solution.order))
    place = (ng.x, ng.y, ng.z)[:d]
    values = nodes.values(ng.CF((*place, solution.displacement, full_stress(solution))))
    about_an_axis = solution.problem.model in ABOUT_AN_AXIS
    components, names = [0, 1, 2, 3], MERIDIAN if about_an_axis else PLANE
    if d == 3:
        components, names = [0, 1, 3, 2, 4, 5], SOLID
    nodes = nodes.divided() if linear else nodes
    grid, stress = nodes.grid(values[:, :d]), values[:, 2 * d :]
    grid.point_data["displacement"] = in_space(values[:, d : 2 * d])
    grid.point_data["stress"] = stress[:, components]
    for k, name in enumerate(names):
        grid.GetPointData().GetAbstractArray("stress").SetComponentName(k, name)
    if about_an_axis:
        grid.point_data["hoop_stress"] = stress[:, 3]
    grid.point_data["von_mises"] = von_mises(stress)
    grid.cell_data["body"] = nodes.body
    grid.field_data["body_names"] = list(nodes.names)
    _name_pairs(grid, solution)
    if solution.estimated:
        indicators = np.asarray(solution.indicators, dtype=float)
        grid.cell_data["indicators"] = np.repeat(indicators, grid.n_cells // len(indicators))
    return grid


def _contact(solution: Solved) -> pyvista.PolyData:
    """Contact points with lines between them, of solids triangles with other corners, too."""
    import pyvista

    points, m, solid = solution.points, len(solution.points), solution.mesh.dim == 3
    data = pyvista.PolyData()
    fields: dict[str, NDArray[Any]] = {
        **{name: getattr(solution, name) for name in ("pressure", "gap", "force")},
        "active": solution.active.astype(np.int32),
        "pair": solution.pair.astype(np.int32),
        "traction": -solution.pressure[:, None] * solution.direction,
    }
    if solid:
        fields["contact_point"] = np.ones(m, np.int32)
    cells: list[Index] = []
    for pair in np.unique(solution.pair).tolist():
        if solid:
            surface = contact_surface(solution, pair)
            others = surface.row < 0
            number = np.where(others, len(points) - 1 + np.cumsum(others), surface.row)
            cells.append(number[surface.triangles])
            points = np.concatenate([points, surface.points[others]])
            own: dict[str, NDArray[Any]] = {
                "pressure": np.nan_to_num(surface.values(solution.pressure)),
                "gap": surface.values(solution.gap),
                "pair": np.full(len(others), pair, np.int32),
            }
            for name, known in fields.items():
                none = np.zeros((len(others), *known.shape[1:]), known.dtype)
                fields[name] = np.concatenate([known, own.get(name, none)[others]])
        else:
            rows = np.flatnonzero(solution.pair == pair)
            cells.append(rows[solution.pairs[pair].line.neighbours])
    if m:
        joined = {"faces" if solid else "lines": sized(np.concatenate(cells))}
        data = pyvista.PolyData(in_space(points), verts=sized(np.arange(m)[:, None]), **joined)
    for name, known in fields.items() if m else ():
        data.point_data[name] = in_space(known) if known.ndim == 2 else known
    _name_pairs(data, solution)
    return data


def _revolved(section: Any, angle: float) -> Any:
    """What the cells of a meridian section pass over, triangles or lines."""
    from vtkmodules.vtkFiltersModeling import vtkVolumeOfRevolutionFilter

    if not section.n_points:
        return section
    turning, steps = vtkVolumeOfRevolutionFilter(), max(3, math.ceil(angle / SECTION_ANGLE))
    turning.SetSweepAngle(angle)
    turning.SetResolution(steps)
    turning.SetOutputPointsPrecision(turning.DOUBLE_PRECISION)
    section.points = section.points[:, [0, 2, 1]]
    whole = through(turning, section)
    turn = np.deg2rad(angle) / steps * np.arange(whole.n_points // section.n_points)
    for name, known in section.point_data.items():
        if known.shape[1:] == (3,):
            r, z, _ = known.T
            x, y, z = np.outer(np.cos(turn), r), np.outer(np.sin(turn), r), np.tile(z, len(turn))
            whole.point_data[name] = np.column_stack([x.ravel(), y.ravel(), z])
    return whole


def _name_pairs(data: pyvista.DataSet, solution: Solved) -> None:
    """Names of the pairs as field data, in the order of their numbers."""
    contact = solution.problem.contact
    if contact:  # VTK has no empty list of strings
        sides = [(pair.secondary, pair.primary or "rigid obstacle") for pair in contact]
        data.field_data["pair_names"] = [" with ".join(names) for names in sides]
        data.field_data["secondary_names"] = [secondary for secondary, _ in sides]
        data.field_data["primary_names"] = [primary for _, primary in sides]
