"""Bounds of the energy contain it on every level; bounds of scenes without exact solutions."""

from __future__ import annotations

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases, cases, paper
from drivers.reference.overkill import Overkill
from ngcontact import Contact, Elastic, Hooke, Problem, adapt, solve
from ngcontact.estimator.bound import force_bar
from ngcontact.geometries.region import compound
from tests.estimator.bound.test_equilibrium import opening
from tests.estimator.bound.test_exact import settled
from tests.given_meshes import two_blocks
from tests.scenes import rectangle, unmatched_blocks

ANISOTROPIC = Hooke([[100.0, 20.0, 5.0], [20.0, 10.0, 1.0], [5.0, 1.0, 3.0]])
BILATERAL = [Contact("upper_contact", "lower_contact", bilateral=True)]
LAW = Elastic(E=1.0, nu=0.3)


def transition(**changes):
    """One transition from contact to gap, with changes."""
    return replace(cases.one_transition().problem, **changes)


def contrast(upper, lower):
    return opening(materials={"upper": Elastic(upper, 0.3), "lower": Elastic(lower, 0.2)})


SCENES = {
    "dual rows": lambda: transition(geometry=unmatched_blocks()),
    "body forces": lambda: cases.clamped_transition().problem,
    "guided": lambda: cases.guided_transition().problem,
    "polygonal zone": lambda: paper.polygonal_zone().problem,
    "bilateral part": lambda: paper.bilateral_part().problem,
    "opening ring": lambda: paper.opening_ring().problem,
    "rigid plane": cases.disc_on_rigid_plane,
    "disc on block": cases.pressed_disc,
    "punch": cases.flat_punch,
    "opening": opening,
    "bilateral": lambda: opening(contact=BILATERAL, traction={"pressed": -1.0}),
    "held by contact": lambda: opening(sliding="lower_axis", traction={"pressed|top": 1.0}),
    "plane stress": lambda: opening(model="plane stress"),
    "anisotropic": lambda: opening(materials={"upper|lower": ANISOTROPIC}),
    "varying": lambda: opening(
        materials={"upper|lower": Elastic(1000 * (1.1 + ng.cos(6 * ng.x)), 0.3)}
    ),
    "1e6 : 1": lambda: contrast(1e9, 1e3),
    "1 : 1e6": lambda: contrast(1e3, 1e9),
    "jumping force": lambda: opening(force={"upper": (0, ng.IfPos(ng.x - 0.13, -1, 1))}),
    "traction": lambda: opening(traction={"pressed|top": (0, -1 - ng.sin(8 * ng.x))}),
    "cone": lambda: axisymmetric_cases.indented_by_cone()[0],
    "flat punch about an axis": lambda: axisymmetric_cases.indented_by_punch()[0],
}
WITNESSES = ["bilateral", "1e6 : 1", "held by contact"]


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.filterwarnings("ignore::ngcontact.ContactWarning")  # zones of few segments
@pytest.mark.study(witness=WITNESSES)
def test_energies_are_enclosed(scene):
    """By bounds of order 2 on all levels; the reference is what one of order 4 encloses.

    And |u - u_h|^2 is at least twice what the energy of a u_h in K is above that of the reference.
    Curved meshes have domains of their own, by up to 3.1e-5 of the area: by as much of it the
    energies of both may differ.
    """
    problem = SCENES[scene]()
    *_, finest = adapt(problem, order=4, max_dofs=5000)
    lower, upper = finest.energy_bounds
    area = ng.Integrate(1, finest.mesh)
    for level in adapt(problem, order=2, max_dofs=1300):
        settled(level)
        low, high = level.energy_bounds
        apart = abs(upper) * abs(ng.Integrate(1, level.mesh) / area - 1)
        assert low <= upper + apart
        assert lower <= high + apart


