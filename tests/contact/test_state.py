"""Pressure on an axis and at corners, and ends of the contact zone: exact on model data."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from drivers.reference import axisymmetric_cases as cases_about_an_axis
from ngcontact import solve
from ngcontact.contact.line import ContactLine
from ngcontact.contact.state import ContactState, continued_to_axis
from ngcontact.fem import MODELS


class Points(SimpleNamespace):
    """The points of a contact line, and what these alone tell."""

    links, twins = ContactLine.links, ContactLine.twins


def line(x, order=1, y=None):
    """Contact points on a polygon through (x, y), `order` + 1 of them on each segment."""
    position = np.column_stack([x, np.zeros(len(x)) if y is None else y])
    first = np.arange(0, len(x) - 1, order)[:, None]
    return Points(position=position, rows=first + np.arange(order + 1), node=np.arange(len(x)))


def state_of(line, gap, active):
    """The state of a line after deformation."""
    return ContactState(line, gap, np.zeros(len(active)), active)


def opening(distance):
    """Gap distance^(3/2) outside of the contact zone, and where there is contact."""
    return np.maximum(distance, 0) ** 1.5, distance < 0


# gap^(2/3) is linear in the data, and so is every fit: exact up to the round-off of the fit.
EXACT = 1e-12


@pytest.mark.parametrize("order", [1, 2, 4])
@pytest.mark.parametrize("end", [0.31, 0.4999, 0.5001, 0.6])
def test_the_model_end_is_found_exactly(end, order):
    x = np.linspace(0, 1, 13) ** 1.3
    found = state_of(line(x, order), *opening(x - end)).transitions
    assert found.position == pytest.approx(np.array([[end, 0.0]]), abs=EXACT)
    [inner], [outer] = found.inner, found.outer
    assert x[inner] < end < x[outer]
    assert outer == inner + 1


def test_points_beyond_a_node_without_one_tell_of_no_end():
    """Their gaps are means over what faces of a long segment."""
    x = np.linspace(0, 1, 25)
    points, (gap, active) = line(x, 4), opening(x - 0.31)
    points.rows[3, 1:-1] = -1
    gap[16:] *= 3
    found = state_of(points, gap, active).transitions
    assert found.position == pytest.approx(np.array([[0.31, 0.0]]), abs=EXACT)


def test_two_zones_have_four_ends():
    x = np.linspace(0, 4, 161)
    # Contact in |x - 1| < 0.43 and |x - 3| < 0.43; between them each end has its half.
    found = state_of(line(x), *opening(np.abs(np.abs(x - 2) - 1) - 0.43)).transitions
    expected = [0.57, 1.43, 2.57, 3.43]
    assert np.sort(found.position[:, 0]) == pytest.approx(expected, abs=EXACT)


@pytest.mark.parametrize("zone", ["whole", "half", "on an axis"])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_the_end_of_an_unresolved_zone_is_told_by_its_force(order, zone):
    """Hertz's half-width, but not of a flat gap, nor in another segment, nor in a short one."""
    x = np.arange(-6 * order if zone == "whole" else 0, 6 * order + 1) / order
    curved, flat = (line(x, order) for _ in range(2))
    curved.gap, flat.gap = x**2 / 10, 0 * x
    curved.on_axis = flat.on_axis = (x == 0) & (zone == "on an axis")
    model = MODELS["axisymmetric" if zone == "on an axis" else "plane strain"]

    def expected(points, closed, a):
        """Ends, as they are and as expected, and points in contact; of half-width `a` by force."""
        active = np.abs(x) < closed
        whole = 4 * a**3 / 15 if zone == "on an axis" else np.pi * a**2 / 20
        force = active * (whole / active.sum() / (2 if zone == "half" else 1))
        state = ContactState(points, np.where(active, 0.0, 0.1 + np.abs(x) ** 1.5), force, active)
        found = state.expected(1.0, model)
        ends = (one.transitions.position[:, 0] for one in (state, found))
        return *ends, found.active

    _, ends, active = expected(curved, 0.1 / order, 0.4)
    assert np.abs(ends) == pytest.approx(0.4, rel=1e-12)  # the line is straight
    assert len(ends) == (2 if zone == "whole" else 1)
    assert np.array_equal(active, np.abs(x) <= 0.4)
    for asked in ((flat, 0.1 / order, 0.4), (curved, 0.1 / order, 4.0), (curved, 5.1, 5.5)):
        known, ends, active = expected(*asked)
        assert np.array_equal(ends, known)
        assert np.array_equal(active, np.abs(x) < asked[1])


