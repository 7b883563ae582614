"""Solids beside exact solutions: a column and a press fit, and Hertz's ellipses."""

import pytest

from drivers.solids import column, cup, ellipse, press_fit


@pytest.mark.parametrize("order", [1, 2])
def test_a_column_is_exact(order):
    for row in column(order, 1.0):
        assert abs(row.difference) < 1e-10


@pytest.mark.parametrize(("matched", "largest"), [(True, 1e-3), (False, 5e-4)])
def test_a_press_fit_of_order_3(matched, largest):
    """Measured: 1.8e-4 and 8.8e-5."""
    mean, _ = press_fit(3, 1.0, matched)
    assert abs(mean.difference) < largest
    assert mean.seconds > 0


@pytest.mark.study
def test_a_ball_in_its_cup():
    """Measured: 5.5e-4, 9.7e-3, 3.0e-3."""
    force, pressure, end = cup(2, 1.0)
    assert abs(force.difference) < 2e-3
    assert abs(pressure.difference) < 1.5e-2
    assert abs(end.difference) < 5e-3


@pytest.mark.parametrize(
    ("ratio", "exact"),
    [
        (2, (0.8037167, 0.5068203, 1.172153)),
        (4, (0.8824143, 0.3528660, 1.533413)),
        (10, (0.9765815, 0.2170448, 2.252597)),
    ],
)
def test_semi_axes_of_hertz(ratio, exact):
    """Of A = F = E* = 1: by elliptic integrals, to seven digits."""
    assert ellipse(1.0, ratio, 1.0, 1.0) == pytest.approx(exact, rel=4e-7)
