"""Exact solutions of bodies with any law: stiff fibres, moduli that vary, glued layers.

Displacements are smooth inside each region of one law, stresses are the law's, body forces balance
them, and the other data are their boundary values: on meshes whose edges follow the regions every
order has its optimal rate. Plane strain, any consistent units.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TypeAlias

import ngsolve as ng
import numpy as np
from netgen.occ import Compound, Face, Glue, OCCGeometry
from numpy.typing import NDArray

from drivers.reference.cases import Case
from drivers.reference.manufactured import equilibrated
from drivers.reference.straight import Exact
from drivers.reference.westergaard import CF
from ngcontact import Contact, Elastic, Hooke, Problem
from ngcontact.geometries.region import Point, body, compound, polygon

Law: TypeAlias = Elastic | Hooke

SIDES: dict[str, Point] = {"left": (-1, 0), "right": (1, 0)}
WAVES = ng.CF((ng.sin(2 * ng.x + ng.y + 0.3), ng.cos(3 * ng.x - 2 * ng.y)))


def fibres(stiffness: float, angle: float, shear: float = 0.4) -> Hooke:
    """A law of modulus 1 with fibres `stiffness` times as stiff, at an angle (radians) to x."""
    c, s = math.cos(angle), math.sin(angle)
    T = np.array(
        [[c * c, s * s, c * s], [s * s, c * c, -c * s], [-2 * c * s, 2 * c * s, c * c - s * s]]
    )
    C = T.T @ np.diag([stiffness, 1.0, shear]) @ T
    return Hooke((C + C.T) / 2)


def _exact(displacement: dict[str, CF], laws: dict[str, Law], p: float) -> Exact:
    """Displacements by region with their stresses and body forces; contact under p all along."""
    return Exact(*equilibrated(displacement, laws), pressure=lambda x: np.full(np.shape(x), p))


def bent_fibres(stiffness: float, angle: float) -> Case:
    """A square of fibres that bend and slide past each other, but do not stretch.

    No stress depends on the fibres' stiffness, while what a mesh misses of the displacement
    stretches them: errors grow like its root until they are as large as the solution.
    """
    (fx, fy), law = (math.cos(angle), math.sin(angle)), fibres(stiffness, angle)
    s, t = fx * ng.x + fy * ng.y, fx * ng.y - fy * ng.x
    along, across = 0.3 * ng.sin(2 * t + 0.4), ng.cos(1.5 * s + t)
    u = ng.CF((along * fx - across * fy, along * fy + across * fx))
    exact = _exact({"body": u}, {"body": law}, 0.0)
    corners: list[Point] = [(0, 0), (1, 0), (1, 1), (0, 1)]
    outline = polygon(corners, ["held", "right", "top", "held"])
    stress = exact.stress["body"]
    problem = Problem(
        geometry=compound(body("body", outline)),
        materials={"body": law},
        displacement={"held": exact.displacement["body"]},
        traction={"right": stress * ng.CF((1, 0)), "top": stress * ng.CF((0, 1))},
        force=exact.force,
    )
    return Case(problem, exact)


def _pressed(laws: dict[str, Law], heights: Sequence[float], exact: Exact) -> Problem:
    """Regions [-1, 1] x [y_i, y_i+1] by rising `heights`, glued but for the contact line y = 0."""
    faces: dict[bool, list[Face]] = {True: [], False: []}
    for region, low, high in zip(laws, heights[:-1], heights[1:], strict=True):
        names = {0.0: f"{'lower' if high == 0 else 'upper'}_contact", heights[0]: "bottom"}
        names[heights[-1]] = "top"
        below, above = (names.get(y, "between") for y in (low, high))
        corners: list[Point] = [(-1, low), (1, low), (1, high), (-1, high)]
        outline = polygon(corners, [below, f"{region}_right", above, f"{region}_left"])
        faces[low >= 0].append(body(region, outline))
    first, *_, last = laws
    return Problem(
        geometry=OCCGeometry(Compound([Glue(both) for both in faces.values()]), dim=2),
        materials=laws,
        displacement={"bottom": exact.displacement[first], "top": exact.displacement[last]},
        traction={
            f"{region}_{side}": exact.stress[region] * ng.CF(normal)
            for region in laws
            for side, normal in SIDES.items()
        },
        force=exact.force,
        contact=[Contact(secondary="upper_contact", primary="lower_contact")],
    )


def layers(
    laws: dict[str, Law], heights: Sequence[float] = (-1.0, 0.0, 1.0), *, p: float = 1.0
) -> Case:
    """Layers of constant laws under the pressure p, in contact on y = 0 and glued elsewhere.

    On all lines between layers s_yy = -p, s_xy = 0 and e_xx is that of the stiffest layer under p:
    the displacement is linear there, up to the square of the distance from the lines times waves
    that are as small as the layer is stiff.
    """
    C = {region: _matrix(law) for region, law in laws.items()}
    e_xx = -p / max(c[0, 0] for c in C.values())
    lines = ng.CF(1.0)
    for y in heights[1:-1]:
        lines = lines * (ng.y - y)
    displacement, start = {}, np.zeros(2)
    for region, low, high in zip(laws, heights[:-1], heights[1:], strict=True):
        c = C[region]
        slope = np.linalg.solve(c[1:, 1:], [-p - c[1, 0] * e_xx, -c[2, 0] * e_xx])[::-1]
        there, grows = (ng.CF(tuple(v.tolist())) for v in (start, slope))
        linear = there + (ng.y - low) * grows + ng.CF((e_xx * ng.x, 0))
        displacement[region] = linear + p / np.linalg.eigvalsh(c)[0] * lines * lines * WAVES
        start = start + slope * (high - low)
    exact = _exact(displacement, laws, p)
    return Case(_pressed(laws, heights, exact), exact)


def pressed_fibres(stiffness: float, angle: float) -> Case:
    """`layers` of one law with fibres, whose stresses stretch them."""
    return layers(dict.fromkeys(("lower", "upper"), fibres(stiffness, angle)))


def stiff_and_soft(contrast: float) -> Case:
    """`layers` in both blocks, of which every other one is `contrast` times stiffer."""
    soft, stiff = Elastic(1.0, 0.3), Elastic(contrast, 0.2)
    laws: dict[str, Law] = {"base": stiff, "lower": soft, "upper": soft, "cap": stiff}
    return layers(laws, (-1.0, -0.4, 0.0, 0.5, 1.0))


def graded(contrast: float, *, p: float = 1.0, nu: float = 0.3) -> Case:
    """Blocks whose moduli vary smoothly by `contrast`, under a pressure p on y = 0.

    u = (y^2 w_x, y^2 w_y - y p / m) / E with m = (1 - nu) / ((1 + nu)(1 - 2 nu)): stresses are as
    large where the blocks are soft as where they are stiff.
    """
    depth, m = math.log(contrast) / 2, (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    waves = {"lower": ng.cos(2 * ng.x + ng.y), "upper": ng.sin(2 * ng.x - ng.y + 0.5)}
    laws: dict[str, Law] = {}
    displacement = {}
    for region, wave in waves.items():
        E = ng.exp(depth * wave)
        laws[region] = Elastic(E, nu)
        displacement[region] = (ng.y * ng.y * WAVES - ng.CF((0, p / m)) * ng.y) / E
    exact = _exact(displacement, laws, p)
    return Case(_pressed(laws, (-1.0, 0.0, 1.0), exact), exact)


def _matrix(law: Law) -> NDArray[np.float64]:
    """A constant law (3, 3) in plane strain."""
    if isinstance(law, Hooke):
        return np.asarray(law.C, dtype=float)
    E, nu = float(law.E), float(law.nu)
    C = np.array([[1 - nu, nu, 0], [nu, 1 - nu, 0], [0, 0, (1 - 2 * nu) / 2]])
    return E / ((1 + nu) * (1 - 2 * nu)) * C
