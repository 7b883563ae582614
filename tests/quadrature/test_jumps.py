"""Moduli that jump inside elements, and jumps along lines: told with place and size."""

from dataclasses import replace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import ContactWarning, Elastic, Hooke, Problem, adapt
from ngcontact.mesh import first_mesh
from ngcontact.quadrature import warn_of_jumps
from ngcontact.quadrature.cells import lattice
from ngcontact.quadrature.features import steps_along
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


START, END = 3.0, 6.0


def found(function, start=START, end=END, places=2048):
    """Jumps of a function seen at some places, as on boundaries, and at both ends."""
    inner = start + (end - start) * lattice(1, places)[:, 0]
    t = np.concatenate([[start], inner, [end]])
    return steps_along(function, t, function(t))


@pytest.mark.parametrize("place", [3.0, 5.0, 5.2, 5.25, 5.7071, 5.999999])
def test_jumps_are_found_where_they_are(place):
    at, size = found(lambda x: np.cos(x) + 1e-3 * (x > place))
    assert at == pytest.approx([place], abs=1e-12)
    assert size == pytest.approx([1e-3], rel=1e-9)


@pytest.mark.parametrize(
    "smooth",
    [
        np.zeros_like,
        np.cos,
        lambda x: np.abs(x - 5.3),
        lambda x: np.sqrt(np.maximum(x - 5.3, 0)),
        lambda x: np.maximum(x - 5.3, 0) ** 0.1,
        lambda x: np.arctan(1e6 * (x - 5.3)),
    ],
    ids=["zero", "smooth", "kink", "root", "tenth root", "steep"],
)
def test_what_is_continuous_does_not_jump(smooth):
    assert found(smooth)[0].size == 0


@pytest.mark.parametrize("length", [1.0, 3000.0])
@pytest.mark.parametrize("size", [1.0, 1e-3])
def test_small_jumps_are_found_beside_large_changes(length, size):
    """Of 1e-3 beside a change of 1, which in 2048 parts bends by 1e-6 from one to the next."""
    place = 0.70710678 * length
    at, amount = found(lambda x: np.sin(3 * x / length) + size * (x > place), 0.0, length)
    assert at == pytest.approx([place], rel=1e-12)
    assert amount == pytest.approx([size], rel=1e-9)
