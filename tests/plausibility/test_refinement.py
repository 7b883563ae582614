"""Estimates that rise from level to level."""

import pytest

from ngcontact.plausibility import estimates_rise


@pytest.mark.parametrize(
    ("estimates", "rise"),
    [
        ([0.3, 0.2, 0.1, 0.12, 0.13, 0.18], True),
        ([0.3, 0.1, 0.14, 0.13, 0.16], True),
        ([0.1, 0.12, 0.13], True),  # two levels, of twice the unknowns each
        ([0.1, 0.13], False),  # one level
        ([0.8, 11.0, 8.0, 2.2], False),  # falls again
        ([1e-3, 1.01e-3, 1.02e-3, 1.03e-3], False),  # noise
        ([0.4, 0.2, 0.1, 0.05], False),
        ([0.5], False),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_rises_of_several_levels_are_found(estimates, rise, unit):
    assert estimates_rise([unit * estimate for estimate in estimates]) == rise
