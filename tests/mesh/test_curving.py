"""Curved elements: their degree, and when a mesh has to be curved."""

import math

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact.geometries import blocks, disc
from ngcontact.mesh.curving import curve
from ngcontact.problem import Triangulation


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
    on_arc = names[Triangulation(mesh).boundaries] == "arc"
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
