"""Moduli that vary: the estimate depends on the law alone, and sees what the mesh does not."""

import math

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from ngcontact import Elastic, Hooke, Problem, solve

SQUARE = MakeStructured2DMesh(quads=False, nx=8, ny=8)
[BODY] = SQUARE.GetMaterials()


def pressed(law, mesh=SQUARE):
    return Problem(
        geometry=mesh,
        materials={BODY: law},
        displacement={"bottom": (0, 0)},
        traction={"top": (0.3, -1)},
    )


def as_function(law):
    return Hooke(ng.CF(tuple(np.array(law.C).ravel().tolist()), dims=(3, 3)))


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize(
    "C",
    [
        ((3.0, 1.0, 0.0), (1.0, 3.0, 0.0), (0.0, 0.0, 1e4)),
        ((3.0, 1.0, 0.0), (1.0, 3e4, 0.0), (0.0, 0.0, 1.0)),
        ((5.0, 2.0, 0.7), (2.0, 3.0, -0.4), (0.7, -0.4, 1.1)),
    ],
)
def test_a_law_as_numbers_and_as_functions_has_one_estimate(C, order):
    # The shear entry as modulus made it .0044 in place of .30 in the first case.
    numbers = solve(pressed(Hooke(C)), order=order)
    functions = solve(pressed(as_function(Hooke(C))), order=order)
    # The functions' projection has a degree more, and finds the same polynomial.
    assert functions.error_estimate == pytest.approx(numbers.error_estimate, rel=1e-6)


def layers(k, profile="page"):
    """E = 1 / (1 - .9 cos 2 pi k y) under a uniform pressure: sigma_yy = -1 whatever E is."""
    mesh = MakeStructured2DMesh(quads=False, nx=k, ny=k)
    wave = ng.cos(2 * math.pi * k * ng.y)
    E = {
        "page": 1 / (1 - 0.9 * wave),
        "exponential": ng.exp(2 * wave),
        "other length": 1 / (1 - 0.9 * ng.cos(5.3 * k * ng.y + 1)),
        "steep": 1.5 + ng.atan(5 * wave) * 0.8,
    }[profile]
    problem = Problem(
        geometry=mesh,
        materials={mesh.GetMaterials()[0]: Elastic(E, 0.0)},
        displacement={"bottom": (None, 0)},
        sliding="left",
        traction={"top": (0, -1)},
    )
    return problem, E


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("k", [4, 8])
@pytest.mark.study(witness=["4-1", "4-2", "8-1"])
def test_moduli_finer_than_the_mesh(k, order):
    # Effectivity without the oscillation: .74 at k = 4, .51 at k = 8. Measured 3.8 to 6.8.
    problem, E = layers(k)
    solution = solve(problem, order=order)
    s = solution.stress
    miss = (s[0, 0] ** 2 + (s[1, 1] + 1) ** 2 + 2 * s[0, 1] ** 2) / E
    error = math.sqrt(ng.Integrate(miss, solution.mesh, order=30))
    assert 1 <= solution.error_estimate / error <= 8


@pytest.mark.parametrize("order", [1, 2, 3])
def test_moduli_that_jump_along_edges(order):
    # The points of NGSolve's rule of order 2 lie on edges: at order 1 the estimate was a sum of
    # stresses of both sides, 5000 times the error at this contrast.
    mesh = MakeStructured2DMesh(quads=False, nx=5, ny=5)
    E = ng.IfPos(ng.y - 0.6, 1e4, 1.0)
    jumping = solve(pressed(Elastic(E, 0.3), mesh), order=order)
    per_element = ng.GridFunction(ng.L2(mesh, order=0))
    per_element.Set(E)  # at the middle of each element
    constant = solve(pressed(Elastic(per_element, 0.3), mesh), order=order)
    assert jumping.error_estimate == pytest.approx(constant.error_estimate, rel=1e-9)
