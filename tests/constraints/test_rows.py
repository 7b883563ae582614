"""Rows as arrays, and which node hosts a row."""

import numpy as np
import pytest

from ngcontact.constraints.basis_transformation import CONTRAST, change_of_basis
from ngcontact.constraints.rows import concatenated, no_rows
from tests.constraints.given import X, Y, clamped, conditions, rows, unit


def test_matrix_of_rows():
    contact = rows(4, (0, (0.6, 0.8), {2: 0.25, 3: 0.75}), (1, X, {}))
    B = contact.matrix
    expected = [
        [0.6, 0, -0.15, -0.45, 0.8, 0, -0.2, -0.6],
        [0, 1, 0, 0, 0, 0, 0, 0],
    ]
    np.testing.assert_allclose(B.toarray(), expected, atol=1e-16)
    assert B.nnz == 7  # nothing stored where the partner has no share
    assert rows(3).matrix.shape == (0, 6)


def test_rows_concatenated_and_selected_are_the_same():
    entries = (0, unit(0.1), {2: 1.0}), (1, unit(0.2), {}), (2, unit(0.3), {3: 0.25, 4: 0.75})
    whole = rows(5, *entries, g=[0.1, 0.2, 0.3])
    parts = [rows(5, entry, g=[gap]) for entry, gap in zip(entries, whole.g, strict=True)]
    joined = concatenated([no_rows(5), *parts])
    for one, other in (
        (joined, whole),
        (whole.select(np.array([2, 0])), concatenated(parts[::-2])),
    ):
        assert (one.matrix != other.matrix).nnz == 0
        np.testing.assert_array_equal(one.node, other.node)
        np.testing.assert_array_equal(one.g, other.g)
        np.testing.assert_array_equal(one.equality, other.equality)
    assert no_rows(5).matrix.shape == (0, 10)


def test_repeated_rows_have_the_number_of_the_first():
    d = unit(0.7)
    alike = (1, d, {3: 0.5, 4: 0.5}), (1, d + 1e-12, {3: 0.5, 4: 0.5}), (1, d, {3: 0.4, 4: 0.6})
    contact = rows(5, (0, d, {3: 1.0}), *alike, (2, d, {4: 1.0}))
    assert contact.repeated().tolist() == [0, 1, 1, 3, 4]


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
