"""Files and pictures of a solution: ``output``, ``scene`` and ``plot``."""

from __future__ import annotations

import errno
import os
import subprocess
import sys
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any

import matplotlib
import ngsolve as ng
import numpy as np
import pytest
import pyvista
from netgen.occ import Compound, Glue, OCCGeometry, WorkPlane, Y
from ngsolve.meshes import MakeStructured2DMesh
from vtkmodules.vtkCommonDataModel import vtkHigherOrderTriangle
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

from ngcontact import Contact, Elastic, Hooke, Problem, solve
from ngcontact.output import files, vtk
from ngcontact.output.files import check_path
from ngcontact.output.nodes import lattice
from ngcontact.output.picture import plot_solution
from ngcontact.output.scene import contact_lines
from ngcontact.output.vtk import write_series, write_solution

MAXH = 0.4


@dataclass
class Stub:
    """What the writers read of a solution, with fields chosen by the test."""

    mesh: Any
    order: int
    displacement: Any
    stress: Any
    points: Any
    problem: Any
    estimated: bool = False

    def __post_init__(self):
        count = len(self.points)
        self.gap = np.linspace(0, 1, count)
        self.pressure = np.linspace(2, 0, count)
        self.force = self.pressure / 10
        self.active = self.pressure > 0.5
        self.pair = np.zeros(count, dtype=int)

    @property
    def indicators(self):
        if not self.estimated:
            pytest.fail("writing has computed an estimate")
        return np.arange(self.mesh.ne) + 0.5


def two_bodies(glue=Compound):
    """Half disc of radius 1 about (0, 1) on the block |x| <= 2, -1 <= y <= 0."""
    disc = WorkPlane().Circle(0, 1, 1).Face() * WorkPlane().MoveTo(-2, -1).Rectangle(4, 2).Face()
    block = WorkPlane().MoveTo(-2, -1).Rectangle(4, 1).Face()
    disc.faces.name, block.faces.name = "disc", "block"
    disc.edges.name = "disc_arc"
    disc.edges.Max(Y).name = "disc_top"
    block.edges.Max(Y).name = "block_top"
    block.edges.Min(Y).name = "block_bottom"
    return OCCGeometry(glue([disc, block]), dim=2)


def stub(order=3, stress=None, model="plane strain", materials=None, mesh=None, curve=None):
    mesh = ng.Mesh(two_bodies().GenerateMesh(maxh=MAXH)) if mesh is None else mesh
    mesh.Curve(order if curve is None else curve)
    u = ng.GridFunction(ng.VectorH1(mesh, order=order))
    u.Set(ng.CF((0.1 * ng.x * ng.y, 0.05 * ng.x**2 - 0.02 * ng.y)))
    steel = Elastic(E=1.0, nu=0.25)
    problem = SimpleNamespace(
        model=model,
        materials={"disc": steel, "block": steel} if materials is None else materials,
        contact=(Contact("disc_arc", "block_top"),),
    )
    angle = np.linspace(-2.2, -0.9, 9)
    points = np.column_stack([np.cos(angle), 1 + np.sin(angle)])
    if stress is None:
        stress = ng.CF((ng.x, ng.y, ng.y, ng.x * ng.y), dims=(2, 2))
    return Stub(mesh, order, u, stress, points, problem)


def written(folder, solution):
    return pyvista.read(write_solution(folder / "bodies.vtu", solution))


# Files of the bodies


