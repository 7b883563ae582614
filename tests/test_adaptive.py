"""The adaptive loop and its entry points: validity of levels, stopping, budgets, bad arguments."""

import re
from dataclasses import replace
from functools import partial

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from drivers.reference.straight import relative_energy_error
from ngcontact import ContactWarning, adapt, solving
from ngcontact.adaptivity import Refinement
from ngcontact.geometries import disc as quarter_disc
from ngcontact.geometries import disc_on_block
from ngcontact.mesh import first_mesh
from ngcontact.problem import MeshArrays


def disc():
    """Disc pressed on a block, an enlarging zone with curved edges."""
    down = {"block_bottom": (0, 0), "disc_top": (0, -0.02)}
    return replace(cases.pressed_disc(), displacement=down)


def unknowns(solution):
    return solution.displacement.space.ndof


def refinement(**changes):
    """What `adapt` asks of its levels by default, but for some changes."""
    default = {"element": "isoparametric", "theta": 0.5, "tolerance": None}
    return Refinement(**(default | changes))


def state(solution):
    """What refinement in place would change."""
    rule = {ng.TRIG: ng.IntegrationRule(ng.TRIG, 3)}
    u = solution.displacement(solution.mesh.MapToAllElements(rule, ng.VOL)).copy()
    vertices = np.array(solution.mesh.ngmesh.Coordinates())
    return u, vertices, solution.pressure.copy(), solution.indicators.copy()


def test_earlier_levels_stay_valid():
    """Refinement in place would change older functions silently."""
    seen = [(s, state(s)) for s in adapt(disc(), maxh=0.6, order=2, max_dofs=4000)]
    assert len(seen) >= 5
    for solution, before in seen:
        assert all(map(np.array_equal, state(solution), before))
        # What is computed late agrees with what would have been computed at once.
        fresh = replace(solution, work=dict(solution.work))
        assert fresh.error_estimate == solution.error_estimate
        assert max(fresh.residuals.values()) < 1e-10


def sides_at_the_end(solution):
    """Lengths of the contact segments at the end of contact."""
    line, [end] = solution.discrete.lines[0], solution.transitions()
    sides = solution.discrete.space.trace.curve[line.segments][:, [0, -1], 0]
    return np.ptp(sides, axis=1)[(sides.min(axis=1) <= end[0]) & (end[0] <= sides.max(axis=1))]


def test_elements_in_which_contact_ends_are_always_refined():
    """Doerfler alone leaves them as they are on the first five levels: corners are worse."""
    problem = cases.partly_opening_block()
    first, *_, last = adapt(problem, order=3, max_dofs=3000)
    assert sides_at_the_end(first) == pytest.approx(1 / 8)
    assert sides_at_the_end(last).max() <= 1 / 8 / 2**2  # third level
    assert last.transitions()[0, 0] == pytest.approx(1.545313, rel=4e-4)  # measured 1.6e-4
    # ... until they are small for the error there is.
    coarse = refinement(order=3, max_dofs=3000, ending=10.0)
    *_, last = solving.levels(problem, first_mesh(problem, None), coarse, [])
    assert sides_at_the_end(last) == pytest.approx(1 / 8)


def test_orders_rise_with_accuracy():
    """Without order and tolerance: 3 as long as errors are of percents, then 4."""
    case = cases.hertz_contact()
    levels = list(adapt(case.problem, order="auto", max_dofs=16_000))
    assert [level.order for level in levels] == [3, 3, 4, 4]
    sizes, errors = [unknowns(s) for s in levels], []
    for level in levels:
        errors.append(relative_energy_error(level, case.exact))
        assert level.displacement.space.globalorder == level.order
        # The estimate is one of the level's own order; measured 4.2, 5.4, 6.0, 6.2.
        assert 3 < level.relative_error_estimate / errors[-1] < 8
    assert (np.diff(sizes) > 0).all()
    assert len(levels[2].steps) <= 2  # the contact of another order warms the start; measured 1
    single = list(adapt(case.problem, max_dofs=16_000))
    assert errors[-1] <= 1.5 * relative_energy_error(single[-1], case.exact)


def test_an_exact_solution_is_not_refined(reproduced):
    case, order = reproduced
    [solution] = adapt(case.problem, maxh=0.4, order=order)
    assert relative_energy_error(solution, case.exact) < 1e-11