@pytest.mark.parametrize("scene", ["dual rows", "opening"])
def test_energies_are_apart_by_half_of_the_squared_bound_and_what_crosses(scene):
    """Under polynomial loads: |s - sigma_h| times |w| on each triangle is all that they add."""
    solution = solve(SCENES[scene](), maxh=0.5, order=2)
    proof, square = solution.equilibrated.proof, solution.error_bound**2
    low, high = solution.energy_bounds
    crossed = proof.stress.distance @ proof.lifting
    # The energies are known to their round-off.
    assert high - low == pytest.approx(square / 2 + crossed, abs=1e-9 * square)


def test_disc_on_a_rigid_plane():
    """The strain energy of the half is known to be 5.221032(1)e-4; no other loads."""
    for solution in adapt(cases.disc_on_rigid_plane(), order=2, max_dofs=1400):
        low, high = solution.energy_bounds
        assert low <= 5.221032e-4 <= high
    assert high - low <= 1e-6
    assert solution.relative_error_bound <= 0.03


# Largest effectivity on all levels and on the last, in brackets what was measured against
# solutions of order 4: 1.99, 1.10 and 1.08 of the disc on a block.
SHARP = {
    "punch-2": (cases.flat_punch, 2, 1500, 9000, 2.0, 1.6),
    "punch-4": (cases.flat_punch, 4, 4000, 20000, 2.0, 1.6),
    "rigid plane-2": (cases.disc_on_rigid_plane, 2, 1500, 9000, 1.5, 1.3),
    "disc on block-2": (cases.pressed_disc, 2, 2000, 9000, 2.2, 1.3),
}


@pytest.mark.parametrize("name", SHARP)
@pytest.mark.filterwarnings("ignore::ngcontact.ContactWarning")  # zones of few segments
@pytest.mark.study(witness=["rigid plane-2"])
def test_effectivity_beside_a_finer_solution(name):
    make, order, size, fine, largest, last = SHARP[name]
    *_, finest = adapt(make(), order=4, max_dofs=fine)
    reference, ratios = Overkill(finest), []
    for level in adapt(make(), order=order, max_dofs=size):
        settled(level)
        error = reference.relative_error(level) * finest.energy_norm
        # The reference has an error of its own.
        ratios.append(level.error_bound / error)
        assert level.error_bound + finest.error_bound >= error
    assert max(ratios) <= largest
    assert ratios[-1] <= last


@pytest.mark.parametrize("order", [1, 2, 3])
@pytest.mark.parametrize("bilateral", [False, True])
def test_the_proved_bar_is_as_large_as_the_error_of_a_displaced_block(order, bilateral):
    """Of the force F that a displacement d of the top takes: F_h - F = e^2 / d, the bar B^2 / d.

    F d is twice the energy, of u_h and of u, and their difference is the square of the error e. G
    is u_h / d but for a translation, so that no bar that is proved can be less, and B is sharp.
    """
    d = 0.01
    problem = cases.touching_blocks(
        {"bottom": (0, 0), "top": (0, -d)}, contact=[replace(BILATERAL[0], bilateral=bilateral)]
    )
    *_, fine = adapt(problem, order=4, max_dofs=12_000)  # 1e-5 of the errors: measured
    solution = solve(problem, maxh=0.25, order=order)
    row = solution.quantities()["force"]
    assert row.proved == pytest.approx(solution.error_bound**2 / d, rel=1e-6)  # measured 6e-10
    error = abs(row.value - abs(fine.contact_force()[1]))
    assert error <= row.proved <= 1.6 * error  # measured 1.13, 1.31, 1.43