@pytest.mark.parametrize("order", range(1, 7))
def test_node_order_is_that_of_vtk(order):
    expected = []
    for k in range((order + 1) * (order + 2) // 2):
        index = [0, 0, 0]
        vtkHigherOrderTriangle.BarycentricIndex(k, index, order)
        expected.append([index[2], index[0], index[1]])  # VTK counts from the third corner
    assert lattice(order).tolist() == expected


@pytest.mark.parametrize(("order", "curve"), [(1, 1), (1, 2), (2, 2), (3, 3), (2, 4), (5, 5)])
def test_cells_cover_the_bodies_and_share_their_nodes(tmp_path, order, curve):
    solution = stub(order, curve=curve)
    mesh = solution.mesh
    grid = written(tmp_path, solution)
    p = max(order, curve)
    inside = (p - 1) * (p - 2) // 2
    assert grid.n_cells == mesh.ne
    assert set(grid.celltypes) == {{1: 5, 2: 22}.get(p, 69)}
    # Nodes of a Lagrange space: on vertices, inside edges, inside triangles. The bodies touch but
    # have vertices of their own.
    assert grid.n_points == mesh.nv + mesh.nedge * (p - 1) + mesh.ne * inside
    exact = ng.Integrate(ng.CF(1.0), mesh, order=2 * p)
    assert area_of_lagrange_cells(grid, p) == pytest.approx(exact, rel=1e-12)
    # The order of the geometry, h^(curve + 1); measured: at most 0.8 of this.
    assert abs(exact - np.pi / 2 - 4) < (0.05 if curve == 1 else MAXH ** (curve + 1) / 200)
    # VTK cuts every side into 2^3 chords at least; a chord s of the circle misses s^3 / 12, all of
    # them less than pi s^2 / 12. Folded cells would count too much.
    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(3)
    surface.Update()
    chords = np.pi * (MAXH / 8) ** 2 / 12 if p > 1 else 0.0
    assert pyvista.wrap(surface.GetOutput()).area == pytest.approx(exact, abs=chords + 1e-12)


def area_of_lagrange_cells(grid, order):
    """Integral of the Jacobian of the polynomials through the nodes, all cells."""
    powers = [(i, j) for i in range(order + 1) for j in range(order + 1 - i)]
    r, s = lattice(order)[:, 1:].T / order
    basis = np.linalg.inv(np.stack([r**i * s**j for i, j in powers], axis=1))
    rule = ng.IntegrationRule(ng.TRIG, 2 * order)
    r, s = np.array(rule.points)[:, :2].T
    by_r = np.stack([i * r ** max(i - 1, 0) * s**j for i, j in powers], axis=1) @ basis
    by_s = np.stack([j * r**i * s ** max(j - 1, 0) for i, j in powers], axis=1) @ basis
    nodes = grid.points[grid.cells.reshape(grid.n_cells, -1)[:, 1:], :2]
    (xr, yr), (xs, ys) = np.moveaxis(by_r @ nodes, 2, 0), np.moveaxis(by_s @ nodes, 2, 0)
    return np.sum(np.abs(xr * ys - xs * yr) @ np.array(rule.weights))


def test_curved_nodes_lie_on_the_circle(tmp_path):
    solution = stub(3)
    grid = written(tmp_path, solution)
    disc = list(grid.field_data["body_names"]).index("disc")
    nodes = np.unique(grid.cells.reshape(-1, 11)[:, 1:][grid["body"] == disc])
    distance = np.sort(np.abs(np.hypot(*(grid.points[nodes, :2] - (0, 1)).T) - 1))
    count = 3 * sum(side.mat == "disc_arc" for side in solution.mesh.Elements(ng.BND)) + 1
    assert count > 3 * np.pi / MAXH
    assert distance[count - 1] < MAXH**4 / 200  # cubics deviate by O(h^4); measured: an eighth
    assert distance[count] > 10 * MAXH**4 / 200  # the others are inside


def test_fields_are_those_of_the_solution_at_the_nodes(tmp_path):
    solution = stub(3)
    grid = written(tmp_path, solution)
    x, y, z = grid.points.T
    assert np.all(z == 0)
    assert grid["displacement"].shape == grid["stress"].shape == grid.points.shape
    np.testing.assert_allclose(grid["stress"], np.stack([x, x * y, y], axis=1), atol=1e-12)
    xx, yy, xy = grid["stress"].T
    zz = 0.25 * (xx + yy)  # plane strain
    invariant = (xx - yy) ** 2 + (yy - zz) ** 2 + (zz - xx) ** 2 + 6 * xy**2
    np.testing.assert_allclose(grid["von_mises"], np.sqrt(invariant / 2), atol=1e-12)
    # The displacement is not a formula on curved elements; NGSolve's point search, away from the
    # touching line, gives it independently; measured: equal to 1e-16.
    for k in np.flatnonzero((np.hypot(x, y - 1) < 0.9) | ((y < -0.1) & (y > -0.9)))[::7]:
        expected = solution.displacement(solution.mesh(x[k], y[k]))
        np.testing.assert_allclose(grid["displacement"][k], [*expected, 0], atol=1e-13)
    array = grid.GetPointData().GetAbstractArray("stress")
    assert [array.GetComponentName(k) for k in range(3)] == ["xx", "yy", "xy"]


@pytest.mark.parametrize("glue", [Compound, Glue])
def test_bodies_keep_their_own_stress_where_they_touch(tmp_path, glue):
    mesh = ng.Mesh(two_bodies(glue).GenerateMesh(maxh=MAXH))
    level = mesh.MaterialCF({"disc": 1.0, "block": 2.0})
    grid = written(tmp_path, stub(2, ng.CF((level, 0, 0, 0), dims=(2, 2)), mesh=mesh))
    names = list(grid.field_data["body_names"])
    assert sorted(names) == ["block", "disc"]
    nodes = grid.cells.reshape(-1, 7)[:, 1:]
    stress = grid["stress"][:, 0][nodes]
    expected = np.where(grid["body"] == names.index("disc"), 1.0, 2.0)
    np.testing.assert_allclose(stress, expected[:, None] + np.zeros_like(stress), rtol=1e-14)


def test_jumping_stress_is_averaged_over_the_cells_at_a_node(tmp_path):
    solution = stub(1)
    jump = ng.GridFunction(ng.L2(solution.mesh, order=0))
    values = np.sin(np.arange(solution.mesh.ne))
    jump.vec.FV().NumPy()[:] = values
    solution.stress = ng.CF((jump, 0, 0, 0), dims=(2, 2))
    grid = written(tmp_path, solution)
    nodes = grid.cells.reshape(-1, 4)[:, 1:]
    for node in (0, 5, grid.n_points - 1):
        mean = values[np.any(nodes == node, axis=1)].mean()
        assert grid["stress"][node, 0] == pytest.approx(mean, rel=1e-12)


C_ISOTROPIC = np.array([[1.2, 0.4, 0.0], [0.4, 1.2, 0.0], [0.0, 0.0, 0.4]])


@pytest.mark.parametrize(
    ("model", "material", "expected"),
    [
        ("plane stress", Elastic(E=1.0, nu=0.3), 5.0),
        ("plane strain", Elastic(E=1.0, nu=0.3), 5.0 * np.sqrt(1 - 0.3 + 0.09)),
        ("plane strain", Elastic(E=1.0, nu=ng.CF(0.3)), 5.0 * np.sqrt(1 - 0.3 + 0.09)),
        ("plane strain", Hooke(C_ISOTROPIC), 5.0),
    ],
)
def test_von_mises_of_uniaxial_stress(tmp_path, model, material, expected):
    materials = {"disc|block": material}
    pull = ng.CF((5.0, 0, 0, 0), dims=(2, 2))
    grid = written(tmp_path, stub(1, pull, model, materials))
    np.testing.assert_allclose(grid["von_mises"], expected, rtol=1e-14)


def test_indicators_are_written_only_if_known(tmp_path):
    solution = stub(2)
    assert "indicators" not in written(tmp_path, solution).cell_data
    solution.estimated = True
    np.testing.assert_array_equal(written(tmp_path, solution)["indicators"], solution.indicators)


def test_quadrilaterals_are_refused(tmp_path):
    solution = stub(1, mesh=MakeStructured2DMesh(quads=True, nx=2, ny=2))
    with pytest.raises(ValueError, match="4 elements of the mesh are no triangles"):
        write_solution(tmp_path / "a.vtu", solution)
    assert list(tmp_path.iterdir()) == []


# Contact points


def test_contact_points_carry_their_values(tmp_path):
    solution = stub(2)
    assert write_solution(tmp_path / "a.b.vtu", solution) == tmp_path / "a.b.vtu"
    data = pyvista.read(tmp_path / "a.b_contact.vtp")
    np.testing.assert_array_equal(data.points[:, :2], solution.points)
    for name in ("pressure", "gap", "force", "active", "pair"):
        np.testing.assert_array_equal(data[name], getattr(solution, name))
    assert np.issubdtype(data["active"].dtype, np.integer)
    assert data.n_verts == 9
    links = np.sort(data.lines.reshape(-1, 3)[:, 1:], axis=1)
    assert sorted(links.tolist()) == [[k, k + 1] for k in range(8)]


@pytest.mark.parametrize("count", [0, 1])
def test_hardly_any_contact_points(tmp_path, count):
    solution = stub(2)
    for name in ("points", "gap", "pressure", "force", "active", "pair"):
        setattr(solution, name, getattr(solution, name)[:count])
    write_solution(tmp_path / "a.vtu", solution)
    assert pyvista.read(tmp_path / "a_contact.vtp").n_points == count
    plot_solution(solution, tmp_path / "a.png")
    assert (tmp_path / "a.png").stat().st_size > 10_000


def lines_of(points, direction=None, pair=None):
    contact = [SimpleNamespace(direction=direction)] * 2
    pair = np.zeros(len(points), dtype=int) if pair is None else pair
    solution = SimpleNamespace(points=points, pair=pair, problem=SimpleNamespace(contact=contact))
    return contact_lines(solution)


def test_contact_line_follows_an_arc_in_any_numbering():
    angle = np.sort(np.random.default_rng(1).uniform(0, 5.5, 60))
    shuffle = np.random.default_rng(2).permutation(60)
    points = np.column_stack([np.cos(angle), np.sin(angle)])[shuffle]
    [(pair, rows, s)] = lines_of(points)
    along = angle[shuffle][rows]
    assert pair == 0
    assert np.all(np.diff(along) > 0) or np.all(np.diff(along) < 0)
    chords = 2 * np.sin(np.abs(np.diff(along)) / 2)
    np.testing.assert_allclose(np.diff(s), chords, rtol=1e-12)
    assert s[0] == 0


def test_contact_line_keeps_both_rows_of_a_corner():
    points = np.array([[0, 0], [1, 0], [2, 0], [2, 0], [2, 1], [2, 2.0]])
    [(_, rows, s)] = lines_of(points)
    assert rows.tolist() == [0, 1, 2, 3, 4, 5]
    assert s.tolist() == [0, 1, 2, 2, 3, 4]


def test_contact_lines_of_pairs_and_of_separate_pieces():
    x = np.arange(20) / 20
    piece = np.column_stack([x, 0 * x])
    points = np.concatenate([piece, np.add(piece, (5, 0)), np.add(piece, (0, 9))])
    (a, first, s), (b, second, t), (c, third, _) = lines_of(points, pair=np.arange(60) // 40)
    assert (a, b, c) == (0, 0, 1)
    assert s[-1] <= t[0]
    assert first.tolist() == list(range(20))
    assert second.tolist() == list(range(20, 40))
    assert third.tolist() == list(range(40, 60))


def test_contact_line_of_a_fixed_direction_runs_along_eta():
    points = np.array([[3.0, 1.0], [-1.0, 2.0], [0.5, 7.0]])
    [(_, rows, eta)] = lines_of(points, direction=(0, -2))
    assert rows.tolist() == [1, 2, 0]
    np.testing.assert_allclose(eta, [-1, 0.5, 3])


# Series, paths, interruptions


def test_series_lists_levels_with_both_files(tmp_path):
    path = write_series(tmp_path / "run & more.pvd", (stub(p) for p in (1, 2)))
    reader = pyvista.PVDReader(path)
    assert reader.time_values == [0.0, 1.0]
    listed = {(d.time, d.part): d.path for d in reader.datasets}
    assert listed == {
        (0.0, 0): "run & more_000.vtu",
        (0.0, 1): "run & more_000_contact.vtp",
        (1.0, 0): "run & more_001.vtu",
        (1.0, 1): "run & more_001_contact.vtp",
    }
    reader.set_active_time_value(1.0)
    bodies, contact = reader.read()
    assert bodies.n_cells == stub(2).mesh.ne
    assert contact.n_points == 9


def test_interrupted_series_lists_what_was_written(tmp_path):
    def levels():
        yield stub(1)
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        write_series(tmp_path / "run.pvd", levels())
    assert pyvista.PVDReader(tmp_path / "run.pvd").time_values == [0.0]
    assert len(list(tmp_path.iterdir())) == 3


def test_empty_series_is_refused(tmp_path):
    with pytest.raises(ValueError, match="the series is empty"):
        write_series(tmp_path / "run.pvd", [])
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("failing", ["_contact_points", "_write"])
def test_failure_leaves_old_files_and_no_others(tmp_path, monkeypatch, failing):
    path = write_solution(tmp_path / "a.vtu", stub(1))
    old = {file.name: file.read_bytes() for file in tmp_path.iterdir()}

    def fail(*arguments):
        if failing == "_write":
            arguments[2].write_text("half a file")
        raise KeyboardInterrupt

    monkeypatch.setattr(vtk, failing, fail)
    with pytest.raises(KeyboardInterrupt):
        write_solution(path, stub(2))
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == old


def test_failing_rename_leaves_old_files_and_no_others(tmp_path, monkeypatch):
    write_solution(tmp_path / "a.vtu", stub(1))
    old = {file.name: file.read_bytes() for file in tmp_path.iterdir()}

    def refuse(source, target):
        raise OSError(errno.ENOSPC, "no space")

    monkeypatch.setattr(os, "replace", refuse)
    with pytest.raises(OSError, match="no space"):
        write_solution(tmp_path / "a.vtu", stub(2))
    with pytest.raises(OSError, match="no space"):
        plot_solution(stub(1), tmp_path / "a.png")
    assert {file.name: file.read_bytes() for file in tmp_path.iterdir()} == old


def test_failure_of_vtk_is_an_error(tmp_path, monkeypatch):
    real = vtk._write
    missing = tmp_path / "missing" / "draft.vtu"
    monkeypatch.setattr(vtk, "_write", lambda writer, data, _: real(writer, data, missing))
    with pytest.raises(OSError, match="VTK could not write"):
        write_solution(tmp_path / "a.vtu", stub(1))
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "error", "message"),
    [
        ("a.vtk", ValueError, r"must end in '\.vtu'"),
        ("a", ValueError, r"must end in '\.vtu'"),
        ("none/a.vtu", FileNotFoundError, "there is no folder .*none"),
        ("file/a.vtu", NotADirectoryError, "is not a folder"),
        ("folder.vtu", IsADirectoryError, "it is a folder"),
    ],
)
def test_bad_paths_are_refused(tmp_path, name, error, message):
    (tmp_path / "file").write_text("")
    (tmp_path / "folder.vtu").mkdir()
    with pytest.raises(error, match=message):
        check_path(tmp_path / name, ".vtu")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["file", "folder.vtu"]


