"""Contact problems of bodies of revolution with exact solutions, ready to solve."""

from __future__ import annotations

from netgen.occ import OCCGeometry

from drivers.reference.axisymmetric import (
    Fit,
    Hertz,
    Indentation,
    cone,
    flat_punch,
    hertz,
    shrink_fit,
)
from drivers.reference.cases import BLOCKS, FIRST, SECOND
from ngcontact import Contact, Elastic, Problem
from ngcontact.geometries.region import body, compound, polygon


def cylinders(inner: float = 0.0, outer: float = 1.0, height: float = 1.0) -> OCCGeometry:
    """Bodies "upper" and "lower", inner < r < outer, above and below y = 0.

    Boundaries are those of `geometries.blocks`; ``axis`` is r = `inner`.
    """
    up = [(inner, 0.0), (outer, 0.0), (outer, height), (inner, height)]
    down = [(inner, 0.0), (inner, -height), (outer, -height), (outer, 0.0)]
    return compound(
        body("upper", polygon(up, ["upper_contact", "upper_side", "top", "axis"])),
        body("lower", polygon(down, ["axis", "bottom", "lower_side", "lower_contact"])),
    )


def hertz_contact(radius: float = 5.0, a: float = 0.3) -> tuple[Problem, Hertz]:
    """Huber's field on cylinders of radius and height 1 with the gap r^2 / 2 radius as data."""
    exact = hertz(FIRST, SECOND, radius=radius, a=a)
    contact = Contact("lower_contact", "upper_contact", direction=(0, 1), gap=exact.initial_gap)
    problem = Problem(
        geometry=cylinders(),
        materials=BLOCKS,
        displacement={
            "top|upper_side": exact.displacement["upper"],
            "bottom|lower_side": exact.displacement["lower"],
        },
        contact=[contact],
        model="axisymmetric",
    )
    return problem, exact


def pressed_cylinders(inner: float = 0.0, rows: str = "auto") -> Problem:
    """Uniform axial pressure 1 on cylinders or rings of two materials, sides free."""
    return Problem(
        geometry=cylinders(inner),
        materials=BLOCKS,
        displacement={"bottom": (None, 0)},
        traction={"top": 1.0},
        contact=[Contact("upper_contact", "lower_contact", rows=rows)],
        model="axisymmetric",
    )


def fitted_rings(
    radii: tuple[float, float, float] = (0.4, 1.1, 1.9),
    interference: float = 0.01,
    height: float = 0.7,
) -> tuple[Problem, Fit]:
    """A sleeve shrunk into a hub, Lame's displacements on bore and rim, ends guided."""
    exact = shrink_fit(FIRST, SECOND, radii=radii, interference=interference)
    bore, r, rim = radii
    inside = [(bore, 0.0), (r, 0.0), (r, height), (bore, height)]
    outside = [(r, 0.0), (rim, 0.0), (rim, height), (r, height)]
    geometry = compound(
        body("sleeve", polygon(inside, ["ends", "sleeve_contact", "ends", "bore"])),
        body("hub", polygon(outside, ["ends", "rim", "ends", "hub_contact"])),
    )
    problem = Problem(
        geometry=geometry,
        materials={"sleeve": FIRST, "hub": SECOND},
        displacement={"bore": exact.displacement["sleeve"], "rim": exact.displacement["hub"]},
        sliding="ends",
        contact=[Contact("sleeve_contact", "hub_contact", gap=-interference)],
        model="axisymmetric",
    )
    return problem, exact


def _indented(exact: Indentation, law: Elastic, pressed: float) -> Problem:
    """A cylinder of radius and height 1 with the exact data on its cut, contact for r < pressed."""
    corners = [(0.0, 0.0), (0.0, -1.0), (1.0, -1.0), (1.0, 0.0), (pressed, 0.0)]
    names = ["axis", "bottom", "side", "free", "pressed"]
    return Problem(
        geometry=compound(body("block", polygon(corners, names))),
        materials={"block": law},
        displacement={"bottom|side": exact.displacement},
        contact=[Contact("pressed", direction=(0, 1), gap=exact.gap)],
        model="axisymmetric",
    )


def indented_by_punch(a: float = 0.3, depth: float = 0.01) -> tuple[Problem, Indentation]:
    """Boussinesq's flat punch."""
    exact = flat_punch(FIRST, a=a, depth=depth)
    return _indented(exact, FIRST, a), exact


def indented_by_cone(a: float = 0.3, slope: float = 0.05) -> tuple[Problem, Indentation]:
    """Sneddon's cone; how far it touches is found."""
    exact = cone(FIRST, a=a, slope=slope)
    return _indented(exact, FIRST, 0.6), exact
