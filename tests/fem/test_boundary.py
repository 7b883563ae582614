"""Boundary nodes: numbers, curves, normals, corner points, values at nodes."""

import math

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from drivers.reference.cases import LINE
from ngcontact.fem import boundary_trace
from ngcontact.geometries import blocks, disc_on_block, graphs, rings
from tests.mesh.test_curving import glued

ORDERS = [1, 2, 3, 4]


def meshed(geometry, order=1, maxh=0.5):
    mesh = ng.Mesh(geometry.GenerateMesh(maxh=maxh))
    mesh.Curve(order)
    return mesh


def refined_in_place(order):
    """A curved mesh after `Refine`, which leaves numbers of edges that no element has."""
    mesh = meshed(disc_on_block(), maxh=0.7)
    mesh.ngmesh.Elements2D().NumPy()["refine"] = np.arange(mesh.ne) % 3 == 0
    mesh.Refine()
    mesh.Refine()
    mesh.Curve(order)
    assert mesh.nedge > mesh.nv + mesh.ne - 2  # Euler's number of edges of two simple regions
    return mesh


def everywhere(trace, count=5):
    """Segments and parameters inside all of them."""
    s = np.random.default_rng(1).random(count * len(trace.region))
    return np.repeat(np.arange(len(trace.region)), count), s


MESHES = {
    "blocks": lambda order: meshed(blocks(line=LINE), order),
    "rings": lambda order: meshed(rings(), order),
    "graphs": lambda order: meshed(
        graphs(lambda x: 0.2 * math.sin(4 * x), lambda x: x**2 / 2 - 0.8), order
    ),
    "refined": refined_in_place,
    "glued": lambda order: meshed(glued(), order),
    "no CAD": lambda order: MakeStructured2DMesh(quads=False, nx=3, ny=2),
}
every_mesh = pytest.mark.parametrize("make", MESHES.values(), ids=list(MESHES))


@pytest.mark.parametrize("order", ORDERS)
@every_mesh
def test_nodal_basis_reproduces_node_values(make, order):
    trace = boundary_trace(make(order), order)
    basis = trace.nodal_basis(np.arange(len(trace.region)))
    values = np.random.default_rng(order).normal(size=trace.space.ndof)
    field = ng.GridFunction(trace.space)
    field.vec.FV().NumPy()[:] = basis @ values
    segment, s = trace.at_nodes(np.arange(len(trace.region)))
    found = trace.evaluate(field, segment, s)[:, 0]
    # Shape functions of order 4 and their inverse: factors of about 10.
    np.testing.assert_allclose(found, values[trace.nodes.ravel()], atol=1e-13)


@every_mesh
def test_points_derivatives_and_normals_agree_with_ngsolve(make):
    for order in ORDERS:
        trace = boundary_trace(make(order), 1)
        assert trace.geometry_order == trace.mesh.GetCurveOrder()
        segment, s = everywhere(trace)
        x = trace.evaluate(ng.CF((ng.x, ng.y)), segment, s)
        np.testing.assert_allclose(trace.point(segment, s), x, atol=1e-13)
        step = 1e-6
        near = np.clip(s, step, 1 - step)
        numeric = (trace.point(segment, near + step) - trace.point(segment, near - step)) / step / 2
        np.testing.assert_allclose(trace.derivative(segment, near), numeric, atol=1e-8)
        # Between two materials either normal is an outward one.
        outside = ~np.isin(segment, trace.segments("inner"))
        segment, s = segment[outside], s[outside]
        expected = trace.evaluate(ng.specialcf.normal(2), segment, s)
        np.testing.assert_allclose(trace.normal(segment, s), expected, atol=1e-12)
