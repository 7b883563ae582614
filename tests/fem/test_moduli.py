"""Moduli of elements."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Elastic
from ngcontact.fem.moduli import contact_modulus, moduli_of
from ngcontact.mesh import first_mesh

BODIES = ("upper", "lower")


@pytest.fixture(scope="module")
def mesh():
    return first_mesh(cases.one_transition().problem, 0.7)


def made_of(law, model="plane strain"):
    problem = cases.one_transition().problem
    return replace(problem, materials=dict.fromkeys(BODIES, law), model=model)


@pytest.mark.parametrize("nu", [-0.9, 0.0, 0.3, 0.499, 0.499999])
def test_bulk_modulus_of_an_isotropic_law(mesh, nu):
    E = 2.5
    mu, lam = E / (2 * (1 + nu)), E * nu / ((1 + nu) * (1 - 2 * nu))
    # C holds lambda + 2 mu and lambda to round-off: mu is their difference.
    tolerance = 1e-15 * (2 + lam / mu) + 1e-12
    found = moduli_of(made_of(Elastic(E, nu)), mesh)
    assert found.bulk == pytest.approx(lam + mu, rel=tolerance)
    least = min(mu, lam + mu)  # eigenvalues of C on strains: 2 mu, 2 mu, 2 (lambda + mu)
    assert found.shear == pytest.approx(least, rel=tolerance)


@pytest.mark.parametrize("model", ["plane strain", "plane stress", "axisymmetric"])
def test_contact_modulus_of_two_equal_bodies_and_of_one(mesh, model):
    problem, side, none = made_of(Elastic(2.5, 0.3), model), np.arange(3), np.arange(0)
    modulus = 2.5 if model == "plane stress" else 2.5 / (1 - 0.3**2)
    moduli = moduli_of(problem, mesh)
    assert contact_modulus(problem, moduli, side, none) == pytest.approx(modulus, rel=1e-12)
    assert contact_modulus(problem, moduli, side, side) == pytest.approx(modulus / 2, rel=1e-12)
