"""The gallery: names, areas and volumes, orientation, curves and vertices of every geometry."""

import inspect
import math
import re

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import geometries
from ngcontact.geometries import (
    ball_in_cup,
    ball_in_socket,
    ball_on_block,
    blocks,
    cone_on_block,
    crossed_cylinders,
    cube_on_block,
    disc,
    disc_on_block,
    disc_on_disc,
    graphs,
    punch,
    ring_in_groove,
    rings,
    rounded_punch,
    shells,
    sleeve_on_shaft,
)

PI = math.pi
LINE = ((-1.0, 0.0), (-0.2, 0.3), (0.5, -0.1), (1.0, 0.2))  # a convex and a re-entrant corner
SLOPE = math.tan(math.radians(10))


def parabola(x):
    return x**2 / 2


def ripple(x):
    return 0.01 * math.sin(8 * PI * x)


def bowl(x):
    return 0.1 * math.sin(4 * x)


def flat(x):
    return -0.1


def cap(radius, depth):
    return PI * depth**2 * (radius - depth / 3)


def shell(inner, outer):
    return PI / 6 * (outer**3 - inner**3)


# A geometry, its options, and the areas of its bodies in their order.
CASES = [
    (ball_in_socket, {}, [PI / 4, 2.1 * 2.05 - 1.05**2 * PI / 4]),
    (cone_on_block, {}, [1 + SLOPE / 2, 4.0]),
    (rounded_punch, {}, [1.2**2 - 0.2**2 * (1 - PI / 4), 2.4**2]),
    (sleeve_on_shaft, {}, [2.0, 0.6]),
    (ring_in_groove, {}, [PI / 4, 3.4 * 1.75 - 1.4 * 0.75, 3.4]),
    (blocks, {}, [2.0, 2.0]),
    # Trapezia under the line: 0.8 * 0.15 + 0.7 * 0.1 + 0.5 * 0.05 = 0.215.
    (blocks, {"line": LINE, "height": 0.8, "lower_height": 0.5}, [1.6 - 0.215, 1.0 + 0.215]),
    (rings, {}, [0.75 * PI, 3 * PI]),
    (rings, {"interference": -0.01, "quarter": True}, [0.75 * PI / 4, (4 - 1.01**2) * PI / 4]),
    (disc, {}, [PI / 4]),
    (disc, {"radius": 2, "symmetric": False}, [2 * PI]),
    (disc_on_block, {}, [PI / 4, 4.0]),
    (disc_on_block, {"radius": 2, "width": 1.5, "height": 1, "symmetric": False}, [2 * PI, 3.0]),
    (disc_on_disc, {"radius": 0.5, "lower_radius": 1, "symmetric": False}, [PI / 8, PI / 2]),
    (disc_on_disc, {}, [PI / 4, PI / 4]),
    (graphs, {"upper": parabola, "lower": flat}, [2 - 1 / 3, 1.8]),
    (
        graphs,  # over [0, 1] the ripple has mean zero, the bowl (1 - cos 4) / 40
        {"upper": bowl, "lower": ripple, "a": 0, "b": 1, "height": 0.5},
        [0.5 - (1 - math.cos(4)) / 40, 0.5],
    ),
    (punch, {"half_width": 1, "punch_height": 0.5, "width": 3, "depth": 2}, [1.0, 12.0]),
]


# The same of solids, and their volumes.
SOLIDS = [
    (ball_on_block, {}, [PI / 6, 2 * PI]),
    (
        ball_on_block,
        {"radius": 2, "width": 1.5, "height": 1, "symmetric": False},
        [16 * PI / 3, 2.25 * PI],
    ),
    (crossed_cylinders, {"lower_radius": 2}, [PI / 2, 2 * PI]),
    (
        crossed_cylinders,
        {"radius": 0.5, "lower_radius": 1, "length": 3, "symmetric": False},
        [0.75 * PI, 3 * PI],
    ),
    (shells, {}, [shell(0.5, 1), shell(1, 1.5)]),
    (shells, {"outer": 2, "interference": 0.01}, [shell(0.5, 1), shell(0.99, 2)]),
    (ball_in_cup, {}, [PI / 6, 1.6 * PI - cap(1.02, 0.6) / 4]),
    (
        ball_in_cup,
        {"clearance": 0.1, "depth": 1, "width": 3, "height": 2, "symmetric": False},
        [2 * PI / 3, 27 * PI - cap(1.1, 1)],
    ),
    (cube_on_block, {}, [1.0, 4.0]),
    (cube_on_block, {"size": 2, "width": 2, "height": 1}, [8.0, 4.0]),
]


