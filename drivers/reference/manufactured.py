"""Manufactured contact solutions: a polygonal line, a circle, and singular ones.

Plane strain, any consistent units. The displacement next to the zone is linear in the distance
from it, with the coefficients that the contact conditions HH81 (3.9)-(3.12) ask for; a cut-off
takes it to nothing away from the zone. Stress is Hooke's law of it, the body force is F =
-div(stress). Pressure and gap meet as t^2 and t^3 at the ends of contact, so that F is bounded.

HH81 Theorems 3.2 and 3.5 claim convergence without regularity, and no rate: the displacements of
`slits` and `with_end_of_guide` grow as r^(1/2) at a point of the boundary. They lie in H^s for
s < 3/2 only, which gives h^(1/2) at every order.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, TypeAlias

import ngsolve as ng
import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.reference.straight import Exact, compiled, equilibrium_fields, shrinkage
from drivers.reference.westergaard import CF, Potential, depth, half_plane, moduli
from ngcontact import Elastic, Hooke

Point: TypeAlias = tuple[float, float]
Fields: TypeAlias = tuple[dict[str, CF], dict[str, CF], dict[str, CF]]

REACH = 0.45  # of bumps across their side
OPEN = 0.5  # part of the half-length of a bump over which an opening one parts the bodies


@dataclass(frozen=True)
class Bump:
    """What happens around the middle of one side of a polygonal line, besides the mean pressure."""

    half_length: float  # of the part of the side that takes part; it must not reach the ends
    pressure: float = 0.0  # added to the mean one in the middle; not where the bodies part
    opening: float = 0.0  # gap in the middle; 0: contact all along
    bow: float = 0.0  # displacement of both bodies across the side, in the middle
    slip: float = 0.0  # of the upper body along the side, there; of the lower one, minus that


class Zone(NamedTuple):
    """Coordinates of a line of constant curvature: d off it and s along it, at right angles.

    `across` and `along` are their unit vectors (2,), `curvature` is that of d = 0 (1 on the unit
    circle with d outwards), `reach` the distance at which the cut-off (1 - (d / reach)^2)^3 ends.
    """

    d: CF
    across: tuple[CF, CF]
    along: tuple[CF, CF]
    curvature: float
    reach: float


def gradient(u: CF) -> CF:
    """Gradient (2, 2) of a displacement given in x and y, row i the gradient of component i."""
    columns = (u.Diff(ng.x), u.Diff(ng.y))
    return ng.CF((columns[0][0], columns[1][0], columns[0][1], columns[1][1]), dims=(2, 2))


def equilibrated(displacement: dict[str, CF], materials: Mapping[str, Elastic | Hooke]) -> Fields:
    """Displacement, its stress and the body force that balances it: the first three of `Exact`."""
    stress = {}
    for body, u in displacement.items():
        grad = gradient(u)
        strain = ng.CF((grad[0, 0], grad[1, 1], grad[0, 1] + grad[1, 0]))
        xx, yy, xy = materials[body].voigt() * strain
        stress[body] = ng.CF((xx, xy, xy, yy), dims=(2, 2))
    force = {body: -(s.Diff(ng.x)[0, :] + s.Diff(ng.y)[1, :]) for body, s in stress.items()}
    return compiled(displacement), compiled(stress), compiled(force)


def near_zone(material: Elastic, zone: Zone, a: CF, b: CF, q: CF) -> CF:
    """Displacement (2,) from a, b and q on the line d = 0, which do not depend on d.

    u_d = w(d) (a + d c) and u_s = w(d) (b + d e): on d = 0 there is no shear and the normal stress
    is q for e = k b - a' and c = (q - lam (k a + b')) / (lam + 2 mu), k the curvature.
    """
    m, k, d = moduli(material), zone.curvature, zone.d
    (nx, ny), (tx, ty) = zone.across, zone.along

    def slope(f: CF) -> CF:
        """Derivative by s, which has the length 1 + k d."""
        return (1 + k * d) * (tx * f.Diff(ng.x) + ty * f.Diff(ng.y))

    c = (q - m.lam * (k * a + slope(b))) / (m.lam + 2 * m.mu)
    e = k * b - slope(a)
    frame = ng.CF((nx, tx, ny, ty), dims=(2, 2))
    return _hat(d / zone.reach) * (frame * ng.CF((a + d * c, b + d * e)))


def _hat(t: CF) -> CF:
    """(1 - t^2)^3 for |t| < 1, 0 elsewhere."""
    rest = ng.IfPos(1 - t * t, 1 - t * t, 0.0)
    return rest * rest * rest


def _step(t: CF) -> CF:
    """1 for |t| < `OPEN`, falling to 0 at |t| = 1."""
    c = (ng.IfPos(t, t, -t) - OPEN) / (1 - OPEN)
    c = ng.IfPos(c, ng.IfPos(1 - c, c, 1.0), 0.0)
    return 1 - c * c * (3 - 2 * c)


def polygonal(
    upper: Elastic,
    lower: Elastic,
    *,
    line: Sequence[Point],
    bumps: Sequence[Bump],
    p: float = 1.0,
) -> Exact:
    """Bodies above and below a polygonal line, pressed by p at its corners; one bump a side.

    Around the corners the stress is -p I and u = -k (x, y), k = (1 + nu)(1 - 2 nu) p / E, which
    must be the same for both bodies; bumps add to it, see `near_zone`. `pressure` and `gap` are
    functions of x.
    """
    materials = {"upper": upper, "lower": lower}
    ends = np.asarray(line, float).tolist()
    sides = list(zip(ends[:-1], ends[1:], bumps, strict=True))
    displacement = {
        body: sum(
            (_bump_field(law, body, *side, p) for side in sides),
            -shrinkage(law, p) * ng.CF((ng.x, ng.y)),
        )
        for body, law in materials.items()
    }

    def along(x: ArrayLike, of: str) -> NDArray[np.float64]:
        """Pressure or gap, summed over sides; p and 0 away from bumps."""
        total = np.full(np.shape(x), p if of == "pressure" else 0.0)
        for start, end, bump in sides:
            s = np.asarray(x, float) - (start[0] + end[0]) / 2
            s = s * math.dist(start, end) / (end[0] - start[0])
            total += _profile(bump, p, np.abs(s) / bump.half_length, of)
        return total

    return Exact(
        *equilibrated(displacement, materials),
        pressure=lambda x: along(x, "pressure"),
        gap=lambda x: along(x, "gap"),
    )


def _profile(bump: Bump, p: float, t: NDArray[np.float64], of: str) -> NDArray[np.float64]:
    """What a bump adds to the pressure p or to the gap at t = |s| / half_length."""
    if of == "gap":
        return bump.opening * np.maximum(1 - (t / OPEN) ** 2, 0) ** 3
    if bump.opening:
        c = np.clip((t - OPEN) / (1 - OPEN), 0, 1)
        return -p * (1 - c * c * (3 - 2 * c))
    return bump.pressure * np.maximum(1 - t * t, 0) ** 3


def _bump_field(
    material: Elastic,
    body: str,
    start: Sequence[float],
    end: Sequence[float],
    bump: Bump,
    p: float,
) -> CF:
    """Displacement that one bump adds to one body, see `polygonal`."""
    size = math.dist(start, end)
    tx, ty = ((end[i] - start[i]) / size for i in range(2))
    mx, my = ((end[i] + start[i]) / 2 for i in range(2))
    t = ((ng.x - mx) * tx + (ng.y - my) * ty) / bump.half_length
    zone = Zone((ng.y - my) * tx - (ng.x - mx) * ty, (-ty, tx), (tx, ty), 0.0, REACH)
    hat, sign = _hat(t), 1.0 if body == "upper" else -1.0
    a, q = bump.bow * hat, -bump.pressure * hat
    if bump.opening:
        # The outward normal n' of the upper body points down: each body moves by half of the gap.
        a += sign * bump.opening / 2 * _hat(t / OPEN)
        q = p * _step(t)
    return near_zone(material, zone, a, sign * bump.slip * hat, q)


def circular(outer: Elastic, inner: Elastic) -> Exact:
    """Rings about the circle r = 1 that part around 45 degrees: `outer` is the body '.

    With w = cos(4 theta): p = (w + .3)^2 / 2 where w > -.3, gap = .02 (-.3 - w)^3 elsewhere. u = 0
    on r = 2; on both axes u.n and the shear vanish. `pressure` and `gap` are functions of theta.
    """
    pressure, opening, turn, bow, slip = 0.5, 0.02, -0.3, 0.05, 0.05
    x, y = ng.x, ng.y
    r, theta = ng.sqrt(x * x + y * y), ng.atan2(y, x)
    cos, sin = ng.cos(4 * theta), ng.sin(4 * theta)
    inside, outside = (ng.IfPos(f, f, 0.0) for f in (cos - turn, turn - cos))
    gap = opening * outside * outside * outside
    zone = Zone(r - 1, (x / r, y / r), (-y / r, x / r), 1.0, 1.0)
    materials, signs = {"outer": outer, "inner": inner}, {"outer": 1.0, "inner": -1.0}
    displacement = {}
    for body, sign in signs.items():
        # n' points inwards: gap = u_r' - u_r''
        a, b = bow * cos + sign / 2 * gap, sign * slip * sin
        displacement[body] = near_zone(materials[body], zone, a, b, -pressure * inside * inside)
    return Exact(
        *equilibrated(displacement, materials),
        pressure=lambda t: pressure * np.maximum(np.cos(4 * np.asarray(t)) - turn, 0) ** 2,
        gap=lambda t: opening * np.maximum(turn - np.cos(4 * np.asarray(t)), 0) ** 3,
    )


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
