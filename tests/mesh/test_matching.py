"""Nodes on a part of a contact line, with one where the gap is least."""

import numpy as np
import pytest

from ngcontact.mesh.matching import narrowest, spaced

EXACT = 1e-12  # round-off of places; a parabola's vertex on the finer step is good to 1e-9
T = np.linspace(0.0, 1.0, 513)


def line(unit):
    """Points at the parameters of a line of length `unit`."""
    return unit * np.column_stack([T, np.zeros(len(T))])


def laid(gap, maxh, unit=1.0):
    """Places where that gap is extreme, and nodes."""
    x = line(unit)
    places = narrowest(T, x, x, maxh * unit, gap)
    return places, spaced(T, x, x, maxh * unit, places)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("least", [0.0, 1e-3, -1e-3])
@pytest.mark.parametrize("sense", [1, -1])
def test_a_node_lies_where_the_gap_is_least(sense, least, unit):
    """On a parabola to round-off, whose error next to the vertex is its square root."""
    places, nodes = laid(lambda t: sense * unit * (least + (t - 0.37) ** 2), 0.2, unit)
    assert len(places) == 1
    assert np.abs(nodes - 0.37).min() < 1e-8
    assert np.diff(nodes).max() <= 0.2 * (1 + EXACT)
    assert np.diff(nodes).min() > 0.1


@pytest.mark.parametrize(
    ("gap", "why"),
    [
        (lambda t: 0.1 + (t - 0.37) ** 2, "too wide for contact"),
        (lambda t: t - 0.37, "the curves cross"),
        (lambda t: np.full(len(t), 1e-3), "the same all along"),
        (lambda t: 1e-16 * np.sin(1e6 * t), "round-off"),
        (lambda t: 1e-3 + t**2, "least at the end"),
        (lambda t: np.where(np.abs(t - 0.37) < 0.1, np.nan, 1e-3 + t), "none opposite"),
        (lambda t: (t - 0.4) ** 2, "a node is there"),
    ],
)
def test_elsewhere_nodes_stay_as_they_are(gap, why):
    _, nodes = laid(gap, 0.2)
    _, even = laid(lambda t: np.ones(len(t)), 0.2)
    np.testing.assert_array_equal(nodes, even), why


def test_places_beside_ends_and_others_leave_no_slivers():
    """Closer than a tenth of a segment, which is 0.2 here."""
    x = line(1.0)
    nodes = spaced(T, x, x, 0.2, np.array([0.01, 0.37, 0.38, 0.6, 0.99]))
    assert np.diff(nodes).min() > 0.02
    assert np.abs(nodes[:, None] - [0.37, 0.6]).min(axis=0).max() < EXACT
