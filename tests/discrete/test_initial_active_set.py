"""First active sets, bodies of very different stiffness, and rows as unknowns of whole zones."""

from dataclasses import replace

import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, ConvergenceError, Elastic, Problem, solve
from ngcontact.contact import ContactState
from ngcontact.discrete import carried_active_set, discretise, first_active_set
from ngcontact.geometries import punch
from ngcontact.mesh import curve, first_mesh


def prepared(problem, maxh, order):
    mesh, _ = curve(first_mesh(problem, maxh), order, "isoparametric")
    return discretise(problem, mesh, order, "isoparametric")


def test_points_that_touch_start_active():
    problem = cases.pressed_disc()
    discrete = prepared(problem, 0.4, 2)
    [line] = discrete.lines
    touching = np.linalg.norm(line.position, axis=1) < 1e-9  # the disc touches the origin
    np.testing.assert_array_equal(first_active_set(discrete), touching)


def test_a_new_point_between_two_is_active_if_one_of_them_is():
    [coarse] = prepared(cases.one_transition().problem, 0.5, 1).lines
    at = np.argsort(coarse.position[:, 0])
    active = np.zeros(len(at), dtype=bool)
    active[at[0]] = True
    middle = coarse.position[at[:2]].mean(axis=0)
    new = replace(
        coarse, node=coarse.node[:1], position=middle[None], direction=coarse.direction[:1]
    )
    none = np.zeros(len(at))  # gaps and forces
    old = ContactState(coarse, none, none, active)
    assert carried_active_set([new], [old]).tolist() == [True]


def test_points_around_a_transition_are_told_by_their_side_of_it():
    """It is located inside elements: finer than the nodes of the mesh it comes from."""
    problem = cases.one_transition().problem
    coarse = solve(problem, maxh=0.4, order=3)
    [end] = coarse.transitions()
    [line] = prepared(problem, 0.1, 3).lines
    carried = carried_active_set([line], coarse.pairs)
    np.testing.assert_array_equal(carried, line.position[:, 0] < end[0])


PAIR = ("punch_contact", "foundation_contact")


def pressed(contrast: float, pair: tuple[str, str] = PAIR, **loads: object) -> Problem:
    """Flat punch, `contrast` times stiffer than its foundation."""
    problem = replace(cases.flat_punch(), geometry=punch(width=20.0, depth=20.0), **loads)
    materials = {**problem.materials, "punch": Elastic(E=contrast, nu=0.3)}
    return replace(problem, materials=materials, contact=[Contact(*pair)])


@pytest.mark.parametrize("pair", [PAIR, PAIR[::-1]])
@pytest.mark.parametrize("contrast", [1e8, 1e10, 1e12, 1e14])
def test_the_force_on_a_stiff_punch_is_that_on_a_rigid_one(
    contrast: float, pair: tuple[str, str]
) -> None:
    rigid = solve(pressed(1e7), maxh=2.0, order=2)
    stiff = solve(pressed(contrast, pair), maxh=2.0, order=2)
    force, expected = abs(stiff.contact_force()[1]), abs(rigid.contact_force()[1])
    # The punch of the comparison gives way by 1e-7 of the foundation.
    assert force == pytest.approx(expected, rel=1e-6)
    pressure, same = (s.pressure[np.argsort(s.points[:, 0])] for s in (stiff, rigid))
    # Likewise; measured 1.6e-7.
    np.testing.assert_allclose(pressure, same, rtol=1e-6)


def test_a_stiff_punch_held_by_contact_alone_is_right_or_refused() -> None:
    loads = {"displacement": {"foundation_bottom": (0, 0)}, "traction": {"punch_top": 0.01}}
    solution = solve(pressed(1e6, **loads), maxh=2.0, order=2)
    # The load is 0.01 times the length 1. Round-off of the stiffer body, 1e6 eps, some tens of
    # times: measured 4e-9.
    assert solution.contact_force()[1] == pytest.approx(0.01, rel=1e-7)
    with pytest.raises(ConvergenceError, match="moduli"):
        solve(pressed(1e12, **loads), maxh=2.0, order=2)
