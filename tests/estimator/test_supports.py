"""Loads and prescribed values that are finer than the mesh: never below the error."""

import math
from dataclasses import replace

import ngsolve as ng
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from drivers.reference.overkill import Overkill
from ngcontact import Elastic, Problem, adapt, solve
from tests.quadrature.test_loads import box, loaded

ROUGH = {
    "a strip of pressure": {"traction": {"top": 100 * box(ng.x, 0.533, 0.01)}},
    "waves of a support": {
        "displacement": {"bottom": (0, 0), "top": (0, -0.01 + 0.01 * ng.cos(120 * ng.x))}
    },
    "a dent of a support": {
        "displacement": {
            "bottom": (0, 0),
            "top": (0, -0.01 * ng.exp(-(((ng.x - 0.4) / 0.01) ** 2))),
        }
    },
}


# Effectivity on the last level. Measured 3.1 to 3.7, 4.2 to 4.9 and 2.9 to 9.3; 9.3 of the waves,
# where the mesh has just resolved them: the estimate still sees their second derivatives (87 % of
# its square), the error has fallen. 7.9 and 6.6 follow on the next two levels, and smooth data have
# 4.5 to 6.1.
LARGEST = {1: 5, 2: 7, 4: 10}


@pytest.mark.parametrize("order", LARGEST)
@pytest.mark.parametrize("name", ROUGH)
@pytest.mark.study(witness=["a dent of a support-1"])
def test_effectivity_of_rough_data(name, order):
    # Waves at order 2: .15 without a slope and without points that follow.
    problem = replace(loaded(), **ROUGH[name])
    *_, reference = adapt(problem, order=4, max_dofs=15_000)
    levels = list(adapt(problem, order=order, max_dofs=1500 * order))
    found = [
        s.relative_error_estimate / Overkill(reference).relative_error(s)
        for s in levels[:: max(1, len(levels) // 3)]
    ]
    assert min(found) >= 1
    assert found[-1] <= LARGEST[order]


def test_waves_between_the_vertices_of_a_support():
    # u_y = 1e-3 cos 64 pi x is 1e-3 at all vertices: on segments of 1 / 8 the miss is
    # w = 1e-3 (cos - 1), with the means of squares 1.5e-6 and 1e-6 (64 pi)^2 / 2 of w and w'.
    mesh = MakeStructured2DMesh(quads=False, nx=8, ny=8)
    waves = {"bottom": (0, 0), "top": (0, 1e-3 * ng.cos(2 * math.pi * 32 * ng.x))}
    law = {mesh.GetMaterials()[0]: Elastic(1.0, 0.3)}
    solution = solve(Problem(mesh, law, displacement=waves), order=1)
    part = solution.estimate_parts["displacement"].sum()
    expected = 1 / 1.3 * 1e-6 * math.sqrt(1.5 * (64 * math.pi) ** 2 / 2)
    assert part == pytest.approx(expected, rel=1e-3)
