"""Bodies of revolution of the gallery: names, volumes, orientation, contact that is found."""

import pytest

from ngcontact import Contact, Elastic, Problem, solve
from ngcontact.geometries import (
    ball_in_socket,
    cone_on_block,
    ring_in_groove,
    rounded_punch,
    sleeve_on_shaft,
)

SOFT = Elastic(E=1.0, nu=0.3)


@pytest.mark.parametrize(
    ("make", "changes", "message"),
    [
        (ball_in_socket, {"clearance": 0}, "clearance = 0: expected a positive length"),
        (cone_on_block, {"slope": 90}, "slope = 90: expected degrees between 0 and 90"),
        (cone_on_block, {"height": 0.1}, "height = 0.1: expected more than that of the cone"),
        (rounded_punch, {"height": 0.1}, "height = 0.1: expected more than rounding"),
        (sleeve_on_shaft, {"interference": -1}, "outer = 1.6: expected more than radius - int"),
        (ring_in_groove, {"depth": 1.0}, "depth = 1.0: expected less than 2 section = 1.0"),
        (ring_in_groove, {"radius": 1.5}, "radius = 1.5: expected more than half the groove"),
    ],
)
def test_what_is_refused(make, changes, message):
    with pytest.raises(ValueError, match=message):
        make(**changes)


def test_a_pressed_on_sleeve_presses_all_along():
    """Lame's pressure in the middle of a long sleeve on a long shaft, more at its ends."""
    problem = Problem(
        geometry=sleeve_on_shaft(interference=0.001, length=4.0),
        materials={"shaft": SOFT, "sleeve": SOFT},
        displacement={"shaft_ends": (None, 0)},
        contact=[Contact("sleeve_contact", "shaft_contact")],
        model="axisymmetric",
    )
    solution = solve(problem, maxh=0.2, order=2)
    assert solution.active.all()
    middle = abs(solution.points[:, 1]) < 0.3
    expected = 0.001 * SOFT.E / 2 * (1 - 1 / 1.6**2)  # one material, solid shaft, plane stress
    assert solution.pressure[middle] == pytest.approx(expected, rel=0.06)
    ends = abs(solution.points[:, 1]) > 1.99
    assert (solution.pressure[ends] > 1.2 * expected).all()
