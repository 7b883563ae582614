"""Curved elements: when a mesh has to be curved; parents of refined vertices."""

import math

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from drivers.reference import cases
from ngcontact.adaptivity import refined
from ngcontact.geometries import blocks, disc
from ngcontact.mesh.curving import copied, curve, vertex_parents
from ngcontact.mesh.generation import first_mesh
from ngcontact.problem import MeshArrays
from tests.scenes import coordinates, near_origin


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


@pytest.mark.parametrize("order", [2, 3])
def test_elements_that_refinement_straightened_are_curved_again(order):
    """NGSolve's Refine leaves the curve order as it was, and the elements straight."""
    mesh = mesh_of(disc())
    mesh.Curve(order)
    mesh.Refine()
    assert mesh.GetCurveOrder() == order
    again, _ = curve(mesh, order, "isoparametric")
    assert again is not mesh
    area = ng.Integrate(ng.CF(1), again, order=2 * order)
    flux = ng.CF((ng.x, ng.y)) * ng.specialcf.normal(2) / 2
    assert area == pytest.approx(ng.Integrate(flux, again, ng.BND, order=2 * order), rel=1e-13)
    assert area == pytest.approx(math.pi / 4, rel=1e-3)
    assert ng.Integrate(ng.CF(1), mesh, order=2 * order) != pytest.approx(area, rel=1e-3)


BLOCK = cases.partly_opening_block()  # straight, nodes matched


def check_midpoints(mesh, old):
    """Vertices after the first `old` ones lie in the middle of their parents."""
    family, xy = vertex_parents(mesh), coordinates(mesh)
    assert len(family) == mesh.nv
    assert (family[:old] == -1).all()
    new = np.arange(old, mesh.nv)
    assert (family[new] >= 0).all()
    assert (family[new] < new[:, None]).all()
    # Round-off of coordinates of size 2.
    np.testing.assert_allclose(xy[new], xy[family[new]].mean(axis=1), rtol=0, atol=1e-15)


@pytest.mark.parametrize("local", [False, True])
def test_vertices_lie_between_their_parents(local):
    mesh = first = first_mesh(BLOCK, 0.5)
    for _ in range(3):
        mesh = refined(BLOCK, mesh, near_origin(mesh) if local else None)
    check_midpoints(mesh, first.nv)
    np.testing.assert_array_equal(vertex_parents(first), np.full((first.nv, 2), -1))


def test_what_refinement_in_place_knows_is_kept():
    mesh = ng.Mesh(first_mesh(BLOCK, 0.5).ngmesh.Copy())
    old = mesh.nv
    mesh.Refine()
    mesh.Refine()
    copy = copied(mesh)
    check_midpoints(copy, old)
    copy.Refine()
    check_midpoints(copy, old)
    check_midpoints(refined(BLOCK, copy), old)
