"""Doerfler marking: the smallest set, ties, zeros, scales; which order a level has."""

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ngcontact.adaptivity import Refinement
from ngcontact.adaptivity.marking import doerfler
from ngcontact.adaptivity.planning import best_order

SHARES = st.floats(0.01, 1.0)
INDICATORS = st.lists(st.floats(0.0, 1.0, width=32), min_size=1, max_size=8).map(np.array)
ROUND_OFF = 1e-13  # of sums of a few numbers


def carries(indicators, marked, theta):
    return (indicators[marked] ** 2).sum() >= theta * (indicators**2).sum() * (1 - ROUND_OFF)


@given(INDICATORS, SHARES)
@settings(max_examples=200, deadline=None)
def test_no_smaller_set_carries_the_share(indicators, theta):
    marked = doerfler(indicators, theta)
    count = np.count_nonzero(marked)
    assert carries(indicators, marked, theta)
    # Brute force; a set that misses by round-off alone does not count.
    for smaller in combinations(range(len(indicators)), max(count - 1, 0)):
        if count:
            sum_of_squares = (indicators[list(smaller)] ** 2).sum()
            assert sum_of_squares < theta * (indicators**2).sum() * (1 + ROUND_OFF)


@pytest.mark.parametrize("scale", [1e-300, 1e-150, 1e-9, 1e9, 1e150, 1e300])
@pytest.mark.parametrize("theta", [0.1, 0.5, 0.9, 1.0])
def test_the_marks_do_not_depend_on_the_unit(scale, theta):
    indicators = np.random.default_rng(0).uniform(0.01, 1, 50) ** 3
    assert (doerfler(scale * indicators, theta) == doerfler(indicators, theta)).all()


@pytest.mark.parametrize(("theta", "count"), [(0.1, 1), (0.25, 2), (0.5, 4), (0.51, 5), (1.0, 8)])
def test_ties_are_marked_one_by_one(theta, count):
    marked = doerfler(np.full(8, 3.0), theta)
    assert np.count_nonzero(marked) == count
    assert marked[:count].all()  # the first ones, so that refinement is deterministic


@pytest.mark.parametrize("theta", [0.1, 0.5, 0.9])
def test_round_off_does_not_choose_among_equals(theta):
    """Parts of elements and mirror images differ by 1e-13 from one machine to another."""
    draw = np.random.default_rng(3)
    indicators = np.repeat(draw.uniform(0.01, 1, 20), 4)
    noisy = indicators * (1 + draw.uniform(-1e-13, 1e-13, 80))
    assert (doerfler(noisy, theta) == doerfler(indicators, theta)).all()


@pytest.mark.parametrize("theta", [0.3, 1.0])
@pytest.mark.parametrize("size", [0, 1, 5])
def test_nothing_is_marked_where_all_indicators_vanish(size, theta):
    marked = doerfler(np.zeros(size), theta)
    assert marked.shape == (size,)
    assert marked.dtype == bool
    assert not marked.any()


@pytest.mark.parametrize("order", [1, 2, 3])
def test_two_orders_need_equal_unknowns_where_the_best_one_changes(order):
    """Orders p on one mesh: errors c^p, unknowns ~ p^2; from there N ~ error^(-2/p)."""
    change = (order / (order + 1)) ** (order * (order + 1))
    assert best_order(1.001 * change) == order
    assert best_order(0.999 * change) == order + 1
    for c in (0.2, 0.6):  # whatever the mesh
        needed = [p**2 * (c**p / change) ** (2 / p) for p in (order, order + 1)]
        assert needed[0] == pytest.approx(needed[1], rel=1e-12)


def chosen(tolerance, start=None, element="isoparametric"):
    return Refinement(1, element, 0.5, tolerance, 1000).choosing(start)


def test_what_chooses_the_order():
    assert [chosen(t).order for t in (0.5, 0.05, 0.03, 1e-6)] == [3, 3, 4, 4]
    assert not chosen(0.05).rising
    assert chosen(None).order == 3
    assert chosen(None).rising
    assert chosen(1e-3, start=2).order == 2
    assert chosen(1e-3, element="physical").order == 1


def test_orders_rise_and_never_fall():
    rising = chosen(None)
    assert [rising.next_order(3, error) for error in (1.0, 0.04, 0.03)] == [3, 3, 4]
    assert rising.next_order(4, 1.0) == 4
    assert chosen(1e-3).next_order(4, 1.0) == 4
    assert chosen(0.05).next_order(3, 1e-9) == 3
