"""Exact solutions: Hooke's law, equilibrium, contact conditions and known values."""

import functools
import math
from types import SimpleNamespace

import ngsolve as ng
import numpy as np
import pytest
from ngsolve.meshes import MakeStructured2DMesh

from drivers.reference import axisymmetric
from drivers.reference.curved import curved, rings
from drivers.reference.manufactured import equilibrated, slits
from drivers.reference.straight import hertz, patch, relative_energy_error, transition
from drivers.reference.westergaard import effective_modulus, moduli
from ngcontact.geometries.region import compound
from ngcontact.problem.material import Elastic
from tests.scenes import rectangle

UPPER, LOWER = Elastic(E=1.0, nu=0.3), Elastic(E=3.0, nu=0.2)
MATERIALS = {"upper": UPPER, "lower": LOWER, "outer": UPPER, "inner": LOWER}
SIDE = {"upper": 1, "lower": -1}
HALVES = {"upper": (-1, 1, 0, 1), "lower": (-1, 1, -1, 0)}
RINGS = {"outer": (0.8, 1.3, 0.7, 1.3), "inner": (0.4, 0.65, -0.65, -0.4)}  # boxes inside the rings

# Solution and, per body, a box on which it holds. The curved contact lines lie inside their boxes:
# the fields continue analytically across them.
CASES = {
    "transition": (transition(UPPER, LOWER, c=1.3), HALVES),
    "hertz": (hertz(UPPER, LOWER, radius=5.0, half_width=0.3), HALVES),
    "patch": (patch(UPPER, LOWER, p0=1.0, p1=0.5), HALVES),
    "cutoff": (transition(UPPER, LOWER, c=1.3, plateau=0.5), HALVES),
    "slits": (slits(UPPER, LOWER, half_width=0.5), HALVES),
    "curved": (curved(UPPER, LOWER), dict.fromkeys(SIDE, (-0.5, 0.5, -0.3, 0.3))),
    "rings": (rings(UPPER, LOWER, qn=0.4, qi=0.2, n=4, delta=0.01), RINGS),
}
BODIES = [(name, body) for name, (_, boxes) in CASES.items() for body in boxes]
ON_LINE = np.unique(np.r_[np.linspace(-1, 1, 41), -0.3, 0.3])  # with all ends of contact


@functools.cache  # and mesh points do not keep their mesh alive
def grid(box):
    """20 x 8 quadrilaterals on a box, graded towards y = 0 if the box ends there.

    Two of the lower and upper half's rows lie beyond |y| = 1/2, where the cut-off begins.
    """
    x0, x1, y0, y1 = box
    power = math.log(1 / 2) / math.log(3 / 4)

    def place(s, t):
        if y0 == 0:
            t = t**power
        elif y1 == 0:
            t = 1 - (1 - t) ** power
        return x0 + (x1 - x0) * s, y0 + (y1 - y0) * t

    return MakeStructured2DMesh(quads=True, nx=20, ny=8, mapping=place)


def at(field, box, x, y):
    """Values at points of a box: (points,) + the shape of the field."""
    values = np.asarray(field(grid(box)(np.asarray(x, float), np.asarray(y, float))))
    return values.reshape(np.size(x), *field.dims)


def two_blocks(maxh):
    """Mesh of the blocks (-1, 1) x (0, 1), "upper", and (-1, 1) x (-1, 0), "lower"."""
    blocks = (rectangle(name, box[:2], box[2:], "side") for name, box in HALVES.items())
    return ng.Mesh(compound(*blocks).GenerateMesh(maxh=maxh))


def discrete(mesh, stress, order=2):
    """Stand-in for a `Solution`, with what the error measurement reads."""
    problem = SimpleNamespace(materials=MATERIALS, model="plane strain")
    return SimpleNamespace(mesh=mesh, stress=stress, problem=problem, order=order)


@pytest.mark.parametrize(("name", "body"), BODIES)
def test_stress_and_force_follow_from_the_displacement(name, body):
    """Against NGSolve's derivatives of the displacement and the package's law."""
    exact, boxes = CASES[name]
    x0, x1, y0, y1 = box = boxes[body]
    rng = np.random.default_rng(0)
    x, y = rng.uniform(x0, x1, 400), rng.uniform(y0, y1, 400)
    away = np.abs(y) > 0.01  # from the ends of contact and of slits
    x, y = x[away], y[away]
    _, stress, force = (
        at(f[body], box, x, y) for f in equilibrated({body: exact.displacement[body]}, MATERIALS)
    )
    size = np.abs(stress).max()
    found = at(exact.stress[body], box, x, y)
    np.testing.assert_allclose(found, stress, rtol=0, atol=1e-12 * size)  # round-off
    # Round-off, next to an end, 0.01 away, that of a second derivative of r^(1/2) or r^(3/2).
    scale = max(np.abs(force).max(), 1e3 * size)
    found = at(exact.force[body], box, x, y)
    np.testing.assert_allclose(found, force, rtol=0, atol=1e-11 * scale)


