"""Files and pictures of a solution."""

from __future__ import annotations

import os
import tempfile
import uuid
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array
from scipy.sparse.csgraph import minimum_spanning_tree
from scipy.spatial import KDTree

from .triplets import from_triplets

if TYPE_CHECKING:
    import pyvista


VTK_CELL = {1: 5, 2: 22}  # VTK_TRIANGLE, VTK_QUADRATIC_TRIANGLE
VTK_LAGRANGE_TRIANGLE = 69  # every higher order


@dataclass(frozen=True, eq=False)
class Nodes:
    """Lagrange nodes of a triangle mesh, shared inside a body and never between bodies.

    ``cells`` (ne, n) numbers the nodes of each triangle in VTK's order, n = (order + 1)
    (order + 2) / 2; ``body`` (ne,) is the position of the element's region in ``names``;
    ``at`` (ne n) are the same nodes as NGSolve mesh points, element after element.
    """

    cells: NDArray[np.int64]
    body: NDArray[np.int64]
    names: tuple[str, ...]
    at: NDArray[Any]

    def values(self, function: ng.CoefficientFunction) -> NDArray[np.float64]:
        """Nodal values (nodes, components): the mean over the triangles that meet there."""
        numbers = self.cells.ravel()
        found = np.asarray(function(self.at), dtype=float).reshape(len(numbers), -1)
        count = np.bincount(numbers)
        return np.stack([np.bincount(numbers, column) / count for column in found.T], axis=1)


def lattice(order: int) -> NDArray[np.int64]:
    """Barycentric indices (n, 3) of the nodes of VTK's Lagrange triangle, row sums = `order`.

    Corners, then the insides of the edges 01, 12, 20, then the inside, which is again such a
    triangle of order - 3.
    """
    if order == 0:
        return np.zeros((1, 3), dtype=np.int64)
    unit, step = np.eye(3, dtype=np.int64), np.arange(1, order)[:, None]
    edges = [(order - step) * unit[a] + step * unit[b] for a, b in ((0, 1), (1, 2), (2, 0))]
    inside = [lattice(order - 3) + 1] if order > 2 else []
    return np.concatenate([order * unit, *edges, *inside])


def nodes_of(mesh: ng.Mesh, order: int) -> Nodes:
    """Nodes of the Lagrange triangles of a mesh; ``ValueError`` if it has other elements."""
    weights = lattice(order)
    # NGSolve's reference triangle has its vertices at (1, 0), (0, 1), (0, 0).
    places = [(a / order, b / order, 0.0) for a, b, _ in weights]
    rule = ng.IntegrationRule(places, [0.0] * len(places))
    at = mesh.MapToAllElements({ng.TRIG: rule}, ng.VOL)
    elements = mesh.ngmesh.Elements2D().NumPy()
    if len(at) != len(elements) * len(weights):
        others = len(elements) - len(at) // len(weights)
        raise ValueError(f"{others} elements of the mesh are no triangles; mesh without quads")
    names = tuple(dict.fromkeys(mesh.GetMaterials()))
    regions = np.array([names.index(name) for name in mesh.GetMaterials()], dtype=np.int64)
    body = regions[elements["index"] - 1]
    vertices = (elements["nodes"][:, :3].astype(np.int64) - 1) * len(names) + body[:, None]
    # A node is known by the vertices it leans on and its weights there, from any triangle.
    key = np.where(weights > 0, vertices[:, None, :] * (order + 1) + weights, 0)
    key = np.sort(key.reshape(-1, 3), axis=1)
    rank = np.lexsort(key.T)
    fresh = np.any(np.diff(key[rank], axis=0, prepend=-1), axis=1)
    cells = np.empty(len(key), dtype=np.int64)
    cells[rank] = np.cumsum(fresh) - 1
    return Nodes(cells.reshape(-1, len(weights)), body, names, at)


def full_stress(solution: Any) -> ng.CoefficientFunction:
    """Stress components xx, yy, xy and zz, the one normal to the plane.

    zz is 0 in plane stress and nu (xx + yy) in plane strain. A material without Poisson's ratio
    ``nu`` (general Hooke) does not say what zz is in plane strain: 0 is taken there.
    """
    stress, zz = solution.stress, ng.CF(0.0)
    if solution.problem.model == "plane strain":
        nu = {body: m.nu for body, m in solution.problem.materials.items() if hasattr(m, "nu")}
        zz = solution.mesh.MaterialCF(nu, default=0) * (stress[0, 0] + stress[1, 1])
    return ng.CF((stress[0, 0], stress[1, 1], stress[0, 1], zz))