def test_folder_that_refuses_files_is_refused(tmp_path, monkeypatch):
    def refuse(dir):  # the keyword of tempfile.TemporaryFile
        raise OSError(errno.EACCES, "Permission denied")

    monkeypatch.setattr(files.tempfile, "TemporaryFile", refuse)
    with pytest.raises(PermissionError, match=r"refuses new files \(Permission denied\)"):
        check_path(tmp_path / "a.vtu", ".vtu")


def test_protected_file_is_refused(tmp_path, monkeypatch):
    (tmp_path / "a.vtu").write_text("old")
    monkeypatch.setattr(os, "access", lambda path, mode: False)
    with pytest.raises(PermissionError, match="write-protected"):
        check_path(tmp_path / "a.vtu", ".vtu")


@pytest.mark.parametrize(
    ("write", "suffix"), [(write_solution, "vtu"), (write_series, "pvd"), (None, "png")]
)
def test_paths_are_checked_before_any_work(tmp_path, write, suffix):
    path = tmp_path / "none" / f"a.{suffix}"
    untouchable = object()  # has none of the attributes of a solution and cannot be iterated
    with pytest.raises(FileNotFoundError):
        plot_solution(untouchable, path) if write is None else write(path, untouchable)


def test_import_loads_neither_vtk_nor_matplotlib():
    code = "import sys, ngcontact.output.vtk, ngcontact.output.picture; print(*sys.modules)"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True)
    modules = set(loaded.stdout.decode().split())
    assert "ngcontact.output.picture" in modules
    assert not {"pyvista", "vtk", "vtkmodules", "matplotlib"} & modules


