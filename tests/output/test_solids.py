"""Files of solids: curved tetrahedra, contact points and the triangles between them, series."""

import ngsolve as ng
import numpy as np
import pytest
import pyvista

from ngcontact import solve
from ngcontact.geometries import shells
from ngcontact.output.nodes import nodes_of
from ngcontact.output.surface import contact_surface
from tests import scenes
from tests.output.solutions import PRESSURE, pressed_ball, pressed_cube


@pytest.mark.parametrize("order", [1, 2, 3])
def test_cells_are_the_curved_elements(order, tmp_path):
    """VTK maps points of its cells where NGSolve maps them, and to positive volumes."""
    mesh = ng.Mesh(shells().GenerateMesh(maxh=0.8, parallel_meshing=False))
    mesh.Curve(order)
    nodes = nodes_of(mesh, order)
    inside = {1: 0, 2: 0, 3: 1}[order]
    assert nodes.cells.max() + 1 == mesh.nv + mesh.nedge * (order - 1) + mesh.nface * inside
    kind = {1: pyvista.CellType.TETRA, 2: pyvista.CellType.QUADRATIC_TETRA}.get(
        order, pyvista.CellType.LAGRANGE_TETRAHEDRON
    )
    place = nodes.values(ng.CF((ng.x, ng.y, ng.z)))
    grid = pyvista.UnstructuredGrid({kind: nodes.cells}, place)
    share = np.random.default_rng(order).dirichlet(np.ones(4))
    # VTK's first two vertices are Netgen's second and first.
    rule = ng.IntegrationRule([(share[1], share[0], share[2])], [1.0])
    expected = ng.CF((ng.x, ng.y, ng.z))(mesh.MapToAllElements({ng.TET: rule}, ng.VOL))
    for k in range(0, grid.n_cells, 7):
        x, weights = np.zeros(3), np.zeros(nodes.cells.shape[1])
        grid.GetCell(k).EvaluateLocation(pyvista._vtk.reference(0), share[1:], x, weights)
        np.testing.assert_allclose(x, expected[k], atol=1e-13)
    linear = pyvista.UnstructuredGrid({pyvista.CellType.TETRA: nodes.cells[:, :4]}, place)
    assert linear.compute_cell_sizes()["Volume"].min() > 0


@pytest.mark.parametrize("order", [1, 2, 3])
def test_fields_are_those_of_the_solution(order, tmp_path):
    solution = pressed_cube(order)
    grid = pyvista.read(solution.write(tmp_path / "cube.vtu"))
    z = grid.points[:, 2]
    array = grid.GetPointData().GetAbstractArray("stress")
    names = [array.GetComponentName(k) for k in range(6)]
    assert names == ["xx", "yy", "zz", "xy", "yz", "xz"]
    exact = np.tile([0, 0, -PRESSURE, 0, 0, 0], (grid.n_points, 1))
    np.testing.assert_allclose(grid["displacement"][:, 2], -PRESSURE * (z + 1), atol=1e-12)
    np.testing.assert_allclose(grid["stress"], exact, atol=1e-12)
    np.testing.assert_allclose(grid["von_mises"], PRESSURE, rtol=1e-11)
    assert sorted(grid.field_data["body_names"]) == ["block", "cube"]
    assert set(np.unique(grid["body"])) == {0, 1}


@pytest.mark.parametrize("order", [1, 2, 3])
def test_contact_points_and_their_surface(order, tmp_path):
    solution = pressed_cube(order)
    solution.write(tmp_path / "cube.vtu")
    data = pyvista.read(tmp_path / "cube_contact.vtp")
    m = len(solution.points)
    np.testing.assert_array_equal(data["contact_point"], np.arange(data.n_points) < m)
    np.testing.assert_allclose(data.points[:m], solution.points, atol=1e-14)
    # All of the face, with vertices that are no contact points at order 2.
    assert data.area == pytest.approx(1.0, rel=1e-12)
    assert (data.n_points > m) == (order == 2)
    np.testing.assert_allclose(data["pressure"], PRESSURE, rtol=1e-10)
    np.testing.assert_allclose(data["gap"], 0, atol=1e-14)
    assert data["force"].sum() == pytest.approx(PRESSURE, rel=1e-12)
    exact = np.tile([0, 0, PRESSURE], (m, 1))  # of the block on the cube
    np.testing.assert_allclose(data["traction"][:m], exact, rtol=1e-10)
    assert data["active"].sum() == m
    assert list(data.field_data["pair_names"]) == ["cube_bottom with block_top"]


def test_a_linear_function_on_the_surface_is_kept():
    """Vertices of order 2 take a mean of values that agree; NaN where none is known."""
    solution = pressed_ball()
    surface = contact_surface(solution, 0)
    x, y, _ = solution.points.T
    found = surface.values(2 * x - 3 * y + 1)
    known = np.isfinite(found)
    exact = 2 * surface.points[:, 0] - 3 * surface.points[:, 1] + 1
    # Middles of curved edges leave chords: measured 1.5 % beside the rim, 1e-3 near the contact.
    near = known & (np.hypot(*surface.points[:, :2].T) < 0.3)
    assert near.sum() > 3
    np.testing.assert_allclose(found[near], exact[near], atol=0.01)
    assert known[surface.row >= 0].all()
    assert not known.all()  # the ball's rim faces nothing


def test_nothing_in_contact_is_an_empty_file(tmp_path):
    held = {"block_bottom|cube_top": (0, 0, 0)}
    problem = scenes.pressed_cube(displacement=held, traction={}, contact=[])
    solve(problem, maxh=1.0, order=1).write(tmp_path / "free.vtu")
    assert pyvista.read(tmp_path / "free_contact.vtp").n_points == 0
