"""Solutions of which files and pictures are made."""

from functools import lru_cache

from ngcontact import Elastic, solve
from tests import scenes

PRESSURE = 0.1


@lru_cache
def disc(order=2):
    """Half of a disc, pressed on a block."""
    return solve(scenes.REFINED["disc on block"], maxh=0.4, order=order)


@lru_cache
def pressed_cube(order):
    """A column under uniform pressure: stress zz alone, as nu = 0; contact everywhere."""
    law = {"cube|block": Elastic(E=1.0, nu=0.0)}
    problem = scenes.pressed_cube(materials=law, traction={"cube_top": PRESSURE})
    return solve(problem, maxh=0.7, order=order)


@lru_cache
def pressed_ball():
    return solve(scenes.pressed_ball(0.1), maxh=0.4, order=2)
