"""First meshes: matched nodes on facing lines, sizes, and the user's geometry left alone."""

import math
from dataclasses import replace

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import OCCGeometry

from ngcontact import Contact, Elastic, Problem
from ngcontact.adaptivity.refinement import matched_vertices
from ngcontact.fem import boundary_trace
from ngcontact.geometries import blocks, disc_on_block, graphs
from ngcontact.geometries.region import body, compound, polygon
from ngcontact.mesh import generation
from ngcontact.mesh.curving import check_curves
from ngcontact.mesh.generation import first_mesh
from tests.pairs import (
    ALL,
    BLOCKS,
    BOUNDED,
    ENLARGING,
    RISING,
    ROUND_OFF,
    SOFT,
    pressed,
    unmatched,
    valley,
    wave,
)
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


def low(name="lower_contact"):
    """Block from x = -1 to 1 below y = 0, its top one edge."""
    corners = [(1.0, 0.0), (-1.0, 0.0), (-1.0, -1.0), (1.0, -1.0)]
    return body("lower", polygon(corners, [name, "sides", "bottom", "sides"]))


def high(name, left, right, contact):
    """Block from x = left to right above y = 0."""
    corners = [(left, 0.0), (right, 0.0), (right, 1.0), (left, 1.0)]
    return body(name, polygon(corners, [contact, "sides", f"{name}_top", "sides"]))


@pytest.mark.parametrize("direction", [None, 1])
@pytest.mark.parametrize("wide_is_secondary", [True, False])
def test_a_line_inside_a_longer_one_has_its_ends_among_the_nodes(wide_is_secondary, direction):
    geometry = compound(high("upper", -0.47, 0.33, "upper_contact"), low())
    names = ["lower_contact", "upper_contact"] if wide_is_secondary else None
    secondary, primary = names or ["upper_contact", "lower_contact"]
    xi = None if direction is None else (0, 1 if wide_is_secondary else -1)
    mesh = first_mesh(pressed(geometry, BLOCKS, Contact(secondary, primary, direction=xi)), 0.4)
    short, wide = (np.sort(vertices(mesh, n)[:, 0]) for n in ("upper_contact", "lower_contact"))
    assert unmatched(short, wide[(wide > -0.5) & (wide < 0.35)]) < ROUND_OFF
    assert np.diff(wide).min() > 0.2  # two halves of 0.8 and two of at most 0.4: no slivers
    assert np.diff(wide).max() < 0.4 * (1 + 1e-6)


def test_a_corner_of_the_primary_meets_a_node_of_the_secondary():
    corners = [(-1.0, 0.0), (0.1, 0.05), (1.0, 0.0), (1.0, 1.0), (-1.0, 1.0)]
    kinked = body(
        "upper", polygon(corners, ["upper_contact"] * 2 + ["sides", "upper_top", "sides"])
    )
    mesh = first_mesh(pressed(compound(kinked, low()), BLOCKS, RISING), 0.4)
    upper, lower = (vertices(mesh, n)[:, 0] for n in ("upper_contact", "lower_contact"))
    assert unmatched(upper, lower) < ROUND_OFF
    assert np.diff(np.sort(lower)).min() > 0.2  # no slivers beside the corner


def test_the_geometry_is_left_as_it_was():
    geometry = disc_on_block()
    problem = pressed(geometry, ("disc", "block"), ENLARGING["disc on block"].contact)
    before = coordinates(ng.Mesh(geometry.GenerateMesh(maxh=0.3)))
    matched = coordinates(first_mesh(problem, 0.3))
    assert all(edge.partition is None for edge in geometry.shape.edges)
    after = coordinates(ng.Mesh(geometry.GenerateMesh(maxh=0.3)))
    assert before.shape != matched.shape
    assert (before == after).all()


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


@pytest.mark.parametrize(
    ("maxh", "error"),
    [
        (0, ValueError),
        (-0.1, ValueError),
        (math.nan, ValueError),
        (math.inf, ValueError),
        ("0.1", TypeError),
        (True, TypeError),
        (0.1j, TypeError),
    ],
)
def test_a_bad_size_is_refused_with_its_value(maxh, error):
    value = repr(maxh) if error is TypeError else str(maxh)
    with pytest.raises(error, match=f"maxh={value}.*0.25") as caught:
        first_mesh(BOUNDED["blocks"].problem(), maxh)
    assert "maxh" in str(caught.value)