# Pictures


@pytest.fixture(scope="module")
def hertz():
    steel = Elastic(E=100.0, nu=0.3)
    problem = Problem(
        geometry=two_bodies(),
        materials={"disc": steel, "block": steel},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -0.02)},
        contact=[Contact("disc_arc", "block_top", direction=(0, -1))],
    )
    return solve(problem, maxh=0.3, order=2)


def test_picture_shows_bodies_and_pressure(tmp_path, hertz):
    figure = plot_solution(hertz, tmp_path / "a.png")
    assert [file.name for file in tmp_path.iterdir()] == ["a.png"]
    bodies, close, profile = figure.axes[:3]
    image = matplotlib.image.imread(tmp_path / "a.png")[:, :, :3]
    height, width = image.shape[:2]
    for axes in (bodies, close, profile):  # each panel has dark and bright pixels
        (x0, y0), (x1, y1) = axes.get_position().get_points()
        rows = slice(int((1 - y1) * height), int((1 - y0) * height))
        panel = image[rows, int(x0 * width) : int(x1 * width)]
        assert panel.std() > 0.03  # a blank panel: 0; measured: 0.1 and more
    assert (
        bodies.get_title() == "deformed bodies, displacement × 1"
    )  # contact closes a gap: true to scale
    assert close.get_xlim()[0] < 0 < close.get_xlim()[1]
    drawn = {line.get_label(): line.get_xydata() for line in profile.lines}
    points = np.column_stack([hertz.points[:, 0], hertz.pressure])
    for label, state in (("in contact", hertz.active), ("open", ~hertz.active)):
        expected = points[state][np.argsort(points[state][:, 0])]
        np.testing.assert_allclose(drawn[label], expected, atol=1e-12)


