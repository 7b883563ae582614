"""First active sets: what touches before the load, and the states of another mesh."""

from dataclasses import replace

import numpy as np

from drivers.reference import cases
from ngcontact import solve
from ngcontact.contact import ContactState
from ngcontact.discrete import carried_active_set, discretise, first_active_set
from ngcontact.mesh import curve, first_mesh


def prepared(problem, maxh, order):
    mesh, _ = curve(first_mesh(problem, maxh), order, "isoparametric")
    return discretise(problem, mesh, order, "isoparametric")


def state(line, active):
    """A pair without gaps or forces."""
    nothing = np.zeros(len(line.node))
    return ContactState(line, nothing, nothing, active)


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
    assert carried_active_set([new], [state(coarse, active)]).tolist() == [True]


def test_points_around_a_transition_are_told_by_their_side_of_it():
    """It is located inside elements: finer than the nodes of the mesh it comes from."""
    problem = cases.one_transition().problem
    coarse = solve(problem, maxh=0.4, order=3)
    [end] = coarse.transitions()
    [line] = prepared(problem, 0.1, 3).lines
    carried = carried_active_set([line], coarse.pairs)
    np.testing.assert_array_equal(carried, line.position[:, 0] < end[0])