def mesh_of(geometry, maxh=0.4, order=3):
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=maxh, parallel_meshing=False))  # threads would wait
    mesh.Curve(order)
    return mesh


def edges_of(geometry, name):
    return [edge for edge in geometry.shape.edges if edge.name == name]


def parts_of(geometry):
    """Bodies, and their sides."""
    shape = geometry.shape
    return (shape.solids, shape.faces) if shape.solids else (shape.faces, shape.edges)


def names_of(geometry):
    return {part.name for parts in parts_of(geometry) for part in parts}


def test_docstrings_list_the_regions_of_every_geometry():
    assert {make.__name__ for make, *_ in CASES + SOLIDS} == set(geometries.__all__)
    found = {}
    for make, options, _ in CASES + SOLIDS:
        found.setdefault(make, set()).update(names_of(make(**options)))
    for make, names in found.items():
        text = inspect.getdoc(make)
        assert names == set(re.findall(r"^``(\w+)`` ", text, flags=re.MULTILINE))
        assert "Lengths are in any consistent unit" in text


@pytest.mark.parametrize(("make", "options", "sizes"), CASES + SOLIDS)
def test_sizes_bodies_and_normals(make, options, sizes):
    """Areas or volumes of the drawing; normals of curved meshes point outwards, all around."""
    geometry = make(**options)
    solid = any(make is other for other, *_ in SOLIDS)
    bodies, _ = parts_of(geometry)
    assert [body.mass for body in bodies] == pytest.approx(sizes, rel=1e-9 if solid else 1e-12)
    mesh = mesh_of(geometry, *((0.5 * max(sizes) ** (1 / 3), 2) if solid else ()))
    assert {*mesh.GetMaterials(), *mesh.GetBoundaries()} == names_of(geometry)
    vertices = [
        {v.nr for element in mesh.Materials(name).Elements() for v in element.vertices}
        for name in mesh.GetMaterials()
    ]
    assert sum(map(len, vertices)) == mesh.nv  # no vertex is shared
    place = (ng.x, ng.y, ng.z)[: mesh.dim]
    through = ng.CF(place) * ng.specialcf.normal(mesh.dim)
    for _ in range(1 if solid else 2):
        # By the divergence theorem, of the same polynomials: round-off. Not curved again: 1e-4.
        inside = ng.Integrate(ng.CF(mesh.dim), mesh, order=8)
        assert ng.Integrate(through, mesh, ng.BND, order=8) == pytest.approx(inside, rel=1e-12)
        # Measured: at most 1.1 % of a solid lies between the curved elements and the surface.
        assert inside / mesh.dim == pytest.approx(sum(sizes), rel=0.03)
        if not solid:
            mesh.Refine()
            mesh.Curve(3)


@pytest.mark.parametrize(("make", "options", "sizes"), CASES + SOLIDS)
def test_sides_lie_where_their_names_say(make, options, sizes):
    geometry, middle = make(**options), {}
    _, sides = parts_of(geometry)
    for side in sides:
        middle.setdefault(side.name, []).append(side.center)
    up = "z" if geometry.shape.solids else "y"
    for low, high, axis in (("left", "right", "x"), ("bottom", "top", up)):
        for name in middle:
            other = middle.get(name.replace(low, high), []) if low in name else []
            assert all(getattr(a, axis) < getattr(b, axis) for a in middle[name] for b in other)


@pytest.mark.parametrize(
    ("f", "bound"),
    [
        (lambda x: 0.3 * x + 0.1, 1e-14),
        (parabola, 1e-14),  # a Bezier curve: round-off
        (lambda x: x**8 / 3, 1e-14),  # the highest degree recognised: measured 1e-15
        (ripple, 1e-10),  # measured 3.7e-11, order 6 in the spacing of the samples
        (lambda x: 1e-3 * abs(x) ** 1.5, 1e-7),  # measured 4.2e-8: curvature unbounded at 0
    ],
)
def test_graph_edge_follows_the_function_evenly_in_x(f, bound):
    (edge,) = edges_of(graphs(f, lambda x: -0.9), "upper_contact")
    points = [edge.Value(t) for t in np.linspace(*edge.parameter_interval, 2001)]
    assert max(abs(p.y - f(p.x)) for p in points) < bound
    assert np.abs([p.x for p in points] - np.linspace(-1, 1, 2001)).max() < 1e-14  # round-off


