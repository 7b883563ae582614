"""Files for ParaView: bodies, contact points, series, bodies of revolution."""

import math
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
import pyvista
from netgen.occ import Compound, Glue, OCCGeometry
from vtkmodules import vtkIOXML
from vtkmodules.vtkFiltersGeometry import vtkDataSetSurfaceFilter

from drivers.reference import axisymmetric_cases, cases
from ngcontact import Elastic, Problem, solve
from ngcontact.output import write_series, write_solution
from tests.output.solutions import disc
from tests.scenes import rectangle

MAXH = 0.4


def written(folder, solution):
    return pyvista.read(write_solution(folder / "bodies.vtu", solution))


@pytest.mark.parametrize(
    ("order", "element"),
    [*((p, "isoparametric") for p in (1, 2, 3, 4)), *((p, "superparametric") for p in (1, 2))],
)
def test_cells_cover_the_bodies_and_share_their_nodes(tmp_path, order, element):
    solution = solve(cases.pressed_disc(), maxh=MAXH, order=order, element=element)
    mesh = solution.mesh
    grid = written(tmp_path, solution)
    p = mesh.GetCurveOrder()
    inside = (p - 1) * (p - 2) // 2
    assert grid.n_cells == mesh.ne
    assert set(grid.celltypes) == {{1: 5, 2: 22}.get(p, 69)}
    # Nodes of a Lagrange space: on vertices, inside edges, inside triangles. The bodies touch but
    # have vertices of their own.
    assert grid.n_points == mesh.nv + mesh.nedge * (p - 1) + mesh.ne * inside
    exact = ng.Integrate(ng.CF(1.0), mesh, order=2 * p)
    # The order of the geometry, h^(p + 1); measured: at most 0.8 of this.
    assert abs(exact - np.pi / 4 - 4) < (0.05 if p == 1 else MAXH ** (p + 1) / 200)
    # VTK cuts every side into 2^3 chords at least; a chord s of the circle misses s^3 / 12, all of
    # them less than pi s^2 / 24. Folded cells would count too much.
    surface = vtkDataSetSurfaceFilter()
    surface.SetInputData(grid)
    surface.SetNonlinearSubdivisionLevel(3)
    surface.Update()
    chords = np.pi * (MAXH / 8) ** 2 / 24 if p > 1 else 0.0
    assert pyvista.wrap(surface.GetOutput()).area == pytest.approx(exact, abs=chords + 1e-12)


def test_fields_are_those_of_the_solution_at_the_nodes(tmp_path):
    """Of a pressure that is linear along the line: elements of order 2 contain the solution."""
    case = cases.pressure_patch(p1=0.5)
    solution = solve(case.problem, maxh=0.5, order=2)
    grid = written(tmp_path, solution)
    nodes, names = grid.cells.reshape(-1, 7)[:, 1:], list(grid.field_data["body_names"])
    for name, law in cases.BLOCKS.items():
        own = np.unique(nodes[grid["body"] == names.index(name)])
        x, y, z = grid.points[own].T
        exact = [case.exact.displacement[name](solution.mesh(*at)) for at in zip(x, y, strict=True)]
        assert not z.any()
        np.testing.assert_allclose(grid["displacement"][own], np.c_[exact, z], atol=1e-12)
        p = 1 + 0.5 * x
        np.testing.assert_allclose(
            grid["stress"][own], np.stack([z, -p, z, -law.nu * p], axis=1), atol=1e-12
        )
        mises = p * np.sqrt(1 - law.nu + law.nu**2)
        np.testing.assert_allclose(grid["von_mises"][own], mises, rtol=1e-11)
    array = grid.GetPointData().GetAbstractArray("stress")
    assert [array.GetComponentName(k) for k in range(4)] == ["xx", "yy", "xy", "zz"]


