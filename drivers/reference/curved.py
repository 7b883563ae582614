"""Exact frictionless contact solutions of two bodies with curved contact lines.

Plane strain, any consistent units. `curved` is an enlarging zone problem of Haslinger & Hlavacek
1981 (HH81), with two different contact curves; `rings` is a bounded zone problem on one curved
contact line, HH81 (2.5).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from drivers.reference.manufactured import equilibrated
from drivers.reference.straight import NO_FORCE, Exact, Profile, compiled
from drivers.reference.westergaard import CF, moduli
from ngcontact import Elastic


@dataclass(frozen=True, eq=False, kw_only=True)
class Curved(Exact):
    """Bodies with contact curves y = curve(x): NumPy functions f', f'' and their derivatives."""

    curve: dict[str, Profile]
    slope: dict[str, Profile]
    half_width: float
    P: float


@dataclass(frozen=True, eq=False, kw_only=True)
class Rings(Exact):
    """Concentric rings under the contact pressure P0 + Pn cos(n theta)."""

    P0: float
    Pn: float


def _parabola(radius: float) -> tuple[Profile, Profile]:
    """Parabola y = x^2 / (2 radius) and its derivative."""
    return (
        lambda x: np.asarray(x, float) ** 2 / (2 * radius),
        lambda x: np.asarray(x, float) / radius,
    )


def curved(
    upper: Elastic,
    lower: Elastic,
    *,
    radii: tuple[float, float] = (1.0, 2.0),
    half_width: float = 0.25,
    pressure: float = 30.0,
    opening: float = 0.5,
    bow: float = 0.2,
) -> Curved:
    """Contact |x| <= a of the curves f' = x^2 / (2 R') above and f'' = -x^2 / (2 R'') below.

    p = pressure (a^2 - x^2)^2 per unit of x in contact, gap = opening (x^2 - a^2)^3 outside of it,
    and u''_y = bow x^2 on the lower curve. Exact for HH81 (3.9')-(3.12') with the direction along
    y: T_eta = 0 and |T_xi| / cos(alpha) = p on both curves. The body force is bounded, with jumps
    at |x| = a; the bodies may end anywhere. Units: pressure stress / length^4, opening length^-5,
    bow 1 / length.
    """
    a = half_width
    signed = {"upper": radii[0], "lower": -radii[1]}
    x, y = ng.x, ng.y
    inside = ng.IfPos(a**2 - x * x, a**2 - x * x, 0.0)
    outside = ng.IfPos(x * x - a**2, x * x - a**2, 0.0)
    eps = x * x / (2 * radii[0]) + x * x / (2 * radii[1])
    heights = {"lower": bow * x * x}
    # The gap is eps + u'_y - u''_y: zero in contact, HH81 (3.12'), and as prescribed outside of it.
    heights["upper"] = heights["lower"] - eps + opening * outside * outside * outside
    displacement = {}
    for body, material in (("upper", upper), ("lower", lower)):
        f, height = x * x / (2 * signed[body]), heights[body]
        slope = ng.CF(
            _slope_off_curve(material, x / signed[body], height.Diff(x), pressure * inside * inside)
        )
        displacement[body] = ng.CF((0.0, height)) + (y - f) * slope
    graphs = {body: _parabola(radius) for body, radius in signed.items()}
    return Curved(
        *equilibrated(displacement, {"upper": upper, "lower": lower}),
        pressure=lambda s: pressure * np.maximum(a**2 - np.asarray(s, float) ** 2, 0) ** 2,
        gap=lambda s: opening * np.maximum(np.asarray(s, float) ** 2 - a**2, 0) ** 3,
        initial_gap=eps,
        curve={body: graph[0] for body, graph in graphs.items()},
        slope={body: graph[1] for body, graph in graphs.items()},
        half_width=a,
        P=16 / 15 * pressure * a**5,
    )


