"""What cannot be bounded yet is refused by name."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import pytest

from drivers.reference import cases
from ngcontact import Elastic, adapt, solve
from tests.scenes import unmatched_blocks


@pytest.mark.parametrize(
    ("problem", "what"),
    [
        (cases.ring_in_ring().problem, 'curved elements, as at "'),
        (
            replace(
                cases.one_transition().problem,
                materials={"upper": Elastic(1 + ng.x * ng.x, 0.3), "lower": Elastic(1, 0.3)},
            ),
            'moduli that vary, as in body "upper"',
        ),
        (
            replace(cases.one_transition().problem, geometry=unmatched_blocks()),
            'dual rows, as on "upper_contact"',
        ),
    ],
)
def test_refused(problem, what):
    solution = solve(problem, maxh=0.5, order=2)
    with pytest.raises(ValueError, match=what):
        _ = solution.error_bound
    levels = adapt(problem, maxh=0.5, order=2, tolerance=1e-2, guaranteed=True)
    with pytest.raises(ValueError, match=what):
        next(levels)


def test_jumping_displacements_have_no_energy():
    case = cases.one_transition()
    problem = replace(
        case.problem, displacement={"top": (0, -0.1), "upper_left": (0, 0), "bottom": (0, 0)}
    )
    solution = solve(problem, maxh=0.5, order=2)
    with pytest.raises(ValueError, match=r'prescribed on "(top|upper_left)" differs at a vertex'):
        _ = solution.error_bound
