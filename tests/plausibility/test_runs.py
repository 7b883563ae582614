"""Told before the solve or on the way: elements that lock, supports that contradict, estimates."""

import math
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Axis, OCCGeometry, Z

from drivers.reference import cases
from ngcontact import ContactWarning, Elastic, adapt, solve
from ngcontact.adaptivity import below_resolution
from ngcontact.mesh import first_mesh
from ngcontact.plausibility import contradictions, estimates_rise, warn_of_implausible
from ngcontact.problem import MeshArrays
from tests.quadrature.test_loads import loaded, square

CONTRADICTIONS = {
    "one component": ({"displacement": {"bottom": (0, 0), "left": (0.1, None)}}, "0 and 0.1 along"),
    "both": ({"displacement": {"bottom": (0, 0), "left": (0, 0.2)}}, "0 and 0.2 along y"),
    "guide": ({"displacement": {"bottom": (0.1, 0)}, "sliding": "left"}, "leads -0.1 across"),
    "one component across a guide": (
        {"displacement": {"bottom": (0.1, None)}, "sliding": "left"},
        "leads -0.1 across the guide",
    ),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_a_run_does_not_refine_into_the_corner_for_ever(name):
    # It took up to 52 levels, all in the corner. From 1/10 to a thousandth are 7 halvings of sides,
    # then meshes grow by a factor.
    data, message = CONTRADICTIONS[name]
    with pytest.warns(ContactWarning, match=message + r".* at their corner \(0, 0\)"):
        solutions = list(adapt(replace(loaded(), **data), order=2, tolerance=0.2, max_dofs=20_000))
    assert len(solutions) <= 16
    mesh = solutions[-1].mesh
    assert MeshArrays(mesh).diameters.min() > 1e-3 / 8
    # The estimate stays what it is, and what lies outside of the corner meets the tolerance.
    last = solutions[-1]
    outside = last.indicators[~below_resolution(mesh, np.zeros((1, 2)))]
    assert last.relative_error_estimate > 0.2
    assert math.hypot(*outside) <= 0.2 * last.energy_norm


@pytest.mark.parametrize("angle", [0, 37])
def test_what_goes_along_a_guide_does_not_contradict_it(angle):
    """At any angle: u along the guide is 0 across it to round-off."""
    shape = square().shape.Rotate(Axis((0, 0, 0), Z), angle)
    a = math.radians(angle)
    along = (-0.1 * math.sin(a), 0.1 * math.cos(a))
    problem = replace(
        loaded(), geometry=OCCGeometry(shape, dim=2), displacement={"bottom": along}, sliding="left"
    )
    free = replace(problem, displacement={"bottom": (0.1, None)})  # along y whatever fits the guide
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactWarning)
        solve(problem, maxh=0.4)
        assert angle == 0 or not contradictions(free, first_mesh(free, 0.4))
    across = {"bottom": (0.1 * math.cos(a), 0.1 * math.sin(a))}
    with pytest.warns(ContactWarning, match="across the guide"):
        solve(replace(problem, displacement=across), maxh=0.4)


def test_a_guide_off_by_the_seventh_digit_contradicts_nothing():
    """Its normal has a part of 2e-7 along the displacement, of which the other component is 0."""
    shape = square().shape.Rotate(Axis((0, 0, 0), Z), 1e-5)
    geometry = OCCGeometry(shape, dim=2)
    problem = replace(
        loaded(), geometry=geometry, displacement={"bottom": (0, 0.1)}, sliding="left"
    )
    assert contradictions(problem, first_mesh(problem, 0.4)) == []


def test_round_off_is_no_contradiction():
    """On the axis the radial displacement e r is 1e-35 where Netgen's corner lies at r = 1e-32."""
    widened = (1e-3 * ng.x, 0.0)
    held = {"arc": widened, "top": widened}
    problem = replace(cases.disc_on_rigid_plane(), displacement=held, contact=[])
    assert contradictions(problem, first_mesh(problem, 0.4)) == []


@pytest.mark.parametrize(
    ("estimates", "rise"),
    [
        ([0.3, 0.2, 0.1, 0.12, 0.13, 0.18], True),
        ([0.3, 0.1, 0.14, 0.13, 0.16], True),
        ([0.1, 0.12, 0.13], True),  # two levels, of twice the unknowns each
        ([0.1, 0.13], False),  # one level
        ([0.8, 11.0, 8.0, 2.2], False),  # falls again
        ([1e-3, 1.01e-3, 1.02e-3, 1.03e-3], False),  # noise
        ([0.4, 0.2, 0.1, 0.05], False),
        ([0.5], False),
    ],
)
@pytest.mark.parametrize("unit", [1.0, 1e-9])
def test_rises_of_several_levels_are_found(estimates, rise, unit):
    assert estimates_rise([unit * estimate for estimate in estimates]) == rise


def locking(problem, maxh, order):
    """Bodies that warnings name."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_of_implausible(problem, first_mesh(problem, maxh), order, [])
    assert all(one.category is ContactWarning for one in caught)
    assert all(f"order {order} lock" in str(one.message) for one in caught)
    return [str(one.message).split('"')[1] for one in caught]


@pytest.mark.parametrize(
    ("nu", "order", "model", "warned"),
    [
        (0.499, 1, "plane strain", True),
        (0.46, 1, "plane strain", True),
        (0.45, 1, "plane strain", False),
        (0.499999, 2, "plane strain", False),  # straight sides
        (0.499, 1, "plane stress", False),
    ],
)
def test_locking_is_not_silent(nu, order, model, warned):
    law = {"upper|lower": Elastic(E=1.0, nu=nu)}
    problem = replace(cases.one_transition().problem, materials=law, model=model)
    assert locking(problem, 0.7, order) == ["upper", "lower"] * warned


@pytest.mark.parametrize(("nu", "highest"), [(0.499, 1), (0.4999, 2), (0.499999, 3)])
def test_higher_orders_lock_beside_curves(nu, highest):
    problem = replace(cases.pressed_disc(), materials={"disc|block": Elastic(E=1.0, nu=nu)})
    for order in (2, 3, 4):
        assert locking(problem, 0.5, order) == ["disc"] * (order <= highest)
