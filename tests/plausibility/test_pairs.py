"""Warnings of pairs: that they come where they should, once, that what they say is so."""

import math
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Axis, OCCGeometry, Pnt, Z

from drivers.reference import cases
from ngcontact import Contact, ContactWarning, Elastic, Problem, adapt, solve
from ngcontact.geometries import blocks, disc_on_disc, rings
from ngcontact.geometries.region import compound
from ngcontact.plausibility import refinement_warning
from ngcontact.plausibility.pairs import PEAK_ERROR, drawn_gap_error
from tests.scenes import pressed_ball, pressed_cube
from tests.solids.test_patch import blocks as solid_blocks
from tests.solids.test_patch import pressed

SOFT = Elastic(E=1.0, nu=0.3)
DOWN = (0, -1)
DIRECTION, STRAIN, ZONE = "inclined to direction", "mean pressure", "is not resolved"


def told(call) -> list[str]:
    """Messages of the package's warnings during a call."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    assert {warning.category for warning in caught} <= {ContactWarning}
    return [str(warning.message) for warning in caught]


def quiet(call) -> bool:
    return told(call) == []


def only(call, *parts: str) -> bool:
    """Whether there is one warning, with all these parts."""
    [message] = told(call)
    return all(part in message for part in parts)


def vee(slope: float, direction=DOWN, unit: float = 1.0, modulus: float = 1.0, turn: float = 0.0):
    """Blocks on two flanks of that slope, pressed on each other; turned, with the direction."""
    h, a = math.tan(math.radians(slope)), math.radians(turn)
    shape = blocks(line=((-1, h), (0, 0), (1, h)), height=h + 1).shape
    shape = shape.Rotate(Axis((0, 0, 0), Z), turn).Scale(Pnt(0, 0, 0), unit)

    def turned(x, y):
        return math.cos(a) * x - math.sin(a) * y, math.sin(a) * x + math.cos(a) * y

    return Problem(
        geometry=OCCGeometry(shape, dim=2),
        materials={"upper|lower": Elastic(E=modulus, nu=0.3)},
        displacement={"bottom": (0, 0), "top": turned(0, -1e-3 * unit)},
        contact=[Contact("upper_contact", "lower_contact", direction and turned(*direction))],
    )


def finest(problem: Problem, order: int = 3, unknowns: int = 6000):
    return lambda: list(adapt(problem, order=order, max_dofs=unknowns))


@pytest.mark.parametrize(
    ("unit", "modulus", "turn"), [(1.0, 1.0, 0.0), (1e3, 1e-9, 33.0), (1e-2, 1e9, -120.0)]
)
def test_one_direction_for_both_flanks_is_told_once(unit, modulus, turn):
    """Whatever the units and the rotation, once for all levels."""
    run = finest(vee(45.0, DOWN, unit, modulus, turn), order=2, unknowns=4000)
    [message] = [message for message in told(run) if DIRECTION in message]
    assert "45 degrees" in message
    assert 'contact 0 of "upper_contact" with "lower_contact"' in message
    assert "direction=None" in message


@pytest.mark.parametrize(("slope", "direction"), [(45.0, None), (10.0, DOWN)])
def test_flanks_across_their_direction_are_silent(slope, direction):
    run = finest(vee(slope, direction), unknowns=4000)
    assert not any(DIRECTION in message for message in told(run))


@pytest.mark.parametrize("press", [2e-3, 1e-6])
def test_the_last_level_resolves_the_zone_of_a_load_however_small(press):
    supports = {"block_bottom": (0, 0), "disc_top": (0, -press)}
    problem = replace(cases.pressed_disc(), displacement=supports)
    assert quiet(finest(problem, unknowns=11_000))
    # One point in contact at 934 unknowns: the peak is 45 % off, 95 % of the lighter load. At 1438
    # the heavier one has three, its peak is 5 % off, and no warning comes.
    assert only(finest(problem, unknowns=1000), ZONE)


@pytest.mark.parametrize(("unit", "modulus"), [(1.0, 1.0), (1e3, 1e9)])
def test_a_gap_of_the_wrong_sign_is_told(unit, modulus):
    geometry = blocks(width=2 * unit, height=unit)
    problem = cases.touching_blocks(
        {"top": (0, 0), "bottom": (0, 0)},
        geometry=geometry,
        materials={"upper|lower": Elastic(E=modulus, nu=0.3)},
        contact=[Contact("upper_contact", "lower_contact", gap=-5 * unit)],
    )
    run = finest(problem, order=2, unknowns=2000)
    assert only(run, STRAIN, "sign of gap", "units of E")
    apart = replace(problem, contact=[replace(problem.contact[0], gap=5 * unit)])
    assert quiet(lambda: solve(apart, maxh=unit / 2, order=2))


PUSHED = "nothing deforms"


def pushed():
    """A block without support, pushed down by 0.1 by another one that is displaced."""
    pair = Contact("lower_contact", "upper_contact")
    return cases.touching_blocks({"top": (0, -0.1)}, contact=[pair])


@pytest.mark.parametrize("order", [1, 2])
def test_a_body_that_nothing_resists_is_told(order):
    solution = solve(pushed(), maxh=0.5, order=order)
    assert solution.at((0.3, -0.5)).displacement == pytest.approx((0, -0.1), abs=1e-12)
    assert only(lambda: solve(pushed(), maxh=0.5, order=order), PUSHED)
    assert only(lambda: list(adapt(pushed(), order=order)), PUSHED)
    assert len(list(adapt(pushed(), order=order, tolerance=1e-3))) == 1


def test_a_flat_obstacle_under_an_inclined_surface_is_silent():
    """A disc pressed by 0.2 of its radius, with normals 25 degrees off where contact ends."""
    disc = cases.disc_on_rigid_plane()
    assert quiet(
        lambda: solve(replace(disc, displacement={"top": (None, -0.2)}), maxh=0.1, order=2)
    )


APART = "bodies are drawn"
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
    way, error = drawn_gap_error(solutions[-1].discrete.space.trace, pair)
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
    return replace(
        cases.ring_in_ring().problem,
        geometry=rings(interference=interference, quarter=True),
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


def lowered_cube(direction=(0, 0, -1), gap=None):
    """A cube pressed down on a block by its top's displacement."""
    return pressed_cube(
        displacement={"block_bottom": (0, 0, 0), "cube_top": (0, 0, -1e-3)},
        traction={},
        contact=[Contact("cube_bottom", "block_top", direction=direction, gap=gap)],
    )


