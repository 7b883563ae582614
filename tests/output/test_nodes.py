"""Lagrange nodes of the elements, and what is evaluated there."""

import numpy as np
import pytest
from vtkmodules.vtkCommonDataModel import vtkHigherOrderTriangle

from ngcontact.fem import von_mises
from ngcontact.output.nodes import lattice, neighbour_tree


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


def test_neighbours_of_points_on_two_curves():
    """Links join the points of a curve in order, and both curves by their shortest distance."""
    x = np.linspace(0, 1, 6)
    points = np.concatenate([np.column_stack([x, 0 * x]), np.column_stack([x, 3 + 0 * x])])
    tree = neighbour_tree(points).tocoo()
    links = sorted(tuple(sorted(link)) for link in zip(tree.row, tree.col, strict=True))
    along = [(k, k + 1) for k in (*range(5), *range(6, 11))]
    assert [link for link in links if link in along] == along
    assert len(links) == len(along) + 1