@pytest.mark.parametrize("glue", [Compound, Glue])
def test_bodies_keep_their_own_stress_where_they_touch(tmp_path, glue):
    """Stretched alike along their common side, with nu = 0."""
    bodies = (rectangle(f"body{k}", (0, 1), (k, k + 1), "side") for k in (0, 1))
    problem = Problem(
        geometry=OCCGeometry(glue(list(bodies)), dim=2),
        materials={"body0": Elastic(1.0, 0.0), "body1": Elastic(2.0, 0.0)},
        displacement={"side": (0.01 * ng.x, 0)},
    )
    grid = written(tmp_path, solve(problem, maxh=MAXH, order=2))
    names = list(grid.field_data["body_names"])
    assert sorted(names) == ["body0", "body1"]
    stress = grid["stress"][:, 0][grid.cells.reshape(-1, 7)[:, 1:]]
    expected = np.where(grid["body"] == names.index("body0"), 0.01, 0.02)
    np.testing.assert_allclose(stress, expected[:, None] + np.zeros_like(stress), rtol=1e-11)


def test_contact_points_carry_their_values(tmp_path):
    solution = disc()
    assert write_solution(tmp_path / "a.b.vtu", solution) == tmp_path / "a.b.vtu"
    data = pyvista.read(tmp_path / "a.b_contact.vtp")
    np.testing.assert_array_equal(data.points[:, :2], solution.points)
    for name in ("pressure", "gap", "force", "active", "pair"):
        np.testing.assert_array_equal(data[name], getattr(solution, name))
    upwards = np.outer(solution.pressure, (0, 1, 0))  # against the direction, on the disc
    np.testing.assert_allclose(data["traction"], upwards, atol=1e-15 * upwards.max())
    for file in (data, pyvista.read(tmp_path / "a.b.vtu")):
        assert list(file.field_data["pair_names"]) == ["disc_arc with block_top"]
        assert list(file.field_data["secondary_names"]) == ["disc_arc"]
        assert list(file.field_data["primary_names"]) == ["block_top"]
    assert np.issubdtype(data["active"].dtype, np.integer)
    assert data.n_verts == len(solution.points)
    along = np.argsort(solution.points[:, 0])
    links = np.sort(data.lines.reshape(-1, 3)[:, 1:], axis=1)
    assert sorted(links.tolist()) == sorted(np.sort(np.c_[along[:-1], along[1:]]).tolist())


def test_series_lists_levels_with_both_files_also_where_it_is_interrupted(tmp_path):
    def levels():
        yield from map(disc, (1, 2))
        raise KeyboardInterrupt

    path = tmp_path / "run & more.pvd"
    with pytest.raises(KeyboardInterrupt):
        write_series(path, levels())
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
    assert bodies.n_cells == disc(2).mesh.ne
    assert contact.n_points == len(disc(2).points)


@pytest.mark.parametrize(
    ("times", "error", "message"),
    [
        ([0.0], ValueError, "1 entries, fewer than there are solutions"),
        ([0.0, 1.0, 2.0], ValueError, "1 entries more than there are solutions"),
        ([1.0, 1.0], ValueError, "give finite, increasing"),
        ([0.0, float("nan")], ValueError, "increasing"),
        (["a", "b"], TypeError, "'b'\\]: give numbers"),
    ],
)
def test_times_that_do_not_fit_are_refused(tmp_path, times, error, message):
    with pytest.raises(error, match=message):
        write_series(tmp_path / "run.pvd", [disc(1), disc(1)], times=times)


def test_indicators_are_written_only_if_known(tmp_path):
    solution = solve(cases.pressed_disc(), maxh=1.0)
    assert "indicators" not in written(tmp_path, solution).cell_data
    indicators = solution.indicators
    np.testing.assert_array_equal(written(tmp_path, solution)["indicators"], indicators)


def test_empty_series_is_refused(tmp_path):
    with pytest.raises(ValueError, match="the series is empty"):
        write_series(tmp_path / "run.pvd", [])
    assert list(tmp_path.iterdir()) == []