def _slope_off_curve(material: Elastic, df: CF, dh: CF, p: CF) -> tuple[CF, CF]:
    """Slope b of u = (0, h(x)) + (y - f(x)) b(x) for which the traction on y = f is (0, -p) per dx.

    With N = (-f', 1), the gradient on the curve is (0, h') x e_x + b x N, and the condition
    stress N = (0, -p) reads (lam + mu) (b.N) N + mu |N|^2 b = r.
    """
    m = moduli(material)
    r = (-m.mu * dh, m.mu * dh * df - p)
    square = 1 + df * df
    along = (m.lam + m.mu) / (m.lam + 2 * m.mu) * (r[1] - r[0] * df) / square
    return (r[0] + along * df) / (m.mu * square), (r[1] - along) / (m.mu * square)


def rings(
    outer: Elastic,
    inner: Elastic,
    *,
    radii: tuple[float, float, float] = (0.5, 1.0, 2.0),
    q0: float = 1.0,
    qn: float = 0.0,
    qi: float = 0.0,
    n: int = 2,
    delta: float = 0.0,
) -> Rings:
    """Ring R0 < r < R1 ("inner") in full contact with the ring R1 < r < R2 ("outer", body ').

    Pressed on r = R2 by the normal pressure q0 + qn cos(n theta) and on r = R0 by qi, with the
    radial interference delta before contact (delta > 0: a shrink fit). The contact pressure is
    P0 + Pn cos(n theta), from Michell's series. The rigid motions are fixed by symmetry: for even n
    the axes are symmetry planes, u.n = 0 without shear. Raises ValueError for loads under which
    the rings would separate (P0 < |Pn|).
    """
    bodies = {"inner": inner, "outer": outer}
    loads = {0: (qi, q0, delta), n: (0.0, qn, 0.0)}
    harmonics = {m: _match(radii, bodies, m, load) for m, load in loads.items()}
    mean, wave = (
        -float(_mode(m, 1.0, outer)[0] @ coefficients["outer"])
        for m, coefficients in harmonics.items()
    )
    if not mean >= abs(wave):
        raise ValueError(
            f"q0 = {q0!r}, qn = {qn!r}, qi = {qi!r}, delta = {delta!r}: the rings separate, "
            f"P0 = {mean:.6g} must be at least |Pn| = {abs(wave):.6g}"
        )
    displacement, stress = {}, {}
    for body, material in bodies.items():
        series = {m: coefficients[body] for m, coefficients in harmonics.items()}
        displacement[body], stress[body] = _series(series, radii[1], material)
    return Rings(
        compiled(displacement),
        compiled(stress),
        dict.fromkeys(bodies, NO_FORCE),
        pressure=lambda theta: mean + wave * np.cos(n * np.asarray(theta, float)),
        initial_gap=ng.CF(-delta),
        P0=mean,
        Pn=wave,
    )


def bearing(
    material: Elastic,
    *,
    radii: tuple[float, float] = (0.5, 1.0),
    loads: dict[int, float] | None = None,
) -> Exact:
    """Ring R0 < r < R1 ("ring") in a rigid bearing: u_r = 0 without shear on r = R1.

    Pressed on r = R0 by the sum of q_n cos(n theta), `loads` q_n by n = 0 or even n; 1 + 0.6 cos(2
    theta) by default. From Michell's series; for even n the axes are symmetry planes.
    """
    loads = {0: 1.0, 2: 0.6} if loads is None else loads
    series = {}
    for n, q in loads.items():
        hole, rim = _mode(n, radii[0] / radii[1], material), _mode(n, 1.0, material)
        equations = [(hole[0], -q), (rim[3], 0.0)]
        if n:
            equations += [(hole[1], 0.0), (rim[1], 0.0)]
        matrix = np.array([row for row, _ in equations])
        scale = np.abs(matrix).max(axis=1)
        right = np.array([value for _, value in equations])
        series[n] = np.linalg.solve(matrix / scale[:, None], right / scale)
    displacement, stress = _series(series, radii[1], material)
    return Exact(
        compiled({"ring": displacement}),
        compiled({"ring": stress}),
        {"ring": NO_FORCE},
        pressure=np.zeros_like,
    )


