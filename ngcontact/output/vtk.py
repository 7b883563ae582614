"""Files for ParaView: curved bodies with fields at nodes, bodies of revolution, contact points."""

from __future__ import annotations

import math
import os
import xml.etree.ElementTree as ET
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ..arrays import Array, Index
from ..contact import neighbours
from ..estimator import Estimated
from ..fem import von_mises
from ..problem import ABOUT_AN_AXIS
from ..solved import Solved, full_stress
from .files import check_path, replacing, several
from .nodes import VTK_CELLS, nodes_of, sized, subdivision
from .surface import contact_surface

if TYPE_CHECKING:
    import pyvista

# Components of a stress, as `full_stress` orders them.
PLANE: tuple[str, ...] = ("xx", "yy", "xy", "zz")
MERIDIAN: tuple[str, ...] = ("rr", "zz", "rz", "hoop")
SOLID = ("xx", "yy", "zz", "xy", "yz", "xz")  # as VTK orders those of a symmetric tensor
VTK_WEDGE = 13
LINKS = {False: "lines", True: "faces"}  # cells between contact points, of solids
SECTION_ANGLE = 6.0  # degrees between two sections of a body of revolution, at most


@dataclass(frozen=True, eq=False)
class Sections:
    """Meridian sections of a body of revolution, and the steps between them."""

    angles: Array  # (t,), radians
    first: Index  # (q,), number of the section at which a step begins
    second: Index  # (q,), and ends

    def turned(self, vectors: Array) -> Array:
        """Vectors (m, 3) that `vectors` (k, 2) of components r, z are at each of the angles."""
        r, z = vectors.T
        x, y = np.outer(np.cos(self.angles), r), np.outer(np.sin(self.angles), r)
        return np.stack([x, y, np.broadcast_to(z, x.shape)], axis=2).reshape(-1, 3)


