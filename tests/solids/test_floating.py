"""Solids that supports do not hold: six motions each, some of them held by contact."""

import netgen.occ as occ
import ngsolve as ng
import numpy as np
import pytest

from ngcontact import Contact, NoEquilibriumError, Problem, solve
from tests.solids.meshes import boxes, named
from tests.solids.test_patch import LAWS


def cube_on_block(counts=(2, 2), **conditions):
    mesh = boxes(
        ("upper", (-0.5, -0.5, 0), (0.5, 0.5, 1), (counts[0],) * 3),
        ("lower", (-1, -1, -1), (1, 1, 0), (2 * counts[1], 2 * counts[1], counts[1])),
    )
    given = {"displacement": {"lower_bottom": (0, 0, 0)}, "traction": {"upper_top": 1.0}}
    return Problem(
        geometry=mesh,
        materials=LAWS,
        contact=[Contact("upper_bottom", "lower_top", direction=(0, 0, -1))],
        **(given | conditions),
    )


@pytest.mark.parametrize("order", [1, 2, 3])
def test_cube_without_supports(order):
    solution = solve(cube_on_block(), order=order)
    assert np.abs(solution.contact_force() - [0, 0, 1]).max() < 1e-12
    words = [str(motion) for motion in solution.free_motions]
    assert len(words) == 3
    assert sum(word.startswith("translation") for word in words) == 2
    assert sum("rotation" in word and "along (0, 0, 1)" in word for word in words) == 1


def test_block_that_slides():
    """Both bodies float: six motions that nothing resists."""
    solution = solve(cube_on_block(displacement={"lower_bottom": (None, None, 0)}), order=2)
    assert len(solution.free_motions) == 6
    assert any('rotation of "upper"' in str(motion) for motion in solution.free_motions)
    assert "free: 6 rigid motions" in str(solution)


@pytest.mark.parametrize(
    ("pull", "words"),
    [
        ((0.1, 0, -1), r'translation of "upper" along \(1, 0, 0\)'),
        ((0, 0, 1), "translation"),
        (ng.CF((-0.1 * ng.y, 0.1 * ng.x, -1)), r"about the axis along \(0, 0, 1\)"),
    ],
)
def test_loads_that_nothing_resists(pull, words):
    with pytest.raises(NoEquilibriumError, match=words) as failure:
        solve(cube_on_block(traction={"upper_top": pull}), order=1)
    assert failure.value.body == "upper"


@pytest.mark.parametrize("order", [1, 2, 3])
def test_load_through_an_edge(order):
    """Its forces would be on a line, whose energy is infinite; just beside it they are spread."""
    load = ng.CF((0, 0, -(1 + 6 * ng.x)))  # the resultant 1 at x = 6 / 12, the edge of the cube
    with pytest.raises(NoEquilibriumError, match=r"an end of its zone, at \(0.5, "):
        solve(cube_on_block(traction={"upper_top": load}), order=order)
    load = ng.CF((0, 0, -(1 + 5.99 * ng.x)))
    solution = solve(cube_on_block(traction={"upper_top": load}), order=order)
    assert solution.force @ solution.points[:, 0] == pytest.approx(5.99 / 12, abs=1e-10)


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize(("angle", "x", "y"), [(20, 0.0, 0.0), (35.4, 0.17, -0.27)])
def test_facets_of_a_wide_secondary_face_in_part(order, angle, x, y):
    """Forces and moments balance, also of slivers; no point opens that pressure should hold.

    Measured: force 7e-12, moments 9e-12, area 7e-16. With mass matrices of all of phi on slivers
    the force was off by 5e-3, with a row wherever a point faces at all areas were by 5e-2.
    """
    block = named("lower", occ.Box((-1, -1, -1), (1, 1, 0)))
    cube = named("upper", occ.Box((-0.5, -0.5, 0), (0.5, 0.5, 1)))
    cube = cube.Rotate(occ.Axis((0, 0, 0), occ.Z), angle).Move((x, y, 0))
    problem = Problem(
        geometry=occ.OCCGeometry(occ.Compound([block, cube])),
        materials=LAWS,
        displacement={"lower_bottom": (0, 0, 0)},
        traction={"upper_top": ng.CF((0, 0, -1 - 0.45 * (ng.x - x)))},
        contact=[Contact("lower_top", "upper_bottom", direction=(0, 0, 1))],
    )
    solution = solve(problem, maxh=0.5, order=order)
    force, points = solution.force, solution.points
    assert force.sum() == pytest.approx(1.0, rel=1e-10)
    assert force @ (points[:, 0] - x) == pytest.approx(0.45 / 12, rel=1e-9)
    assert force @ (points[:, 1] - y) == pytest.approx(0.0, abs=1e-9 * 0.45 / 12)
    assert solution.contact_area() == pytest.approx(1.0, rel=1e-12)
    assert solution.steps == [0]
