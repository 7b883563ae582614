"""The pressure pi_h along a contact line, from the pressures of its points."""

from __future__ import annotations

import numpy as np
import pytest

from ngcontact.estimator.contact.tractions import pressure_on_segments
from ngcontact.lagrange import gauss_lobatto


@pytest.mark.parametrize("axis", [0, -1, 1])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_node_without_a_point_continues_the_others(order, axis):
    """At an end of Gamma_K on Gamma_u the row is dropped: degree order - 1 through the rest."""
    s = gauss_lobatto(order, axis)
    exact = (s - 0.3) ** (order - 1)
    known = np.concatenate([[np.nan], exact[1:]])
    values = pressure_on_segments(np.array([known, exact]), np.array([s, s]))
    assert values[0] == pytest.approx(exact, abs=1e-13)  # round-off of a fit of degree 3
    assert (values[1] == exact).all()


def test_segments_without_points_have_no_pressure():
    assert pressure_on_segments(np.full((1, 2), np.nan), np.array([[0.0, 1.0]])).tolist() == [
        [0, 0]
    ]
