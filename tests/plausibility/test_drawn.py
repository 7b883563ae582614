"""Bodies drawn apart: that what is said of their pressures is so, and nothing of right scenes."""

import math

import numpy as np
import pytest
from netgen.occ import Axis, Z

from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.geometries import disc_on_disc, rings
from ngcontact.geometries.region import compound
from ngcontact.plausibility.pairs import PEAK_ERROR, way_and_error
from tests.plausibility.messages import only, quiet, told

APART, CONTRADICTED = "bodies are drawn", "the drawing has them"
MODULUS = 1 / (2 * (1 - 0.3**2))  # E* of two equal bodies, over E


def discs(way, pair=None, radii=(1.0, 1.0), unit=1.0, turn=0.0):
    """Halves of two discs, drawn that way apart, pressed by 0.002 along the common normal."""
    axis = Axis((0, 0, 0), Z)
    upper, lower = disc_on_disc(*(unit * radius for radius in radii)).shape.faces
    bodies = upper.Move((0, way * unit, 0)), lower
    c, s = math.cos(math.radians(turn)), math.sin(math.radians(turn))
    down = (way + 2e-3) * unit
    return Problem(
        geometry=compound(*(face.Rotate(axis, turn) for face in bodies)),
        materials={"upper|lower": Elastic(E=1 / unit, nu=0.3)},
        displacement={"bottom": (0, 0), "top": (down * s, -down * c)},
        sliding="axis",
        contact=[pair or Contact("upper_arc", "lower_arc")],
    )


def measured(problem, exact):
    """Error of the peak relative to the `exact` one, of a force; way and error that are told."""
    solutions = []
    messages = told(lambda: solutions.extend(adapt(problem, order=3, tolerance=1e-2)))
    [pair] = solutions[-1].pairs
    way, error = way_and_error(solutions[-1].discrete.space.trace, pair)
    assert any(APART in message for message in messages) == (error > PEAK_ERROR)
    peak = exact(2 * np.hypot(*solutions[-1].contact_force()))
    return solutions[-1].pressure.max() / peak - 1, way, error


@pytest.mark.parametrize("radii", [(1.0, 1.0), (1.0, 3.0), (3.0, 1.0)])
@pytest.mark.study(witness=["radii1"])
def test_peaks_are_wrong_by_what_is_said(radii):
    """By way / radius of the secondary, to first order; without the way to 0.1 %."""
    radius = 1 / (1 / radii[0] + 1 / radii[1])
    hertz = lambda force: np.sqrt(force * MODULUS / (np.pi * radius))  # noqa: E731
    wrong, way, error = measured(discs(0.04, radii=radii), hertz)
    assert way == pytest.approx(0.04, rel=0.05)  # and the round parts beside the lowest point
    assert error == pytest.approx(0.04 / radii[0], rel=0.06)
    assert wrong == pytest.approx(error, rel=0.1, abs=1e-3)


@pytest.mark.parametrize(
    "problem",
    [
        discs(0.0),
        discs(PEAK_ERROR / 2),
        discs(0.04, Contact("upper_arc", "lower_arc", direction=(0, -1))),
        discs(0.04, radii=(5.0, 1.0)),
        discs(0.04, Contact("lower_arc", "upper_arc"), radii=(1.0, 5.0)),
    ],
    ids=["touching", "near", "direction", "flatter", "flatter below"],
)
@pytest.mark.study(witness=["direction"])
def test_bodies_whose_normals_are_right_are_silent(problem):
    assert quiet(lambda: list(adapt(problem, order=2, tolerance=0.1)))


def pressed_ring(interference, gap=None):
    return Problem(
        geometry=rings(interference=interference, quarter=True),
        materials={"inner|outer": Elastic(E=1.0, nu=0.3)},
        sliding="inner_cut_x|inner_cut_y|outer_cut_x|outer_cut_y",
        traction={"hole": 0.1},
        contact=[Contact("inner_contact", "outer_contact", gap=gap)],
    )


@pytest.mark.parametrize(
    ("interference", "gap"), [(-0.01, -0.01), (-0.01, -0.015), (0.01, 0.01), (0.01, 0.002)]
)
def test_a_gap_of_the_other_sign_than_the_drawing_is_told(interference, gap):
    sides = ["apart", "into each other"]
    says, draws = sides if gap > 0 else sides[::-1]
    parts = (f"gap says that bodies are {abs(gap):.3g} {says}", f"0.01 {draws}")
    assert only(lambda: solve(pressed_ring(interference, gap), maxh=0.3, order=2), *parts)