@pytest.mark.parametrize(("order", "degree"), [(1, 2), (2, 4)])
def test_the_proved_bar_is_what_elements_miss_of_a_support(order, degree):
    """A column that cannot give way sideways: its force is that of the mean of u_D on the top.

    u_h has the interpolant there. The stress of G is uniform, so that nothing else is missed.
    """
    law = Elastic(2.0, 0.0)
    problem = cases.touching_blocks(  # of width 2 and height 2
        {"bottom": (None, 0), "top": (None, -0.01 * (1 + ng.x**degree))},
        materials={"upper": law, "lower": law},
        sliding="upper_left|upper_right|lower_left|lower_right",
        contact=BILATERAL,
    )
    row = solve(problem, maxh=0.5, order=order).quantities()["force"]
    error = abs(row.value - law.E * 0.01 * (1 + 1 / (degree + 1)))
    assert 1e-6 < error < row.proved * (1 + 1e-9)
    assert row.proved == pytest.approx(error, rel=1e-6)  # measured 4e-12 and 3e-7


def test_the_proved_bar_is_that_of_the_force_the_other_way(monkeypatch):
    """Errors of F and -F are one: what lowers the bar of the one and raises the other's counts."""
    bars = []

    def both(proof, u, G, directions):
        other = ng.GridFunction(G.space)
        other.vec.data = -G.vec
        bars.append(force_bar(proof, u, G, directions))
        bars.append(force_bar(proof, u, other, [-e for e in directions]))
        return bars[0]

    monkeypatch.setattr("ngcontact.estimator.quantities.readings.force_bar", both)
    solve(cases.hertz_contact().problem, maxh=0.3, order=2).quantities()
    assert bars[1] == pytest.approx(bars[0], rel=1e-9)


@pytest.mark.filterwarnings("ignore:contact 0")
def test_penetration_that_no_point_sees_is_in_the_bound():
    """Between points of a coarse mesh: u_h moves the upper block, and strains nothing."""
    nodes = np.linspace(-1, 1, 5)  # of segments in whose middle the gap would be -0.02
    problem = cases.touching_blocks(
        {"top": (0, -0.02), "bottom": (0, 0)},
        geometry=two_blocks(nodes, nodes),
        contact=[replace(cases.TOUCHING, direction=(0, -1), gap=2 * (ng.x - 0.25) ** 2)],
    )
    solution = solve(problem, order=1)
    assert not solution.active.any()
    *_, fine = adapt(problem, order=3, max_dofs=3000)
    assert solution.energy < 1e-20 * fine.energy
    # |u| is the root of twice the energy of u, without loads. Measured: 2.66 times.
    assert 1 <= solution.error_bound / (2 * fine.energy) ** 0.5 <= 4
    low, high = solution.energy_bounds
    assert low <= fine.energy <= high


ROUGH = {  # largest effectivity; measured 1.11, 1.17, 1.05, 1.05, without vertices there 1.2 to 6
    "kink": (ng.IfPos(ng.x - 0.7123, 0.7123 - ng.x, 0.0), 1.25),
    "jump": (ng.IfPos(ng.x - 0.7123, -1.0, 0.0), 1.3),
    "narrow": (-ng.exp(-(((ng.x - 1.1) / 0.05) ** 2)), 1.15),
    "root": (-(((ng.x - 0.71) ** 2) ** 0.25), 1.15),
}


@pytest.mark.parametrize("name", ROUGH)
def test_tractions_that_are_rough_inside_segments(name):
    """Errors by the energy of a graded solution of order 4, which is 1e3 times nearer."""
    load, effectivity = ROUGH[name]
    problem = Problem(
        geometry=compound(rectangle("block", (0, 2), (0, 1), ("foot", "side", "top", "left"))),
        materials={"block": LAW},
        displacement={"left": (0, None)},
        traction={"top": (0, load)},
        contact=[Contact("foot", direction=(0, -1), gap=0)],
    )
    *_, fine = adapt(problem, tolerance=1e-5)
    solution = solve(problem, maxh=0.25, order=2)
    lower, upper = solution.energy_bounds
    assert lower <= fine.energy <= upper
    error = (2 * (solution.energy - fine.energy)) ** 0.5
    assert error <= solution.error_bound <= effectivity * error
