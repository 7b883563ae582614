"""Supports that contradict each other at a corner: told, and not refined for ever."""

from __future__ import annotations

import math
import re
import warnings
from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest
from netgen.occ import Axis, OCCGeometry, Z

from ngcontact import Contact, ContactWarning, Elastic, Problem, adapt, solve
from ngcontact.adaptivity import settled
from ngcontact.geometries import blocks, disc
from ngcontact.mesh import diameters, first_mesh
from ngcontact.plausibility import contradictions
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
    assert diameters(mesh).min() > 1e-3 / 8
    # The estimate stays what it is, and what lies outside of the corner meets the tolerance.
    last = solutions[-1]
    outside = last.indicators[~settled(mesh, np.zeros((1, 2)))]
    assert last.relative_error_estimate > 0.2
    assert math.hypot(*outside) <= 0.2 * last.energy_norm


def turned():
    """The square turned by 37 degrees, in units of a thousandth."""
    shape = square().shape.Rotate(Axis((0, 0, 0), Z), 37).Scale((0, 0, 0), 1000)
    data = {"bottom": (0, 0), "right": (30, -50)}
    return replace(loaded(), geometry=OCCGeometry(shape, dim=2), displacement=data)


def pressed():
    """Blocks in contact; one side of the upper one leads away from its top."""
    return Problem(
        geometry=blocks(),
        materials={"upper": Elastic(1.0, 0.3), "lower": Elastic(10.0, 0.2)},
        displacement={"bottom": (0, 0), "top": (0, -0.05), "upper_left": (0.1, None)},
        contact=[Contact("upper_contact", "lower_contact")],
    )


def curved():
    """Half a disc on a plane whose top and axis move apart."""
    return Problem(
        geometry=disc(),
        materials={"disc": Elastic(1.0, 0.3)},
        displacement={"top": (0, -0.005), "axis": (0.02, None)},
        contact=[Contact("arc", direction=(0, -1), gap=ng.y)],
    )


@pytest.mark.parametrize(
    ("make", "place"),
    [
        (turned, (798.635510, 601.815023)),  # 1000 (cos 37, sin 37)
        (pressed, (-1, 1)),
        (curved, (0, 1)),
    ],
)
def test_contradictions_of_other_bodies(make, place):
    problem = make()
    with pytest.warns(ContactWarning, match="at their corner") as caught:
        solutions = list(adapt(problem, order=2, tolerance=0.2, max_dofs=20_000))
    found = [re.findall(r"at their corner \((.*?), (.*?)\)", str(w.message)) for w in caught]
    [[corner]] = [each for each in found if each]
    size = max(map(abs, place))
    assert [float(x) for x in corner] == pytest.approx(place, abs=1e-3 * size)  # four digits
    last = solutions[-1]
    assert len(solutions) <= 16
    # It did not end for want of unknowns: outside of the corner the tolerance is met.
    outside = last.indicators[~settled(last.mesh, np.array([place]))]
    assert last.relative_error_estimate > 0.2
    assert math.hypot(*outside) <= 0.2 * last.energy_norm


def test_only_small_elements_within_the_disc_are_settled():
    mesh = first_mesh(loaded(), 0.3)
    assert not settled(mesh, np.zeros((1, 2))).any()  # an element at the corner is larger
    assert not settled(mesh, np.zeros((0, 2))).any()


@pytest.mark.parametrize("angle", [0, 37])
def test_what_goes_along_a_guide_does_not_contradict_it(angle):
    """At any angle: u along the guide is 0 across it to round-off."""
    shape = square().shape.Rotate(Axis((0, 0, 0), Z), angle)
    a = math.radians(angle)
    along = (-0.1 * math.sin(a), 0.1 * math.cos(a))
    problem = replace(
        loaded(), geometry=OCCGeometry(shape, dim=2), displacement={"bottom": along}, sliding="left"
    )
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactWarning)
        solve(problem, maxh=0.4)
    across = {"bottom": (0.1 * math.cos(a), 0.1 * math.sin(a))}
    with pytest.warns(ContactWarning, match="across the guide"):
        solve(replace(problem, displacement=across), maxh=0.4)


def test_sound_supports_are_no_doubt():
    data = {"bottom": (0, 0), "left": (0, None), "top": (None, 0.1)}
    with warnings.catch_warnings():
        warnings.simplefilter("error", ContactWarning)
        solve(replace(loaded(), displacement=data), maxh=0.3)


def test_round_off_is_no_contradiction():
    """On the axis the radial displacement e r is 1e-35 where Netgen's corner lies at r = 1e-32."""
    widened = (1e-3 * ng.x, 0.0)
    problem = Problem(
        geometry=disc(),
        materials={"disc": Elastic(E=200.0, nu=0.3)},
        displacement={"arc": widened, "top": widened},
        sliding="axis",
    )
    assert contradictions(problem, first_mesh(problem, 0.4)) == []
