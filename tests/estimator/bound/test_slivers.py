"""Vertices of both bodies that all but face each other."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from drivers.reference import cases
from drivers.reference.straight import energy_error
from ngcontact import solve
from ngcontact.estimator.bound import error_bound
from tests.given_meshes import two_blocks


def shifted(by, order):
    case, x = cases.hertz_contact(half_width=0.3), np.linspace(-1, 1, 11)
    y = x + by * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 1, 0])
    solution = solve(replace(case.problem, geometry=two_blocks(y, x)), order=order)
    trace = solution.discrete.space.trace
    proof = error_bound(solution.problem, trace, solution.displacement, solution.pairs)
    return proof.bound / energy_error(solution, case.exact)[0]


@pytest.mark.parametrize("order", [1, 3])
def test_narrow_sides_cost_nothing(order):
    narrow, wide = shifted(3e-7, order), shifted(1e-2, order)
    assert 1 < narrow < 1.02 * wide  # measured: 1.001 and 1.003 times


def test_sides_that_are_not_opposite_are_refused():
    with pytest.raises(ValueError, match="face each other to within 5e-08 of a side"):
        shifted(1e-8, 1)
