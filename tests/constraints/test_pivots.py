"""Which node hosts a contact row: the secondary's, the softer, one that is free."""

import numpy as np
import pytest

from ngcontact.constraints.basis_transformation import change_of_basis
from ngcontact.constraints.pivots import CONTRAST
from tests.constraints.given import Y, clamped, conditions, rows


def hosts(contact, given=None, stiffness=None):
    """Host node of each row, (m,)."""
    basis = change_of_basis(given or conditions(), contact, stiffness=stiffness)
    return (basis.unknown % contact.coupling.shape[1]).tolist()


def test_the_secondary_hosts_between_bodies_alike():
    contact = rows(3, (0, Y, {1: 0.4, 2: 0.6}))
    assert hosts(contact) == [0]
    assert hosts(contact, stiffness=np.array([0.9 * CONTRAST, 1.0, 1.0])) == [0]


@pytest.mark.parametrize("weights", [(0.4, 0.6), (1.1, -0.1), (0.0, 1.0)])
def test_the_nearest_node_of_a_much_softer_body_hosts(weights):
    contact = rows(4, (0, Y, dict(zip((1, 2), weights, strict=True))), (3, Y, {}))
    stiffness = np.array([1.1 * CONTRAST, 1.0, 1.0, 1.1 * CONTRAST])
    assert hosts(contact, stiffness=stiffness) == [1 + int(np.argmax(np.abs(weights))), 3]


def test_a_much_softer_node_that_is_held_does_not_host():
    contact = rows(3, (0, Y, {1: 0.4, 2: 0.6}))
    stiffness = np.array([1.1 * CONTRAST, 1.0, 1.0])
    assert hosts(contact, conditions(*clamped(2)), stiffness) == [0]
    assert hosts(contact, conditions(*clamped(0), *clamped(2)), stiffness) == [1]