def assert_contact(exact, boxes, x, y, normal, along, atol):
    """No shear, the same pressure on both bodies, and the gap after deformation.

    At points of the line; `normal` (k, 2) leads from the first of the `boxes`' bodies to the other.
    Pressure and gap are functions of `along` (k,).
    """
    p, gap = exact.pressure(along), exact.gap(along)
    assert gap.min() >= 0
    assert np.abs(p * gap).max() < 1e-15 * np.abs(p).max()  # one of them is 0, but for round-off
    size, opened = np.abs(p).max(), at(exact.initial_gap, next(iter(boxes.values())), x, y)
    scale = 0.0
    for (body, box), sign in zip(boxes.items(), (-1, 1), strict=True):
        traction = np.einsum("kij,kj->ki", at(exact.stress[body], box, x, y), normal)
        np.testing.assert_allclose(traction, -p[:, None] * normal, rtol=0, atol=atol * size)
        u = at(exact.displacement[body], box, x, y)
        scale, opened = max(scale, np.abs(u).max()), opened + sign * (u * normal).sum(axis=1)
    np.testing.assert_allclose(opened, gap, rtol=0, atol=1e-13 * scale)  # round-off


@pytest.mark.parametrize("name", ["transition", "hertz", "patch", "cutoff"])
def test_conditions_on_the_contact_line(name):
    exact, x = CASES[name][0], ON_LINE
    assert exact.pressure(x).min() >= 0
    assert exact.pressure(x).max() > 0
    # p has an infinite slope at the end of contact: round-off in x counts by its square root
    assert_contact(exact, HALVES, x, 0 * x, np.tile((0, -1), (len(x), 1)), x, 1e-7)


def boundary_work(exact, body, box):
    """Integral of the traction times the displacement over the boundary: A(u, u) if F = 0."""
    traction = exact.stress[body] * ng.specialcf.normal(2)
    work = ng.InnerProduct(traction, exact.displacement[body])
    return ng.Integrate(work, grid(box), ng.BND, order=30)


def test_transition_energies():
    exact = transition(UPPER, LOWER)
    assert effective_modulus(UPPER, LOWER) == pytest.approx(0.813008130081, abs=1e-12)
    assert exact.gap(1.0) == pytest.approx(1.64, rel=1e-14)
    # Clapeyron; the twelve digits of the reference values
    energies = [boundary_work(exact, body, HALVES[body]) for body in ("upper", "lower")]
    assert energies == pytest.approx([1.293180760825, 0.520333087196], abs=2e-12)


def test_hertz_known_values():
    exact = hertz(UPPER, LOWER, radius=5.0, half_width=0.3)
    assert exact.p0 == pytest.approx(0.024390243902, rel=1e-10)
    assert exact.P == pytest.approx(0.011493631659, rel=1e-10)
    s, w = np.polynomial.chebyshev.chebgauss(50)  # exact for sqrt(1 - s^2) times a polynomial
    total = 0.3 * np.sum(w * np.sqrt(1 - s**2) * exact.pressure(0.3 * s))
    assert total == pytest.approx(exact.P, rel=1e-12)
    # reference by x = a sin(t) in contact; here the quadrature of its ends leaves 5e-6 (measured)
    energies = [boundary_work(exact, body, HALVES[body]) for body in ("upper", "lower")]
    assert energies == pytest.approx([1.3069965e-4, 4.949773e-5], rel=1e-5)


BALLS, SECTION = axisymmetric.hertz(UPPER, LOWER, radius=5.0, a=0.3), (0, 6, -6, 6)


def test_balls_at_their_surface():
    """Pressure, no shear, and the gap after deformation: Johnson 1985 (3.39), (3.42)."""
    r, u = np.array([0.0, 0.1, 0.29, 0.3, 0.31, 0.5, 2.0]), {}
    for body in SIDE:
        stress = at(BALLS.stress[body], SECTION, r, 0 * r)
        assert -stress[:, 1, 1] == pytest.approx(BALLS.pressure(r), abs=1e-14)
        assert not stress[:, 0, 1].any()
        u[body] = at(BALLS.displacement[body], SECTION, r, 0 * r)[:, 1]
    opening = r**2 / 10 + u["upper"] - u["lower"]
    assert opening == pytest.approx(BALLS.gap(r), abs=1e-14)
    assert ((opening > 1e-12) == (r > 0.3)).all()


