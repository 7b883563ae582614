"""First meshes: matched nodes on facing lines, sizes, a node where the gap is least."""

import math
from dataclasses import replace

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import OCCGeometry

from ngcontact import Contact, Elastic, Problem
from ngcontact.fem import boundary_trace
from ngcontact.geometries import ball_on_block, blocks, disc_on_block, graphs
from ngcontact.mesh import generation
from ngcontact.mesh.curving import check_curves
from ngcontact.mesh.generation import first_mesh, narrowest, spaced
from tests.pairs import ALL, BLOCKS, BOUNDED, ENLARGING, ROUND_OFF, pressed, unmatched, valley
from tests.scenes import coordinates, vertices

SIZES = (None, 1.0, 0.4, 0.11)


def lengths(mesh, pattern):
    """Chords of the segments of the boundaries of that name."""
    trace = boundary_trace(mesh, 1)
    return trace.lengths(trace.segments(pattern))


@pytest.mark.parametrize("maxh", SIZES)
@pytest.mark.parametrize("name", ALL)
@pytest.mark.study(
    witness=[
        *("bounded blocks-1.0", "bounded punch-1.0", "bounded polygon-1.0"),
        *("enlarging blocks-1.0", "enlarging disc on block-None", "enlarging disc on block-0.4"),
    ]
)
def test_vertices_coincide_or_have_common_eta(name, maxh):
    if "punch" in name and maxh is not None:
        maxh = max(maxh, 0.4)  # the foundation is large
    pair = ALL[name]
    points = [vertices(first_mesh(pair.problem(), maxh), side) for side in pair.sides]
    for k, curve in enumerate(pair.curves):
        x, y = points[k][np.abs(points[k][:, 0]) < pair.part].T
        # The spline of a graph is good to 1e-12 here; circles and lines are exact.
        assert np.abs(y - [curve(v) for v in x]).max() < ROUND_OFF
        points[k] = x
    assert len(points[0]) >= 2
    assert unmatched(*points) < ROUND_OFF


@pytest.mark.parametrize("maxh", [2.0, 0.4, 0.11])
def test_contact_segments_keep_the_size_and_resolve_the_curvature(maxh):
    mesh = first_mesh(ENLARGING["disc on block"].problem(), maxh)
    assert lengths(mesh, "disc_arc").max() < maxh * (1 + 1e-6)
    # At most half a radian each, where the lines are matched.
    angle = np.sort(np.arcsin(np.minimum(vertices(mesh, "disc_arc")[:, 0], 1.0)))
    matched = angle[angle < math.radians(61)]
    assert matched[-1] == pytest.approx(math.radians(60), abs=1e-2)
    assert np.diff(matched).max() < 0.5 * (1 + 1e-3)


def test_the_default_size_is_an_eighth_of_the_largest_extent():
    problem = pressed(blocks(width=4.0), BLOCKS, *[BOUNDED["blocks"].contact])
    mesh = first_mesh(problem)
    assert lengths(mesh, "top|bottom") == pytest.approx(4 / 8)
    assert lengths(mesh, "upper_contact|lower_contact") == pytest.approx(4 / 16)
    # The user's geometry is left as it was, and a size that is given holds everywhere.
    assert lengths(first_mesh(problem, 0.5), "upper_contact|lower_contact") == pytest.approx(0.5)


def test_a_problem_of_solids_has_one_first_mesh():
    """Once it has a triangulation, as after meshing or drawing, the box of a ball is another."""
    contact = Contact("ball_surface", "block_top", direction=(0, 0, -1))
    materials = dict.fromkeys(("ball", "block"), Elastic(E=1.0, nu=0.3))
    problem = Problem(ball_on_block(), materials, {"block_bottom": (0, 0, 0)}, contact=[contact])
    one, other = first_mesh(problem), first_mesh(problem)
    assert one.ne == other.ne
    np.testing.assert_allclose(coordinates(other), coordinates(one), rtol=0, atol=ROUND_OFF)


def test_partitions_of_the_user_are_honoured():
    geometry = blocks()
    fractions = {"upper_contact": [0.2, 0.5, 0.6], "top": [0.125]}
    for edge in geometry.shape.edges:
        if edge.name in fractions:
            edge.partition = fractions[edge.name]
    mesh = first_mesh(pressed(geometry, BLOCKS, BOUNDED["blocks"].contact), 0.7)
    for name, inner in fractions.items():
        x = np.sort(vertices(mesh, name)[:, 0])
        x = (x - x[0]) / (x[-1] - x[0])
        x = x if name == "upper_contact" else 1 - x[::-1]  # the top runs to the left
        assert x == pytest.approx([0, *inner, 1], abs=ROUND_OFF)
    kept = {edge.name: list(edge.partition) for edge in geometry.shape.edges if edge.partition}
    assert kept == fractions


@pytest.mark.parametrize("name", ["upper_contact", "lower_contact"])
def test_the_size_of_one_edge_holds_on_the_facing_one(name):
    geometry = blocks()
    for edge in geometry.shape.edges:
        if edge.name == name:
            edge.maxh = 0.1
    mesh = first_mesh(pressed(geometry, BLOCKS, BOUNDED["blocks"].contact), 0.5)
    for side in ("upper_contact", "lower_contact"):
        assert lengths(mesh, side) == pytest.approx(0.1)
    assert lengths(mesh, "top").min() > 0.2


