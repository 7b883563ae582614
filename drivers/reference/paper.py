"""Cases of single theorems and remarks of HH81, beside those of `cases`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import ngsolve as ng
from netgen.occ import OCCGeometry

from drivers.reference.cases import (
    BLOCKS,
    FIRST,
    LINE,
    OUTSIDE,
    SECOND,
    TOUCHING,
    UPWARDS,
    Case,
    touching_blocks,
)
from drivers.reference.manufactured import Bump, circular, polygonal, slits, with_end_of_guide
from drivers.reference.straight import Exact, hertz, uniform_pressure
from ngcontact import Contact, Elastic, Problem
from ngcontact.geometries import rings as ring_geometry
from ngcontact.geometries.region import Point, body, compound, polygon

ALIKE = Elastic(E=18 / 13, nu=0.2)  # shrinks as FIRST does under equal stresses in the plane
CUTS = "inner_cut_x|inner_cut_y|outer_cut_x|outer_cut_y"


def _polygonal_blocks(names: Sequence[str]) -> OCCGeometry:
    """Blocks as `geometries.blocks` has them, with a name for every side of the line."""
    above = [*LINE, (1.0, 1.0), (-1.0, 1.0)]
    below = [*LINE[::-1], (-1.0, -1.0), (1.0, -1.0)]
    up = [*(f"upper_{name}" for name in names), "upper_right", "top", "upper_left"]
    down = [*(f"lower_{name}" for name in names[::-1]), "lower_left", "bottom", "lower_right"]
    return compound(body("upper", polygon(above, up)), body("lower", polygon(below, down)))


def _tractions(exact: Exact, normals: dict[str, Point]) -> dict[str, ng.CF]:
    """Exact tractions on boundaries with constant normals, by names that begin with the body."""
    return {
        name: exact.stress["upper" if name.startswith(("upper", "top")) else "lower"] * ng.CF(n)
        for name, n in normals.items()
    }


SIDES: dict[str, Point] = {
    "upper_left": (-1, 0),
    "upper_right": (1, 0),
    "lower_left": (-1, 0),
    "lower_right": (1, 0),
}


def polygonal_zone() -> Case:
    """Three sides, a convex and a re-entrant corner: the middle one opens, the others slip."""
    bumps = (
        Bump(0.27, pressure=0.5, bow=0.05, slip=0.1),
        Bump(0.36, opening=0.1, bow=0.05, slip=0.1),
        Bump(0.32, pressure=-0.4, bow=-0.05, slip=-0.1),
    )
    exact = polygonal(FIRST, ALIKE, line=LINE, bumps=bumps)
    problem = touching_blocks(
        {"top": exact.displacement["upper"], "bottom": exact.displacement["lower"]},
        geometry=_polygonal_blocks(["contact"] * 3),
        materials={"upper": FIRST, "lower": ALIKE},
        traction=_tractions(exact, SIDES),
        force=exact.force,
    )
    return Case(problem, exact)


def bilateral_part() -> Case:
    """Remark 3.3: the lower body hangs on a bilateral part of the zone alone, with tension in it.

    The part is the two outer sides: no rigid motion is free of normal displacements on both.
    """
    bumps = (
        Bump(0.27, pressure=-2.0, bow=0.05, slip=0.1),
        Bump(0.36, opening=0.1, bow=0.05, slip=0.1),
        Bump(0.32, pressure=-2.0, bow=-0.05, slip=-0.1),
    )
    exact = polygonal(FIRST, ALIKE, line=LINE, bumps=bumps)
    problem = Problem(
        geometry=_polygonal_blocks(["held", "contact", "held"]),
        materials={"upper": FIRST, "lower": ALIKE},
        displacement={"top": exact.displacement["upper"]},
        traction=_tractions(exact, SIDES | {"bottom": (0, -1)}),
        force=exact.force,
        contact=[
            Contact(secondary="upper_held", primary="lower_held", bilateral=True),
            TOUCHING,
        ],
    )
    return Case(problem, exact)


def opening_ring() -> Case:
    """Theorem 3.3: rings that part over an arc of a circular zone; clamped rim, guided cuts."""
    exact = circular(FIRST, SECOND)
    inwards = ng.CF((-ng.x, -ng.y)) / ng.sqrt(ng.x * ng.x + ng.y * ng.y)
    problem = Problem(
        geometry=ring_geometry(quarter=True),
        materials={"outer": FIRST, "inner": SECOND},
        displacement={"rim": (0, 0)},
        sliding=CUTS,
        traction={"hole": exact.stress["inner"] * inwards},
        force=exact.force,
        contact=[Contact(secondary="outer_contact", primary="inner_contact")],
    )
    return Case(problem, exact)


def circular_patch(p: float = 1.0) -> Case:
    """Uniform stress -p I across a circular zone, one material: linear displacement."""
    bodies = ("outer", "inner")
    exact = uniform_pressure(FIRST, bodies, p=p)
    problem = Problem(
        geometry=ring_geometry(quarter=True),
        materials=dict.fromkeys(bodies, FIRST),
        displacement={"rim": exact.displacement["outer"]},
        sliding=CUTS,
        traction={"hole": p},
        contact=[Contact(secondary="outer_contact", primary="inner_contact")],
    )
    return Case(problem, exact)


def slit_blocks(half_width: float = 0.5) -> Case:
    """Theorem 3.2: a bounded zone between two slits, a flat punch's pressure: no H^2."""
    exact = slits(FIRST, SECOND, half_width=half_width)
    a = half_width
    above: list[Point] = [(-1, 0), (-a, 0), (a, 0), (1, 0), (1, 1), (-1, 1)]
    below: list[Point] = [(1, 0), (a, 0), (-a, 0), (-1, 0), (-1, -1), (1, -1)]
    up = ["slit", "upper_contact", "slit", "upper_right", "top", "upper_left"]
    down = ["slit", "lower_contact", "slit", "lower_left", "bottom", "lower_right"]
    geometry = compound(body("upper", polygon(above, up)), body("lower", polygon(below, down)))
    displacement = {OUTSIDE[name]: u for name, u in exact.displacement.items()}
    return Case(touching_blocks(displacement, geometry=geometry), exact)


def end_of_guide(c: float = 0.2) -> Case:
    """Theorem 3.5: half of Hertz contact on a guide that ends at (1, -1), homogeneous data."""
    smooth = hertz(FIRST, SECOND, radius=5.0, half_width=0.3, plateau=0.5)
    exact = with_end_of_guide(smooth, BLOCKS, at=1.0, c=c, reach=0.95)
    above: list[Point] = [(0, 0), (2, 0), (2, 1), (0, 1)]
    below: list[Point] = [(0, 0), (0, -1), (1, -1), (2, -1), (2, 0)]
    up = ["upper_contact", "upper_right", "top", "upper_axis"]
    down = ["lower_axis", "lower_loose", "lower_guide", "lower_right", "lower_contact"]
    loaded: dict[str, Point] = {
        "upper_right": (1, 0),
        "lower_right": (1, 0),
        "lower_loose": (0, -1),
    }
    problem = touching_blocks(
        {"top": (0, 0)},
        geometry=compound(body("upper", polygon(above, up)), body("lower", polygon(below, down))),
        sliding="upper_axis|lower_axis|lower_guide",
        traction=_tractions(exact, loaded),
        force=exact.force,
        contact=[replace(UPWARDS, gap=exact.initial_gap)],
    )
    return Case(problem, exact)