def test_solids_are_told_of_directions_gaps_and_strains():
    slope = math.radians(30)
    inclined = lowered_cube((math.sin(slope), 0, -math.cos(slope)))
    for problem, *parts in (
        (inclined, DIRECTION, "30 degrees", "direction=(0.5, 0, -0.866)"),
        (lowered_cube(gap=-3.0), STRAIN, "sign of gap"),
    ):
        assert only(lambda problem=problem: solve(problem, maxh=0.7, order=1), *parts)
    assert quiet(lambda: solve(lowered_cube(), maxh=0.7, order=1))


THROUGH, SMALL_ZONE = "pass through each other", "is not resolved, by 1 of at least 4 nodes"


def test_solids_are_told_of_penetration_where_no_row_stands():
    """At order 2 the vertex that touches first has no row; the force is 0."""
    found = []
    run = lambda: found.append(solve(pressed_ball(0.005), maxh=0.7))  # noqa: E731
    assert only(run, THROUGH, "by 0.005 near (0, 0, 0)")
    assert not found[0].active.any()


def test_solids_are_told_of_zones_of_few_points():
    """One point in contact at order 1, the pressures of which are far off."""
    assert only(lambda: solve(pressed_ball(0.005), maxh=0.7, order=1), SMALL_ZONE)
    assert quiet(lambda: solve(pressed_ball(0.2), maxh=0.4))  # five


@pytest.mark.parametrize(
    ("counts", "gap", "fine", "words"),
    [
        ((8, 8), 0.5 * (ng.x - 0.25) ** 2, (8, 8), "9 nodes in one row"),
        ((4, 3), 0.1 * (ng.x - 0.3) ** 2 + 0.1 * ng.y**2 - 0.01, (8, 6), "apart, by 0.00198"),
    ],
)
def test_solids_are_told_of_facets_that_are_wider_than_the_zone(counts, gap, fine, words):
    """Below a roller and, by means over facets, below a ball; without it forces are right."""

    def force(counts, order):
        problem = pressed(solid_blocks(*counts))
        contact = [replace(problem.contact[0], gap=gap)]
        given = {"lower_bottom": (0, 0, 0), "upper_top": (0, 0, -0.01)}
        problem = replace(problem, sliding=None, traction={}, displacement=given, contact=contact)
        found = []
        messages = told(lambda: found.append(solve(problem, order=order)))
        return found[0].contact_force()[2], messages

    coarse, [message] = force(counts, 1)
    assert words in message
    two, three = (force(fine, order) for order in (2, 3))
    assert two[1] == three[1] == []
    assert coarse > 1.25 * three[0]  # measured 1.31 and 1.63
    assert two[0] == pytest.approx(three[0], rel=0.05)  # measured 1.9e-2 and 2.9e-2


@pytest.mark.parametrize("solids", [False, True])
def test_loads_that_bring_nothing_into_contact_are_told(solids):
    """A displacement of the wrong sign; without any there is nothing to say."""
    problem = pressed_ball(-0.01) if solids else cases.pressed_disc()
    for lift in (0.01, 0.0):
        given = {"block_bottom": (0, 0), "disc_top": (0, lift)}
        if solids:
            given = {"block_bottom": (0, 0, 0), "ball_top": (0, 0, lift)}
        run = lambda given=given: solve(replace(problem, displacement=given), maxh=0.7)  # noqa: E731
        assert only(run, "no pair is in contact") if lift else quiet(run)


def test_estimates_of_solids_that_rise_are_told_with_their_place():
    mesh = solve(lowered_cube(), maxh=0.7, order=1).mesh
    message = refinement_warning(mesh, np.arange(1.0, mesh.ne + 1), [1e-2, 2e-2, 3e-2])
    place = message[message.index("near (") + 6 : message.index(") in body")].split(", ")
    corners = [mesh[v].point for v in mesh[ng.ElementId(ng.VOL, mesh.ne - 1)].vertices]
    assert [float(x) for x in place] == pytest.approx(np.mean(corners, axis=0), abs=1e-3)


@pytest.mark.parametrize(("moduli", "told_of"), [((1.0, 1e12), False), ((1e12, 1.0), True)])
def test_forces_that_round_off_takes_are_told(moduli, told_of):
    """A stiff disc displaced by d: E eps d stands beside forces of d, 2.5 % at 1e12."""
    laws = {"disc": Elastic(moduli[0], 0.3), "block": Elastic(moduli[1], 0.3)}
    down = {"block_bottom": (0, 0), "disc_top": (0, -0.01)}
    problem = replace(cases.pressed_disc(), materials=laws, displacement=down)
    found = told(lambda: solve(problem, maxh=0.15, order=2))
    assert any("round-off" in message for message in found) == told_of
