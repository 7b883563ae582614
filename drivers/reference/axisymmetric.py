"""Exact frictionless contact solutions of bodies of revolution, x = r and y = z.

A half-space under the pressure p(r) on a circle of radius a has the displacement (Love 1929;
Johnson 1985, chapter 3), with the depth Z, the harmonic V = int p / distance and chi, dchi/dZ = V:

    4 pi mu u_r = -(1 - 2 nu) dchi/dr - Z dV/dr,    4 pi mu u_Z = 2 (1 - nu) V - Z dV/dZ.

For Hertz's pressure p0 (1 - r^2/a^2)^(1/2) this is Huber's field, for Boussinesq's flat punch
p = P / 2 pi a (a^2 - r^2)^(1/2); both are elementary in lambda, r^2 / (a^2 + lambda) + Z^2 / lambda
= 1, and t = Z / lambda^(1/2), which is (1 - r^2/a^2)^(1/2) on the circle and 0 outside of it.
Sneddon's cone is a sum of flat punches. Lame's rings are in plane strain along the axis.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import ngsolve as ng
import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.reference.straight import NO_FORCE, Exact, Profile, compiled
from drivers.reference.westergaard import CF, SIDES, depth, effective_modulus, moduli
from ngcontact import Elastic

PUNCHES = 24  # Gauss points of the sum of punches that is a cone: round-off at a distance


@dataclass(frozen=True, eq=False, kw_only=True)
class Revolved(Exact):
    """Exact solution of bodies of revolution; pressure and gap are functions of the radius."""

    hoop: dict[str, CF]  # stress


@dataclass(frozen=True, eq=False, kw_only=True)
class Hertz(Revolved):
    """Hertz contact of radius a, greatest pressure p0, force P and approach delta."""

    a: float
    p0: float
    P: float
    delta: float


class Spheroid(NamedTuple):
    """Coordinates about a circle of radius `a`: depth `Z`, `q` = lambda^(1/2), `t`, `S`, `phi`.

    `square` is a^2 + lambda, `S` = lambda + a^2 t^2, `phi` = atan(a / q).
    """

    a: float
    Z: CF
    q: CF
    t: CF
    S: CF
    phi: CF
    square: CF


def spheroid(a: float, r: CF, Z: CF) -> Spheroid:
    """Coordinates at radius and depth, without cancellation on either side of the circle's edge."""
    b = r * r + Z * Z - a * a
    S = ng.sqrt(b * b + 4 * a * a * Z * Z)
    t_inside = ng.sqrt(ng.IfPos(-b, S - b, 1.0) / (2 * a * a))
    q_outside = ng.sqrt(ng.IfPos(-b, 1.0, S + b) / 2)
    t = ng.IfPos(-b, t_inside, ng.IfPos(q_outside, Z / q_outside, 0.0))
    q = ng.IfPos(-b, Z / t_inside, q_outside)
    return Spheroid(a, Z, q, t, ng.IfPos(S, S, 1e-300), ng.atan2(a, q), a * a + q * q)


def huber_displacement(material: Elastic, p0: float, a: float, body: str) -> CF:
    """Displacement (2,) under Hertz's pressure; nothing moves at a distance."""
    spread, sink = huber(material, p0, a, ng.x, depth(body))
    return ng.CF((ng.x * spread, SIDES[body] * sink))


def huber(material: Elastic, p0: float, a: float, r: CF, Z: CF) -> tuple[CF, CF]:
    """Radial displacement over the radius, and that into the depth, at a radius and a depth."""
    c, m = spheroid(a, r, Z), moduli(material)
    nu = material.nu
    edge = a * a / 3 * (1 + c.t + c.t * c.t) / ((1 + c.t) * c.square)
    chi_r = 2 * edge + c.Z * (c.q / c.square - c.phi / a)  # dchi/dr over pi p0 r
    pull = -(c.phi - a * c.q / c.square) / a  # dV/dr over pi p0 r
    sink = 2 * c.Z * (c.t - c.Z * c.phi / a)  # Z^2 a^2 times the integral of Z^2's coefficient
    V = a * c.phi + (r * r * pull - sink) / 2  # over pi p0
    scale = p0 / (4 * m.mu)
    return -scale * ((1 - 2 * nu) * chi_r + c.Z * pull), scale * (2 * (1 - nu) * V + sink)


def huber_stress(material: Elastic, p0: float, a: float, body: str) -> tuple[CF, CF]:
    """Stress (2, 2) in the plane and hoop stress under Hertz's pressure."""
    c, nu, r = spheroid(a, ng.x, depth(body)), material.nu, ng.x
    edge = (1 - 2 * nu) / 3 * a * a * (1 + c.t + c.t * c.t) / ((1 + c.t) * c.square)
    bulge, arc = (1 - nu) * c.q * c.q / c.square, (1 + nu) * c.q / a * c.phi
    zz = -a * a * c.t * c.t * c.t / c.S
    rr = edge - zz + c.t * (bulge + arc - 2)
    hoop = -edge - c.t * (2 * nu + bulge - arc)
    rz = -SIDES[body] * a * a * r * c.t * c.t * c.q / (c.S * c.square)
    return p0 * ng.CF((rr, rz, rz, zz), dims=(2, 2)), p0 * hoop