@pytest.mark.parametrize(
    ("order", "element"),
    [(1, "physical"), *((p, "isoparametric") for p in (1, 2, 3, 4)), (2, "superparametric")],
)
@pytest.mark.study(witness=["4-isoparametric", "3-isoparametric", "2-superparametric"])
def test_no_level_exceeds_the_number_of_unknowns(order, element):
    # Rings: curved edges, on which functions linear in physical coordinates need edge functions.
    problem = cases.ring_in_ring().problem
    sizes = [
        unknowns(s)
        for s in adapt(problem, maxh=0.6, order=order, element=element, max_dofs=400 + 80 * order)
    ]
    assert len(sizes) >= 2
    # Budgets at which a level just fits, and at which it just does not: then it is marked less.
    for budget, count in ((sizes[-1], len(sizes)), (sizes[-1] - 1, len(sizes) - 1)):
        levels = adapt(problem, maxh=0.6, order=order, element=element, max_dofs=budget)
        found = [unknowns(s) for s in levels]
        assert found[:count] == sizes[:count]
        assert max(found) <= budget


BAD = [
    ("theta", 0, ValueError),
    ("theta", 1.01, ValueError),
    ("theta", "0.5", TypeError),
    ("tolerance", 0, ValueError),
    ("tolerance", 5, ValueError),  # percent is not meant, nor an absolute error
    ("max_dofs", 0, ValueError),
    ("max_dofs", "many", TypeError),
    ("order", 0, ValueError),
    ("order", 5, ValueError),
    ("order", 2.0, TypeError),
    ("order", True, TypeError),
    ("element", "curved", ValueError),
    ("maxh", 0, ValueError),
    ("maxh", float("nan"), ValueError),
    ("maxh", "0.1", TypeError),
]


@pytest.mark.usefixtures("no_work")
@pytest.mark.parametrize(("name", "value", "error"), BAD)
def test_bad_arguments_of_adapt_are_refused_at_the_call(name, value, error):
    with pytest.raises(error, match=rf"{name}={value!r}|{name}={value}"):
        adapt(cases.one_transition().problem, **{name: value})


@pytest.mark.parametrize("guaranteed", [False, True])
def test_a_tolerance_out_of_reach_is_told(guaranteed):
    """By the estimate, or by the bound of the last level, whatever the estimate suggests."""
    options = {"order": 2, "tolerance": 1e-6, "max_dofs": 2000, "guaranteed": guaranteed}
    with pytest.warns(ContactWarning) as caught:
        *_, last = adapt(cases.one_transition().problem, **options)
    [warning] = caught
    assert last.bounded == guaranteed
    told = last.relative_error_bound if guaranteed else last.relative_error_estimate
    name = "bound" if guaranteed else "estimate"
    assert f"the {name} is {told:.2e}, more than tolerance=1e-06" in str(warning.message)
    assert warning.filename == __file__


def small_disc(radius):
    """Problem A of a radius, whose segments at the end of contact come to the kernel's digits."""
    problem = cases.disc_on_rigid_plane()
    displacement = {"top": (None, -0.005 * radius)}
    return replace(problem, geometry=quarter_disc(radius), displacement=displacement)


def test_segments_at_the_limit_of_the_kernel_are_left_alone():
    """There was a ValueError that blamed the input; 0.2232663 R is half of Problem A's force."""
    with pytest.warns(ContactWarning, match=r'"arc" near \(0\.00254.*not divided any more') as said:
        solutions = list(adapt(small_disc(0.05), order=4, max_dofs=30_000))
    assert len(said) == 1
    last, before = solutions[-1], solutions[-2]
    assert last.displacement.space.ndof > 20_000
    assert last.error_estimate < 0.7 * before.error_estimate
    # From the levels of the whole disc: 0.223266 to six digits from 6000 unknowns on.
    assert np.hypot(*last.contact_force()) == pytest.approx(0.2232663 * 0.05, rel=1e-5)


def test_adapt_stops_at_the_bound():
    case, tolerance = cases.hertz_contact(), 1e-2
    levels = list(adapt(case.problem, order=3, tolerance=tolerance, guaranteed=True))
    assert levels[-1].relative_error_bound <= tolerance
    assert levels[-1].bounded
    assert not levels[0].bounded  # its estimate said that it is too coarse
    assert "bound" not in str(levels[0])
    assert f"bound {levels[-1].relative_error_bound:.2e}" in str(levels[-1])
    assert relative_energy_error(levels[-1], case.exact) <= tolerance
    assert sum(level.work["equilibrations"] for level in levels[:-1]) <= 2
    # The bound that is forecast ends the plan: hardly more unknowns than the estimate's own first
    # level that meets the tolerance needs.
    plain = adapt(case.problem, order=3, max_dofs=8000)
    fine = next(level for level in plain if level.relative_error_bound <= tolerance)
    assert unknowns(levels[-1]) <= 1.2 * unknowns(fine)


