"""Bodies of revolution against closed forms: patches, Lame, Huber, Boussinesq, Sneddon, shells."""

import math
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases as cases
from drivers.reference.cases import FIRST, SECOND
from drivers.reference.straight import relative_energy_error
from ngcontact import Contact, Problem, adapt, solve
from ngcontact.geometries import rings
from tests.estimator.bound.test_exact import settled
from tests.scenes import divided

ROUND_OFF = 1e-10  # of fields that the elements contain, and of resultants


def swollen(law, a, b, inner, outer, r):
    """Lame: radial displacement at r of a spherical shell a < r < b under pressures."""
    sums = (1 - 2 * law.nu) * (inner * a**3 - outer * b**3) * r
    differences = (1 + law.nu) / 2 * (inner - outer) * a**3 * b**3 / r**2
    return (sums + differences) / (law.E * (b**3 - a**3))


@pytest.mark.parametrize("rows", ["auto", "dual"])
@pytest.mark.parametrize(
    ("order", "maxh", "limit"), [(1, 0.05, 2e-2), (2, 0.1, 5e-3), (4, 0.15, 2e-4)]
)
def test_a_spherical_shell_shrunk_on_another(order, maxh, limit, rows):
    """Uniform pressure on a sphere that meets the axis, no end of contact; the force of a half."""
    problem = Problem(
        geometry=rings(0.5, 1.0, 2.0, quarter=True),
        materials={"inner": FIRST, "outer": SECOND},
        sliding="inner_cut_y|outer_cut_y",
        contact=[Contact("inner_contact", "outer_contact", gap=-0.01, rows=rows)],
        model="axisymmetric",
    )
    solution = solve(problem, maxh=maxh, order=order)
    p = 0.01 / (swollen(SECOND, 1, 2, 1, 0, 1) - swollen(FIRST, 0.5, 1, 0, 1, 1))
    assert np.abs(solution.pressure / p - 1).max() < limit
    assert len(solution.transitions()) == 0
    assert abs(solution.contact_force()[1]) == pytest.approx(math.pi * p, rel=limit)


ORDERS = (1, 2, 3, 4)
EXACT = 1e-10  # promised of fields that the elements contain; measured 2e-13


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("inner", [0.0, 0.5])
@pytest.mark.parametrize("rows", ["auto", "dual", "2:3"])
def test_uniform_pressure_is_exact(inner, rows, order):
    """On and off the axis; the force is that of the whole body, radial ones cancel."""
    if rows == "2:3":
        problem = cases.pressed_cylinders(inner)
        counts = {"upper_contact": 3, "lower_contact": 2}
        problem = replace(problem, geometry=divided(problem.geometry, counts))
        solution = solve(problem, maxh=1.0, order=order)
        assert len(solution.points) == 3 * order + 1
    else:
        solution = solve(cases.pressed_cylinders(inner, rows=rows), maxh=0.5, order=order)
    area = np.pi * (1 - inner**2)
    assert np.abs(solution.pressure - 1).max() < EXACT
    assert solution.contact_force() == pytest.approx((0, area), rel=EXACT)
    assert solution.reactions["bottom"] == pytest.approx((0, area), rel=EXACT)
    assert solution.energy == pytest.approx(-area / 2 * (1 / FIRST.E + 1 / SECOND.E), rel=EXACT)
    assert len(solution.transitions()) == 0
    for name, law in (("upper", FIRST), ("lower", SECOND)):
        u = ng.CF((law.nu / law.E * ng.x, 0))[0]
        error = ng.Integrate((solution.displacement[0] - u) ** 2, solution.mesh.Materials(name))
        assert error**0.5 < EXACT
    hoop = ng.Integrate(solution.hoop_stress**2, solution.mesh)
    assert hoop**0.5 < EXACT
    if order > 1:  # squares of round-off of stresses over those of the stress
        assert solution.relative_error_estimate < 1e-9
    settled(solution)
    assert solution.relative_error_bound <= 1e-7