def test_scale_is_obeyed_and_stated(tmp_path, hertz):
    figure = plot_solution(hertz, tmp_path / "a.png", scale=3)
    assert figure.axes[0].get_title() == "deformed bodies, displacement × 3"
    # disc_top sinks by 0.02, so that its drawn height is 1 - 3 * 0.02
    [shading] = [c for c in figure.axes[0].collections if hasattr(c, "_triangulation")]
    assert shading._triangulation.y.max() == pytest.approx(0.94, abs=1e-3)


def test_small_displacement_without_a_gap_is_magnified(tmp_path):
    solution = stub(2)
    solution.displacement.vec.data *= 1e-3
    solution.active[:] = False
    title = plot_solution(solution, tmp_path / "a.png").axes[0].get_title()
    # |u| is largest at (2, -1), 0.297e-3; 4 % of the size 4 are 538 times that.
    assert title == "deformed bodies, displacement × 500"


def test_without_a_path_the_picture_is_shown(monkeypatch):
    matplotlib.use("Agg")
    from matplotlib import pyplot

    shown = []
    monkeypatch.setattr(pyplot, "show", lambda: shown.append(pyplot.get_fignums()))
    figure = plot_solution(stub(1))
    assert shown == [[figure.number]]
    pyplot.close(figure)


def test_a_picture_in_a_file_leaves_pyplot_alone(tmp_path):
    from matplotlib import pyplot

    before = pyplot.get_fignums()
    plot_solution(stub(1), tmp_path / "a.png")
    assert pyplot.get_fignums() == before


def test_bad_scale_and_suffix_are_refused(tmp_path):
    with pytest.raises(ValueError, match="scale = nan"):
        plot_solution(object(), tmp_path / "a.png", scale=float("nan"))
    with pytest.raises(ValueError, match=r"must end in '\.png'"):
        plot_solution(object(), tmp_path / "a.pdf")
