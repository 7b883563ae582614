"""Exact solutions about an axis: Hooke's law, equilibrium, contact conditions, known values."""

import math

import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from drivers.reference.axisymmetric import cone, flat_punch, hertz, huber_displacement, shrink_fit
from drivers.reference.westergaard import effective_modulus, moduli
from ngcontact.problem import Elastic

UPPER, LOWER = Elastic(E=1.0, nu=0.3), Elastic(E=3.0, nu=0.2)
A, R = 0.3, 5.0
HERTZ = hertz(UPPER, LOWER, radius=R, a=A)
FIT = shrink_fit(UPPER, LOWER, radii=(0.4, 1.1, 1.9), interference=0.01)
PUNCH = flat_punch(LOWER, a=A, depth=0.01)
CONE = cone(LOWER, a=A, slope=0.05)
MESH = MakeStructured2DMesh(quads=True, nx=4, ny=4, mapping=lambda s, t: (6 * s, 6 * (2 * t - 1)))
# Inside, near and far from the circle, beside its edge, close to the surface.
PLACES = [(0.1, 0.05), (0.25, 0.02), (0.31, 0.02), (0.6, 0.3), (0.05, 0.6), (1, 1), (0.5, 0.003)]
STEP = 1e-5  # of differences: their error is its square over that of the distance to the edge
DIFFERENCES = 1e-6


def at(field, x, y):
    return np.asarray(field(MESH(x, y)), dtype=float)


def slopes(field, x, y):
    """Derivatives along r and z."""
    h = STEP
    return (at(field, x + h, y) - at(field, x - h, y)) / (2 * h), (
        at(field, x, y + h) - at(field, x, y - h)
    ) / (2 * h)


def stress_by_hooke(law, u, x, y):
    """rr, rz, rz, zz and hoop from differences of a displacement."""
    along_r, along_z = slopes(u, x, y)
    strain = [along_r[0], (along_r[1] + along_z[0]) / 2, along_z[1], at(u, x, y)[0] / x]
    m = moduli(law)
    trace = m.lam * (strain[0] + strain[2] + strain[3])
    rz = 2 * m.mu * strain[1]
    rr, zz, hoop = (trace + 2 * m.mu * strain[k] for k in (0, 2, 3))
    return np.array([rr, rz, rz, zz, hoop])


@pytest.mark.parametrize(("body", "law", "side"), [("upper", UPPER, 1), ("lower", LOWER, -1)])
@pytest.mark.parametrize(("r", "depth"), PLACES)
def test_huber_is_elastic_and_in_equilibrium(body, law, side, r, depth):
    u, stress, hoop = HERTZ.displacement[body], HERTZ.stress[body], HERTZ.hoop[body]
    z = side * depth
    here, around = at(stress, r, z), float(at(hoop, r, z))
    by_hooke = stress_by_hooke(law, u, r, z)
    assert np.append(here, around) == pytest.approx(by_hooke, abs=DIFFERENCES * HERTZ.p0)
    along_r, along_z = slopes(stress, r, z)
    balance = (
        along_r[0] + along_z[1] + (here[0] - around) / r,
        along_r[1] + along_z[3] + here[1] / r,
    )
    assert np.abs(balance).max() < 1e2 * DIFFERENCES * HERTZ.p0


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


@pytest.mark.parametrize("exact", [PUNCH, CONE])
@pytest.mark.parametrize(("r", "depth"), [p for p in PLACES if p[1] >= 0.05])
def test_indentations_are_in_equilibrium(exact, r, depth):
    h, z = 1e-3, -depth
    s = {
        (i, j): stress_by_hooke(LOWER, exact.displacement, r + i * h, z + j * h)
        for i, j in ((0, 0), (1, 0), (-1, 0), (0, 1), (0, -1))
    }
    along_r, along_z = (s[1, 0] - s[-1, 0]) / (2 * h), (s[0, 1] - s[0, -1]) / (2 * h)
    balance = (
        along_r[0] + along_z[1] + (s[0, 0][0] - s[0, 0][4]) / r,
        along_r[1] + along_z[3] + s[0, 0][1] / r,
    )
    size = np.abs(along_r).max() + np.abs(along_z).max()
    assert np.abs(balance).max() < 1e-3 * size + 1e-8


@pytest.mark.parametrize("exact", [PUNCH, CONE])
def test_indentations_are_as_deep_as_the_obstacle(exact):
    """Inside the circle the surface lies on the obstacle; the force is that of the pressure."""
    for r in (0.0, 0.1, 0.2, 0.28):
        tolerance = 1e-12 if exact is PUNCH else 1e-2  # the sum of 24 punches has edges there
        depth = at(exact.displacement, r, 0.0)[1]
        assert depth == pytest.approx(float(at(exact.gap, r, 0.0)), rel=tolerance)
    nodes, weights = np.polynomial.legendre.leggauss(60)
    angle = math.pi / 4 * (1 + nodes)  # r = a sin(angle): the pressures are smooth in it
    r = A * np.sin(angle)
    force = math.pi / 4 * weights @ (2 * math.pi * r * exact.pressure(r) * A * np.cos(angle))
    assert force == pytest.approx(exact.P, rel=1e-5)
    far = at(exact.displacement, 0.0, -6.0)
    point = exact.P * (2 * (1 - 0.2) + 1) / (4 * math.pi * moduli(LOWER).mu * 6.0)
    assert -far[1] == pytest.approx(point, rel=2 * (A / 6) ** 2)


@pytest.mark.parametrize(("body", "law", "r"), [("sleeve", UPPER, 0.7), ("hub", LOWER, 1.4)])
def test_shrink_fit_is_elastic_and_in_equilibrium(body, law, r):
    u, stress, hoop = FIT.displacement[body], FIT.stress[body], FIT.hoop[body]
    here = np.append(at(stress, r, 0.1), at(hoop, r, 0.1))
    assert here == pytest.approx(stress_by_hooke(law, u, r, 0.1), abs=DIFFERENCES * FIT.p)
    along_r, _ = slopes(stress, r, 0.1)
    assert along_r[0] + (here[0] - here[4]) / r == pytest.approx(0, abs=1e-4 * FIT.p)


def test_shrink_fit_at_its_surfaces():
    for body, free in (("sleeve", 0.4), ("hub", 1.9)):
        assert at(FIT.stress[body], free, 0.0)[0] == pytest.approx(0, abs=1e-15)
        assert at(FIT.stress[body], 1.1, 0.0)[0] == pytest.approx(-FIT.p)
    hub, sleeve = (at(FIT.displacement[body], 1.1, 0.0)[0] for body in ("hub", "sleeve"))
    assert hub - sleeve == pytest.approx(0.01)
