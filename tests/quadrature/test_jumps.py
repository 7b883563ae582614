"""Moduli that jump inside elements: told with their place, and refined together."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import ContactWarning, Elastic, Hooke, Problem, adapt
from ngcontact.mesh import first_mesh
from ngcontact.quadrature import warn_of_jumps
from tests.quadrature.test_loads import square

BODIES = ("upper", "lower")


@pytest.fixture(scope="module")
def mesh():
    return first_mesh(cases.one_transition().problem, 0.7)


def made_of(law):
    return replace(cases.one_transition().problem, materials=dict.fromkeys(BODIES, law))


def rotated(angle):
    """A law 100 times stiffer along an axis at that angle; its trace does not depend on it."""
    c, s = np.cos(angle), np.sin(angle)
    T = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    return T.T @ np.diag([100.0, 1.0, 1.0]) @ T


def functions(first, second):
    """C as a function, of two matrices on both sides of x = .37 + y / 10."""
    side = ng.x - 0.37 - 0.1 * ng.y
    entries = zip(first.ravel().tolist(), second.ravel().tolist(), strict=True)
    return Hooke(ng.CF(tuple(ng.IfPos(side, a, b) for a, b in entries), dims=(3, 3)))


JUMPS = {
    "contrast 3": Elastic(ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 1.0, 3.0), 0.3),
    "contrast 1e4": Elastic(ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 1.0, 1e4), 0.3),
    "nu": Elastic(1.0, ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 0.0, 0.45)),
    "axes": functions(rotated(0.3), rotated(-0.3)),
    "beside a smooth change": Elastic(
        (1 + ng.x * ng.x) * ng.IfPos(ng.x - 0.37 - 0.1 * ng.y, 1.0, 20.0), 0.3
    ),
}


@pytest.mark.parametrize("name", JUMPS)
@pytest.mark.parametrize("unit", [1.0, 1e9])
def test_jumps_inside_elements_are_told_with_their_place(name, unit, mesh):
    law = JUMPS[name]
    if unit != 1:
        law = Hooke(unit * law.voigt())
    with pytest.warns(ContactWarning, match="jump inside") as caught:
        warn_of_jumps(made_of(law), mesh)
    assert len(caught) == 2  # one of each body
    for warning, body in zip(caught, BODIES, strict=True):
        message = str(warning.message)
        assert f'"{body}"' in message
        assert "an edge of the geometry" in message
        x, y = map(float, message.split("near (")[1].split(")")[0].split(","))
        assert x == pytest.approx(0.37 + 0.1 * y, abs=1e-3)  # printed with four digits


def test_elements_in_which_moduli_jump_are_refined_together():
    # One at a time, as chance cuts it, more than 64 levels led to 10 000 unknowns. Measured: 5.
    problem = Problem(
        geometry=square(),
        materials={"body": Elastic(ng.IfPos(ng.x - 0.37, 1.0, 1e4), 0.3)},
        displacement={"bottom": (0, 0)},
        traction={"top": (0.3, -1.0)},
    )
    with pytest.warns(ContactWarning, match="jump inside"):
        assert len(list(adapt(problem, order=2, max_dofs=10_000))) <= 8
