"""Exact contact solutions of solids: Hertz between two half-spaces, by a quarter of cubes."""

from __future__ import annotations

import math
from typing import NamedTuple

import netgen.occ as occ
import ngsolve as ng

from drivers.reference.axisymmetric import huber
from drivers.reference.cases import BLOCKS, FIRST, SECOND
from drivers.reference.westergaard import CF, effective_modulus
from ngcontact import Contact, Problem, Solution
from ngcontact.fem.model import SOLID_MODEL


class HertzOfSolids(NamedTuple):
    """Radius of contact, greatest pressure and force on the whole circle, exact displacement."""

    a: float
    p0: float
    P: float
    displacement: dict[str, CF]


def relative_energy_error(solution: Solution, exact: HertzOfSolids) -> float:
    """Energy norm of the error over that of u_h, the exact field interpolated two degrees up."""
    mesh, problem, order = solution.mesh, solution.problem, solution.order
    V, square = ng.VectorH1(mesh, order=order + 2), 0.0
    for body, u in exact.displacement.items():
        there, miss = mesh.Materials(body), ng.GridFunction(V)
        miss.Set(u - solution.displacement, definedon=there)
        e = SOLID_MODEL.strain(miss)
        density = ng.InnerProduct(problem.materials[body].voigt("solid") * e, e)
        square += ng.Integrate(density, mesh, definedon=there, order=2 * order + 4)
    return math.sqrt(square) / solution.energy_norm


def quarter(section: occ.OCCGeometry) -> occ.OCCGeometry:
    """Quarters of bodies of revolution about y by their meridian `section`, cut by faces "cut".

    Bodies and other faces have the names of the faces and edges that sweep them.
    """
    axis = occ.Axis((0, 0, 0), occ.Y)
    bodies = [face.Revolve(axis, 90) for face in section.shape.faces]
    for face in (face for one in bodies for face in one.faces):
        face.name = face.name or "cut"
    return occ.OCCGeometry(occ.Compound(bodies))


def quarter_cubes() -> occ.OCCGeometry:
    """Cubes "upper" and "lower" of size 1 above and below z = 0, x, y > 0.

    Faces "x" and "y" on the planes of symmetry, "upper_contact", "lower_contact", "upper_outer",
    "lower_outer".
    """
    bodies = []
    for name, low in (("upper", 0), ("lower", -1)):
        cube = occ.Box((0, 0, low), (1, 1, low + 1))
        cube.solids.name, cube.faces.name = name, f"{name}_outer"
        cube.faces.Min(occ.X).name, cube.faces.Min(occ.Y).name = "x", "y"
        contact = cube.faces.Min(occ.Z) if name == "upper" else cube.faces.Max(occ.Z)
        contact.name = f"{name}_contact"
        bodies.append(cube)
    return occ.OCCGeometry(occ.Compound(bodies))


def hertz_of_solids(radius: float = 5.0, a: float = 0.3) -> tuple[Problem, HertzOfSolids]:
    """Huber's field on a quarter of two cubes with the gap r^2 / 2 radius as data."""
    stiffness = effective_modulus(FIRST, SECOND)
    p0, delta = 2 * stiffness * a / (math.pi * radius), a * a / radius
    r = ng.sqrt(ng.x * ng.x + ng.y * ng.y)
    displacement = {}
    for body, side in (("upper", 1.0), ("lower", -1.0)):
        depth = ng.IfPos(side * ng.z, side * ng.z, 0.0)  # never -0, which flips atan2
        spread, sink = huber(BLOCKS[body], p0, a, r, depth)
        down = delta if body == "upper" else 0.0
        displacement[body] = ng.CF((ng.x * spread, ng.y * spread, side * sink - down)).Compile()
    contact = Contact(
        "lower_contact",
        "upper_contact",
        direction=(0, 0, 1),
        gap=(ng.x * ng.x + ng.y * ng.y) / (2 * radius),
    )
    problem = Problem(
        geometry=quarter_cubes(),
        materials=BLOCKS,
        displacement={f"{body}_outer": u for body, u in displacement.items()},
        sliding=["x", "y"],
        contact=[contact],
    )
    return problem, HertzOfSolids(a, p0, 2 / 3 * math.pi * a * a * p0, displacement)
