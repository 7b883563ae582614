"""Models: one object for each name, and what it says of stresses and rigid motions."""

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact import Elastic, Hooke
from ngcontact.fem import MODELS
from ngcontact.geometries import blocks

ROUND_OFF = 1e-14  # of sums of a few numbers of size 1
TRANSLATIONS_AND_ROTATION = (ng.CF((1, 0)), ng.CF((0, 1)), ng.CF((-ng.y, ng.x)))


@pytest.fixture(scope="module")
def mesh():
    return ng.Mesh(blocks().GenerateMesh(maxh=1.0))


def size(function, mesh):
    return ng.Integrate(ng.InnerProduct(function, function), mesh) ** 0.5


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_rigid_motions_are_those_without_strain(mesh, model):
    u = ng.GridFunction(ng.VectorH1(mesh, order=1))
    without = []
    for motion in TRANSLATIONS_AND_ROTATION:
        u.Set(motion)
        without.append(size(model.strain(u), mesh) < ROUND_OFF * 100)  # gradients are over h
    assert tuple(without) == model.motions


@pytest.mark.parametrize(
    ("model", "law", "expected"),
    [
        ("plane strain", Elastic(E=2.0, nu=0.25), 0.25 * 7),
        ("plane strain", Hooke(np.diag([3.0, 3.0, 1.0])), 0.0),  # it does not say
        ("plane stress", Elastic(E=2.0, nu=0.25), 0.0),
    ],
)
def test_stress_out_of_the_plane(mesh, model, law, expected):
    stress = [ng.CF(3.0), ng.CF(4.0), ng.CF(1.0)]
    found = MODELS[model].out_of_plane({"upper|lower": law}, {}, mesh, stress)
    assert found(mesh(0.5, 0.5)) == pytest.approx(expected, abs=ROUND_OFF)


@pytest.fixture(scope="module")
def section():
    """Meridian section 0 < r < 1, 0 < z < 1."""
    return MakeStructured2DMesh(quads=False, nx=4, ny=4)


def test_strains_about_an_axis(section):
    """U = (r^2 + r z, z^2 - r): also on the axis, where the hoop strain is the radial one."""
    u = ng.GridFunction(ng.VectorH1(section, order=2))
    u.Set(ng.CF((ng.x**2 + ng.x * ng.y, ng.y**2 - ng.x)))
    model = MODELS["axisymmetric"]
    for r, z in ((0.0, 0.3), (0.0, 1.0), (0.3, 0.6), (1.0, 0.1)):
        expected = [2 * r + z, 2 * z, r + z, r - 1]
        assert model.strain(u)(section(r, z)) == pytest.approx(expected, abs=1e-13)
    assert ng.Integrate(model.volume(u), section) == pytest.approx(1.5 + 1 + 1)
    gradient = ng.InnerProduct(ng.Grad(u), ng.Grad(u)) + (ng.x + ng.y) ** 2
    assert size(model.gradients(u, u) - gradient, section) < 1e-12
