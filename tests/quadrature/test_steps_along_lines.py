"""Jumps along lines are told from what is only steep."""

import numpy as np
import pytest

from ngcontact.quadrature.jumps import steps_along
from ngcontact.quadrature.lattice import lattice

START, END = 3.0, 6.0


def found(function, start=START, end=END, places=2048):
    """Jumps of a function seen at some places, as on boundaries, and at both ends."""
    inner = start + (end - start) * lattice(1, places)[:, 0]
    t = np.concatenate([[start], inner, [end]])
    return steps_along(function, t, function(t))


@pytest.mark.parametrize("place", [3.0, 5.0, 5.2, 5.25, 5.7071, 5.999999])
def test_jumps_are_found_where_they_are(place):
    at, size = found(lambda x: np.cos(x) + 1e-3 * (x > place))
    assert at == pytest.approx([place], abs=1e-12)
    assert size == pytest.approx([1e-3], rel=1e-9)


@pytest.mark.parametrize(
    "smooth",
    [
        np.zeros_like,
        np.cos,
        lambda x: np.abs(x - 5.3),
        lambda x: np.sqrt(np.maximum(x - 5.3, 0)),
        lambda x: np.maximum(x - 5.3, 0) ** 0.1,
        lambda x: np.arctan(1e6 * (x - 5.3)),
    ],
    ids=["zero", "smooth", "kink", "root", "tenth root", "steep"],
)
def test_what_is_continuous_does_not_jump(smooth):
    assert found(smooth)[0].size == 0


@pytest.mark.parametrize("length", [1.0, 3000.0])
@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_small_jumps_are_found_beside_large_changes(length, size):
    """Of 1e-3 beside a change of 1, which in 2048 parts bends by 1e-6 from one to the next."""
    place = 0.70710678 * length
    at, amount = found(lambda x: np.sin(3 * x / length) + size * (x > place), 0.0, length)
    assert at == pytest.approx([place], rel=1e-12)
    assert amount == pytest.approx([size], rel=1e-9)
