"""What cannot be bounded is refused by name."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases, cases
from ngcontact import ContactError, ContactWarning, solve
from tests.given_meshes import two_blocks

REFUSED = {
    'curves that meet the axis, as "arc"': replace(
        cases.disc_on_rigid_plane(), model="axisymmetric"
    ),
    "loads that are no polynomials at the axis": replace(
        axisymmetric_cases.pressed_cylinders(),
        traction={},
        force={"upper|lower": (0, -ng.exp(3 * ng.x * ng.y))},
    ),
    "at a vertex require different displacements": replace(
        cases.one_transition().problem,
        displacement={"top": (0, -0.1), "upper_left": (0, 0), "bottom": (0, 0)},
    ),
}


@pytest.mark.parametrize("words", REFUSED)
def test_what_has_no_bound_is_named(words):
    with pytest.raises((ValueError, ContactError), match=words):
        _ = solve(REFUSED[words], maxh=0.5, order=2).error_bound


@pytest.mark.parametrize("place", [0.1, 0.25, 0.5])  # inside a segment, at a vertex or beside one
def test_displacements_that_jump_inside_a_boundary(place):
    step = ng.IfPos(ng.x - place, -0.01, 0.0)
    problem = replace(
        cases.one_transition().problem, displacement={"top": (0, step), "bottom": (0, 0)}
    )
    with pytest.warns(ContactWarning, match=r'"top" jumps by 0.01 along y at a point \('):
        solution = solve(problem, maxh=0.25, order=2)
    with pytest.raises(ValueError, match=rf'"top" jumps near \({place}, 1\)'):
        _ = solution.error_bound


@pytest.mark.parametrize(
    "steep",
    [
        lambda x: ng.atan(1e4 * (x - 0.1)),
        lambda x: ng.sqrt(ng.IfPos(x, x, 0)),
        lambda x: ng.IfPos(x, x, 0),
    ],
    ids=["steep", "root", "kink"],
)
def test_steep_displacements_are_none_that_jump(steep):
    law = cases.one_transition().problem
    problem = replace(law, displacement={"top": (0, -0.01 * steep(ng.x)), "bottom": (0, 0)})
    assert solve(problem, maxh=0.5, order=1).error_bound < np.inf


@pytest.mark.parametrize("angle", [0.0, 0.3])
@pytest.mark.parametrize("rows", ["nodal", "auto"])
def test_rows_where_nodes_do_not_face_nodes(rows, angle):
    """What nodal ones leave open is lifted, and costs more."""
    mesh = two_blocks(np.linspace(-1, 1, 6), np.linspace(-1, 1, 8), angle)
    pair = replace(cases.TOUCHING, rows=rows)
    down = {"bottom": (0, 0), "top": (0, -0.01)}
    problem = cases.touching_blocks(down, geometry=mesh, contact=[pair])
    assert solve(problem).relative_error_bound < 1


def test_only_an_axis_is_named_as_one(monkeypatch):
    monkeypatch.setattr("ngcontact.estimator.bound.bound.CURVED_RATIO", 0.0)
    with pytest.raises(ValueError, match="no polynomials where curves turn far"):
        _ = solve(cases.ring_in_bearing().problem, maxh=0.6, order=4).error_bound
