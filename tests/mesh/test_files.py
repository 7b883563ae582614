"""Meshes of files: Gmsh's formats, what is kept of them, and what is refused."""

import math
import warnings
from dataclasses import replace

import meshio
import ngsolve as ng
import numpy as np
import pytest

from drivers.reference.straight import relative_energy_error
from ngcontact import ContactWarning, Elastic, Problem, adapt, find_contacts, solve
from ngcontact.geometries import blocks, disc_on_block, rings
from ngcontact.mesh import cad_edges, curve, first_mesh, read
from ngcontact.problem import MeshArrays
from tests.test_fits import exact, fit

NAMES = {"line": ("line", "line3"), "tri": ("triangle", "triangle6")}
NAMES |= {"quad": ("quad",), "tet": ("tetra",)}
DIMS = {"line": 1, "tri": 2, "quad": 2, "tet": 3}


class File:
    """Nodes (n, 3), and blocks of cells: kind, nodes (k, m) from 0, name or ""."""

    def __init__(self, points, blocks):
        self.points = np.column_stack([points, np.zeros((len(points), 3 - points.shape[1]))])
        self.blocks = blocks

    def write(self, path, version, order=1):
        """In Gmsh's text format; each block is an entity, which has one of the nodes at least."""
        groups = [(name, DIMS[kind]) for kind, _, name in self.blocks]
        tags = {group: k for k, group in enumerate(dict.fromkeys(groups), start=1) if group[0]}
        own = [np.full(len(cells), k) for k, (_, cells, _) in enumerate(self.blocks, start=1)]
        mesh = meshio.Mesh(
            self.points,
            [(NAMES[kind][order - 1], cells) for kind, cells, _ in self.blocks],
            field_data={name: np.array([tag, dim]) for (name, dim), tag in tags.items()},
        )
        named = [0 * k + tags.get(group, 0) for k, group in zip(own, groups, strict=True)]
        mesh.cell_data = {"gmsh:physical": named, "gmsh:geometrical": own}
        entity = np.minimum(np.arange(len(self.points)), len(groups) - 1)
        dims = np.array([dim for _, dim in groups])
        mesh.point_data["gmsh:dim_tags"] = np.column_stack([dims[entity], entity + 1])
        mesh.cell_sets["gmsh:bounding_entities"] = [np.zeros(0, dtype=int) for _ in groups]
        meshio.write(path, mesh, {2.2: "gmsh22", 4.1: "gmsh"}[version], binary=False)
        return path


def drawn(geometry, maxh, order=1):
    """A drawing, meshed, as a file of first or second order, whose middles lie on the curves."""
    mesh = first_mesh(Problem(geometry, {".*": Elastic(E=1.0, nu=0.3)}), maxh)
    view, edges = MeshArrays(mesh), cad_edges(mesh)
    points, middles = view.vertices.tolist(), {}

    def middle(a, b, edge=None):
        key = min(a, b), max(a, b)
        if key not in middles:
            x = (view.vertices[a] + view.vertices[b])[None] / 2
            x = x if edge is None else edge.point(edge.project(x))
            middles[key] = len(points)
            points.append(x[0].tolist())
        return middles[key]

    blocks = []
    for k, name in enumerate(mesh.GetBoundaries()):
        cells = view.facets[view.boundaries == k]
        if order == 2:
            cells = np.array([[a, b, middle(a, b, edges[k])] for a, b in cells.tolist()])
        blocks.append(("line", cells, name))
    for k, name in enumerate(mesh.GetMaterials()):
        cells = view.elements[view.bodies == k]
        if order == 2:
            sides = [[middle(a, b), middle(b, c), middle(c, a)] for a, b, c in cells.tolist()]
            cells = np.hstack([cells, sides])
        blocks.append(("tri", cells, name))
    return File(np.array(points), blocks)


def square(kind="quad", name="body", rim="rim"):
    points = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], dtype=float)
    cells = {"quad": [[0, 1, 2, 3]], "tri": [[0, 1, 2], [2, 0, 3]]}[kind]
    sides = [[0, 1], [1, 2], [2, 3]]
    return File(points, [("line", np.array(sides), rim), (kind, np.array(cells), name)])