def von_mises(stress: NDArray[np.float64]) -> NDArray[np.float64]:
    """Von Mises stress (k,) of the components xx, yy, xy, zz (k, 4)."""
    size = float(np.abs(stress).max(initial=0.0)) or 1.0  # squares must stay in range
    xx, yy, xy, zz = stress.T / size
    return size * np.sqrt(((xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2) / 2 + 3 * xy**2)


def neighbour_tree(points: NDArray[np.float64]) -> csr_array:
    """Neighbours along the curves through points (m, 2): minimum spanning tree of distances."""
    near = list(range(1, min(len(points), 9) + 1))
    distance, neighbour = KDTree(points).query(points, k=near)
    start = np.broadcast_to(np.arange(len(points))[:, None], neighbour.shape)
    other = neighbour != start
    # The two rows of a corner are at distance 0, which a sparse graph reads as "no edge".
    weight = np.maximum(distance[other], np.finfo(float).tiny)
    graph = from_triplets(weight, start[other], neighbour[other], (len(points), len(points)))
    return minimum_spanning_tree(graph)


def check_path(path: str | os.PathLike[str], suffix: str) -> Path:
    """Output path, known to be writable; to be called before any work is done.

    Raises ``ValueError`` if the name does not end in `suffix` and the fitting ``OSError`` if its
    folder is missing, none or refuses new files, or if it is a folder or a protected file.
    """
    target = Path(path)
    if target.suffix.lower() != suffix:
        raise ValueError(f"cannot write {str(target)!r}: the name must end in {suffix!r}")
    folder, say = target.parent, f"cannot write {str(target)!r}: "
    if not folder.exists():
        raise FileNotFoundError(f"{say}there is no folder {str(folder)!r}; create it first")
    if not folder.is_dir():
        raise NotADirectoryError(f"{say}{str(folder)!r} is not a folder")
    if target.is_dir():
        raise IsADirectoryError(f"{say}it is a folder; give the name of a file")
    if target.exists() and not os.access(target, os.W_OK):
        raise PermissionError(f"{say}the file is write-protected; choose another name")
    try:
        tempfile.TemporaryFile(dir=folder).close()
    except OSError as error:
        reason = f"{say}the folder refuses new files ({error.strerror}); choose another folder"
        raise OSError(error.errno, reason) from error
    return target


@contextmanager
def replacing(*paths: Path) -> Iterator[list[Path]]:
    """Temporary names beside `paths`, renamed to them on success and removed on failure."""
    mark = uuid.uuid4().hex[:8]
    drafts = [path.with_name(f".{path.stem}-{mark}{path.suffix.lower()}") for path in paths]
    try:
        yield drafts
        for draft, path in zip(drafts, paths, strict=True):
            os.replace(draft, path)
    finally:
        for draft in drafts:
            draft.unlink(missing_ok=True)


def write_solution(path: str | os.PathLike[str], solution: Any) -> Path:
    """Bodies of a solution as ``.vtu``, contact points beside it as ``<stem>_contact.vtp``.

    The cells are Lagrange triangles of the order of the geometry or of the displacement,
    whichever is higher. Point data: ``displacement``, ``stress`` (xx, yy, xy; means inside each
    body) and ``von_mises`` (see `full_stress`). Cell data: ``body``, whose names
    are the field data ``body_names``, and ``indicators`` if they have been computed already.
    Contact points: ``pressure``, ``gap``, ``force``, ``active`` and ``pair``. Any consistent
    units. Returns the path. A file appears complete or not at all. Raises ``ValueError`` and
    ``OSError`` as `check_path` does, before any work.
    """
    target = check_path(path, ".vtu")
    beside = check_path(target.with_name(f"{target.stem}_contact.vtp"), ".vtp")
    from vtkmodules.vtkIOXML import vtkXMLPolyDataWriter, vtkXMLUnstructuredGridWriter

    with replacing(target, beside) as drafts:
        _write(vtkXMLUnstructuredGridWriter(), _bodies(solution), drafts[0])
        _write(vtkXMLPolyDataWriter(), _contact_points(solution), drafts[1])
    return target


def write_series(path: str | os.PathLike[str], solutions: Iterable[Any]) -> Path:
    """Solutions, one per level, as a ``.pvd`` for ParaView; the level stands for the time.

    Beside it the files of `write_solution`: ``<stem>_000.vtu``, ``<stem>_000_contact.vtp``, and
    so on. `solutions` may be a generator: the ``.pvd`` lists the levels written so far.

    Raises ``ValueError`` if there is no solution; otherwise as `check_path`, before any work.
    """
    target = check_path(path, ".pvd")
    root = ET.Element("VTKFile", type="Collection", version="1.0", byte_order="LittleEndian")
    collection = ET.SubElement(root, "Collection")
    for level, solution in enumerate(solutions):
        stem = f"{target.stem}_{level:03d}"
        write_solution(target.with_name(f"{stem}.vtu"), solution)
        for part, name in enumerate((f"{stem}.vtu", f"{stem}_contact.vtp")):
            entry = {"timestep": str(level), "group": "", "part": str(part), "file": name}
            ET.SubElement(collection, "DataSet", entry)
        ET.indent(root)
        with replacing(target) as (draft,):
            ET.ElementTree(root).write(draft, encoding="utf-8", xml_declaration=True)
    if len(collection) == 0:
        raise ValueError(f"no solution to write to {str(target)!r}: the series is empty")
    return target


def _bodies(solution: Any) -> pyvista.UnstructuredGrid:
    """Both bodies with their fields as a VTK grid."""
    import pyvista

    order = max(solution.mesh.GetCurveOrder(), solution.order)
    nodes = nodes_of(solution.mesh, order)
    count, size = nodes.cells.shape
    cells = np.column_stack([np.full(count, size), nodes.cells]).ravel()
    kinds = np.full(count, VTK_CELL.get(order, VTK_LAGRANGE_TRIANGLE), dtype=np.uint8)
    grid = pyvista.UnstructuredGrid(cells, kinds, nodes.values(ng.CF((ng.x, ng.y, 0))))
    u = solution.displacement
    grid.point_data["displacement"] = nodes.values(ng.CF((u[0], u[1], 0)))
    stress = nodes.values(full_stress(solution))
    grid.point_data["stress"] = stress[:, :3]
    for k, component in enumerate(("xx", "yy", "xy")):
        grid.GetPointData().GetAbstractArray("stress").SetComponentName(k, component)
    grid.point_data["von_mises"] = von_mises(stress)
    grid.cell_data["body"] = nodes.body
    grid.field_data["body_names"] = list(nodes.names)
    if solution.estimated:
        grid.cell_data["indicators"] = np.asarray(solution.indicators, dtype=float)
    return grid


def _contact_points(solution: Any) -> pyvista.PolyData:
    """Contact points as VTK vertices, neighbours of a pair joined by lines."""
    import pyvista

    points = np.asarray(solution.points, dtype=float).reshape(-1, 2)
    if len(points) == 0:
        return pyvista.PolyData()
    lines = []
    for pair in np.unique(solution.pair):
        rows = np.flatnonzero(solution.pair == pair)
        tree = neighbour_tree(points[rows]).tocoo()
        lines.append(np.column_stack([np.full(tree.nnz, 2), rows[tree.row], rows[tree.col]]))
    data = pyvista.PolyData(
        np.column_stack([points, np.zeros(len(points))]),
        verts=np.column_stack([np.ones(len(points), dtype=int), np.arange(len(points))]).ravel(),
        lines=np.concatenate(lines).ravel(),
    )
    for name in ("pressure", "gap", "force", "active", "pair"):
        kind = np.int32 if name in ("active", "pair") else float
        data.point_data[name] = np.asarray(getattr(solution, name), dtype=kind)
    return data


def _write(writer: Any, data: pyvista.DataSet, path: Path) -> None:
    """Write a data set with a VTK XML writer; VTK reports failure by return value only."""
    writer.SetFileName(str(path))
    writer.SetInputData(data)
    if not writer.Write():
        raise OSError(f"VTK could not write {str(path)!r} (disk full?)")
