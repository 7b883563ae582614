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
from drivers.reference.westergaard import CF, Potential, depth, half_plane, hooke, moduli
from ngcontact import Elastic, Hooke

Point: TypeAlias = tuple[float, float]
Fields: TypeAlias = tuple[dict[str, CF], dict[str, CF], dict[str, CF]]
Derivatives: TypeAlias = tuple[CF, CF, CF, CF]  # of one variable: a function, its first three

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


def near_zone(
    material: Elastic, zone: Zone, a: Derivatives, b: Derivatives, q: Derivatives
) -> tuple[CF, CF, CF]:
    """Displacement (2,), stress (2, 2) and force (2,) from a, b and q on the line d = 0.

    u_d = w(d) (a + d c) and u_s = w(d) (b + d e): on d = 0 there is no shear and the normal stress
    is q for e = k b - a' and c = (q - lam (k a + b')) / (lam + 2 mu), k the curvature.
    """
    m, k, d = moduli(material), zone.curvature, zone.d
    stiff = m.lam + 2 * m.mu
    c = [(q[i] - m.lam * (k * a[i] + b[i + 1])) / stiff for i in range(3)]
    e = [k * b[i] - a[i + 1] for i in range(3)]
    ratio = d / zone.reach
    rest = ng.IfPos(1 - ratio * ratio, 1 - ratio * ratio, 0.0)
    w = rest * rest * rest
    w1 = -6 / zone.reach * ratio * rest * rest
    w2 = (24 * ratio * ratio - 6 * rest) * rest / zone.reach**2
    # f[i][j]: derivative i times by d and j times by s
    fields = []
    for start, slope in ((a, c), (b, e)):
        line = [start[j] + d * slope[j] for j in range(3)]
        fields.append(
            (
                [w * line[j] for j in range(3)],
                [w1 * line[j] + w * slope[j] for j in range(2)],
                [w2 * line[0] + 2 * w1 * slope[0]],
            )
        )
    u, v = fields
    h = 1 + k * d  # length per s
    grad = ng.CF(
        (u[1][0], (u[0][1] - k * v[0][0]) / h, v[1][0], (v[0][1] + k * u[0][0]) / h), dims=(2, 2)
    )
    # Navier's equations: F = -stiff grad(div u) + mu curl(curl u)
    bulk_d = u[2][0] + (k * u[1][0] + v[1][1]) / h - k * (k * u[0][0] + v[0][1]) / h**2
    bulk_s = u[1][1] + (k * u[0][1] + v[0][2]) / h
    turn_s = v[1][1] + (k * v[0][1] - u[0][2]) / h
    turn_d = v[2][0] + (k * v[1][0] - u[1][1]) / h - k * (k * v[0][0] - u[0][1]) / h**2
    force = (-stiff * bulk_d + m.mu * turn_s / h, -stiff * bulk_s / h - m.mu * turn_d)
    (nx, ny), (tx, ty) = zone.across, zone.along
    frame = ng.CF((nx, tx, ny, ty), dims=(2, 2))
    return (
        frame * ng.CF((u[0][0], v[0][0])),
        hooke(material, frame * grad * frame.trans),
        frame * ng.CF(force),
    )


def _power(t: CF, end: float, scale: float) -> Derivatives:
    """Derivatives by s = scale t of the bump (1 - (t / end)^2)^3 for |t| < end, 0 elsewhere."""
    r, unit = t / end, scale * end
    inner = 1 - r * r
    rest = ng.IfPos(inner, inner, 0.0)
    third = ng.IfPos(inner, (72 * rest - 48 * r * r) * r, 0.0)
    return (
        rest * rest * rest,
        -6 / unit * r * rest * rest,
        (24 * r * r - 6 * rest) * rest / unit**2,
        third / unit**3,
    )


def _step(t: CF, start: float, scale: float) -> Derivatives:
    """Derivatives by s = scale t of 1 for |t| < start, falling to 0 at |t| = 1."""
    size, sign, unit = ng.IfPos(t, t, -t), ng.IfPos(t, 1.0, -1.0), scale * (1 - start)
    c = (size - start) / (1 - start)
    c = ng.IfPos(c, ng.IfPos(1 - c, c, 1.0), 0.0)
    within = ng.IfPos(c * (1 - c), 1.0, 0.0)
    return (
        1 - c * c * (3 - 2 * c),
        -6 / unit * sign * c * (1 - c),
        within * (12 * c - 6) / unit**2,
        ng.CF(0.0),
    )


def _sum(*terms: tuple[float, Derivatives]) -> Derivatives:
    """Sum of factors times functions, with derivatives."""
    first, second, third, fourth = (
        sum((c * f[i] for c, f in terms if c), ng.CF(0.0)) for i in range(4)
    )
    return first, second, third, fourth


