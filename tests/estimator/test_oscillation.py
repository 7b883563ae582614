"""Moduli that vary: the estimate depends on the law alone, and sees what the mesh does not."""

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