def test_whole_circles_are_divided_on_the_facing_side():
    """A full circle is no graph over eta: nodes match where the discs face, areas stay right."""
    upper, lower = (occ.WorkPlane().Circle(0, y, 1).Face() for y in (1, -1))
    for face, name in ((upper, "upper"), (lower, "lower")):
        face.faces.name, face.edges.name = name, f"{name}_rim"
    discs = Problem(
        geometry=OCCGeometry(occ.Compound([upper, lower]), dim=2),
        materials={"upper|lower": Elastic(E=1.0, nu=0.3)},
        contact=[Contact("upper_rim", "lower_rim", direction=(0, -1))],
    )
    mesh = first_mesh(discs, maxh=0.4)
    assert mesh.ne < 200  # measured 95
    mesh.Curve(3)
    for name in ("upper", "lower"):
        # Area of a disc by cubic curves of chord 0.4: O(h^4), measured 3e-5.
        assert ng.Integrate(ng.CF(1), mesh.Materials(name)) == pytest.approx(math.pi, rel=1e-3)


def test_two_pairs_on_one_circle_do_not_ask_for_nodes_on_its_far_sides():
    """What lies behind a disc sees the other face through it, and would spoil the nodes there."""
    disc = occ.Circle((0, 0), 1.0).Face()
    disc.name, disc.edges.name = "disc", "rim"
    deep = math.sqrt(2)
    outline = [(0, -deep), (-2, 2 - deep), (-2, -3), (2, -3), (2, 2 - deep)]
    notch = body("notch", polygon(outline, ["left", "side", "bottom", "side", "right"]))
    problem = Problem(
        geometry=OCCGeometry(occ.Compound([disc, *notch.faces]), dim=2),
        materials={"disc|notch": SOFT},
        contact=[
            Contact("rim", "left", direction=(-1, -1)),
            Contact("rim", "right", direction=(1, -1)),
        ],
    )
    mesh = first_mesh(problem, 0.25)
    rim = vertices(mesh, "rim")
    for contact in problem.contact:
        trace = boundary_trace(mesh, 1)
        matched = coordinates(mesh)[list(matched_vertices(trace, contact))]
        # Each matches up to 60 degrees from its direction; from 30 on the other's nodes are there.
        facing = rim[rim @ contact.direction > math.cos(math.radians(29))]
        assert len(facing) >= 3
        distance = np.linalg.norm(facing[:, None] - matched, axis=2)
        assert distance.min(axis=1).max() < ROUND_OFF


def scaled_mesh(geometry, size, degree):
    """Curved mesh of a geometry of `size` times its own."""
    shape = geometry.shape.Scale(occ.Pnt(0, 0, 0), size)
    mesh = ng.Mesh(OCCGeometry(shape, dim=2).GenerateMesh(maxh=0.25 * size))
    mesh.Curve(degree)
    return mesh


CURVED = {  # the smallest size of which check_curves accepts the mesh
    "arcs": (disc_on_block(), 5e-5),
    "splines": (graphs(wave, valley), 1e-2),
}


@pytest.mark.parametrize("large", [False, True])
@pytest.mark.parametrize("name", CURVED)
def test_accepted_sizes_are_curved_as_size_1_is(name, large):
    geometry, size = CURVED[name]
    size = 1e8 if large else size  # Netgen meshes sizes to 3e8
    one, other = (scaled_mesh(geometry, s, 5) for s in (1.0, size))
    check_curves(other)
    nodes = [boundary_trace(mesh, 4).curve for mesh in (one, other)]
    # Round-off; measured 1e-15. At a fifth of the smallest size arcs are off by 3e-4.
    assert np.abs(nodes[1] / size - nodes[0]).max() < ROUND_OFF


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


@pytest.mark.parametrize("unit", [1e-6, 2e8])
@pytest.mark.parametrize("angle", [0.0, 17.3])
def test_lengths_that_are_meshed(unit, angle):
    """Areas scale; the kernel's tolerance is 1e-7 of a length, 0.1 of one of 1e-6."""
    turned = PRESSED.geometry.shape.Rotate(occ.Axis((0, 0, 0), occ.Z), angle)
    shape = turned.Scale(occ.Pnt(0, 0, 0), unit)
    mesh = first_mesh(replace(PRESSED, geometry=OCCGeometry(shape, dim=2)))
    area = ng.Integrate(ng.CF(1.0), first_mesh(PRESSED))
    assert ng.Integrate(ng.CF(1.0), mesh) / unit**2 == pytest.approx(area, rel=1e-9)