@pytest.mark.parametrize(
    ("ask", "error", "asked"),
    [
        (lambda run: run.pressure, AttributeError, "has no pressure"),
        (lambda run: run[-1], TypeError, r"has no \[-1\]"),
    ],
)
def test_a_run_that_is_taken_for_a_solution_says_how_to_get_one(ask, error, asked):
    run = adapt(cases.one_transition().problem, order=2, max_dofs=3000)
    with pytest.raises(error, match=rf"{asked}: .*\*_, solution = adapt\(...\)"):
        ask(run)
    first = next(run)  # which is still to be had
    *_, last = run
    assert last.displacement.space.ndof > first.displacement.space.ndof


def test_guaranteed_needs_a_tolerance():
    with pytest.raises(ValueError, match="tolerance=None"):
        adapt(cases.one_transition().problem, guaranteed=True)
    with pytest.raises(TypeError, match="guaranteed=1"):
        adapt(cases.one_transition().problem, guaranteed=1, tolerance=1e-2)


def test_refinement_ends_where_no_curve_can_be_divided(monkeypatch):
    every = partial(np.ones, dtype=bool)
    monkeypatch.setattr("ngcontact.adaptivity.planning.at_limit", lambda mesh, _: every(mesh.ne))
    with pytest.warns(ContactWarning, match="refinement ends here"):
        [solution] = adapt(small_disc(1.0), order=2, max_dofs=3000)
    assert solution.relative_error_estimate > 1e-3


def pressed(way):
    """Problem A, pressed so far; 0.005 is the benchmark's."""
    return replace(cases.disc_on_rigid_plane(), displacement={"top": (None, -way)})


def size_at(solution, place):
    """Diameter of the element whose centre is nearest to a place."""
    centres = MeshArrays(solution.mesh).corners.mean(axis=1)
    return MeshArrays(solution.mesh).diameters[np.linalg.norm(centres - place, axis=1).argmin()]


@pytest.fixture(scope="module")
def sequence():
    """Deeper and back: all levels of each load."""
    loads = [list(adapt(pressed(0.002), tolerance=1e-3))]
    for way in (0.005, 0.008, 0.005, 0.002):
        loads.append(list(adapt(pressed(way), tolerance=1e-3, start=loads[-1][-1])))
    return loads


def test_each_load_takes_two_levels_of_less_than_twice_the_unknowns(sequence):
    for levels in sequence[1:]:
        assert len(levels) == 2
        assert levels[-1].relative_error_estimate <= 1e-3
        assert sum(map(unknowns, levels)) < 2 * unknowns(levels[-1])
        assert levels[0].work["factorizations"] <= 2
        assert levels[1].work["factorizations"] == 1
        assert len(levels[1].steps) <= 2


def test_loads_have_the_forces_of_a_run_of_their_own(sequence):
    # Of an error of 1e-3 in the energy norm, forces have about the square.
    assert 2 * sequence[1][-1].contact_force()[1] == pytest.approx(0.4465326527, rel=1e-5)
    forces = [levels[-1].contact_force()[1] for levels in sequence]
    assert forces[:2] == pytest.approx(forces[:2:-1], rel=1e-5)
    assert forces[0] < 0.3 * forces[2]


def test_meshes_do_not_grow_with_the_sequence(sequence):
    *_, alone = adapt(pressed(0.002), tolerance=1e-3)
    assert unknowns(sequence[-1][-1]) <= 1.3 * unknowns(alone)  # measured 1.0
    # Where contact ended under the largest load, elements are large again.
    [end] = sequence[2][-1].transitions()
    assert size_at(sequence[4][-1], end) > 4 * size_at(sequence[2][-1], end)


@pytest.mark.usefixtures("no_work")
def test_what_cannot_be_continued_is_refused(sequence):
    start, problem = sequence[0][0], pressed(0.005)
    other = replace(problem, geometry=disc_on_block())

    def refused(error, words, problem=problem, **options):
        with pytest.raises(error, match=re.escape(words)):
            adapt(problem, **({"start": start} | options))

    refused(TypeError, "start is a list: give a Solution", start=[start])
    refused(ValueError, "start has order=4", order=3)
    refused(ValueError, "element='superparametric'", element="superparametric")
    refused(ValueError, "maxh=0.1 has no effect", maxh=0.1)
    refused(ValueError, "start has 1 contact pairs, the problem 0", replace(problem, contact=[]))
    renamed = [replace(problem.contact[0], secondary="top")]
    refused(ValueError, "('arc', None)", replace(problem, contact=renamed))
    refused(ValueError, "the geometry is not the one of start", other)
    refused(
        ValueError, "the geometry is not the one of start", replace(problem, geometry=start.mesh)
    )
    refused(ValueError, "more than max_dofs=100", max_dofs=100)
