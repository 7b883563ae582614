"""Lagrange nodes of the elements, and what is evaluated there."""

import numpy as np
import pytest
from vtkmodules.vtkCommonDataModel import vtkHigherOrderTriangle

from ngcontact.fem import von_mises
from ngcontact.output.nodes import lattice


@pytest.mark.parametrize("order", range(1, 7))
def test_node_order_is_that_of_vtk(order):
    expected = []
    for k in range((order + 1) * (order + 2) // 2):
        index = [0, 0, 0]
        vtkHigherOrderTriangle.BarycentricIndex(k, index, order)
        expected.append([index[2], index[0], index[1]])  # VTK counts from the third corner
    assert lattice(order).tolist() == expected


def test_von_mises_of_large_stresses():
    """Its squares would leave the range of numbers."""
    pull = np.array([[1.0, 0.0, 0.0, 0.0], [0.0, 0.0, 1.0, 0.0], [2.0, 2.0, 0.0, 2.0]])
    expected = [1.0, np.sqrt(3.0), 0.0]
    for size in (1.0, 1e-200, 1e200):
        assert von_mises(size * pull) / size == pytest.approx(expected, rel=1e-15)