def test_a_closed_line_has_no_first_point():
    count, end = 60, 0.733
    angle = np.linspace(0, 2 * math.pi, count, endpoint=False)
    ring = Points(
        position=np.column_stack([np.cos(angle), np.sin(angle)]),
        rows=np.column_stack([np.arange(count), np.roll(np.arange(count), -1)]),
        node=np.arange(count),
    )
    from_zero = np.abs((angle + math.pi) % (2 * math.pi) - math.pi)
    found = state_of(ring, *opening(from_zero - end)).transitions.position
    # Distances are chords, shorter than arcs by h^2 / 24 of them; the end is on a chord of
    # the circle, h^2 / 8 inside.
    h = 2 * math.pi / count
    expected = np.array([[math.cos(end), -math.sin(end)], [math.cos(end), math.sin(end)]])
    assert found[found[:, 1].argsort()] == pytest.approx(expected, abs=h**2 / 8)


def at_a_corner(x, corner, order=1):
    """Points on a line that turns at x[corner], which carries two of them: the right one last."""
    nodes = np.append(np.arange(len(x)), corner)
    rows = np.arange(0, len(x) - 1, order)[:, None] + np.arange(order + 1)
    rows[rows[:, 0] == corner, 0] = len(x)
    position = np.column_stack([x, -0.3 * np.maximum(x - x[corner], 0)])[nodes]
    return Points(position=position, rows=rows, node=nodes)


@pytest.mark.parametrize("order", [1, 2, 4])
def test_contact_that_ends_at_a_corner(order):
    # Active left of the corner and there on its left side, open on its right side.
    x, corner = np.linspace(0, 1, 13), 4
    lines = at_a_corner(x, corner, order)
    active = np.append(x < x[corner] + 1e-9, False)
    gap = np.where(active, 0.0, 1e-3 + lines.position[:, 0] - x[corner])
    for state, outer in ((active, corner + 1), (np.append(x > x[corner] + 1e-9, True), corner - 1)):
        found = state_of(lines, np.where(state, 0.0, gap + 1e-3), state).transitions
        assert found.position.tolist() == [[x[corner], 0.0]]
        # The warm start takes the way from `inner` to `outer` for the direction of the contact.
        assert found.outer.tolist() == [outer]
        assert lines.node[found.inner].tolist() == [corner]


def test_no_end_at_a_corner_inside_the_contact():
    x, corner = np.linspace(0, 1, 9), 4
    lines = at_a_corner(x, corner)
    active = np.ones(10, dtype=bool)
    for i in (corner, 9):  # the node has slid off one side of the corner
        one_side = active.copy()
        one_side[i] = False
        assert len(state_of(lines, ~one_side * 1e-6, one_side).transitions.position) == 0


# Two segments that meet at node 1, where the points 1 and 2 are.
BENT = Points(node=np.array([0, 1, 1, 2]), rows=np.array([[0, 1], [2, 3]]))


def mask(text):
    return np.array([c == "x" for c in text])


@pytest.mark.parametrize(
    ("active", "expected"),
    [
        ("xx.x", "xxxx"),  # slid off one side of the corner, inside the contact
        ("x.xx", "xxxx"),
        ("xx..", "xx.."),  # the contact ends at the corner
        ("..xx", "..xx"),
        ("x..x", "x..x"),  # the corner itself is apart
        ("xxxx", "xxxx"),
        ("....", "...."),
    ],
)
def test_a_point_that_touches_one_side_inside_the_contact(active, expected):
    given = mask(active)
    assert state_of(BENT, given, given).in_contact.tolist() == mask(expected).tolist()
    assert given.tolist() == mask(active).tolist()  # the argument stays


@pytest.mark.parametrize("order", [1, 2, 3])
def test_pressure_on_an_axis(order):
    """The even continuation at orders 1 and 2, exact for c0 + c1 r^2; force over weight above."""
    solution = solve(cases_about_an_axis.pressed_cylinders(), maxh=0.1, order=order)
    line, m = solution.pairs[0].line, len(solution.points)
    r = line.position[:, 0]
    axis = int(np.argmin(r))
    assert np.flatnonzero(line.on_axis).tolist() == [axis]
    even = 2 - 0.7 * r**2
    given = even + 0.1 * line.on_axis
    active = np.ones(m, dtype=bool)
    heavy = replace(line, weight=np.where(line.on_axis, 1e-12, line.weight))  # says nothing
    found = continued_to_axis(heavy, given, active)
    assert found[axis] == pytest.approx(2.0 if order < 3 else 2.1, abs=1e-9)
    assert np.array_equal(np.delete(found, axis), np.delete(given, axis))
    # Open points do not count, nor does a continuation from fewer than two.
    beyond = np.where(r > 0.75, 0.0, given)
    assert continued_to_axis(heavy, beyond, r < 0.75)[axis] == pytest.approx(found[axis])
    few = np.argsort(r)[:3]
    assert continued_to_axis(heavy, given, np.isin(np.arange(m), few))[axis] == given[axis]
    assert continued_to_axis(heavy, given, ~line.on_axis)[axis] == given[axis]
