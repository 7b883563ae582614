"""Scenes on which rows at single nodes went wrong without a word, each against what is known."""

import math
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Compound, OCCGeometry

from ngcontact import (
    Contact,
    ContactError,
    ContactWarning,
    ConvergenceError,
    Elastic,
    Problem,
    solve,
    solving,
)
from ngcontact.fem import boundary_trace
from ngcontact.geometries.region import DOWN, LEFT, RIGHT, UP, body, compound, polygon, quarter_arc
from ngcontact.mesh import first_mesh
from tests.discrete.test_equilibrium import loose
from tests.scenes import distance, rectangle, solved_with_load

EXACT = 1e-10  # round-off times the condition of small meshes
LAW = Elastic(E=1.0, nu=0.3)
UNIFORM = (0.3 * 1.3 * ng.x, -(1 - 0.3**2) * ng.y)  # plane strain under -1 along y


def over_a_slot(width, middle, pairs):
    """A plate on two blocks, 0 < x < 1, with a slot between them; uniform pressure 1."""
    slot = middle - width / 2, middle + width / 2
    bodies = [
        rectangle("plate", (0, 1), (0, 0.5)),
        rectangle("a", (0, slot[0]), (-0.5, 0)),
        rectangle("b", (slot[1], 1), (-0.5, 0)),
    ]
    problem = Problem(
        geometry=OCCGeometry(Compound(bodies), dim=2),
        materials={"plate|a|b": LAW},
        displacement={"plate_top|a_bottom|b_bottom": UNIFORM},
        contact=[Contact(*pair) for pair in pairs],
    )
    return problem, slot


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("swap", [False, True])
@pytest.mark.parametrize("primaries", [["a_top|b_top"], ["a_top", "b_top"]])
@pytest.mark.study(witness=["primaries0-True-1", "primaries0-False-1", "primaries0-False-2"])
def test_a_slot_of_any_width_leaves_pressures_right(order, swap, primaries):
    """Nodes at one end of a narrow slot only, at both of a wide one, inside the widest."""
    pairs = [("plate_bottom", name)[:: -1 if swap else 1] for name in primaries]
    for width in (1e-6, 1e-3, 6e-3, 3e-2, 1e-1):
        problem, slot = over_a_slot(width, 0.47, pairs)
        mesh = first_mesh(problem, 0.2)
        d, result = solved_with_load(problem, mesh, order, "plate_bottom", [slot])
        weight = np.concatenate([line.weight for line in d.lines])
        np.testing.assert_allclose(result.force / weight, 1.0, rtol=EXACT)
        assert distance(d, result, UNIFORM) < EXACT


LOOSE = replace(loose((0.3, -1.0)), contact=[Contact("outer_contact", "inner_contact")])


def test_roles_that_fail_are_exchanged_with_a_warning(monkeypatch):
    """What is solved is the problem with roles the other way round, on the same mesh."""
    mesh, solved = first_mesh(LOOSE, 0.35), solving.minimise_energy

    def fails_with_the_outer_one(discrete, active):
        if discrete.problem.contact[0].secondary == "outer_contact":
            raise ConvergenceError("the active set did not settle")
        return solved(discrete, active)

    monkeypatch.setattr(solving, "minimise_energy", fails_with_the_outer_one)
    with pytest.warns(
        ContactWarning, match=r'given in Contact\("outer_.*", "inner_.*"\).*roles="auto"'
    ):
        solution = solve(LOOSE, mesh, order=2)
    [pair] = solution.problem.contact
    assert pair.sides == ["inner_contact", "outer_contact"]
    right = solve(replace(LOOSE, contact=[pair]), mesh, order=2)
    np.testing.assert_allclose(solution.energy, right.energy, rtol=1e-9)  # round-off, amplified
    assert np.array_equal(solution.active, right.active)
    np.testing.assert_allclose(solution.contact_force(), right.contact_force(), rtol=1e-9)


def disc_in_vee(contact, settle):
    """A disc of radius 1 in a groove of two flanks at 45 degrees."""
    middle = (0, math.sqrt(2))
    around = [DOWN, RIGHT, UP, LEFT, DOWN]
    disc = body(
        "disc",
        [("arc", quarter_arc(middle, 1, *around[k : k + 2])) for k in range(4)],
        [("bore", quarter_arc(middle, 0.4, *around[::-1][k : k + 2])) for k in range(4)],
    )
    outline = [(0, 0), (-2, 2), (-2, -1), (2, -1), (2, 2)]
    vee = body("vee", polygon(outline, ["left", "side", "bottom", "side", "right"]))
    return Problem(
        geometry=compound(disc, vee),
        materials={"disc|vee": LAW},
        displacement={"bottom": (0, 0), "bore": (None, settle)},
        contact=contact,
    )


