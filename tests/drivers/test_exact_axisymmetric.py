"""Hertz contact about an axis: its surface, known values. Bounds and rates see its stresses."""

import math

import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from drivers.reference.axisymmetric import hertz, huber_displacement
from drivers.reference.westergaard import effective_modulus, moduli
from ngcontact.problem import Elastic

UPPER, LOWER = Elastic(E=1.0, nu=0.3), Elastic(E=3.0, nu=0.2)
A, R = 0.3, 5.0
HERTZ = hertz(UPPER, LOWER, radius=R, a=A)
MESH = MakeStructured2DMesh(quads=True, nx=4, ny=4, mapping=lambda s, t: (6 * s, 6 * (2 * t - 1)))


def at(field, x, y):
    return np.asarray(field(MESH(x, y)), dtype=float)


@pytest.mark.parametrize("r", [0.0, 0.1, 0.29, 0.3, 0.31, 0.5, 2.0])
def test_huber_at_the_surface(r):
    """Pressure, no shear, and the gap after deformation: Johnson 1985 (3.39), (3.42)."""
    for body in ("upper", "lower"):
        stress = at(HERTZ.stress[body], r, 0.0)
        assert -stress[3] == pytest.approx(float(HERTZ.pressure(r)), abs=1e-14)
        assert stress[1] == 0
    upper, lower = (at(HERTZ.displacement[body], r, 0.0)[1] for body in ("upper", "lower"))
    opening = r**2 / (2 * R) + upper - lower
    assert opening == pytest.approx(float(HERTZ.gap(r)), abs=1e-14)
    assert (opening > 1e-12) == (r > A)


def test_hertz_known_values():
    """F = 4/3 E* a^3 / R; on the axis at the surface rr = hoop = -(1 + 2 nu) / 2 p0."""
    E = effective_modulus(UPPER, LOWER)
    assert pytest.approx(4 / 3 * E * A**3 / R) == HERTZ.P
    assert pytest.approx(1.5 * HERTZ.P / (math.pi * A**2)) == HERTZ.p0
    stress, hoop = at(HERTZ.stress["upper"], 0.0, 0.0), at(HERTZ.hoop["upper"], 0.0, 0.0)
    assert stress[0] == pytest.approx(-0.8 * HERTZ.p0)
    assert hoop == pytest.approx(-0.8 * HERTZ.p0)
    far = at(huber_displacement(UPPER, HERTZ.p0, A, "upper"), 0.0, 6.0)
    point = HERTZ.P * (2 * (1 - 0.3) + 1) / (4 * math.pi * moduli(UPPER).mu * 6.0)  # Boussinesq
    assert far[1] == pytest.approx(point, rel=2 * (A / 6) ** 2)
