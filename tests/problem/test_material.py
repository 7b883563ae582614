"""Hooke's laws: values against the textbook compliances, refusals with value and remedy."""

import math

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact.problem.material import VOIGT, Elastic, Hooke

# A few products and one inversion of numbers of size one: some units of round-off.
ROUND_OFF = 1e-13


@pytest.fixture(scope="module")
def mesh():
    return MakeStructured2DMesh(quads=False, nx=2, ny=2)


def matrix_of(law, model, mesh, at=(0.3, 0.2)):
    size = len(VOIGT[model])
    return np.array(law.voigt(model)(mesh(*at))).reshape(size, size)


PLANE = ("plane strain", "plane stress")


def orthotropic():
    """A plane-stress law with E1 = 10, E2 = 1, nu12 = 0.3, G = 0.4."""
    compliance = [[1 / 10, -0.3 / 10, 0], [-0.3 / 10, 1, 0], [0, 0, 1 / 0.4]]
    stiffness = np.linalg.inv(compliance)
    return (stiffness + stiffness.T) / 2


@pytest.mark.parametrize("nu", [-0.5, 0.0, 0.3, 0.4999])
@pytest.mark.parametrize("model", VOIGT)
def test_isotropic_law_inverts_the_compliance(mesh, model, nu):
    E = 7.0
    modulus, ratio = (E / (1 - nu**2), nu / (1 - nu)) if model == "plane strain" else (E, nu)
    size = len(VOIGT[model])
    shears = 3 if model == "solid" else 1
    normal = size - shears
    compliance = np.diag([1 + ratio] * normal + [2 * (1 + ratio)] * shears)
    compliance[:normal, :normal] -= ratio
    product = matrix_of(Elastic(E, nu), model, mesh) @ (compliance / modulus)
    # Round-off grows with the condition number, 1e4 at nu = 0.4999.
    assert np.abs(product - np.eye(size)).max() < ROUND_OFF / (1 - 2 * nu)


def test_hooke_is_used_as_it_is(mesh):
    given = orthotropic()
    law = Hooke(given.tolist())
    for model in PLANE:
        assert tuple(law.voigt(model).dims) == (3, 3)
        assert np.array_equal(matrix_of(law, model, mesh), given)
    varying = Hooke((1 + ng.x) * law.voigt("plane strain"))
    found = matrix_of(varying, "plane strain", mesh, at=(0.5, 0.5))
    assert np.abs(found - 1.5 * given).max() < ROUND_OFF * given.max()


@pytest.mark.parametrize(
    ("E", "nu", "error", "message"),
    [
        (-1, 0.3, ValueError, r"E = -1\.0: Young's modulus must be positive"),
        (math.nan, 0.3, ValueError, r"E = nan: give a finite number"),
        ("210e9", 0.3, TypeError, r"E = '210e9': give a real number"),
        (ng.CF((1, 2)), 0.3, ValueError, r"E is a CoefficientFunction of dim 2: give a scalar"),
        (ng.CF(1j), 0.3, TypeError, r"E is a complex CoefficientFunction: it must be real"),
        (1, math.nan, ValueError, r"nu = nan: give a finite number"),
        (1, -1, ValueError, r"nu = -1\.0: Poisson's ratio must lie in -1 < nu < 1/2"),
    ],
)
def test_elastic_refuses(E, nu, error, message):
    with pytest.raises(error, match=message):
        Elastic(E, nu)


@pytest.mark.parametrize(
    ("data", "error", "message"),
    [
        (np.eye(2), ValueError, r"shape \(2, 2\): a Voigt matrix has \(3, 3\)"),
        ([[1, 0], [0]], TypeError, r"C = .*: give a 3x3 matrix .* of real numbers"),
        (1j * np.eye(3), TypeError, r"give a 3x3 matrix .* of real numbers"),
        (np.diag([1, math.nan, 1]), ValueError, r"nan.*must be finite"),
        ([[2, 0, 0], [1e-9, 2, 0], [0, 0, 1]], ValueError, r"1e-09.*must be symmetric"),
        ([[1, 2, 0], [2, 1, 0], [0, 0, 1]], ValueError, r"2\.0.*must be positive definite"),
        (np.ones((3, 3)), ValueError, r"1\.0.*must be positive definite"),
        (np.diag([1, 1, -1]), ValueError, r"-1\.0.*must be positive definite"),
        (ng.CF((1, 2, 3)), ValueError, r"dims \(3,\): a Voigt matrix has \(3, 3\)"),
        (ng.CF((1j,) * 9, dims=(3, 3)), TypeError, r"complex.*must be real"),
    ],
)
def test_hooke_refuses(data, error, message):
    with pytest.raises(error, match=message):
        Hooke(data)


@pytest.mark.parametrize("model", PLANE)
def test_functions_of_zero_are_not_zero_in_forms(mesh, model):
    """NGSolve makes a zero of 0 x, and takes exp and cos of it for zero in bilinear forms."""
    one = ng.exp(0 * ng.x)

    space = ng.L2(mesh, order=0) ** 3
    u, v = map(ng.CF, space.TnT())
    matrices = []
    plain = Elastic(2.0, 0.3)
    whole = Hooke(plain.voigt(model) * one)
    for law in (plain, Elastic(2.0 * one, 0.3), Elastic(2.0, 0.3 * ng.cos(0 * ng.y)), whole):
        form = ng.BilinearForm(ng.InnerProduct(law.voigt(model) * u, v) * ng.dx).Assemble()
        matrices.append(form.mat.ToDense().NumPy())
    for matrix in matrices[1:]:
        np.testing.assert_allclose(matrix, matrices[0], rtol=1e-13, atol=1e-15)