def write_solution(
    path: str | os.PathLike[str], solution: Estimated, sections: Sections | None = None
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
    does, before any work. Of the `sections` of a body of revolution see `write_revolved`.
    """
    target = check_path(path, ".vtu")
    beside = check_path(target.with_name(f"{target.stem}_contact.vtp"), ".vtp")
    from vtkmodules.vtkCommonCore import vtkObject
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    writers = vtkXMLUnstructuredGridWriter(), vtkXMLPolyDataWriter()
    made = _bodies(solution, sections), _contact(solution, sections)
    with replacing(target, beside) as drafts:
        for writer, data, draft in zip(writers, made, drafts, strict=True):
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
    angles = np.deg2rad(float(angle)) / steps * np.arange(steps if angle == 360 else steps + 1)
    first = np.arange(steps)
    return write_solution(path, solution, Sections(angles, first, (first + 1) % len(angles)))


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


def _increasing(times: Iterable[float]) -> list[float]:
    """Finite increasing numbers."""
    values = list(times)
    for before, time in zip([None, *values], values, strict=False):
        if isinstance(time, bool) or not isinstance(time, int | float | np.number):
            raise TypeError(f"times hold {time!r}: give numbers")
        if not np.isfinite(time) or (before is not None and not time > before):
            raise ValueError(f"times hold {time} after {before}: give finite, increasing numbers")
    return [float(time) for time in values]


def _in_space(vectors: Array) -> Array:
    """Vectors (k, d) with a third component 0 in the plane."""
    return np.pad(vectors, ((0, 0), (0, 3 - vectors.shape[1])))


def _bodies(solution: Estimated, sections: Sections | None) -> pyvista.UnstructuredGrid:
    """Bodies with their fields: curved elements, or wedges between `sections`."""
    import pyvista

    order, d = max(solution.mesh.GetCurveOrder(), solution.order), solution.mesh.dim
    nodes, place = nodes_of(solution.mesh, order), (ng.x, ng.y, ng.z)[:d]
    values = nodes.values(ng.CF((*place, solution.displacement, full_stress(solution))))
    about_an_axis = solution.problem.model in ABOUT_AN_AXIS
    components, names = [0, 1, 2, 3], MERIDIAN if about_an_axis else PLANE
    if d == 3:
        components, names = [0, 1, 3, 2, 4, 5], SOLID
    cells, kind, body = nodes.cells, VTK_CELLS[d][min(order, 3) - 1], nodes.body
    lifted, times = _in_space, 1
    if sections is not None:
        triangles = nodes.cells[:, subdivision(order)[0]].reshape(-1, 3)
        ends = sections.second, sections.first
        wedges = [len(values) * at[:, None, None] + triangles for at in ends]
        cells, kind = np.concatenate(wedges, axis=2).reshape(-1, 6), VTK_WEDGE
        body = np.tile(np.repeat(nodes.body, order**2), len(sections.first))
        components, names = [0, 1, 3, 2], ("rr", "zz", "hoop", "rz")
        lifted, times = sections.turned, len(sections.angles)
    kinds = np.full(len(cells), kind, dtype=np.uint8)
    grid = pyvista.UnstructuredGrid(sized(cells), kinds, lifted(values[:, :d]))
    stress = values[:, 2 * d :]
    grid.point_data["displacement"] = lifted(values[:, d : 2 * d])
    grid.point_data["stress"] = np.tile(stress[:, components], (times, 1))
    for k, name in enumerate(names):
        grid.GetPointData().GetAbstractArray("stress").SetComponentName(k, name)
    if about_an_axis and sections is None:
        grid.point_data["hoop_stress"] = stress[:, 3]
    grid.point_data["von_mises"] = np.tile(von_mises(stress), times)
    grid.cell_data["body"] = body
    grid.field_data["body_names"] = list(nodes.names)
    if sections is None:
        _name_pairs(grid, solution)
        if solution.estimated:
            grid.cell_data["indicators"] = np.asarray(solution.indicators, dtype=float)
    return grid


def _contact(solution: Solved, sections: Sections | None) -> pyvista.PolyData:
    """Contact points with lines, of solids triangles, between neighbours; surfaces on `sections`.

    Some corners of the triangles of solids are no contact points.
    """
    import pyvista

    points, m, solid = solution.points, len(solution.points), solution.mesh.dim == 3
    data, lifted, times = pyvista.PolyData(), _in_space, 1
    fields: dict[str, NDArray[Any]] = {
        "pressure": solution.pressure,
        "gap": solution.gap,
        "force": solution.force,
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
            cells.append(rows[neighbours(solution.pairs[pair].line)])
    if sections is None and m:
        single, joined = sized(np.arange(m)[:, None]), sized(np.concatenate(cells))
        data = pyvista.PolyData(_in_space(points), verts=single, **{LINKS[solid]: joined})
    elif sections is not None and cells and len(links := np.concatenate(cells)):
        first, second = (m * at[:, None] for at in (sections.first, sections.second))
        quads = [first + links[:, 0], first + links[:, 1], second + links[:, 1]]
        faces = np.stack([*quads, second + links[:, 0]], axis=2).reshape(-1, 4)
        lifted, times = sections.turned, len(sections.angles)
        data = pyvista.PolyData(lifted(points), faces=sized(faces))
        del fields["force"]
    for name, known in fields.items() if data.n_points else ():
        data.point_data[name] = lifted(known) if known.ndim == 2 else np.tile(known, times)
    _name_pairs(data, solution)
    return data


def _name_pairs(data: pyvista.DataSet, solution: Solved) -> None:
    """Names of the pairs as field data, in the order of their numbers."""
    contact = solution.problem.contact
    if contact:  # VTK has no empty list of strings
        sides = [(pair.secondary, pair.primary or "rigid obstacle") for pair in contact]
        data.field_data["pair_names"] = [" with ".join(names) for names in sides]
        data.field_data["secondary_names"] = [secondary for secondary, _ in sides]
        data.field_data["primary_names"] = [primary for _, primary in sides]
