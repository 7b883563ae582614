"""Curved elements: when a mesh has to be curved; parents of vertices; exact boundary curves."""

import math
from functools import partial

import ngsolve as ng
import numpy as np
import pytest
from netgen.geom2d import SplineGeometry
from netgen.occ import Glue, OCCGeometry, WorkPlane
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact.geometries import blocks, disc
from ngcontact.mesh.cad import CadEdge, cad_edges
from ngcontact.mesh.curving import curve
from ngcontact.problem import MeshArrays
from tests.geometries.test_geometries import CASES


def mesh_of(geometry, maxh=0.5):
    return ng.Mesh(geometry.GenerateMesh(maxh=maxh))


def test_curve_copies_only_where_it_must():
    straight = mesh_of(blocks())
    assert curve(straight, 3, "isoparametric") == (straight, 0)
    no_cad = MakeStructured2DMesh(quads=False, nx=2, ny=2)
    assert curve(no_cad, 3, "isoparametric") == (no_cad, 0)
    mesh = mesh_of(disc())
    curved, count = curve(mesh, 2, "isoparametric")
    assert curved is not mesh
    assert (mesh.GetCurveOrder(), curved.GetCurveOrder()) == (1, 2)
    names = np.array(mesh.GetBoundaries())
    on_arc = names[MeshArrays(mesh).boundaries] == "arc"
    assert count == np.count_nonzero(on_arc) > 0
    assert curve(curved, 2, "isoparametric") == (curved, count)
    assert curve(curved, 1, "superparametric") == (curved, count)
    assert curve(curved, 1, "isoparametric")[0].GetCurveOrder() == 1
    assert curved.GetCurveOrder() == 2


@pytest.mark.parametrize("marked", [True, False])
@pytest.mark.parametrize("order", [2, 3])
def test_elements_that_refinement_straightened_are_curved_again(order, marked):
    """NGSolve's Refine keeps the curve order, and straightens all elements, marked or not."""
    mesh = mesh_of(disc())
    mesh.Curve(order)
    for element in mesh.Elements():
        mesh.SetRefinementFlag(element, marked)
    mesh.Refine()
    assert mesh.GetCurveOrder() == order
    again, _ = curve(mesh, order, "isoparametric")
    assert again is not mesh
    area = ng.Integrate(ng.CF(1), again, order=2 * order)
    flux = ng.CF((ng.x, ng.y)) * ng.specialcf.normal(2) / 2
    assert area == pytest.approx(ng.Integrate(flux, again, ng.BND, order=2 * order), rel=1e-13)
    assert area == pytest.approx(math.pi / 4, rel=1e-3)
    assert ng.Integrate(ng.CF(1), mesh, order=2 * order) != pytest.approx(area, rel=1e-3)


def test_a_refined_mesh_is_curved_again_also_without_cad():
    circle = SplineGeometry()
    circle.AddCircle((0, 0), 1)
    mesh = mesh_of(circle)
    mesh.Refine()
    mesh.Curve(3)
    curved, _ = curve(mesh, 3, "isoparametric")
    assert curved.nedge == (3 * mesh.ne + mesh.GetNE(ng.BND)) / 2 < mesh.nedge  # Euler
    assert ng.Integrate(ng.CF(1), curved, order=6) == pytest.approx(math.pi, rel=1e-4)


RNG = np.random.default_rng(3)
CENTRES = [(0.0, 0.0, 1.0), (0.3, 0.7, 0.1), (100.0, -50.0, 2.0)]


def circle(x=0.0, y=0.0, radius=1.0):
    """A whole circle, counterclockwise from its rightmost point."""
    [edge] = WorkPlane().Circle(x, y, radius).Face().edges
    return CadEdge(edge)


def angles(theta):
    return np.column_stack([np.cos(theta), np.sin(theta)])


@pytest.mark.parametrize(("x", "y", "radius"), CENTRES)
def test_circle_normals_are_radial_also_at_the_seam(x, y, radius):
    edge = circle(x, y, radius)
    assert edge.closed
    assert not edge.straight
    theta = np.concatenate([RNG.uniform(0, 2 * math.pi, 200), RNG.uniform(-0.05, 0.05, 200)])
    radial = angles(theta)
    scale = np.abs([x, y]).max() / radius + 1  # of round-off in the coordinates
    for r in (radius, 1.01 * radius, 0.97 * radius):
        points = [x, y] + r * radial
        np.testing.assert_allclose(edge.normal_at(edge.project(points)), radial, atol=1e-15 * scale)
        foot = edge.point(edge.project(points))
        np.testing.assert_allclose(foot, [x, y] + radius * radial, atol=1e-15 * scale * radius)


@pytest.mark.parametrize(("x", "y", "radius"), CENTRES)
def test_levels_of_a_circle_are_crossings_near_by(x, y, radius):
    edge = circle(x, y, radius)
    theta, side = RNG.uniform(0.3, 6, 200), RNG.uniform(-0.1, 0.1, 200)
    axes = angles(theta + math.pi / 2 + RNG.uniform(-1, 1, 200))  # not along the normal
    points, near = ([x, y] + radius * angles(t) for t in (theta, theta + side))
    values = (points * axes).sum(axis=1)
    scale = np.abs([x, y]).max() / radius + 1  # of round-off in the coordinates
    found = edge.point(edge.level(axes, values, 1.01 * (near - [x, y]) + [x, y]))
    np.testing.assert_allclose(found, points, rtol=0, atol=1e-14 * scale * radius)
    assert np.isnan(edge.level(np.array([0.6, 0.8]), values + 3 * scale * radius, near)).all()


def glued():
    """A square with a disc inside, one geometry with an inner boundary and a closed edge."""
    square = WorkPlane().Rectangle(2, 2).Face()
    disc = WorkPlane().MoveTo(1, 1).Circle(0.4).Face()
    square.edges.name, disc.edges.name = "side", "inner"
    square.faces.name, disc.faces.name = "square", "disc"
    return OCCGeometry(Glue([square - disc, disc]), dim=2)


def nameless():
    """Two bodies whose boundaries have no names, one with a hole."""
    ring = WorkPlane().Circle(3, 0, 1).Face() - WorkPlane().Circle(3, 0, 0.5).Face()
    return OCCGeometry(Glue([ring, WorkPlane().Rectangle(1, 1).Face()]), dim=2)


@pytest.mark.parametrize(
    "make", [glued, nameless, *(partial(make, **options) for make, options, _ in CASES)]
)
def test_segments_lie_on_the_edge_of_their_region(make):
    mesh = ng.Mesh(make().GenerateMesh(maxh=0.6))
    mesh.Refine()
    edges = cad_edges(mesh)
    assert edges is not None
    assert [edge.name or "default" for edge in edges] == [
        n or "default" for n in mesh.GetBoundaries()
    ]
    vertices = np.array(mesh.ngmesh.Coordinates())[:, :2]
    segments = mesh.ngmesh.Elements1D().NumPy()
    met = set()
    for region, edge in enumerate(edges):
        ends = segments["nodes"][segments["index"] == region + 1][:, :2].astype(int) - 1
        assert len(ends) > 0
        points = vertices[np.unique(ends)]
        foot = edge.point(edge.project(points))
        # Netgen stores coordinates of the curve itself; 1e-12 allows for OCC's own round-off.
        np.testing.assert_allclose(foot, points, atol=1e-12)
        met.add(region)
    assert len(met) == len(mesh.GetBoundaries())
