"""Exact frictionless contact solutions of two bodies that meet along the line y = 0.

Plane strain, any consistent units. The bodies are called "upper" (body ' of Haslinger & Hlavacek
1981, HH81) and "lower" (body ''). Every solution holds on any subdomains of the two half-planes:
the cut boundaries carry its displacement or its traction as data.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import ngsolve as ng
import numpy as np
from numpy.typing import ArrayLike, NDArray

from drivers.reference.westergaard import (
    CF,
    SIDES,
    Field,
    Potential,
    depth,
    effective_modulus,
    half_plane,
    hertz_potential,
    hooke,
    moduli,
    root_potential,
)
from ngcontact import Elastic, Hooke, Solution

Profile: TypeAlias = Callable[[ArrayLike], NDArray[np.float64]]

NO_FORCE = ng.CF((0.0, 0.0))


def closed(s: ArrayLike) -> NDArray[np.float64]:
    """No gap anywhere."""
    return np.zeros(np.shape(s))


@dataclass(frozen=True, eq=False)
class Exact:
    """An exact contact solution; the dictionaries are keyed by the body's name.

    Pressure and gap are NumPy functions of x on the contact line, of the angle for rings.
    """

    displacement: dict[str, CF]  # (2,), finite and correct at every point, vertices included
    stress: dict[str, CF]  # (2, 2) in the plane; times the outward normal the traction data
    force: dict[str, CF]  # (2,) body force F = -div(stress)
    pressure: Profile  # >= 0: -T_n of bounded zones, -T_xi per unit eta of enlarging ones
    gap: Profile = closed  # >= 0 after deformation
    # Before deformation, the right side of the contact condition; negative: interference.
    initial_gap: CF = field(default_factory=lambda: ng.CF(0.0))


@dataclass(frozen=True, eq=False, kw_only=True)
class Hertz(Exact):
    """Hertz contact with half width a, greatest pressure p0 and total force P per unit depth."""

    half_width: float
    p0: float
    P: float


def compiled(fields: dict[str, CF]) -> dict[str, CF]:
    """Every field with its common subexpressions evaluated once (up to 400 times faster)."""
    return {body: field.Compile() for body, field in fields.items()}


def equilibrium_fields(
    fields: dict[str, Field], materials: dict[str, Elastic]
) -> tuple[dict[str, CF], dict[str, CF], dict[str, CF]]:
    """Displacement, stress and (zero) force of equilibrated fields, the first three of `Exact`."""
    displacement = compiled({body: field.u for body, field in fields.items()})
    stress = compiled({body: hooke(materials[body], field.grad) for body, field in fields.items()})
    return displacement, stress, dict.fromkeys(fields, NO_FORCE)


def transition(
    upper: Elastic, lower: Elastic, *, c: float = 1.0, plateau: float | None = None
) -> Exact:
    """One change from contact (x < 0) to separation (x > 0) of bodies with no initial gap.

    Z = i c sqrt(z): p = c sqrt(-x), gap = 4 c x^(3/2) / (3 E*). The displacement grows as r^(3/2),
    which is the regularity of frictionless contact with smooth data. Units: c stress per square
    root of length. With a `plateau` times a C^3 cut-off chi, see `_fields`.
    """
    opening = 4 * c / (3 * effective_modulus(upper, lower))
    potentials = {body: root_potential(c, body) for body in SIDES}
    return Exact(
        *_fields(potentials, {"upper": upper, "lower": lower}, plateau),
        pressure=lambda x: c * np.sqrt(np.maximum(-np.asarray(x, float), 0)),
        gap=lambda x: opening * np.maximum(np.asarray(x, float), 0) ** 1.5,
    )


def _fields(
    potentials: dict[str, Potential], materials: dict[str, Elastic], plateau: float | None
) -> tuple[dict[str, CF], dict[str, CF], dict[str, CF]]:
    """Displacement, stress and force of equilibrated fields, with a `plateau` times a cut-off.

    That is 1 for |y| <= plateau and falls to 0 at |y| = 1, where displacement and traction vanish:
    the homogeneous data of HH81 (3.6) and (3.8), clamped top, guided bottom. The remaining data are
    tractions on the sides and a body force, zero for |y| <= plateau. With a guided bottom the
    problem is semicoercive (HH81 Remark 3.7): the lower body is determined up to a translation
    along x.
    """
    fields = {body: half_plane(potentials[body], law, body) for body, law in materials.items()}
    if plateau is None:
        return equilibrium_fields(fields, materials)
    displacement, stress, force = {}, {}, {}
    for body, material in materials.items():
        u, grad = fields[body]
        m, t = moduli(material), (depth(body) - plateau) / (1 - plateau)
        t = ng.IfPos(t, ng.IfPos(1 - t, t, 1.0), 0.0)
        chi = 1 - t**4 * (35 - 84 * t + 70 * t**2 - 20 * t**3)
        d1 = -SIDES[body] * 140 * t**3 * (1 - t) ** 3 / (1 - plateau)  # d chi / dy
        d2 = -420 * t**2 * (1 - t) ** 2 * (1 - 2 * t) / (1 - plateau) ** 2
        displacement[body] = chi * u
        s, outer = hooke(material, grad), ng.CF((0, d1 * u[0], 0, d1 * u[1]), dims=(2, 2))
        stress[body] = hooke(material, chi * grad + outer)
        # F = -div(chi s(u) + C:(u x grad chi)) with div s(u) = 0.
        stiff = m.lam + 2 * m.mu
        fx = d1 * (s[0, 1] + m.lam * grad[1, 0] + m.mu * grad[0, 1]) + d2 * m.mu * u[0]
        fy = d1 * (s[1, 1] + m.mu * grad[0, 0] + stiff * grad[1, 1]) + d2 * stiff * u[1]
        force[body] = -ng.CF((fx, fy))
    return compiled(displacement), compiled(stress), compiled(force)


def hertz(
    upper: Elastic,
    lower: Elastic,
    *,
    radius: float,
    half_width: float,
    plateau: float | None = None,
) -> Hertz:
    """Hertz contact |x| <= a of flat bodies that carry eps = x^2 / (2 R) as gap data.

    p = p0 sqrt(1 - x^2/a^2), p0 = a E* / (2 R), P = pi a p0 / 2 (K. L. Johnson, Contact Mechanics,
    1985, chapter 4): exact for the linearised enlarging zone problem, direction along y. For two
    curved bodies 1/R is the sum of both curvatures. With a `plateau` displacement and traction fall
    to zero on |y| = 1, see `_fields`.
    """
    a = half_width
    p0 = a * effective_modulus(upper, lower) / (2 * radius)
    potentials = {body: hertz_potential(p0 / a, a, body) for body in SIDES}

    def gap(x: ArrayLike) -> NDArray[np.float64]:
        s = np.maximum(np.abs(np.asarray(x, float)) / a, 1.0)
        return a**2 / (2 * radius) * (s * np.sqrt(s**2 - 1) - np.arccosh(s))

    return Hertz(
        *_fields(potentials, {"upper": upper, "lower": lower}, plateau),
        pressure=lambda x: p0 * np.sqrt(np.maximum(1 - (np.asarray(x, float) / a) ** 2, 0)),
        gap=gap,
        initial_gap=ng.x * ng.x / (2 * radius),
        half_width=a,
        p0=p0,
        P=math.pi * a * p0 / 2,
    )


def patch(upper: Elastic, lower: Elastic, *, p0: float = 1.0, p1: float = 0.0) -> Exact:
    """Full contact under the pressure p0 + p1 x, without initial gap; u_y = 0 on y = 0.

    The only stress is s_yy = -(p0 + p1 x). The displacement is linear for p1 = 0 (elements of order
    1 reproduce it) and quadratic otherwise (order 2). A contact solution where p0 + p1 x >= 0.
    """
    materials = {"upper": upper, "lower": lower}
    x, y, fields = ng.x, ng.y, {}
    for body, material in materials.items():
        m, p = moduli(material), p0 + p1 * x
        u = ng.CF((m.ratio * (p0 * x + p1 * x * x / 2) + p1 * y * y / 2, -p * y))
        grad = ng.CF((m.ratio * p, p1 * y, -p1 * y, -p), dims=(2, 2))
        fields[body] = Field(u / m.plane, grad / m.plane)
    return Exact(
        *equilibrium_fields(fields, materials),
        pressure=lambda x: p0 + p1 * np.asarray(x, float),
    )


def shrinkage(material: Elastic, p: float) -> float:
    """Relative shortening (1 + nu)(1 - 2 nu) p / E of lengths in the plane under -p I."""
    return p * (1 + material.nu) * (1 - 2 * material.nu) / material.E


def uniform_pressure(material: Elastic, bodies: Sequence[str], *, p: float = 1.0) -> Exact:
    """Uniform stress -p I in bodies of one material, whatever the line in which they meet.

    u = -k (x, y), see `shrinkage`.
    """
    u = -shrinkage(material, p) * ng.CF((ng.x, ng.y))
    return Exact(
        displacement=dict.fromkeys(bodies, u),
        stress=dict.fromkeys(bodies, ng.CF((-p, 0, 0, -p), dims=(2, 2))),
        force=dict.fromkeys(bodies, NO_FORCE),
        pressure=lambda s: np.full(np.shape(s), p),
    )


def relative_energy_error(solution: Solution, exact: Exact) -> float:
    """Relative error of a discrete stress in the energy norm, over all bodies."""
    error, norm = energy_error(solution, exact)
    return error / norm


def energy_error(solution: Solution, exact: Exact) -> tuple[float, float]:
    """Error of a discrete stress in the energy norm, over all bodies, and the exact one's norm.

    The norm is the square root of the sum over bodies of the integral of s : C^-1 : s. The order of
    integration, 2 p + 8, leaves room for the exact stress, whose gradient grows as r^(-1/2) at the
    ends of the contact zone. Raises ValueError for another model than that of the exact solution
    and for a body that the mesh does not have.
    """
    problem, mesh = solution.problem, solution.mesh
    hoop = getattr(exact, "hoop", None)  # of bodies of revolution
    if problem.model != ("plane strain" if hoop is None else "axisymmetric"):
        raise ValueError(f"model = {problem.model!r}: the exact solution is of another one")
    error = norm = 0.0
    for body, stress in exact.stress.items():
        if body not in mesh.GetMaterials():
            raise ValueError(f"no body {body!r} in the mesh: it has {mesh.GetMaterials()}")
        material, region = problem.materials[body], mesh.Materials(body)
        stresses = [(solution.stress - stress, None), (stress, None)]
        if hoop is not None:
            hoops = (solution.hoop_stress - hoop[body], hoop[body])
            stresses = [(s, h) for (s, _), h in zip(stresses, hoops, strict=True)]
        energies = [_complementary_energy(material, *pair) for pair in stresses]
        both = ng.CF(tuple(energies)).Compile()  # the exact stress once
        integrals = ng.Integrate(both, region, order=2 * solution.order + 8)
        error, norm = error + integrals[0], norm + integrals[1]
    return math.sqrt(error), math.sqrt(norm)


def _complementary_energy(material: Elastic | Hooke, s: CF, hoop: CF | None) -> CF:
    """Twice the complementary energy density, s : C^-1 : s; with a `hoop` times 2 pi r."""
    if isinstance(material, Hooke):
        voigt = ng.CF((s[0, 0], s[1, 1], s[0, 1]))
        return ng.InnerProduct(ng.Inv(material.voigt()) * voigt, voigt)
    square, trace, nu = ng.InnerProduct(s, s), s[0, 0] + s[1, 1], material.nu
    if hoop is None:
        return (square - nu * trace * trace) / (2 * moduli(material).mu)
    trace = trace + hoop
    energy = square + hoop * hoop - nu / (1 + nu) * trace * trace
    return 2 * math.pi * ng.x * energy / (2 * moduli(material).mu)
