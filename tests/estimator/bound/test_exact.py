"""Guaranteed bounds against exact errors: never below, and hardly above."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Circle, Glue, OCCGeometry

from drivers.adaptive_study.runs import levels_of
from drivers.reference import axisymmetric_cases, cases, paper
from drivers.reference.laws import pressed_fibres
from drivers.reference.overkill import Overkill
from drivers.reference.straight import energy_error
from drivers.reference.westergaard import moduli
from ngcontact import Elastic, adapt, solve
from ngcontact.estimator.bound import error_bound
from tests.given_meshes import two_blocks
from tests.quadrature.test_loads import loaded, square
from tests.runs import levels
from tests.scenes import pressed, unmatched_blocks

RESIDUAL = 1e-10  # of equilibrium, relative to the largest stress; measured at most 5e-14


def settled(solution):
    """Its certificate holds, its energies are as near to each other as B^2 is small."""
    certificate = dict(solution.equilibrated.certificate)
    assert certificate.pop("least pressure") >= 0
    assert max(certificate.values()) <= RESIDUAL
    low, high = solution.energy_bounds
    noise = 1e-12 * (solution.energy_norm**2 + abs(solution.energy))
    assert high - low <= 1.5 * solution.error_bound**2 + noise


def effectivity(solution, exact):
    """Bound over exact error."""
    settled(solution)
    return solution.error_bound / energy_error(solution, exact)[0]


def test_a_solution_in_the_space_has_no_error(reproduced):
    case, order = reproduced
    solution = solve(case.problem, maxh=0.5, order=order)
    assert solution.work["equilibrations"] == 0
    # Gaps are known to round-off, p* times them is a square of B: measured at most 1e-8.
    assert solution.relative_error_bound <= 1e-7
    low, high = solution.energy_bounds
    assert low <= solution.energy <= high
    assert high - low <= 1e-12 * solution.energy_norm**2
    assert solution.work["equilibrations"] == 1


nearly_incompressible = partial(
    cases.one_transition, Elastic(E=1.0, nu=0.4999), Elastic(E=3.0, nu=0.4999)
)
small_zone = partial(cases.hertz_contact, half_width=0.05)


def by_ratio(make, ratio, swap=False):
    """A case whose contact lines have segments of a ratio: nodes do not face nodes."""

    def posed():
        return cases.Case(pressed(make(), ratio, swap), make().exact)

    return posed


def with_dual_rows():
    """S1 with three divisions of one line that the other has not."""
    case = cases.one_transition()
    contact = [replace(pair, rows="dual") for pair in case.problem.contact]
    problem = replace(case.problem, geometry=unmatched_blocks(), contact=contact)
    return cases.Case(problem, case.exact)


def balls():
    return cases.Case(*axisymmetric_cases.hertz_contact())


def shrink_fit():
    return cases.Case(*axisymmetric_cases.fitted_rings())


SWAPPED = by_ratio(cases.one_transition, (4, 6), swap=True)

# Cases, orders, largest number of unknowns, the largest effectivity on all levels and on the last
# one, with some room above what was measured (in brackets).
CASES = {
    "S1-1": (cases.one_transition, 1, 1000, 1.08, 1.05),  # 1.03, 1.03
    "S1-2": (cases.one_transition, 2, 2500, 1.05, 1.02),  # 1.011, 1.001
    "S1-3": (cases.one_transition, 3, 2500, 1.12, 1.05),  # 1.06, 1.02
    "S1-4": (cases.one_transition, 4, 4400, 1.2, 1.1),  # 1.10, 1.05
    "S3-1": (cases.hertz_contact, 1, 900, 1.2, 1.05),  # 1.11, 1.005
    "S3-2": (cases.hertz_contact, 2, 3500, 1.2, 1.05),  # 1.10, 1.008
    "S3-3": (cases.hertz_contact, 3, 3500, 1.2, 1.12),  # 1.07, 1.05
    "S3-4": (cases.hertz_contact, 4, 3500, 1.4, 1.4),  # 1.21, 1.21
    "S3 of .05-1": (small_zone, 1, 1200, 1.5, 1.05),  # 1.26, 1.02
    "S3 of .05-2": (small_zone, 2, 3500, 1.25, 1.05),  # 1.10, 1.02
    "S3 of .05-4": (small_zone, 4, 3500, 1.4, 1.4),  # 1.23, 1.23
    "nu = .4999-2": (nearly_incompressible, 2, 4000, 1.05, 1.03),  # 1.009, 1.009
    "nu = .4999-4": (nearly_incompressible, 4, 4400, 1.2, 1.15),  # 1.08, 1.05
    "2:3-2": (by_ratio(cases.one_transition, (4, 6)), 2, 2600, 1.1, 1.05),  # 1.04, 1.002
    "2:3-4": (by_ratio(cases.one_transition, (4, 6)), 4, 4000, 1.5, 1.15),  # 1.26, 1.04
    "2:3, swapped-2": (SWAPPED, 2, 2600, 1.1, 1.05),  # 1.01, 1.01
    "5:37-4": (by_ratio(cases.one_transition, (5, 37)), 4, 4000, 1.2, 1.2),  # 1.10, 1.10
    "S3, 2:3-2": (by_ratio(cases.hertz_contact, (4, 6)), 2, 3000, 1.5, 1.05),  # 1.34, 1.008
    "S3, 2:3-4": (by_ratio(cases.hertz_contact, (4, 6)), 4, 4000, 1.8, 1.3),  # 1.52, 1.12
    "S3, 5:37-4": (by_ratio(cases.hertz_contact, (5, 37)), 4, 4000, 1.4, 1.2),  # 1.23, 1.08
    "dual rows-1": (with_dual_rows, 1, 1300, 1.35, 1.1),  # 1.20, 1.05
    "dual rows-2": (with_dual_rows, 2, 1300, 1.9, 1.3),  # 1.73, 1.18
    "bearing-2": (cases.ring_in_bearing, 2, 2600, 1.03, 1.02),  # 1.001, 1.000
    "bearing-3": (cases.ring_in_bearing, 3, 2600, 1.1, 1.05),  # 1.01, 1.001
    "rings-2": (cases.ring_in_ring, 2, 2000, 1.1, 1.03),  # 1.04, 1.005
    "rings-4": (cases.ring_in_ring, 4, 2700, 1.1, 1.1),  # 1.04, 1.04
    # 1.009; 1.07 if straight sides were divided as soon as curved ones
    "rings, 2:3-3": (by_ratio(cases.ring_in_ring, (4, 6)), 3, 1000, 1.03, 1.03),
    "Hertz about an axis-1": (balls, 1, 500, 1.2, 1.1),
    "Hertz about an axis-2": (balls, 2, 1500, 1.5, 1.1),
    "Hertz about an axis-3": (balls, 3, 1500, 1.4, 1.4),
    "shrink fit-1": (shrink_fit, 1, 900, 1.05, 1.02),
    "shrink fit-2": (shrink_fit, 2, 1500, 1.05, 1.02),
}
WITNESSES = ["S1-2", "S3-1", "S3 of .05-4", "nu = .4999-2", "2:3-2", "rings-2", "bearing-3"]
WITNESSES += ["rings, 2:3-3", "dual rows-1", "Hertz about an axis-2", "shrink fit-2"]


@pytest.mark.parametrize("name", CASES)
@pytest.mark.study(witness=WITNESSES)
def test_effectivity(name):
    make, order, size, largest, last = CASES[name]
    found = [effectivity(one, make().exact) for one in levels(make, order, size)]
    # The exact solution is one of circles, the meshes' are curves: measured 0.9985 at order 3.
    assert min(found) >= (1 if "ring" not in name else 0.995)
    assert max(found) <= largest
    assert found[-1] <= last


@pytest.mark.parametrize("make", [cases.ring_in_bearing, cases.ring_in_ring])
def test_straight_segments_for_circles(make):
    """Order 1: tractions turn at each vertex, which no stress of two triangles does.

    The domain of the mesh is another one, by which errors differ: its area lacks up to 1 %.
    Measured 1.01 to 1.07 and 1.005 to 1.03; 2.2 where only one line counts as straight.
    """
    for solution in levels(make, 1, 900):
        assert 0.97 <= effectivity(solution, make().exact) <= 1.1


@pytest.mark.parametrize(
    ("make", "order"),
    [
        *((cases.ring_in_bearing, order) for order in (3, 4)),
        (cases.ring_in_ring, 3),
        (paper.opening_ring, 3),
    ],
)
def test_coarse_curves(make, order):
    """Measured 1.017, 1.005, 1.028, 1.06; the last has forces on flat triangles.

    Where one bisection counted as enough rings in a bearing had no bound, those in a ring 1.21.
    """
    case = make()
    assert 0.995 <= effectivity(solve(case.problem, maxh=0.6, order=order), case.exact) <= 1.1


@pytest.mark.parametrize(
    ("make", "order", "size"),
    [
        *((cases.clamped_transition, *row) for row in ((1, 400), (2, 1300), (4, 4000))),
        *((cases.curved_lines, *row) for row in ((2, 1800), (4, 2500))),  # kinks inside triangles
    ],
)
@pytest.mark.study(witness=["clamped_transition-1-400"])
def test_body_forces_and_tractions(make, order, size):
    """No polynomials: what they miss is added."""
    for solution in levels(make, order, size):
        assert 1 <= effectivity(solution, make().exact)
        assert solution.bound_parts["loads"] > 0


def with_shear(inner, factor=1.0):
    """U = (r z, r^2 + z^2) / 100 with what it takes of body forces, held on all sides."""
    r, z, law = ng.x, ng.y, moduli(cases.FIRST)
    walls = "top|bottom|upper_side|lower_side|upper_contact|lower_contact"
    walls += "" if inner == 0 else "|axis"
    return replace(
        axisymmetric_cases.pressed_cylinders(inner),
        materials={"upper|lower": cases.FIRST},
        displacement={walls: (0.01 * r * z, 0.01 * (r * r + z * z))},
        traction={},
        force={"upper|lower": (0, -0.01 * factor * (10 * law.mu + 4 * law.lam))},
        contact=[],
    )


@pytest.mark.parametrize("inner", [0.0, 0.5])
def test_a_quadratic_field_about_an_axis(inner):
    """With forces it has no error; with twice the forces the bound is that of another solution."""
    solution = solve(with_shear(inner), maxh=0.4, order=2)
    settled(solution)
    assert solution.relative_error_bound <= 1e-7
    other = solve(with_shear(inner, factor=2.0), maxh=0.4, order=2)
    assert other.relative_error_bound > 1e-3


# Vertices of both bodies that all but face each other.


def shifted(by, order):
    case, x = cases.hertz_contact(half_width=0.3), np.linspace(-1, 1, 11)
    y = x + by * np.array([0, 1, -1, 1, -1, 1, -1, 1, -1, 1, 0])
    solution = solve(replace(case.problem, geometry=two_blocks(y, x)), order=order)
    trace = solution.discrete.space.trace
    proof = error_bound(solution.problem, trace, solution.displacement, solution.pairs)
    return proof.bound / energy_error(solution, case.exact)[0]


@pytest.mark.parametrize("order", [1, 3])
def test_narrow_sides_cost_nothing(order):
    narrow, wide = shifted(3e-7, order), shifted(1e-2, order)
    assert 1 < narrow < 1.02 * wide  # measured: 1.001 and 1.003 times


def test_sides_that_are_not_opposite_are_refused():
    with pytest.raises(ValueError, match="face each other to within 5e-08 of a side"):
        shifted(1e-8, 1)


def test_lines_that_nearly_cross_at_a_vertex():
    """The sides at the middle of a block miss two lines by 1e-8 of their length (measured)."""
    case = pressed_fibres(1e4, 0.0)
    *_, solution = levels_of(case.problem, "uniform", 1, 400, 0.4)
    error, _ = energy_error(solution, case.exact)
    assert error <= solution.error_bound <= 1.4 * error  # measured 1.31
    # Tractions are as far out of balance as in blocks without such a vertex, 1e-13; 2e-10 before.
    assert solution.equilibrated.certificate["tractions"] <= 1e-12


@pytest.mark.parametrize(("at", "radius"), [((0.0828, 0.1277), 0.0146), ((0.2166, 0.3042), 0.0121)])
def test_bounds_see_discs_between_points(at, radius):
    """Forces on discs that have none of the points of a whole triangle; B was .82 of the error."""
    disc = Circle(at, radius).Face()
    disc.faces.name = "body"
    inside = ng.IfPos(radius**2 - (ng.x - at[0]) ** 2 - (ng.y - at[1]) ** 2, 1.0, 0.0)
    problem = loaded(force={"body": (0, -2e3 * inside)})
    resolved = OCCGeometry(Glue([square().shape.faces[0] - disc, disc]), dim=2)
    *_, reference = adapt(replace(problem, geometry=resolved), order=4, max_dofs=12_000)
    for maxh in (0.3, 0.25):
        solution = solve(problem, maxh=maxh, order=2)
        error = Overkill(reference).relative_error(solution) * reference.energy_norm
        # The finer solution's error is a hundredth of this one or less. Measured 2.9 to 4.2.
        assert reference.error_estimate <= 0.02 * error
        assert 1 <= solution.error_bound / error <= 8