@pytest.mark.parametrize(
    ("geometry", "names"),
    [
        (ball_on_block(), {"ball_surface": 3, "block_top": 3}),
        (crossed_cylinders(), {"upper_surface": 4, "lower_surface": 4}),
        (crossed_cylinders(symmetric=False), {"upper_surface": 4, "lower_surface": 4}),
        (shells(), {"inner_contact": 3, "outer_contact": 3}),
        (ball_in_cup(), {"ball_surface": 3, "cup_surface": 3}),
        (ball_in_cup(symmetric=False), {"cup_surface": 1}),
    ],
)
def test_contact_is_on_one_face_without_a_seam(geometry, names):
    """As many edges as the drawing has, so none of them crosses the face."""
    for name, count in names.items():
        (face,) = (face for face in geometry.shape.faces if face.name == name)
        assert len(list(face.edges)) == count


@pytest.mark.parametrize("make", [ball_on_block, crossed_cylinders, ball_in_cup])
def test_both_bodies_have_a_vertex_where_they_touch(make):
    for solid in make().shape.solids:  # measured: 2.7e-15 after cuts of the kernel
        assert min(math.hypot(v.p.x, v.p.y, v.p.z) for v in solid.vertices) < 1e-14


@pytest.mark.parametrize(
    ("make", "options", "error", "message"),
    [
        (blocks, {"width": 1e-7}, ValueError, "use a smaller unit of length"),
        (blocks, {"line": ((0, 0),)}, ValueError, "at least two vertices"),
        (blocks, {"line": ((0, 0), 1)}, TypeError, "line[1] = 1: expected at least two"),
        (blocks, {"line": ((0, 0), (0, 1))}, ValueError, "line[1] = (0, 1) follows x = 0.0"),
        (blocks, {"line": ((0, 0), (1, 1))}, ValueError, "line[1] = (1.0, 1.0): expected y"),
        (rings, {"interface": 0.5}, ValueError, "interface = 0.5: expected more than inner"),
        (rings, {"interference": 0.5}, ValueError, "interference = 0.5: expected more than"),
        (graphs, {"upper": flat, "lower": lambda x: "a"}, TypeError, "lower(-1.0) = 'a'"),
        (graphs, {"upper": flat, "lower": flat, "a": 2}, ValueError, "b = 1.0: expected more"),
        (graphs, {"upper": parabola, "lower": flat, "height": 0.5}, ValueError, "upper: values"),
        (graphs, {"upper": abs, "lower": flat}, ValueError, "the edge misses the graph by 1.3e-03"),
        (cone_on_block, {"slope": 90}, ValueError, "slope = 90: expected degrees between 0 and 90"),
        (cone_on_block, {"height": 0.1}, ValueError, "expected more than that of the cone"),
        (rounded_punch, {"height": 0.1}, ValueError, "height = 0.1: expected more than rounding"),
        (sleeve_on_shaft, {"interference": -1}, ValueError, "outer = 1.6: expected more than ra"),
        (ring_in_groove, {"depth": 1.0}, ValueError, "depth = 1.0: expected less than 2 section"),
        (ring_in_groove, {"radius": 1.5}, ValueError, "radius = 1.5: expected more than half"),
        (punch, {"width": 0.5}, ValueError, "width = 0.5: expected more than half_width = 0.5"),
        (ball_on_block, {"radius": 1e-4}, ValueError, "use a smaller unit of length"),
        (shells, {"interface": 0.5}, ValueError, "interface = 0.5: expected more than inner"),
        (shells, {"interference": 0.5}, ValueError, "interference = 0.5: expected more than"),
        (ball_in_cup, {"depth": 1.02}, ValueError, "depth = 1.02: expected less than radius + "),
        (ball_in_cup, {"width": 0.9}, ValueError, "width = 0.9: expected more than radius of the"),
    ],
)
def test_bad_parameters_are_refused(make, options, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make(**options)


@pytest.mark.parametrize("name", geometries.__all__)
def test_every_parameter_is_checked(name):
    make = getattr(geometries, name)
    others = {"upper": flat, "lower": flat} if make is graphs else {}
    for parameter in inspect.signature(make).parameters:
        signed = parameter in ("a", "b", "interference")
        for value in (math.nan, "yes") if signed else (math.nan, "yes", 0):
            with pytest.raises((ValueError, TypeError), match=f"{parameter} = {value!r}"):
                make(**others | {parameter: value})
