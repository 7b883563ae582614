"""Models: one object for each name, and what it says of stresses and rigid motions."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Elastic, Hooke
from ngcontact.fem import MODELS
from ngcontact.geometries import blocks
from ngcontact.problem import MODEL_NAMES

ROUND_OFF = 1e-14  # of sums of a few numbers of size 1
TRANSLATIONS_AND_ROTATION = (ng.CF((1, 0)), ng.CF((0, 1)), ng.CF((-ng.y, ng.x)))


@pytest.fixture(scope="module")
def mesh():
    return ng.Mesh(blocks().GenerateMesh(maxh=1.0))


def size(function, mesh):
    return ng.Integrate(ng.InnerProduct(function, function), mesh) ** 0.5


def test_every_model_has_an_object():
    assert tuple(MODELS) == MODEL_NAMES


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_rigid_motions_are_those_without_strain(mesh, model):
    u = ng.GridFunction(ng.VectorH1(mesh, order=1))
    without = []
    for motion in TRANSLATIONS_AND_ROTATION:
        u.Set(motion)
        without.append(size(model.strain(u), mesh) < ROUND_OFF * 100)  # gradients are over h
    assert tuple(without) == model.motions


@pytest.mark.parametrize("model", MODELS.values(), ids=MODELS)
def test_stress_in_the_plane_is_symmetric(mesh, model):
    found = model.in_plane([ng.CF(float(k)) for k in (1, 2, 3)])(mesh(0.5, 0.5))
    assert np.array_equal(np.reshape(found, (2, 2)), [[1, 3], [3, 2]])


@pytest.mark.parametrize(
    ("model", "law", "expected"),
    [
        ("plane strain", Elastic(E=2.0, nu=0.25), 0.25 * 7),
        ("plane strain", Hooke(np.diag([3.0, 3.0, 1.0])), 0.0),  # it does not say
        ("plane stress", Elastic(E=2.0, nu=0.25), 0.0),
    ],
)
def test_stress_out_of_the_plane(mesh, model, law, expected):
    stress = ng.CF((3, 1, 1, 4), dims=(2, 2))
    found = MODELS[model].out_of_plane({"upper|lower": law}, mesh, stress)
    assert found(mesh(0.5, 0.5)) == pytest.approx(expected, abs=ROUND_OFF)
