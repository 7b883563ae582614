"""Lagrange interpolation at Gauss-Lobatto points: nodes, weights, polynomial exactness."""

import numpy as np
import pytest

from ngcontact.lagrange import gauss, gauss_lobatto, lagrange, lagrange_derivative, zeros

ORDERS = [1, 2, 3, 4, 5]
S = np.linspace(0, 1, 23)


def weights(order):
    """Integrals of the Lagrange polynomials over [0, 1]."""
    s, w = gauss(order)
    return w @ lagrange(order, s)


@pytest.mark.parametrize("order", ORDERS)
def test_weights_integrate_polynomials_of_degree_2p_minus_1(order):
    nodes, w = gauss_lobatto(order), weights(order)
    assert nodes[[0, -1]].tolist() == [0, 1]  # with that exactness the only such points
    for degree in range(2 * order):
        assert w @ nodes**degree == pytest.approx(1 / (degree + 1), rel=1e-14)
    assert w @ nodes ** (2 * order) != pytest.approx(1 / (2 * order + 1), rel=1e-6)


@pytest.mark.parametrize("order", range(12))
def test_gauss_rule_is_exact_for_its_order(order):
    s, w = gauss(order)
    for degree in range(order + 1):
        assert w @ s**degree == pytest.approx(1 / (degree + 1), rel=1e-14)


@pytest.mark.parametrize("order", ORDERS)
def test_interpolation_reproduces_polynomials_of_its_degree(order):
    nodes = gauss_lobatto(order)
    for degree in range(order + 1):
        values = nodes**degree
        np.testing.assert_allclose(lagrange(order, S) @ values, S**degree, atol=2e-14)
        slope = degree * S ** max(degree - 1, 0)
        np.testing.assert_allclose(lagrange_derivative(order, S) @ values, slope, atol=2e-13)
    # ... and no more: the error of s^(p+1) is the node polynomial.
    error = S ** (order + 1) - lagrange(order, S) @ nodes ** (order + 1)
    expected = np.prod(S[:, None] - nodes, axis=1)
    np.testing.assert_allclose(error, expected, atol=2e-14)


@pytest.mark.parametrize("at_ends", [False, True])
@pytest.mark.parametrize("order", ORDERS)
def test_zeros_are_all_changes_of_sign(order, at_ends):
    """Of polynomials by their roots, inside, outside and at ends, a hundredth apart at least."""
    rng = np.random.default_rng(order)
    places = -0.49 + 0.04 * np.arange(50)  # 0 and 1 are none of them
    roots = np.array([rng.choice(places, order, replace=False) for _ in range(200)])
    if at_ends:
        roots[:, 0] = np.arange(200) % 2
    values = np.prod(gauss_lobatto(order)[:, None] - roots[:, None], axis=2)
    number, s = zeros(order, values)
    inside = (roots >= 0) & (roots <= 1)
    np.testing.assert_array_equal(np.bincount(number, minlength=200), inside.sum(axis=1))
    expected = np.sort(np.where(inside, roots, np.inf), axis=1)
    # Round-off of coefficients over the product of distances of roots, at least 1e-5 at degree 5.
    np.testing.assert_allclose(s, expected[np.isfinite(expected)], atol=1e-9)
    assert zeros(order, np.ones((3, order + 1)))[0].size == 0


@pytest.mark.parametrize("axis", [-1, 1])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_points_of_a_weight_that_vanishes_at_one_end(order, axis):
    """Positive weights at every order, exact for degree 2 order - 1, mirrored at the other end."""
    nodes = gauss_lobatto(order, axis)
    assert nodes == pytest.approx(1 - gauss_lobatto(order, -axis)[::-1], abs=1e-15)
    assert (lagrange(order, nodes, axis) == np.eye(order + 1)).all()
    s, w = gauss(3 * order + 1)
    weight = s if axis < 0 else 1 - s
    weights = (w * weight) @ lagrange(order, s, axis)
    assert (weights > 0).all()
    for degree in range(2 * order):
        expected = w @ (weight * s**degree)
        assert weights @ nodes**degree == pytest.approx(expected, abs=1e-15)
