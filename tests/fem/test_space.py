"""The spaces V_h against independent assemblies, and linear fields."""

import math

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Elastic, Problem
from ngcontact.fem import boundary_trace
from ngcontact.fem.space import assemble
from ngcontact.geometries import disc, graphs, rings
from ngcontact.mesh import curve, first_mesh
from tests.mesh.test_curving import mesh_of

ORDERS = [1, 2, 3, 4]
STEEL = Elastic(E=2.0, nu=0.3)
GRADIENT = np.array([[0.3, -1.1], [0.4, 0.7]])
LINEAR = ng.CF((0.3 * ng.x - 1.1 * ng.y + 0.2, 0.4 * ng.x + 0.7 * ng.y - 0.5))
STRAIN = np.array([0.3, 0.7, -0.7])


def space_of(mesh, element="physical", order=1, **data):
    """Space of a problem with one law for all bodies unless `materials` says otherwise."""
    data = {"materials": dict.fromkeys(mesh.GetMaterials(), STEEL), **data}
    mesh, _ = curve(mesh, order, element)
    return assemble(Problem(geometry=mesh, **data), boundary_trace(mesh, order), element)


CURVED = {
    "disc": lambda: mesh_of(disc(symmetric=False)),
    "rings": lambda: mesh_of(rings(quarter=True), maxh=0.4),
    "graphs": lambda: mesh_of(graphs(lambda x: 0.2 * math.sin(4 * x), lambda x: x**2 / 2 - 0.8)),
    # Corner elements have two curved sides.
    "coarse": lambda: mesh_of(disc(), maxh=2.0),
}
every_curved = pytest.mark.parametrize("make", CURVED.values(), ids=list(CURVED))


def field(space, values):
    """Function of V_h with these node values."""
    u = ng.GridFunction(space.V)
    u.vec.FV().NumPy()[:] = space.basis @ values
    return u


def strains(u, mesh):
    """Voigt strain (k, 3) inside all elements."""
    rule = ng.IntegrationRule([(0.2, 0.3), (0.6, 0.1), (0.1, 0.85)], [1, 1, 1])
    grad = ng.Grad(u)
    e = ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))
    return np.asarray(e(mesh.MapToAllElements(rule, ng.VOL))).reshape(-1, 3)


@every_curved
def test_physical_element_reproduces_linear_fields(make):
    space = space_of(make())
    mesh = space.trace.mesh
    assert mesh.GetCurveOrder() == 2
    xy = np.array(mesh.ngmesh.Coordinates())[:, :2]
    values = xy @ GRADIENT.T + [0.2, -0.5]
    u = field(space, values.T.ravel())
    np.testing.assert_allclose(strains(u, mesh), np.tile(STRAIN, (3 * mesh.ne, 1)), atol=1e-13)
    assert math.sqrt(ng.Integrate(ng.InnerProduct(u - LINEAR, u - LINEAR), mesh)) < 1e-14


@pytest.mark.parametrize(
    ("element", "order"),
    [("physical", 1), *(("isoparametric", order) for order in ORDERS), ("superparametric", 2)],
)
@every_curved
def test_stiffness_and_loads_of_any_function_are_integrals(make, element, order):
    """Of a law that varies, a body force and a traction; linear fields are in isoparametric V_h."""
    mesh, F, P = make(), ng.CF((0.7, -0.4)), ng.CF((-0.2, 0.5))
    E = 2 + 0.3 * ng.x - 0.2 * ng.y + 0.1 * ng.x * ng.y
    bodies = mesh.GetMaterials()
    laws = dict.fromkeys(bodies, Elastic(E, 0.3))
    data = {"force": dict.fromkeys(bodies, F), "traction": {".*": P}}
    space = space_of(mesh, element, order, materials=laws, **data)
    mesh, u = space.trace.mesh, ng.GridFunction(space.V)
    assert mesh.GetCurveOrder() == order + (element != "isoparametric")
    if element == "isoparametric":
        u.Set(LINEAR)
        # Gradients of the solution of a projection: its condition grows with the order.
        expected = np.tile(STRAIN, (3 * mesh.ne, 1))
        np.testing.assert_allclose(strains(u, mesh), expected, atol=1e-11)
    u = field(space, np.random.default_rng(order).normal(size=space.basis.shape[1]))
    grad, v = ng.Grad(u), u.vec.FV().NumPy()
    e = ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))
    lam, mu = 0.3 / (1.3 * 0.4), 1 / 2.6
    density = lam * (e[0] + e[1]) ** 2 + 2 * mu * (e[0] ** 2 + e[1] ** 2 + e[2] ** 2 / 2)
    energy = ng.Integrate(E * density, mesh, order=20)
    # Gradients of mapped polynomials are rational: the rule has an error, measured up to 6e-5.
    assert space.energy(v) == pytest.approx(energy, rel=2e-4)
    work = ng.Integrate(F * u, mesh, order=12) + ng.Integrate(P * u, mesh, ng.BND, order=20)
    assert v @ space.f == pytest.approx(work, rel=1e-7)


def test_only_elements_with_curved_sides_are_curved():
    mesh, _ = curve(first_mesh(cases.ring_in_ring().problem, 0.3), 2, "isoparametric")
    trace = boundary_trace(mesh, 2)
    segments = trace.segments("rim|hole|inner_contact|outer_contact")
    expected = np.zeros(mesh.ne, dtype=bool)
    expected[trace.element[segments]] = True
    assert (trace.curved_elements == expected).all()
    assert expected.sum() < mesh.ne
    straight = boundary_trace(first_mesh(cases.one_transition().problem, 0.3), 2)
    assert not straight.curved_elements.any()
