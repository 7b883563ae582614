"""Squares that stay in the range of numbers."""

import numpy as np
import pytest

from ngcontact.arrays import power_of_two, root_of_squares


@pytest.mark.parametrize("size", [1e-300, 1e-170, 1.0, 1e170, 1e300])
def test_root_of_squares_that_are_out_of_range(size):
    assert root_of_squares(np.array([3.0, -4.0]) * size) == pytest.approx(5 * size, rel=1e-14)
    unit = power_of_two(np.array([0.0, -size]))
    assert unit <= size < 2 * unit
    assert np.frexp(unit)[0] == 0.5


def test_root_of_squares_of_nothing():
    assert root_of_squares(np.zeros(3)) == 0.0
    assert root_of_squares(np.zeros(0)) == 0.0
