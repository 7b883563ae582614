"""Exact contact solutions whose displacement grows as r^(1/2) at a point of the boundary.

HH81 Theorems 3.2 and 3.5 claim convergence without regularity, and no rate. These solutions lie in
H^s for s < 3/2 only, which gives h^(1/2) at every order. Plane strain, any consistent units.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING

import ngsolve as ng
import numpy as np

from drivers.reference.manufactured import equilibrated
from drivers.reference.straight import Exact, compiled, equilibrium_fields
from drivers.reference.westergaard import Potential, depth, half_plane, moduli

if TYPE_CHECKING:
    from ngcontact.problem import Elastic


def slits(upper: Elastic, lower: Elastic, *, half_width: float, force: float = 1.0) -> Exact:
    """Two half-planes that touch for |x| < a between slits with free faces, pressed by `force`.

    Z = -i P / (pi sqrt(z^2 - a^2)): p = P / (pi sqrt(a^2 - x^2)), the pressure under a rigid flat
    punch (K. L. Johnson, Contact Mechanics, 1985, section 2.8), here of two elastic bodies, as
    u_y = 0 for |x| < a in both. The slits are taken as wide enough to stay open.
    """
    materials = {"upper": upper, "lower": lower}
    a = half_width
    k = force / math.pi
    fields = {
        body: half_plane(_slit_potential(k, a, body), material, body)
        for body, material in materials.items()
    }
    return Exact(
        *equilibrium_fields(fields, materials),
        pressure=lambda x: k / np.sqrt(a**2 - np.asarray(x, float) ** 2),
    )


def _slit_potential(k: float, a: float, body: str) -> Potential:
    """Z = -i k / w, w = sqrt(z^2 - a^2) as in `hertz_potential`, W = -i k log((z + w) / a)."""
    x, Y = ng.x, depth(body)
    r1, r2 = (ng.sqrt((x - s) * (x - s) + Y * Y) for s in (a, -a))
    t1, t2 = (ng.atan2(Y, x - s) for s in (a, -a))
    half = (t1 + t2) / 2
    rho, square = ng.sqrt(r1 * r2), r1 * r2
    cos, sin, cos3, sin3 = ng.cos(half), ng.sin(half), ng.cos(3 * half), ng.sin(3 * half)
    slope = ng.sqrt(ng.sin(t1) * ng.sin(t2))  # Y / rho
    wr, wi = rho * cos, rho * sin
    modulus = 0.5 * ng.log(((x + wr) * (x + wr) + (Y + wi) * (Y + wi)) / a**2)
    argument = ng.atan2(Y + wi, x + wr)
    turned = k * slope / square
    return Potential(
        Z=(-k * sin / rho, -k * cos / rho),
        YdZ=(turned * (x * sin3 - Y * cos3), turned * (x * cos3 + Y * sin3)),
        W=(k * argument, -k * modulus),
        YZ=(-k * slope * sin, -k * slope * cos),
    )


def with_end_of_guide(
    exact: Exact, materials: dict[str, Elastic], *, at: float, c: float, reach: float
) -> Exact:
    """`exact` plus a field r^(1/2) where Gamma_0 ends on the bottom y = -1 of the body "lower".

    The field is that of Z = c z^(-1/2) about (`at`, -1): guided for x > `at`, free of traction for
    x < `at`, which is a crack's by symmetry; times the cut-off (1 - (r / reach)^2)^3, which leaves
    both conditions as they are, but for tractions on the free part. The body must be guided there
    by `exact`. Units: c stress times square root of length.
    """
    m = moduli(materials["lower"])
    X, Y = ng.x - at, ng.y + 1
    r, t = ng.sqrt(X * X + Y * Y), math.pi / 2 - ng.atan2(X, Y)  # no branch near y = -1
    root, cos, sin = c * ng.sqrt(r), ng.cos(t / 2), ng.sin(t / 2)
    deep = root * ng.sin(t)
    plus, minus = (m.kappa + 1) / 2, (m.kappa - 1) / 2
    crack = ng.CF((2 * minus * root * cos + deep * sin, 2 * plus * root * sin - deep * cos))
    window = 1 - (X * X + Y * Y) / reach**2
    window = ng.IfPos(window, window, 0.0)
    window = window * window * window
    added = equilibrated({"lower": window * crack / (2 * m.mu)}, materials)
    displacement, stress, force = (
        compiled(whole | {"lower": whole["lower"] + part["lower"]})
        for whole, part in zip((exact.displacement, exact.stress, exact.force), added, strict=True)
    )
    return replace(exact, displacement=displacement, stress=stress, force=force)
