"""What cannot be bounded yet is refused by name."""

from __future__ import annotations

from dataclasses import replace

import pytest

from drivers.reference import cases
from drivers.stress.scenes.drawing import scene_of
from drivers.stress.scenes.posing import answer
from ngcontact import ContactError, solve


def test_curves_that_meet_the_axis_are_refused():
    problem = replace(cases.disc_on_rigid_plane(), model="axisymmetric")
    solution = solve(problem, maxh=0.5, order=2)
    with pytest.raises(ValueError, match='curves that meet the axis, as "arc"'):
        _ = solution.error_bound


def test_jumping_displacements_have_no_energy():
    case = cases.one_transition()
    problem = replace(
        case.problem, displacement={"top": (0, -0.1), "upper_left": (0, 0), "bottom": (0, 0)}
    )
    solution = solve(problem, maxh=0.5, order=2)
    with pytest.raises(ValueError, match=r'prescribed on "(top|upper_left)" differs at a vertex'):
        _ = solution.error_bound


@pytest.mark.parametrize("seed", [333, 470])
def test_bodies_held_at_few_points_of_large_segments(seed):
    """Forces in vertices balance the load, polynomials of one sign have no resultants so near.

    On half the size they have. Of one of them unbalanced pressures were taken, and jumps of 6e-4.
    """
    scene = scene_of(seed)
    coarse, fine = (answer(replace(scene, maxh=h)).solution for h in (scene.maxh, scene.maxh / 2))
    with pytest.raises(ContactError, match="give a finer mesh where it is held"):
        _ = coarse.error_bound
    assert fine.error_bound <= 2 * fine.error_estimate
