"""Forces of supports by boundary: at common nodes each has what it prescribes."""

import pytest

from ngcontact import Elastic, Problem, solve
from ngcontact.geometries.region import body, compound, polygon
from tests.solids.meshes import boxes

LAWS = {"a": Elastic(E=2.0, nu=0.3)}


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("guides", [True, False])
def test_three_faces_of_a_cube(order, guides):
    """Under pressure every guide bears its face, up to the edges; so do single components."""
    held = {"a_left": (0, None, None), "a_front": (None, 0, None), "a_bottom": (None, None, 0)}
    problem = Problem(
        geometry=boxes(("a", (0, 0, 0), (1, 2, 3), (2, 3, 2))),
        materials=LAWS,
        sliding="|".join(held) if guides else None,
        displacement={} if guides else held,
        traction={"a_right|a_back|a_top": 1.0},
    )
    found = solve(problem, order=order).reactions
    for name, expected in (("left", (6, 0, 0)), ("front", (0, 3, 0)), ("bottom", (0, 0, 2))):
        assert found[f"a_{name}"] == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("displacement", [{}, {"one": (None, 0)}])
def test_boundaries_that_prescribe_one_direction_share_it(order, displacement):
    """A bar rests on two lengths, .3 and .7 of its width, of which a third boundary is no part."""
    corners = [(0, 0), (0.3, 0), (1, 0), (1, 2), (0, 2)]
    outline = polygon(corners, ["one", "two", "right", "top", "left"])
    problem = Problem(
        geometry=compound(body("a", outline)),
        materials=LAWS,
        displacement=displacement,
        sliding="left|two" if displacement else "left|two|one",
        traction={"top": 1.0, "right": 2.0},
    )
    found = solve(problem, maxh=0.5, order=order).reactions
    for name, expected in (("one", (0, 0.3)), ("two", (0, 0.7)), ("left", (4, 0))):
        assert found[name] == pytest.approx(expected, abs=1e-11)
