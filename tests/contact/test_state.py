"""One value for each contact pair, cut from arrays over all of them."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.contact import by_line
from ngcontact.geometries import blocks


@pytest.fixture(scope="module")
def two_pairs():
    """Blocks that press on each other, the lower one on a rigid floor with a gap on the left."""
    steel = Elastic(E=1.0, nu=0.3)
    problem = Problem(
        geometry=blocks(),
        materials={"upper": steel, "lower": steel},
        displacement={"top": (0, -0.1)},
        sliding="lower_left|upper_left",
        contact=[
            Contact("upper_contact", "lower_contact"),
            Contact("bottom", direction=(0, -1), gap=0.02 * (ng.x - 1) ** 2),
        ],
    )
    return solve(problem, maxh=0.4, order=2)


def test_parts_are_those_of_the_lines(two_pairs):
    lines = two_pairs.discrete.lines
    numbers = np.arange(len(two_pairs.points))
    parts = by_line(lines, numbers)
    assert [len(part) for part in parts] == [len(line.node) for line in lines]
    assert np.concatenate(parts).tolist() == numbers.tolist()
    for number, part in enumerate(parts):
        assert (two_pairs.pair[part] == number).all()


def test_no_line_has_no_part():
    assert by_line([], np.zeros(0)) == []


def test_states_together_are_the_solution(two_pairs):
    assert [state.line.contact.secondary for state in two_pairs.pairs] == [
        "upper_contact",
        "bottom",
    ]
    for name in ("gap", "force", "pressure", "active"):
        together = np.concatenate([getattr(state, name) for state in two_pairs.pairs])
        np.testing.assert_array_equal(together, getattr(two_pairs, name))
    second = two_pairs.pairs[1]
    assert 0 < np.count_nonzero(second.active) < len(second.active)
    np.testing.assert_array_equal(second.transitions.position, two_pairs.transitions(1))
    # Divided and multiplied by the weight: the last bit.
    np.testing.assert_allclose(second.pressure * second.line.weight, second.force, rtol=4e-16)
