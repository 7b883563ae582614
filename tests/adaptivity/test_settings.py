"""Which order a level has."""

import pytest

from ngcontact.adaptivity import Refinement
from ngcontact.adaptivity.settings import best_order


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
