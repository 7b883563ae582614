"""One value for each contact pair, cut from arrays over all of them."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.reference import axisymmetric_cases as cases_about_an_axis
from ngcontact import solve
from ngcontact.contact.state import continued_to_axis


@pytest.mark.parametrize("order", [1, 2, 3])
def test_pressure_on_an_axis(order):
    """The even continuation at orders 1 and 2, exact for c0 + c1 r^2; force over weight above."""
    solution = solve(cases_about_an_axis.pressed_cylinders(), maxh=0.1, order=order)
    line, m = solution.pairs[0].line, len(solution.points)
    r = line.position[:, 0]
    axis = int(np.argmin(r))
    assert np.flatnonzero(line.on_axis).tolist() == [axis]
    even = 2 - 0.7 * r**2
    given = even + 0.1 * line.on_axis
    active = np.ones(m, dtype=bool)
    heavy = replace(line, weight=np.where(line.on_axis, 1e-12, line.weight))  # says nothing
    found = continued_to_axis(heavy, given, active)
    assert found[axis] == pytest.approx(2.0 if order < 3 else 2.1, abs=1e-9)
    assert np.array_equal(np.delete(found, axis), np.delete(given, axis))
    # Open points do not count, nor does a continuation from fewer than two.
    beyond = np.where(r > 0.75, 0.0, given)
    assert continued_to_axis(heavy, beyond, r < 0.75)[axis] == pytest.approx(found[axis])
    few = np.argsort(r)[:3]
    assert continued_to_axis(heavy, given, np.isin(np.arange(m), few))[axis] == given[axis]
    assert continued_to_axis(heavy, given, ~line.on_axis)[axis] == given[axis]
