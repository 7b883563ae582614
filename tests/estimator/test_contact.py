"""The pressure pi_h along a contact line, from the pressures of its points."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from ngcontact.estimator.contact import pressure_on_segments
from ngcontact.lagrange import gauss_lobatto


def line(rows, faces=True):
    """Contact points by their numbers at the nodes of each segment."""
    rows = np.array(rows)
    return SimpleNamespace(rows=rows, faces=np.full(len(rows), faces))


def test_values_are_those_of_the_points():
    pressure = np.array([1.0, 2.0, 4.0])
    values = pressure_on_segments(line([[0, 1], [1, 2]]), pressure, 1)
    assert values.tolist() == [[1, 2], [2, 4]]


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_a_node_without_a_point_continues_the_others(order):
    """At an end of Gamma_K on Gamma_u the row is dropped: degree order - 1 through the rest."""
    s = gauss_lobatto(order)
    exact = (s - 0.3) ** (order - 1)
    rows = [[-1, *range(order)]]
    values = pressure_on_segments(line(rows), exact[1:], order)
    assert values[0] == pytest.approx(exact, abs=1e-13)  # round-off of a fit of degree 3


def test_segments_that_do_not_face_the_primary_have_zeros_without_points():
    values = pressure_on_segments(line([[-1, 0]], faces=False), np.array([3.0]), 1)
    assert values.tolist() == [[0, 3]]
    nothing = pressure_on_segments(line([[-1, -1]]), np.zeros(0), 1)
    assert nothing.tolist() == [[0, 0]]