def _mode(n: int, r: float, material: Elastic) -> NDArray[np.float64]:
    """Michell's functions of harmonic n at the radius r R1: rows srr, srt, stt, ur / R1, ut / R1.

    One column per stress function, 2 for n = 0 and 4 else; srt and ut multiply sin(n theta), the
    other rows cos(n theta). The columns are Kolosov's phi = z^(m + 1) and psi = z^(m - 1) for m = n
    and m = -n.
    """
    return np.array([[c * r**e for c, e in column] for column in _michell(n, material)]).T


def _michell(n: int, material: Elastic) -> list[list[tuple[float, int]]]:
    """Coefficient and exponent of r of every entry of `_mode`, column by column."""
    columns, k = [], moduli(material)
    for m in (n, -n) if n else (0,):
        s, w = math.copysign(1, m), 1 / (2 * k.mu)
        columns += [
            [
                ((m + 1) * (2 - m), m),
                (s * m * (m + 1), m),
                ((m + 1) * (m + 2), m),
                (w * (k.kappa - m - 1), m + 1),
                (s * w * (k.kappa + m + 1), m + 1),
            ],
            [(1 - m, m - 2), (s * (m - 1), m - 2), (m - 1, m - 2), (-w, m - 1), (s * w, m - 1)],
        ]
    return columns


def _match(
    radii: tuple[float, float, float],
    bodies: dict[str, Elastic],
    n: int,
    load: tuple[float, float, float],
) -> dict[str, NDArray[np.float64]]:
    """Coefficients of harmonic n per body; the load is (hole, outer pressure, interference)."""
    hole = _mode(n, radii[0] / radii[1], bodies["inner"])
    rim = _mode(n, radii[2] / radii[1], bodies["outer"])
    inside, outside = (_mode(n, 1.0, bodies[body]) for body in ("inner", "outer"))
    none = np.zeros(hole.shape[1])
    equations = [
        (hole[0], none, -load[0]),
        (none, rim[0], -load[1]),
        (inside[0], -outside[0], 0.0),  # T'_n = T''_n, HH81 (3.10)
        (inside[3], -outside[3], -load[2] / radii[1]),  # closed gap
    ]
    if n:  # no shear on the four circles, HH81 (3.11)
        equations += [(hole[1], none, 0.0), (none, rim[1], 0.0)]
        equations += [(inside[1], none, 0.0), (none, outside[1], 0.0)]
    matrix = np.array([np.concatenate(equation[:2]) for equation in equations])
    scale = np.abs(matrix).max(axis=1)
    both = np.linalg.solve(matrix / scale[:, None], [e[2] for e in equations] / scale)
    return {"inner": both[: len(none)], "outer": both[len(none) :]}


def _series(
    series: dict[int, NDArray[np.float64]], unit: float, material: Elastic
) -> tuple[CF, CF]:
    """Displacement and stress of the sum of harmonics, radii measured in the given unit."""
    r, theta = ng.sqrt(ng.x * ng.x + ng.y * ng.y) / unit, ng.atan2(ng.y, ng.x)
    rows = [ng.CF(0.0)] * 5
    for n, coefficients in series.items():
        angular = [ng.sin(n * theta) if row in (1, 4) else ng.cos(n * theta) for row in range(5)]
        for coefficient, column in zip(coefficients, _michell(n, material), strict=True):
            for row, (c, e) in enumerate(column):
                rows[row] = rows[row] + coefficient * c * r**e * angular[row]
    srr, srt, stt, ur, ut = rows
    cos, sin = ng.x / (r * unit), ng.y / (r * unit)
    turn = ng.CF((cos, -sin, sin, cos), dims=(2, 2))
    polar = ng.CF((srr, srt, srt, stt), dims=(2, 2))
    return unit * turn * ng.CF((ur, ut)), turn * polar * turn.trans