FLANKS = ("left", "right")
SLOPE = math.sqrt(0.5)
VEE_PAIRS = {
    "disc": [Contact("arc", name) for name in FLANKS],
    "disc, both": [Contact("arc", "left|right")],
    "flanks": [Contact(name, "arc") for name in FLANKS],
    "fixed": [
        Contact("right", "arc", direction=(-SLOPE, SLOPE)),
        Contact("left", "arc", direction=(SLOPE, SLOPE)),
    ],
}


@pytest.mark.parametrize("maxh", [0.4, 0.23])
@pytest.mark.parametrize("pairs", VEE_PAIRS)
@pytest.mark.study(witness=["disc, both-0.4", "disc, both-0.23", "disc-0.4"])
def test_both_curves_have_a_node_where_they_touch(pairs, maxh):
    """And feel a settlement to which nodes beside it, .02 apart, were blind without a word."""
    problem = disc_in_vee(VEE_PAIRS[pairs], -0.01)
    mesh = first_mesh(problem, maxh)
    trace = boundary_trace(mesh, 1)
    for name in ("arc", *FLANKS):
        x = trace.curve[trace.segments(name)][:, [0, -1]].reshape(-1, 2)
        for side in {"left": [-1], "right": [1], "arc": [-1, 1]}[name]:
            away = np.linalg.norm(x - SLOPE * np.array([side, 1]), axis=1)
            assert away.min() < 1e-8  # the gap there is its square
    for settle in (-0.01, -1e-6):
        here = replace(
            problem, geometry=mesh, displacement={"bottom": (0, 0), "bore": (None, settle)}
        )
        solution = solve(here, order=2)
        if settle == -0.01:
            assert solution.force.sum() / 2 == pytest.approx(1.21e-3, rel=0.23)
        elif not any(pair.line.means.any() for pair in solution.pairs):
            assert solution.active.any()


PASSED = "pass through each other between contact points"


def told(problem, **options):
    """The solution, and how often it was told that bodies pass through each other."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ContactWarning)
        solution = solve(problem, **options)
    return solution, sum(PASSED in str(warning.message) for warning in caught)


@pytest.mark.parametrize("order", [1, 3])
@pytest.mark.parametrize("pairs", ["flanks", "fixed"])
def test_what_a_mesh_as_given_does_not_see_is_told(pairs, order):
    """No node where the curves touch: no contact at order 1, a third of the force lost at 3."""
    problem = disc_in_vee(VEE_PAIRS[pairs], -0.01)
    mesh = ng.Mesh(problem.geometry.GenerateMesh(maxh=0.4))
    solution, count = told(replace(problem, geometry=mesh), order=order)
    assert solution.force.sum() / 2 < 0.8 * 1.21e-3
    assert count == 2  # both flanks


@pytest.mark.parametrize("order", [1, 2, 3, 4])
@pytest.mark.parametrize("settle", [-0.01, -0.05])
@pytest.mark.study(witness=["-0.01-1", "-0.01-2"])
def test_overlaps_between_points_in_contact_are_not_told(settle, order):
    """Of O(h^2) where a single point touches, up to 0.12 of the peak in these scenes."""
    for pairs in ("disc, both", "flanks"):
        solution, count = told(disc_in_vee(VEE_PAIRS[pairs], settle), maxh=0.4, order=order)
        assert solution.active.any()
        assert count == 0


def test_other_roles_are_not_tried_where_the_gap_is_given(monkeypatch):
    """The error of the roles that were given is raised, as where the others fail, too."""
    calls = []

    def fail(discrete, active):
        calls.append(discrete.problem.contact)
        raise ConvergenceError(f"attempt {len(calls)}")

    monkeypatch.setattr(solving, "minimise_energy", fail)
    mesh = first_mesh(LOOSE, 0.5)
    with pytest.raises(ConvergenceError, match="attempt 1"):
        solve(LOOSE, mesh, order=2)
    assert [pairs[0].secondary for pairs in calls] == ["outer_contact", "inner_contact"]
    calls.clear()
    with pytest.raises(ContactError):
        solve(replace(LOOSE, contact=[replace(LOOSE.contact[0], gap=0.01)]), mesh, order=2)
    assert len(calls) <= 1
