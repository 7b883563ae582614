"""Bodies that nothing holds are told, also where the load does not drive them."""

from __future__ import annotations

import pytest

from geometries import blocks, rings
from ngcontact import Contact, ConvergenceError, Elastic, Problem, solve
from ngcontact.adapt import free_motion

STEEL = Elastic(E=1000.0, nu=0.3)
PRESS_FIT = Contact("outer_contact", "inner_contact")


def pressed_blocks(**held):
    return Problem(
        geometry=blocks(),
        materials={"upper|lower": STEEL},
        displacement={"bottom": (0, 0)},
        traction={"top": 1.0},
        contact=[Contact("upper_contact", "lower_contact")],
        **held,
    )


@pytest.mark.parametrize("order", [1, 2, 4])
def test_a_block_that_can_slide(order):
    """The pressure does not drive the sliding, and a factorisation does not notice it."""
    with pytest.raises(ConvergenceError, match=r'"upper" can move along \(1, 0\)') as failure:
        solve(pressed_blocks(), maxh=0.3, order=order)
    assert failure.value.iterate.u.size > 0
    held = solve(pressed_blocks(sliding="upper_left"), maxh=0.3, order=order)
    assert free_motion(held.discrete, held.active) is None


def test_a_ring_that_can_turn():
    fit = Problem(
        geometry=rings(interference=1e-3),
        materials={"inner|outer": STEEL},
        displacement={"hole": (0, 0)},
        contact=[PRESS_FIT],
    )
    with pytest.raises(ConvergenceError, match=r'"outer" can turn about \((-?0), (-?0)\)'):
        solve(fit, maxh=0.3, order=2)


def test_contact_holds_what_it_presses():
    """One active point of a guided block leaves its rotation free, two hold it."""
    solution = solve(pressed_blocks(sliding="upper_left"), maxh=0.3, order=1)
    active = solution.active.copy()
    active[:] = False
    assert free_motion(solution.discrete, active) is not None
    active[[0, 1]] = True
    assert free_motion(solution.discrete, active) is None


def test_the_quarter_of_a_press_fit_is_held():
    fit = Problem(
        geometry=rings(interference=1e-3, quarter=True),
        materials={"inner|outer": STEEL},
        sliding=".*_cut_.",
        contact=[PRESS_FIT],
    )
    assert solve(fit, maxh=0.3, order=2).active.all()
