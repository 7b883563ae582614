"""Degrees to which elements are curved."""

from __future__ import annotations

from ngcontact.mesh.curving import geometry_order

ORDERS = [1, 2, 3, 4]


def test_geometry_order():
    assert [geometry_order(p, "isoparametric") for p in ORDERS] == ORDERS
    assert [geometry_order(p, "superparametric") for p in ORDERS] == [2, 3, 4, 5]
    assert geometry_order(1, "physical") == 2
