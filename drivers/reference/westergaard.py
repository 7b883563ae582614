"""Plane strain fields of a half-plane that is pressed without shear, by Westergaard's function.

Two bodies meet along y = 0: "upper" (y > 0) and "lower" (y < 0). Without shear on y = 0 the fields
follow from one function Z, analytic for y > 0 (H. M. Westergaard, J. Appl. Mech. 6 (1939) A49):
with W' = Z and kappa = 3 - 4 nu,

    2 mu u_x = (kappa - 1)/2 Re W - y Im Z,     2 mu u_y = (kappa + 1)/2 Im W - y Re Z,

so that on y = 0 the pressure is -Re Z and u_y = 2 Im W / E_plane, E_plane = E / (1 - nu^2). The
lower body carries the mirror image, hence the gap is eps + 2 Im W / E*, 1/E* the sum of both
1/E_plane.

Only real arithmetic is used, in forms that stay finite at the ends of the contact zone, where Z' is
unbounded. Points off their half-plane by round-off are taken as points of y = 0, so the branch is
always that of the body asked for. Any consistent units.
"""

from __future__ import annotations

import math
from typing import NamedTuple, TypeAlias

import ngsolve as ng

from ngcontact import Elastic

CF: TypeAlias = ng.CoefficientFunction

SIDES = {"upper": 1.0, "lower": -1.0}


class Moduli(NamedTuple):
    """Plane strain moduli of one body: 3 - 4 nu, E / (1 - nu^2) and nu / (1 - nu) beside Lame's."""

    mu: float
    lam: float
    kappa: float
    plane: float
    ratio: float


class Field(NamedTuple):
    """Displacement (2,) and its gradient (2, 2), row i the gradient of component i."""

    u: CF
    grad: CF


class Potential(NamedTuple):
    """Real and imaginary parts of Z, of Y Z' and of the integral W of Z, at z = x + i Y.

    And of Y Z, where Z is unbounded and Y times Z would be no number.
    """

    Z: tuple[CF, CF]
    YdZ: tuple[CF, CF]
    W: tuple[CF, CF]
    YZ: tuple[CF, CF] | None = None


def moduli(material: Elastic) -> Moduli:
    """Plane strain moduli of an isotropic material with fields E and nu."""
    E, nu = material.E, material.nu
    mu = E / (2 * (1 + nu))
    return Moduli(mu, 2 * mu * nu / (1 - 2 * nu), 3 - 4 * nu, E / (1 - nu**2), nu / (1 - nu))


def effective_modulus(first: Elastic, second: Elastic) -> float:
    """E* of a contact pair: 1/E* is the sum of both (1 - nu^2) / E."""
    return 1 / (1 / moduli(first).plane + 1 / moduli(second).plane)


def hooke(material: Elastic, grad: CF) -> CF:
    """In-plane stress (2, 2) of a displacement gradient (2, 2) in plane strain."""
    m = moduli(material)
    return m.mu * (grad + grad.trans) + m.lam * (grad[0, 0] + grad[1, 1]) * ng.Id(2)


def depth(body: str) -> CF:
    """Distance Y >= 0 from the line y = 0; +0 (never -0, which flips atan2) for points on it."""
    y = SIDES[body] * ng.y
    return ng.IfPos(y, y, 0.0)


def half_plane(potential: Potential, material: Elastic, body: str) -> Field:
    """Field of Z in one body; the lower one is the mirror image of the upper one."""
    side, Y, m = SIDES[body], depth(body), moduli(material)
    (zr, zi), (dr, di), (wr, wi) = potential.Z, potential.YdZ, potential.W
    yr, yi = potential.YZ or (Y * zr, Y * zi)
    plus, minus, scale = (m.kappa + 1) / 2, (m.kappa - 1) / 2, 1 / (2 * m.mu)
    u = (minus * wr - yi, side * (plus * wi - yr))
    # From W' = Z and the Cauchy-Riemann equations: d/dY of Re and Im is -Im' and +Re'.
    grad = (minus * zr - di, side * (-plus * zi - dr), side * (plus * zi - dr), minus * zr + di)
    return Field(scale * ng.CF(u), scale * ng.CF(grad, dims=(2, 2)))


def root_potential(c: float, body: str) -> Potential:
    """Z = i c sqrt(z); with Y = r sin(t), Y Z' = i (c/2) sqrt(r) sin(t) exp(-i t/2) is regular."""
    Y = depth(body)
    r, t = ng.sqrt(ng.x * ng.x + Y * Y), ng.atan2(Y, ng.x)
    root, cos, sin = ng.sqrt(r), ng.cos(t / 2), ng.sin(t / 2)
    slope, arc = c / 2 * root * ng.sin(t), 2 * c / 3 * r * root
    return Potential(
        Z=(-c * root * sin, c * root * cos),
        YdZ=(slope * sin, slope * cos),
        W=(-arc * ng.sin(1.5 * t), arc * ng.cos(1.5 * t)),
    )


def hertz_potential(k: float, a: float, body: str) -> Potential:
    """Z = i k (w - z), w = sqrt(z^2 - a^2), W = i k (z w - a^2 log((z + w)/(i a)) - z^2) / 2.

    With polar coordinates (r1, t1) about a and (r2, t2) about -a, w is sqrt(r1 r2) times
    exp(i (t1 + t2)/2), and Y / |w| = sqrt(sin(t1) sin(t2)) is regular at both ends.
    The i in the logarithm makes u_x odd in x.
    """
    x, Y = ng.x, depth(body)
    r1, r2 = (ng.sqrt((x - s) * (x - s) + Y * Y) for s in (a, -a))
    t1, t2 = (ng.atan2(Y, x - s) for s in (a, -a))
    rho, cos, sin = ng.sqrt(r1 * r2), ng.cos((t1 + t2) / 2), ng.sin((t1 + t2) / 2)
    wr, wi = rho * cos, rho * sin
    slope = ng.sqrt(ng.sin(t1) * ng.sin(t2))
    modulus = 0.5 * ng.log(((x + wr) * (x + wr) + (Y + wi) * (Y + wi)) / a**2)
    argument = ng.atan2(Y + wi, x + wr) - math.pi / 2
    return Potential(
        Z=(k * (Y - wi), k * (wr - x)),
        YdZ=(k * slope * (x * sin - Y * cos), k * (slope * (x * cos + Y * sin) - Y)),
        W=(
            k / 2 * (2 * x * Y + a**2 * argument - x * wi - Y * wr),
            k / 2 * (x * wr - Y * wi - a**2 * modulus - x * x + Y * Y),
        ),
    )
