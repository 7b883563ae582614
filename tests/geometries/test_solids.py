"""Solids of the gallery: names, volumes, closed surfaces, faces without seams in contact."""

import math
import re

import ngsolve as ng
import numpy as np
import pytest

from ngcontact.geometries import (
    ball_in_cup,
    ball_on_block,
    crossed_cylinders,
    cube_on_block,
    shells,
)

PI = math.pi


def cap(radius, depth):
    return PI * depth**2 * (radius - depth / 3)


def shell(inner, outer):
    return PI / 6 * (outer**3 - inner**3)


# A geometry, its options, and the volumes of its bodies in their order.
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


@pytest.mark.parametrize(("make", "options", "volumes"), SOLIDS)
def test_volumes_bodies_and_normals(make, options, volumes):
    """Volumes of the drawing; the surface of each curved body is closed, its normals outward."""
    geometry = make(**options)
    assert [solid.mass for solid in geometry.shape.solids] == pytest.approx(volumes, rel=1e-9)
    size = max(volumes) ** (1 / 3)
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=0.5 * size))
    mesh.Curve(2)
    vertices = [
        {v.nr for element in mesh.Materials(name).Elements() for v in element.vertices}
        for name in mesh.GetMaterials()
    ]
    assert sum(map(len, vertices)) == mesh.nv  # no vertex is shared
    through = ng.CF((ng.x, ng.y, ng.z)) * ng.specialcf.normal(3)
    inside = ng.Integrate(ng.CF(3), mesh, order=8)
    # Both sides integrate the same polynomials.
    assert ng.Integrate(through, mesh, ng.BND, order=8) == pytest.approx(inside, rel=1e-12)
    # Measured: at most 1.1 % of the volume lies between the curved elements and the surface.
    assert inside / 3 == pytest.approx(sum(volumes), rel=0.03)


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


def test_the_cup_and_the_interference_have_the_radii_asked_for():
    mesh = ng.Mesh(ball_in_cup(clearance=0.1).GenerateMesh(maxh=0.4))
    at = [v.point for v in mesh.vertices]
    cup = {v.nr for e in mesh.Boundaries("cup_surface").Elements() for v in e.vertices}
    radii = [np.linalg.norm(np.subtract(at[k], (0, 0, 1.1))) for k in cup]
    assert radii == pytest.approx([1.1] * len(cup), rel=1e-12)
    mesh = ng.Mesh(shells(interference=-0.1).GenerateMesh(maxh=0.4))
    at = [v.point for v in mesh.vertices]
    bore = {v.nr for e in mesh.Boundaries("outer_contact").Elements() for v in e.vertices}
    assert [np.linalg.norm(at[k]) for k in bore] == pytest.approx([1.1] * len(bore), rel=1e-12)


@pytest.mark.parametrize(
    ("make", "options", "error", "message"),
    [
        (ball_on_block, {"radius": 0}, ValueError, "radius = 0: expected a positive"),
        (ball_on_block, {"radius": 1e-4}, ValueError, "use a smaller unit of length"),
        (ball_on_block, {"width": -1}, ValueError, "width = -1: expected a positive"),
        (ball_on_block, {"symmetric": 1}, TypeError, "symmetric = 1: expected True or False"),
        (crossed_cylinders, {"lower_radius": "1"}, TypeError, "lower_radius = '1': expected a"),
        (crossed_cylinders, {"length": 0}, ValueError, "length = 0: expected a positive"),
        (shells, {"interface": 0.5}, ValueError, "interface = 0.5: expected more than inner"),
        (shells, {"interference": 0.5}, ValueError, "interference = 0.5: expected more than"),
        (ball_in_cup, {"depth": 1.02}, ValueError, "depth = 1.02: expected less than radius + "),
        (ball_in_cup, {"width": 0.9}, ValueError, "width = 0.9: expected more than radius of the"),
        (cube_on_block, {"height": 0}, ValueError, "height = 0: expected a positive"),
    ],
)
def test_bad_parameters_are_refused(make, options, error, message):
    with pytest.raises(error, match=re.escape(message)):
        make(**options)
