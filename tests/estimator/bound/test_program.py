"""The dual problem of a block between a plate and a plane, whose solution is known by hand."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.estimator.bound import error_bound
from tests.estimator.bound.test_cells import square

E, GAP = 3.0, 0.01
ROUND_OFF = 1e-11


def block(top, **changes):
    """The unit square with nu = 0, moved by `top` along y, over a plane GAP below it."""
    data = {
        "geometry": square(2),
        "materials": {"body": Elastic(E, 0.0)},
        "displacement": {"top": (None, top)},
        "sliding": "left",
        "contact": [Contact("bottom", direction=(0, -1), gap=GAP)],
    }
    return Problem(**(data | changes))


def proof_of(problem, field, order=1):
    """A proof for a displacement in place of the solution, with the solution's active points."""
    solution = solve(problem, order=order)
    noise = 1e-8 * E**0.5 * GAP  # squares of it are round-off
    assert solution.error_bound <= noise
    u = ng.GridFunction(solution.displacement.space)
    u.Set(ng.CF(field), dual=True)
    return error_bound(problem, solution.discrete.space.trace, u, solution.pairs)


def pressure_of(proof):
    """Bernstein coefficients of p*, one line."""
    return proof.stress.pressure[0]


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("bottom", [0.0, -0.004, -GAP, -0.015])
def test_a_block_that_is_pressed(bottom, order):
    """By d = 0.03. With u_h = `bottom` below, |u - u_h|^2 = E gap^2 whatever its sign.

    Where contact is, w closes the gap on the lower row of triangles, of height 1/2; then the stress
    of u_h is in equilibrium.
    """
    d = 0.03
    gap = GAP + bottom
    proof = proof_of(block(-d), (0, bottom + (-d - bottom) * ng.y), order=order)
    np.testing.assert_allclose(pressure_of(proof), E * (d + bottom), rtol=ROUND_OFF)
    assert proof.parts["lifting"] == pytest.approx(2 * E * gap**2, rel=1e-9, abs=1e-20)
    assert proof.bound**2 == pytest.approx(2 * E * gap**2, rel=1e-9, abs=1e-15)
    # L(u) = E (d - GAP)^2 / 2, L(u_h) = E (d + bottom)^2 / 2.
    exact, have = E * (d - GAP) ** 2 / 2, E * (d + bottom) ** 2 / 2
    noise = 1e-12 * have
    assert have - proof.below - noise <= exact <= have + proof.above + noise
    assert proof.below + proof.above <= 1.5 * proof.bound**2 + noise


def test_a_block_that_does_not_reach_the_plane():
    """It hangs from the plate: no pressure, whatever u_h says."""
    proof = proof_of(block(-0.004), (0, -0.004 - 0.003 * (1 - ng.y)))
    assert np.abs(pressure_of(proof)).max(initial=0.0) <= ROUND_OFF * E * GAP
    assert proof.bound**2 == pytest.approx(E * 0.003**2, rel=1e-9)
    assert proof.parts["constitutive"] == pytest.approx(E * 0.003**2, rel=1e-9)


def test_a_load_on_a_block_that_only_contact_holds():
    """P* has its resultant, though u_h has none: p^2 / E, and w as above."""
    problem = block(0.0, displacement={}, traction={"top": (0, -0.06)}, sliding="left|right")
    proof = proof_of(problem, (0, -GAP / 2))
    np.testing.assert_allclose(pressure_of(proof), 0.06, rtol=1e-9)
    assert proof.parts["constitutive"] == pytest.approx(0.06**2 / E, rel=1e-9)
    assert proof.parts["lifting"] == pytest.approx(2 * E * (GAP / 2) ** 2, rel=1e-9)


def test_bilateral_rows_pull():
    """A block that is lifted off a plane to which it is glued."""
    pair = Contact("bottom", direction=(0, -1), gap=GAP, bilateral=True)
    problem = block(0.02, contact=[pair])
    proof = proof_of(problem, (0, -GAP + (0.02 + GAP) * ng.y))
    np.testing.assert_allclose(pressure_of(proof), -E * (0.02 + GAP), rtol=1e-9)
    assert proof.bound <= 1e-7 * E**0.5 * (0.02 + GAP)