@pytest.mark.parametrize("version", [2.2, 4.1])
@pytest.mark.parametrize("order", [1, 2])
def test_straight_files_are_the_meshes_they_were(tmp_path, version, order):
    """Two blocks: the same solution as on the mesh that was written."""
    file = drawn(blocks(), 0.4, order)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        mesh = read(file.write(tmp_path / "blocks.msh", version, order))
    data = {
        "materials": {"upper|lower": Elastic(E=1.0, nu=0.3)},
        "displacement": {"bottom": (0, 0), "top": (0, -0.1 - 0.05 * ng.x)},
    }
    drawing = Problem(blocks(), contact=find_contacts(blocks(), within=1e-6), **data)
    one = solve(drawing, first_mesh(Problem(blocks(), data["materials"]), 0.4), order=2)
    other = solve(
        replace(drawing, geometry=mesh, contact=find_contacts(mesh, within=1e-6)), order=2
    )
    assert sorted(set(mesh.GetBoundaries())) == sorted(set(one.mesh.GetBoundaries()))
    assert mesh.ne == one.mesh.ne
    assert other.energy == pytest.approx(one.energy, rel=1e-10)


@pytest.mark.parametrize("version", [2.2, 4.1])
def test_curved_sides_of_second_order_are_kept(tmp_path, version):
    file = drawn(disc_on_block(), 0.3, 2)
    with pytest.warns(ContactWarning, match=r"turn by up to 0.\d+ degrees where curves are"):
        mesh = read(file.write(tmp_path / "disc.msh", version, 2))
    fine = curve(mesh, 4, "isoparametric")[0]
    half = math.pi / 4  # quarter of a disc: area
    area = ng.Integrate(1.0, fine.Materials("disc"), order=8)
    polygon = ng.Integrate(1.0, mesh.Materials("disc"))
    assert abs(area - half) < 1e-3 * abs(polygon - half)
    r = ng.sqrt(ng.x**2 + (ng.y - 1) ** 2)
    arc = fine.Boundaries("disc_arc")
    off = math.sqrt(ng.Integrate((r - 1) ** 2, arc, order=8) / ng.Integrate(1.0, arc))
    assert off < 1e-5
    straight = [edge.name for edge in cad_edges(mesh) if edge.straight]
    assert "block_top" in straight
    assert "disc_arc" not in straight


@pytest.mark.filterwarnings("ignore:sides of second order")
@pytest.mark.parametrize("scale", [1e-3, 1e3, 1e9])
def test_curves_are_those_of_the_file_in_any_unit(tmp_path, scale):
    file, areas = drawn(rings(), 0.4, 2), []
    for size in (1.0, scale):
        file.points = file.points * size
        mesh = read(file.write(tmp_path / "rings.msh", 4.1, 2))
        mesh.Curve(3)
        areas.append(ng.Integrate(1.0, mesh, order=6) / size**2)
    assert areas[1] == pytest.approx(areas[0], rel=1e-12)  # round-off of the area


@pytest.mark.filterwarnings("ignore:sides of second order")
def test_second_order_keeps_the_rates_of_order_2(tmp_path):
    """A press fit against Lame's solution, whose circles the file has to its accuracy."""
    file = drawn(rings(0.5, 1.0, 2.0, 1e-3, quarter=True), 0.125, 2)
    mesh = read(file.write(tmp_path / "rings.msh", 4.1, 2))
    stress, pressure = exact(1e-3)
    problem = replace(fit(1e-3), geometry=mesh)
    levels = list(adapt(problem, order=2, max_dofs=6000))
    errors = [relative_energy_error(level, stress) for level in levels]
    estimates = [level.relative_error_estimate for level in levels]
    unknowns = [level.displacement.space.ndof for level in levels]
    rate = np.polyfit(np.log(unknowns), np.log(errors), 1)[0]
    assert rate < -0.9  # theory: 1
    assert all(error < known for error, known in zip(errors, estimates, strict=True))
    right = pressure["outer"] * (1 - 1e-3) * math.pi / 2
    assert levels[-1].force.sum() == pytest.approx(right, rel=1e-3)


def test_first_order_files_say_that_curves_are_polygons(tmp_path):
    with pytest.warns(ContactWarning, match="straight sides of a file turn by .* degrees without"):
        mesh = read(drawn(rings(), 0.4).write(tmp_path / "rings.msh", 2.2))
    assert cad_edges(mesh) is None