def polygonal(
    upper: Elastic,
    lower: Elastic,
    *,
    line: Sequence[Point],
    bumps: Sequence[Bump],
    p: float = 1.0,
    reach: float = 0.45,
) -> Exact:
    """Bodies above and below a polygonal line, pressed by p at its corners; one bump a side.

    Around the corners the stress is -p I and u = -k (x, y), k = (1 + nu)(1 - 2 nu) p / E, which
    must be the same for both bodies; bumps add to it, see `near_zone`. `pressure` and `gap` are
    functions of x. Raises ValueError for materials of different k, and for bumps that leave their
    sides.
    """
    materials = {"upper": upper, "lower": lower}
    shrink = [shrinkage(m, p) for m in materials.values()]
    if not math.isclose(*shrink, rel_tol=1e-12):
        raise ValueError(f"shrinkage {shrink}: both bodies must shrink alike under pressure")
    ends = np.asarray(line, float).tolist()
    sides = list(zip(ends[:-1], ends[1:], bumps, strict=True))
    for start, end, bump in sides:
        if not 0 < 2 * bump.half_length < math.dist(start, end):
            raise ValueError(f"half_length = {bump.half_length!r}: must stay inside its side")
    mean = (-shrink[0] * ng.CF((ng.x, ng.y)), ng.CF((-p, 0, 0, -p), dims=(2, 2)), ng.CF((0, 0)))
    parts: Fields = ({}, {}, {})
    for body, material in materials.items():
        added = [_bump_field(material, body, *side, p, reach) for side in sides]
        for part, first, more in zip(parts, mean, zip(*added, strict=True), strict=True):
            part[body] = sum(more, first)

    def along(x: ArrayLike, of: str) -> NDArray[np.float64]:
        """Pressure or gap, summed over sides; p and 0 away from bumps."""
        total = np.full(np.shape(x), p if of == "pressure" else 0.0)
        for start, end, bump in sides:
            s = np.asarray(x, float) - (start[0] + end[0]) / 2
            s = s * math.dist(start, end) / (end[0] - start[0])
            total += _profile(bump, p, np.abs(s) / bump.half_length, of)
        return total

    displacement, stress, force = map(compiled, parts)
    return Exact(
        displacement,
        stress,
        force,
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
    reach: float,
) -> tuple[CF, CF, CF]:
    """Displacement, stress and force that one bump adds to one body, see `polygonal`."""
    size = math.dist(start, end)
    tx, ty = ((end[i] - start[i]) / size for i in range(2))
    mx, my = ((end[i] + start[i]) / 2 for i in range(2))
    t = ((ng.x - mx) * tx + (ng.y - my) * ty) / bump.half_length
    zone = Zone((ng.y - my) * tx - (ng.x - mx) * ty, (-ty, tx), (tx, ty), 0.0, reach)
    hat, sign = _power(t, 1.0, bump.half_length), 1.0 if body == "upper" else -1.0
    a, q = [(bump.bow, hat)], [(-bump.pressure, hat)]
    if bump.opening:
        # The outward normal n' of the upper body points down: each body moves by half of the gap.
        a.append((sign * bump.opening / 2, _power(t, OPEN, bump.half_length)))
        q = [(p, _step(t, OPEN, bump.half_length))]
    return near_zone(material, zone, _sum(*a), _sum((sign * bump.slip, hat)), _sum(*q))


@dataclass(frozen=True, eq=False, kw_only=True)
class Circular(Exact):
    """A zone on the unit circle, first quadrant, open between the angles `ends`."""

    ends: tuple[float, float]


def circular(
    outer: Elastic,
    inner: Elastic,
    *,
    pressure: float = 0.5,
    opening: float = 0.02,
    turn: float = -0.3,
    bow: float = 0.05,
    slip: float = 0.05,
) -> Circular:
    """Rings about the circle r = 1 that part around 45 degrees: `outer` is the body '.

    With w = cos(4 theta): p = pressure (w - turn)^2 where w > turn, gap = opening (turn - w)^3
    elsewhere. u = 0 on r = 2; on both axes u.n and the shear vanish. `pressure` and `gap` are
    functions of theta.
    """
    x, y = ng.x, ng.y
    r, theta = ng.sqrt(x * x + y * y), ng.atan2(y, x)
    cos, sin = ng.cos(4 * theta), ng.sin(4 * theta)
    wave = (cos, -4 * sin, -16 * cos, 64 * sin)
    across = (sin, 4 * cos, -16 * sin, -64 * cos)
    inside, outside = (ng.IfPos(f, f, 0.0) for f in (cos - turn, turn - cos))
    # f(w): f' w', f'' w'^2 + f' w'', f''' w'^3 + 3 f'' w' w'' + f' w'''
    w1, w2, w3 = wave[1:]
    p = (
        inside * inside,
        2 * inside * w1,
        ng.IfPos(inside, 2 * w1 * w1, 0.0) + 2 * inside * w2,
        ng.CF(0.0),
    )
    gap = (
        outside * outside * outside,
        -3 * outside * outside * w1,
        6 * outside * w1 * w1 - 3 * outside * outside * w2,
        ng.IfPos(outside, -6 * w1 * w1 * w1, 0.0)
        + 18 * outside * w1 * w2
        - 3 * outside * outside * w3,
    )
    zone = Zone(r - 1, (x / r, y / r), (-y / r, x / r), 1.0, 1.0)
    parts: Fields = ({}, {}, {})
    for body, material, sign in (("outer", outer, 1.0), ("inner", inner, -1.0)):
        a = _sum((bow, wave), (sign * opening / 2, gap))  # n' points inwards: gap = u_r' - u_r''
        b, q = _sum((sign * slip, across)), _sum((-pressure, p))
        for part, field in zip(parts, near_zone(material, zone, a, b, q), strict=True):
            part[body] = field
    end = math.acos(turn) / 4
    displacement, stress, force = map(compiled, parts)
    return Circular(
        displacement,
        stress,
        force,
        pressure=lambda t: pressure * np.maximum(np.cos(4 * np.asarray(t)) - turn, 0) ** 2,
        gap=lambda t: opening * np.maximum(turn - np.cos(4 * np.asarray(t)), 0) ** 3,
        ends=(end, math.pi / 2 - end),
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