def hertz(upper: Elastic, lower: Elastic, *, radius: float, a: float) -> Hertz:
    """Two half-spaces with the gap r^2 / 2 radius between them, pressed until contact has radius a.

    The upper one moves down by delta = a^2 / radius at a distance, the lower one not at all.
    """
    stiffness = effective_modulus(upper, lower)
    p0, delta = 2 * stiffness * a / (math.pi * radius), a * a / radius
    bodies = {"upper": upper, "lower": lower}
    stress = {body: huber_stress(law, p0, a, body) for body, law in bodies.items()}
    displacement = {body: huber_displacement(law, p0, a, body) for body, law in bodies.items()}
    displacement["upper"] -= ng.CF((0.0, delta))

    def gap(r: ArrayLike) -> NDArray[np.float64]:
        s = np.maximum(np.asarray(r, float) / a, 1.0)
        root = np.sqrt(s * s - 1)
        closed = a * a / radius / math.pi * ((2 - s * s) * np.arcsin(1 / s) + root)
        return (s * a) ** 2 / (2 * radius) - delta + closed

    return Hertz(
        compiled(displacement),
        compiled({body: s for body, (s, _) in stress.items()}),
        force=dict.fromkeys(bodies, NO_FORCE),
        pressure=lambda r: p0 * np.sqrt(np.maximum(1 - (np.asarray(r, float) / a) ** 2, 0)),
        gap=gap,
        initial_gap=ng.x * ng.x / (2 * radius),
        hoop=compiled({body: hoop for body, (_, hoop) in stress.items()}),
        a=a,
        p0=p0,
        P=2 / 3 * math.pi * a * a * p0,
        delta=delta,
    )


@dataclass(frozen=True, eq=False)
class Indentation:
    """A rigid obstacle pressed into the half-space y < 0 by P, contact for r <= a."""

    displacement: CF  # (2,), not to be asked for at the edge of a punch and the tip of a cone
    pressure: Profile  # on the circle, a NumPy function of the radius
    gap: CF  # height of the obstacle above y = 0, negative inside
    a: float
    P: float


def punch_displacement(material: Elastic, P: CF | float, a: float, body: str) -> CF:
    """Displacement (2,) under a flat punch of radius a with the force P."""
    c, m, nu = spheroid(a, ng.x, depth(body)), moduli(material), material.nu
    scale = P / (4 * math.pi * m.mu)
    chi_r = 1 / (c.square * (1 + c.t))  # dchi/dr over P r
    pull = -c.q / (c.square * c.S)  # dV/dr over P r
    u_r = -scale * ng.x * ((1 - 2 * nu) * chi_r + c.Z * pull)
    down = scale * (2 * (1 - nu) * c.phi / a + c.Z * c.t / c.S)
    return ng.CF((u_r, SIDES[body] * down))


def flat_punch(material: Elastic, *, a: float, depth: float) -> Indentation:
    """Boussinesq's flat rigid punch of radius a, pressed in by `depth`: P = 2 E* a depth."""
    P = 2 * moduli(material).plane * a * depth
    return Indentation(
        punch_displacement(material, P, a, "lower"),
        pressure=lambda r: P / (2 * math.pi * a * np.sqrt(a * a - np.asarray(r, float) ** 2)),
        gap=ng.CF(-depth),
        a=a,
        P=P,
    )


def cone(material: Elastic, *, a: float, slope: float) -> Indentation:
    """Sneddon's rigid cone of surface slope tan(beta): depth pi/2 a slope, P = pi/2 E* a^2 slope.

    Contact of radius s grows by the field of a flat punch of that radius: their sum, right to
    round-off where the distance from the circle is about a.
    """
    plane = moduli(material).plane
    nodes, weights = np.polynomial.legendre.leggauss(PUNCHES)
    u = ng.CF((0.0, 0.0))
    for s, w in zip(a * (1 + nodes) / 2, a * weights / 2, strict=True):
        P = math.pi * plane * slope * s * w
        u += punch_displacement(material, P, float(s), "lower")
    return Indentation(
        u,
        pressure=lambda r: plane * slope / 2 * np.arccosh(a / np.asarray(r, float)),
        gap=slope * ng.x - math.pi / 2 * a * slope,
        a=a,
        P=math.pi / 2 * plane * a * a * slope,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
class Fit(Revolved):
    """Shrink fit with the contact pressure p everywhere."""

    p: float


def shrink_fit(
    sleeve: Elastic, hub: Elastic, *, radii: tuple[float, float, float], interference: float
) -> Fit:
    """Lame's rings radii[0] < r < radii[1] < r < radii[2], plane strain along the axis, bare rims.

    The bodies are "sleeve" and "hub"; the gap before contact is -interference.
    """
    bore, r, rim = radii
    compliance, fields = 0.0, {}
    for body, law, free in (("sleeve", sleeve, bore), ("hub", hub, rim)):
        m = moduli(law)
        # Stress A -+ B / r^2 with rr = -1 on the interface and 0 on the free rim.
        A = -1 / (1 - free**2 / r**2)
        B = -A * free**2
        fields[body] = (A, B, m)
        u = (A / (m.lam + m.mu) * r - B / m.mu / r) / 2
        compliance += u if body == "hub" else -u
    p = interference / compliance
    x = ng.x
    displacement, stress, hoop = {}, {}, {}
    for body, (A, B, m) in fields.items():
        displacement[body] = ng.CF((p * (A / (m.lam + m.mu) * x - B / m.mu / x) / 2, 0.0))
        rr, hoop[body] = p * (A + B / (x * x)), ng.CF(p * (A - B / (x * x)))
        axial = m.lam / (m.lam + m.mu) * p * A
        stress[body] = ng.CF((rr, 0.0, 0.0, axial), dims=(2, 2))
    return Fit(
        displacement,
        stress,
        force=dict.fromkeys(fields, NO_FORCE),
        pressure=lambda z: np.full(np.shape(z), p),
        initial_gap=ng.CF(-interference),
        hoop=hoop,
        p=p,
    )