@pytest.mark.filterwarnings("ignore:sides of second order")
def test_whole_circles_are_closed_curves(tmp_path):
    """Of one name, as a pin and its hole; vertices of quarter arcs are no corners."""
    mesh = read(drawn(rings(), 0.5, 2).write(tmp_path / "rings.msh", 4.1, 2))
    edges = {edge.name: edge for edge in cad_edges(mesh)}
    assert len(edges) == len(cad_edges(mesh)) == 4
    assert all(edge.closed for edge in edges.values())
    angle = np.linspace(0, 2 * math.pi, 100)
    circle = 2.0 * np.column_stack([np.cos(angle), np.sin(angle)])
    normal = edges["rim"].normal_at(edges["rim"].project(circle))
    assert np.abs(np.abs((normal * circle / 2).sum(axis=1)) - 1).max() < 1e-6


def test_quadrilaterals_are_split_and_lines_without_a_name_are_default(tmp_path):
    mesh = read(square().write(tmp_path / "square.msh", 2.2))
    assert (mesh.ne, mesh.GetMaterials()) == (2, ("body",))
    assert sorted(mesh.GetBoundaries()) == ["default", "rim"]
    assert ng.Integrate(1.0, mesh) == pytest.approx(1.0)
    clockwise = read(square("tri").write(tmp_path / "square.msh", 4.1))
    assert ng.Integrate(1.0, clockwise) == pytest.approx(1.0)


def changed(file, points=None, more=()):
    file.points = file.points if points is None else np.array(points, dtype=float)
    file.blocks = [*file.blocks, *more]
    return file


@pytest.mark.parametrize(
    ("file", "told"),
    [
        (square(name=""), r"1 cells, one at \(0, 0\), are of no body: give every body a name"),
        (changed(square(), more=[("tet", np.array([[0, 1, 2, 3]]), "solid")]), 'kind "tetra" are'),
        (changed(square(), [(0, 0, 0), (1, 0, 0), (1, 1, 1), (0, 1, 1)]), "do not lie in a plane"),
        (changed(square(), more=[("line", np.array([[1, 3]]), "cut")]), '\'?"cut" is no side'),
        (changed(square(), more=[("tri", np.array([[0, 1, 2]]), "twin")]), "overlap on"),
        (changed(square("tri"), [(0, 0, 0), (1, 0, 0), (2, 0, 0), (0, 1, 0)]), "degenerate"),
        (File(square().points, square().blocks[:1]), "no triangles or quadrilaterals"),
        (changed(square(), [(0, math.nan), (1, 0), (1, 1), (0, 1)]), "1 coordinates of nodes are"),
        (changed(square(), [(0, 0), (1, 0), (1, 1)]), "cells with nodes that it does not have"),
    ],
)
def test_files_that_do_not_fit_are_refused(tmp_path, file, told):
    if file.points.shape[1] == 2:
        file = File(file.points, file.blocks)
    path = file.write(tmp_path / "part.msh", 2.2)
    with pytest.raises(ValueError, match=told) as caught:
        read(path)
    assert "part.msh" in str(caught.value)


def test_what_is_no_file_of_a_mesh(tmp_path, capsys):
    with pytest.raises(FileNotFoundError, match="there is no file"):
        read(tmp_path / "none.msh")
    element = "*NODE\n1, 0, 0\n*ELEMENT, TYPE=CPS6\n1, 1, 1, 1, 1, 1, 1\n"
    files = {"text.msh": "no mesh\n", "text.txt": "no mesh\n", "empty.msh": "", "6.inp": element}
    for name, text in files.items():
        (tmp_path / name).write_text(text)
        with pytest.raises(ValueError, match=f"{name}.* cannot be read as a mesh; meshio .* Gmsh"):
            read(tmp_path / name)
    assert capsys.readouterr().out == ""


def test_sides_that_fold_a_cell_are_refused(tmp_path):
    points = [(0, 0), (1, 0), (0.5, 0.1), (0.5, 0.15), (0.75, 0.05), (0.25, 0.05)]
    cells = np.array([[0, 1, 2, 3, 4, 5]])
    file = File(np.array(points), [("tri", cells, "body")])
    with pytest.raises(ValueError, match="curved sides fold a cell near"):
        read(file.write(tmp_path / "folded.msh", 2.2, 2))