@pytest.mark.parametrize(("order", "limit"), [(1, 1.5e-2), (2, 6e-4), (3, 5e-5), (4, 5e-6)])
def test_shrink_fit(order, limit):
    """Measured 1.7e-3, 7e-5, 9e-6, 3e-7; promised four to fifteen times that."""
    problem, exact = cases.fitted_rings()
    solution = solve(problem, maxh=0.02 * order, order=order)
    assert solution.active.all()
    assert np.abs(solution.pressure / exact.p - 1).max() < limit
    assert solution.contact_force() == pytest.approx((0, 0), abs=EXACT * exact.p)
    place = solution.mesh(0.8, 0.1)
    assert solution.out_of_plane_stress(place) == solution.hoop_stress(place) < 0


# Relative energy error at 4000 unknowns that `adapt` stays below: 1.5 times what was measured.
# Then force, radius and peak pressure.
HUBER = {
    1: (9e-2, 6e-3, 4e-3, 4e-2),
    2: (1.2e-2, 1e-4, 2e-3, 2e-3),
    3: (3e-3, 3e-5, 1e-3, 1e-3),
    4: (1.5e-3, 3e-5, 1e-3, 1e-3),
}


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.study(witness=["3"])
def test_huber(order):
    """Rates, effectivities, and one end of contact at every level, none at the axis."""
    problem, exact = cases.hertz_contact()
    levels = list(adapt(problem, order=order, max_dofs=10_000 if order == 2 else 6000))
    errors = [relative_energy_error(s, exact) for s in levels]
    half, last = len(levels) // 2, levels[-1]
    unknowns = [s.displacement.space.ndof for s in levels]
    # Unknowns to the power -p/2, over the second half of the levels, to 12 percent.
    rate = -np.polyfit(np.log(unknowns[half:]), np.log(errors[half:]), 1)[0]
    assert rate > 0.88 * order / 2
    ratios = [s.relative_error_estimate / e for s, e in zip(levels, errors, strict=True)]
    assert 1 < min(ratios) <= max(ratios) < 8  # measured 3.3 to 6.4 at all orders and levels
    for solution in levels:
        assert len(solution.transitions()) == 1
        assert solution.transitions()[0, 0] > 0.5 * exact.a
    error, force, radius, peak = HUBER[order]
    assert errors[-1] < error
    assert last.contact_force()[1] == pytest.approx(-exact.P, rel=force)
    assert last.transitions()[0, 0] == pytest.approx(exact.a, rel=radius)
    assert last.pressure.max() == pytest.approx(exact.p0, rel=peak)


@pytest.mark.parametrize(
    ("make", "order"),
    [(make, p) for make in (cases.indented_by_punch, cases.indented_by_cone) for p in (2, 3, 4)],
)
@pytest.mark.study(witness=["indented_by_punch-3", "indented_by_cone-4"])
def test_indentation(make, order):
    """Boussinesq and Sneddon: singular at the edge and at the tip. Measured 2e-4 at 4000.

    The cone: forces 6e-7 to 1.4e-5, ends 2e-5 to 9e-5.
    """
    problem, exact = make()
    *_, solution = adapt(problem, order=order, max_dofs=4000)
    assert solution.contact_force()[1] == pytest.approx(-exact.P, rel=1e-3)
    at = solution.transitions()[:, 0]
    assert at == pytest.approx([exact.a] if make is cases.indented_by_cone else [], rel=2e-3)


def test_a_plane_problem_has_no_hoop_stress():
    problem = replace(cases.pressed_cylinders(), model="plane strain")
    with pytest.raises(ValueError, match="plane model has no hoop stress: out_of_plane_stress"):
        solve(problem, maxh=0.5).hoop_stress  # noqa: B018


def test_the_model_decides_what_is_used_again():
    """On the same mesh rows and stiffness of the plane are not those about an axis."""
    about = replace(cases.pressed_cylinders(), sliding="axis")
    plane = replace(about, model="plane strain")
    first = solve(plane, maxh=0.5, order=2)
    again = solve(about, first.mesh, order=2, start=first)
    assert np.abs(again.pressure - 1).max() < EXACT
    back = solve(plane, first.mesh, order=2, start=again)
    assert back.contact_force() == pytest.approx(first.contact_force(), abs=1e-12)
