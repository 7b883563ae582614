"""Bodies of revolution against closed forms: tubes, shells, laws, a ball on its seat, zones."""

import math

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import axisymmetric_cases as cases
from drivers.reference.cases import FIRST, SECOND
from drivers.reference.westergaard import moduli
from ngcontact import Contact, Elastic, Problem, adapt, solve
from ngcontact.geometries import rings
from ngcontact.geometries.region import body, compound, polygon, quarter_arc, segment

BORE, JOINT, RIM = 0.4, 1.1, 1.9
ROUND_OFF = 1e-10  # of fields that the elements contain, and of resultants


def tubes(pressure, clearance, swapped=False, force=()):
    """A tube in a tube, ends guided; the inner one is blown up to the outer one."""
    inside = [(BORE, 0), (JOINT, 0), (JOINT, 0.7), (BORE, 0.7)]
    outside = [(JOINT, 0), (RIM, 0), (RIM, 0.7), (JOINT, 0.7)]
    sides = ("outer_face", "inner_face") if swapped else ("inner_face", "outer_face")
    return Problem(
        geometry=compound(
            body("inner", polygon(inside, ["ends", "inner_face", "ends", "bore"])),
            body("outer", polygon(outside, ["ends", "rim", "ends", "outer_face"])),
        ),
        materials={"inner": FIRST, "outer": SECOND},
        traction={"bore": pressure},
        force=dict(force),
        sliding="ends",
        contact=[Contact(*sides, gap=clearance)],
        model="axisymmetric",
    )


def widened(law, a, b, inner, outer, r):
    """Lame: u_r at r of a tube a < r < b under pressures `inner`, `outer`, without axial strain."""
    sums = (1 - 2 * law.nu) * (inner * a * a - outer * b * b) * r
    differences = (inner - outer) * a * a * b * b / r
    return (1 + law.nu) / law.E / (b * b - a * a) * (sums + differences)


def at_joint(law_in, law_out, blown):
    """What the joint's pressure 1 takes off the difference of both u_r, and what `blown` adds."""
    closing = widened(law_in, BORE, JOINT, 0, 1, JOINT) - widened(law_out, JOINT, RIM, 1, 0, JOINT)
    return -closing, widened(law_in, BORE, JOINT, blown, 0, JOINT)


@pytest.mark.parametrize(
    ("order", "maxh", "limit"), [(1, 0.05, 3e-2), (2, 0.1, 4e-3), (4, 0.15, 1e-4)]
)
@pytest.mark.parametrize("swapped", [False, True])
def test_a_tube_blown_up_through_its_clearance(order, maxh, limit, swapped):
    pressure, clearance = 0.01 * FIRST.E, 1e-3
    softness, way = at_joint(FIRST, SECOND, pressure)
    solution = solve(tubes(pressure, clearance, swapped), maxh=maxh, order=order)
    assert np.abs(solution.pressure / ((way - clearance) / softness) - 1).max() < limit
    below = solve(
        tubes(0.9 * pressure * clearance / way, clearance, swapped), maxh=maxh, order=order
    )
    assert not below.active.any()


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


@pytest.mark.parametrize("order", [2, 3])
def test_a_ball_on_a_conical_seat(order):
    """A ring of contact at 45 degrees: Hertz on a line, of the force per length of its circle."""
    q, load = math.sqrt(0.5), 5e-4
    ball = [
        ("arc", quarter_arc((0, 1), 1, 3, 0)),
        ("flat", segment((1, 1), (0, 1))),
        ("axis", segment((0, 1), (0, 0))),
    ]
    seat = [(0.2, -0.6), (1.5, -0.6), (1.5, 2.5 - 2 * q), (0.2, 1.2 - 2 * q)]
    soft, stiff = Elastic(1.0, 0.3), Elastic(3.0, 0.2)
    problem = Problem(
        geometry=compound(
            body("ball", ball), body("seat", polygon(seat, ["base", "wall", "seat", "hole"]))
        ),
        materials={"ball": soft, "seat": stiff},
        displacement={"base": (0, 0)},
        traction={"flat": load},
        contact=[Contact("arc", "seat", direction=(q, -q))],
        model="axisymmetric",
    )
    *_, solution = adapt(problem, order=order, max_dofs=4000)
    weight = load * math.pi
    assert solution.contact_force()[1] == pytest.approx(weight, rel=ROUND_OFF)
    low, high = np.sort(solution.transitions()[:, 0])
    per_length = weight / q / (2 * math.pi * q)
    a = math.sqrt(4 * per_length / math.pi * sum(1 / moduli(law).plane for law in (soft, stiff)))
    # The line is curved: a / r = 0.04 is neglected, to first order it only moves the middle.
    assert (low + high) / 2 == pytest.approx(q, rel=2e-3)
    assert (high - low) / 2 == pytest.approx(a * q, rel=2e-3)
    assert solution.pressure.max() == pytest.approx(2 * per_length / math.pi / a, rel=5e-3)


@pytest.mark.parametrize("order", [2, 3, 4])
def test_a_modulus_that_varies_with_the_radius(order):
    """Nu = 0: sigma_zz = E(r) times a strain, all else 0, which the elements contain."""
    problem = Problem(
        geometry=cases.cylinders(),
        materials={"upper|lower": Elastic(1 + 3 * ng.x**2, 0.0)},
        displacement={"bottom": (None, 0), "top": (None, -0.02)},
        contact=[Contact("upper_contact", "lower_contact")],
        model="axisymmetric",
    )
    solution = solve(problem, maxh=0.25, order=order)
    force = 2 * math.pi * 0.01 * (1 / 2 + 3 / 4)
    assert abs(solution.contact_force()[1]) == pytest.approx(force, rel=ROUND_OFF)
    assert solution.relative_error_bound < ROUND_OFF
    if order == 4:  # whose rows contain pressures of degree 2
        p = 0.01 * (1 + 3 * solution.points[:, 0] ** 2)
        assert solution.pressure == pytest.approx(p, rel=ROUND_OFF)