def test_balls_known_values():
    """F = 4/3 E* a^3 / R; on the axis at the surface rr = hoop = -(1 + 2 nu) / 2 p0."""
    E, (stress, hoop) = effective_modulus(UPPER, LOWER), (BALLS.stress, BALLS.hoop)
    assert pytest.approx(4 / 3 * E * 0.3**3 / 5) == BALLS.P
    assert pytest.approx(1.5 * BALLS.P / (math.pi * 0.3**2)) == BALLS.p0
    assert at(stress["upper"], SECTION, 0, 0)[0, 0, 0] == pytest.approx(-0.8 * BALLS.p0)
    assert at(hoop["upper"], SECTION, 0, 0)[0] == pytest.approx(-0.8 * BALLS.p0)
    sinking = axisymmetric.huber_displacement(UPPER, BALLS.p0, 0.3, "upper")
    point = BALLS.P * (2 * 0.7 + 1) / (4 * math.pi * moduli(UPPER).mu * 6.0)  # Boussinesq
    assert at(sinking, SECTION, 0, 6)[0, 1] == pytest.approx(point, rel=2 * (0.3 / 6) ** 2)


def test_curved_tractions_and_gap():
    exact, boxes = CASES["curved"]
    x = np.unique(np.r_[np.linspace(-0.5, 0.5, 41), -0.25, 0.25])
    p, gap, u = exact.pressure(x), exact.gap(x), {}
    assert np.all(p >= 0)
    assert np.all(gap >= 0)
    assert np.all(p * gap == 0)
    for body, side in SIDE.items():
        y, slope = exact.curve[body](x), exact.slope[body](x)
        np.testing.assert_allclose(y, side * x**2 / (2 if side > 0 else 4), rtol=1e-15)
        np.testing.assert_allclose(slope, np.gradient(y, x, edge_order=2), rtol=0, atol=1e-13)
        normal = -side * np.transpose([-slope, 1 + 0 * x])  # outward, length ds / d eta
        traction = np.einsum("kij,kj->ki", at(exact.stress[body], boxes[body], x, y), normal)
        # (3.10'), (3.11') of HH81 per unit eta, to round-off
        np.testing.assert_allclose(traction, np.transpose([0 * x, side * p]), rtol=0, atol=1e-14)
        u[body] = at(exact.displacement[body], boxes[body], x, y)[:, 1]
    initial = at(exact.initial_gap, boxes["upper"], x, 0 * x)
    np.testing.assert_allclose(
        initial, exact.curve["upper"](x) - exact.curve["lower"](x), atol=1e-15
    )
    np.testing.assert_allclose(initial + u["upper"] - u["lower"], gap, rtol=0, atol=1e-15)
    s, w = np.polynomial.legendre.leggauss(4)  # exact: p is a polynomial of degree 4 in contact
    total = exact.half_width * np.sum(w * exact.pressure(exact.half_width * s))
    assert total == pytest.approx(exact.P, rel=1e-14)


@pytest.mark.parametrize(
    ("load", "mean", "wave"),
    [
        ({}, 1.0282485876, 0),
        ({"qn": 0.3}, 1.0282485876, 0.4139552814),
        ({"q0": 0.0, "delta": 0.01}, 0.0042372881, 0),
        ({"qn": 0.4, "qi": 0.2, "n": 4}, 1.0463276836, 0.2908511488),
    ],
)
def test_rings_known_pressures_and_conditions(load, mean, wave):
    exact = rings(UPPER, LOWER, **load)
    assert (exact.P0, exact.Pn) == pytest.approx((mean, wave), abs=1e-10)  # printed digits
    theta = np.linspace(-math.pi, math.pi, 37)
    radial = np.transpose([np.cos(theta), np.sin(theta)])
    box, n = (-2.1, 2.1, -2.1, 2.1), load.get("n", 2)
    outer = load.get("q0", 1.0) + load.get("qn", 0.0) * np.cos(n * theta)
    for body, r, q in (("inner", 0.5, load.get("qi", 0.0) + 0 * theta), ("outer", 2.0, outer)):
        traction = np.einsum("kij,kj->ki", at(exact.stress[body], box, *r * radial.T), radial)
        np.testing.assert_allclose(traction, -q[:, None] * radial, rtol=0, atol=1e-12)  # round-off
    assert_contact(exact, {"inner": box, "outer": box}, *radial.T, radial, theta, 1e-12)


def test_relative_energy_error_measures_both_bodies():
    exact, mesh = transition(UPPER, LOWER), two_blocks(0.3)
    whole = mesh.MaterialCF(exact.stress)
    assert relative_energy_error(discrete(mesh, whole), exact) == 0
    scaled = relative_energy_error(discrete(mesh, 1.01 * whole), exact)
    assert scaled == pytest.approx(0.01, rel=1e-10)
    half = mesh.MaterialCF({"upper": 0 * exact.stress["upper"], "lower": exact.stress["lower"]})
    share = math.sqrt(1.293180760825 / (1.293180760825 + 0.520333087196))
    # quadrature of r near the tip
    assert relative_energy_error(discrete(mesh, half), exact) == pytest.approx(share, rel=1e-6)
