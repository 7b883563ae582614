"""Nodes that lie at the same place on both curves."""

import math

import numpy as np
import pytest

from ngcontact.contact.search import coincident
from ngcontact.lagrange import gauss_lobatto, lagrange
from tests.contact.curves import at, graph, nodes_on, upward


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_coincident_nodes(order):
    curve = graph(lambda x: 0.3 * x, [0, 0.4, 1])
    normal = np.array([-0.3, 1.0]) / math.hypot(0.3, 1)
    nodes = np.einsum("ji,qid->qjd", lagrange(1, gauss_lobatto(order)), curve)
    nodes = np.unique(nodes.reshape(-1, 2), axis=0)
    lift = np.zeros(len(nodes))
    lift[::2] = 1e-11
    points = nodes + lift[:, None] * normal
    found = coincident(
        points, np.tile(-normal, (len(nodes), 1)), curve, upward(curve), nodes_on(curve, order)
    )
    np.testing.assert_allclose(at(curve, found), nodes, atol=1e-15)
    assert np.isin(found.s, gauss_lobatto(order)).all()
    # The gap is a subtraction of coordinates, not zero by decree.
    np.testing.assert_allclose(found.distance, lift, atol=5e-16)  # two ulp of the coordinates


def test_coincident_vertex_of_two_segments():
    """At a corner the row of each side has its partner on the segment that opposes it."""
    corner = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.0, -1.0]]])
    points = np.ones((2, 2)) * [1.0, 0.0]
    found = coincident(
        points, np.array([[0.0, -1.0], [-1.0, 0.0]]), corner, -np.ones(2), nodes_on(corner, 1)
    )
    assert found.segment.tolist() == [0, 1]
    assert found.s.tolist() == [1.0, 0.0]
    assert found.distance.tolist() == [0.0, 0.0]