def test_hoop_stress_is_in_the_file(tmp_path):
    problem, exact = axisymmetric_cases.fitted_rings()
    solution = solve(problem, maxh=0.2, order=3)
    grid = pyvista.read(solution.write(tmp_path / "fit.vtu"))
    r = grid.points[:, 0]
    hub = grid.points[:, 0] > 1.1 + 1e-6
    at = [exact.hoop["hub"](solution.mesh(x, 0.1)) for x in r[hub]]
    # Nodal means of a stress of degree 2 on elements of size 0.2.
    assert grid["hoop_stress"][hub] == pytest.approx(at, abs=0.02 * np.abs(at).max())


@pytest.fixture(scope="module")
def pressed():
    return solve(axisymmetric_cases.pressed_cylinders(0.5), maxh=0.5, order=2)


@pytest.mark.parametrize(("angle", "sections"), [(360.0, 60), (270.0, 46), (90.0, 16), (4.0, 4)])
def test_the_body_is_turned(tmp_path, pressed, angle, sections):
    """The volume of rings between chords of at most 6 degrees; fields turn with the body."""
    path = pressed.revolved(tmp_path / "body.vtu", angle=angle)
    grid = pyvista.read(path)
    steps = sections if angle == 360 else sections - 1
    turn = math.radians(angle)
    chords = math.sin(turn / steps) / (turn / steps)
    assert grid.volume == pytest.approx(turn / 2 * (1 - 0.25) * 2 * chords, rel=1e-9)
    assert grid.n_cells == steps * 4 * pressed.mesh.ne
    x, y, _ = grid.points.T
    u = grid["displacement"]
    assert np.abs(u[:, 0] * y - u[:, 1] * x).max() < 1e-9 * np.abs(u).max()
    assert grid["stress"].shape == (grid.n_points, 4)
    assert grid["stress"][:, 1] == pytest.approx(-1, abs=1e-9)
    assert np.abs(grid["stress"][:, [0, 2, 3]]).max() < 1e-9
    assert grid["von_mises"] == pytest.approx(1, abs=1e-9)
    # The pressure of 1 pushes the upper body up; its area in single floats.
    surface = pyvista.read(tmp_path / "body_contact.vtp")
    assert surface.area == pytest.approx(turn / 2 * (1 - 0.25) * chords, rel=1e-6)
    assert surface.n_points == sections * len(pressed.points)
    assert surface["pressure"] == pytest.approx(1, abs=1e-9)
    assert surface["traction"] == pytest.approx(np.tile([0.0, 0.0, 1.0], (surface.n_points, 1)))
    assert np.abs(surface["gap"]).max() < 1e-9
    assert surface["active"].all()
    assert list(surface.field_data["secondary_names"]) == ["upper_contact"]


def test_what_is_refused(tmp_path, pressed):
    for angle in (0, -1, 361, math.nan):
        with pytest.raises(ValueError, match="give degrees above 0, at most 360"):
            pressed.revolved(tmp_path / "body.vtu", angle=angle)
    with pytest.raises(ValueError, match=r"must end in '.vtu'"):
        pressed.revolved(tmp_path / "body.vtk")
    plane = solve(replace(axisymmetric_cases.pressed_cylinders(), model="plane strain"), maxh=1.0)
    with pytest.raises(ValueError, match='model "plane strain": a body of revolution has'):
        plane.revolved(tmp_path / "body.vtu")
    assert list(tmp_path.iterdir()) == []


def test_interrupted_writing_leaves_both_old_files(tmp_path, monkeypatch):
    """Contact points are written after the bodies."""
    write_solution(tmp_path / "a.vtu", disc(1))
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}

    class Interrupted(vtkIOXML.vtkXMLPolyDataWriter):
        def Write(self):  # noqa: N802
            raise KeyboardInterrupt

    monkeypatch.setattr(vtkIOXML, "vtkXMLPolyDataWriter", Interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_solution(tmp_path / "a.vtu", disc(2))
    assert len(before) == 2
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
