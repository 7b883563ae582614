"""Estimates that rise from level to level."""

from __future__ import annotations

import numpy as np
import pytest

from ngcontact import Contact, ContactWarning, Elastic, Problem, adapt
from ngcontact.geometries import blocks
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


@pytest.mark.study
def test_a_gap_rougher_than_every_mesh_is_told_once_with_its_place():
    """Its waves are 6e-5 long: finer meshes only see more of them."""
    problem = Problem(
        geometry=blocks(),
        materials={"upper|lower": Elastic(E=1.0, nu=0.3)},
        displacement={"top": (0, -0.01), "bottom": (0, 0)},
        contact=[
            Contact(
                "upper_contact",
                "lower_contact",
                gap=lambda x, y: -1e-4 * (1 + np.sin(1e5 * x)),
            )
        ],
    )
    with pytest.warns(ContactWarning) as caught:
        levels = list(adapt(problem, order=1, max_dofs=30_000))
    messages = [str(warning.message) for warning in caught]
    [message] = [message for message in messages if "refinement does not help" in message]
    assert len(levels) > 7  # it goes on after it was told, at the seventh
    y = float(message.split("near (")[1].split(")")[0].split(",")[1])
    assert abs(y) < 0.1  # at the contact line
    assert "a gap or a load" in message