def test_refinement_beyond_the_kernel_s_lengths_is_refused():
    """Measured: elements beside the end of an arc turn over at 5e-7 units, order 4."""
    mesh = ng.Mesh(disc_on_block().GenerateMesh(maxh=0.3))
    for level in range(20):
        if level == 18:
            check_curves(mesh)  # segments of 1.2e-6: measured, elements still have their shape
        corner = np.linalg.norm(coordinates(mesh) - [1.0, 1.0], axis=1).argmin()
        elements = mesh.ngmesh.Elements2D().NumPy()
        elements["refine"] = (elements["nodes"][:, :3].astype(int) - 1 == corner).any(axis=1)
        mesh.Refine()
        mesh = ng.Mesh(mesh.ngmesh.Copy())
    with pytest.raises(ValueError, match=r'"disc_arc".* segments of [0-9.]+e-07'):
        check_curves(mesh)
    check_curves(ng.Mesh(blocks().GenerateMesh(maxh=0.3)))


def test_small_curves_are_refused_unless_they_are_arcs_of_circles():
    """On others OCC's projections are wrong: of this extent, measured, from 2e-3 on."""
    check_curves(ng.Mesh(disc_on_block(radius=1e-3).GenerateMesh()))
    size = 1e-3
    waves = graphs(lambda x: valley(x / size) * size, lambda x: 0.0, -size, size, size)
    with pytest.raises(ValueError, match=r"has the extent 0\.002 and"):
        check_curves(ng.Mesh(waves.GenerateMesh()))


PRESSED = pressed(blocks(), BLOCKS, BOUNDED["blocks"].contact)


@pytest.mark.parametrize(
    ("unit", "offset"), [(1e9, 0.0), (1e12, 0.0), (1.0, 1e9), (1e-7, 0.0)], ids=str
)
@pytest.mark.parametrize("angle", [0.0, 17.3])
def test_lengths_that_are_not_meshed_are_refused(unit, offset, angle, monkeypatch):
    """Netgen never returned, at angles that depend on the shape."""
    monkeypatch.setattr(generation, "_generated", lambda *_: pytest.fail("meshed"))
    turned = PRESSED.geometry.shape.Rotate(occ.Axis((0, 0, 0), occ.Z), angle)
    shape = turned.Scale(occ.Pnt(0, 0, 0), unit).Move(occ.Vec(offset, 0, 0))
    problem = replace(PRESSED, geometry=OCCGeometry(shape, dim=2))
    with pytest.raises(ValueError, match=r"has the extent \S+ and reaches \S+ .* unit of length"):
        first_mesh(problem)


def test_two_cams_without_a_direction_are_told_to_give_one():
    """Normals of one full ellipse divide the other, which faces away for the most part."""
    parts = []
    for name, y in (("upper", 1.2), ("lower", 0.0)):
        face = occ.WorkPlane(occ.Axes((0, y, 0), n=occ.Z, h=occ.X)).Ellipse(1.0, 0.6).Face()
        face.name, face.edges.name = name, f"{name}_rim"
        parts.append(face)
    steel = Elastic(E=1.0, nu=0.3)
    problem = Problem(
        geometry=OCCGeometry(occ.Compound(parts), dim=2),
        materials={"upper": steel, "lower": steel},
        contact=[Contact("upper_rim", "lower_rim")],
    )
    message = 'bulge towards each other give contact 0 of "upper_rim" with "lower_rim" a direction'
    with pytest.raises(ValueError, match=message):
        first_mesh(problem, 0.2)
    along = replace(problem, contact=[Contact("upper_rim", "lower_rim", direction=(0, -1))])
    assert first_mesh(along, 0.2).ne > 50


EXACT = 1e-12  # round-off of places; a parabola's vertex on the finer step is good to 1e-9
T = np.linspace(0.0, 1.0, 513)


def line(unit):
    """Points at the parameters of a line of length `unit`."""
    return unit * np.column_stack([T, np.zeros(len(T))])


def laid(gap, maxh, unit=1.0):
    """Places where that gap is extreme, and nodes."""
    x = line(unit)
    places = narrowest(T, x, x, maxh * unit, gap)
    return places, spaced(T, x, x, maxh * unit, places)


@pytest.mark.parametrize(
    ("gap", "why"),
    [
        (lambda t: 0.1 + (t - 0.37) ** 2, "too wide for contact"),
        (lambda t: t - 0.37, "the curves cross"),
        (lambda t: np.full(len(t), 1e-3), "the same all along"),
        (lambda t: 1e-16 * np.sin(1e6 * t), "round-off"),
        (lambda t: 1e-3 + t**2, "least at the end"),
        (lambda t: np.where(np.abs(t - 0.37) < 0.1, np.nan, 1e-3 + t), "none opposite"),
        (lambda t: (t - 0.4) ** 2, "a node is there"),
    ],
)
def test_elsewhere_nodes_stay_as_they_are(gap, why):
    _, nodes = laid(gap, 0.2)
    _, even = laid(lambda t: np.ones(len(t)), 0.2)
    np.testing.assert_array_equal(nodes, even, err_msg=why)


def test_places_beside_ends_and_others_leave_no_slivers():
    """Closer than a tenth of a segment, which is 0.2 here."""
    x = line(1.0)
    nodes = spaced(T, x, x, 0.2, np.array([0.01, 0.37, 0.38, 0.6, 0.99]))
    assert np.diff(nodes).min() > 0.02
    assert np.abs(nodes[:, None] - [0.37, 0.6]).min(axis=0).max() < EXACT
