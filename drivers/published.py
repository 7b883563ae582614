"""Problems that other codes publish, solved adaptively: their numbers and ours side by side.

Frictionless contact at small strains, stated with the numbers of its source, in its units. Figures
are closed forms that the source gives or computes from what it states; where bodies are finite, a
note says what the closed form leaves out. Prints the table of docs/published.md, which --page
writes.

    python -m drivers.published
    python -m drivers.published roller "patch test"
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeAlias, get_args

import ngsolve as ng
import numpy as np
from netgen.occ import Compound, OCCGeometry, Rectangle, WorkPlane, Y

from drivers.command_line import Count, Order, run
from drivers.reference.half_spaces import Hertz
from drivers.reference.solids import quarter
from drivers.tables import table
from ngcontact import Contact, Elastic, Problem, Solution, adapt
from ngcontact.geometries import disc, disc_on_block, disc_on_disc, rounded_punch

Measure = Callable[[Solution], float]


@dataclass(frozen=True)
class Figure:
    """A published number, with its unit in the name, and how it is read off a solution."""

    name: str
    published: float
    measure: Measure
    within: float  # relative difference that `why` explains


@dataclass(frozen=True)
class Published:
    """A problem with its data in the source's units, and what explains the differences."""

    title: str
    source: str  # where it is published
    statement: str
    problem: Callable[[], Problem]
    figures: tuple[Figure, ...]
    why: str
    levels: tuple[int, int] | None = None  # of solids: their order and most unknowns


def peak(pair: int = 0, unit: float = 1.0) -> Measure:
    """Largest pressure of a pair, over `unit`."""
    return lambda solution: float(solution.pressure[solution.pair == pair].max()) / unit


def half_width(unit: float = 1.0) -> Measure:
    """Distance of the end of contact from the axis x = 0, over `unit`."""
    return lambda solution: float(solution.transitions()[0, 0]) / unit


def mean_pressure(pair: int) -> Measure:
    """Mean over the points of a pair whose pressure is one number."""
    return lambda solution: float(solution.pressure[solution.pair == pair].mean())


def below(solution: Solution) -> tuple[float, float]:
    """Displacement and stress along y in the lower body, next to the origin."""
    at = solution.at((0.0, -1e-3, 0.0))
    return float(at.displacement[..., 1].item()), float(at.stress[..., 1, 1].item())


def roller() -> Problem:
    """Half of a cylinder on half of a block, mm and MPa."""
    return Problem(
        geometry=disc_on_block(radius=50.0, width=100.0, height=200.0),
        materials={"disc": Elastic(E=210e3, nu=0.3), "block": Elastic(E=70e3, nu=0.3)},
        displacement={"block_bottom": (0, 0)},
        traction={"disc_top": (0, -35e3 / 100)},
        sliding="axis",
        contact=[Contact("disc_arc", "block_top", direction=(0, -1))],
    )


def crushed_spheres() -> Problem:
    """Two hemispheres, mm and MPa."""
    return Problem(
        geometry=disc_on_disc(50.0, 50.0),
        materials={"upper|lower": Elastic(E=20e3, nu=0.3)},
        displacement={"top": (None, -2), "bottom": (None, 2)},
        contact=[Contact("upper_arc", "lower_arc", direction=(0, -1))],
        model="axisymmetric",
    )


def sphere_on_plane(radius: float, law: Elastic, load: float) -> Callable[[], Problem]:
    """A hemisphere on a rigid plane, with a pressure `load` on its top."""
    return lambda: Problem(
        geometry=disc(radius),
        materials={"disc": law},
        traction={"top": (0, -load)},
        contact=[Contact("arc", direction=(0, -1), gap=ng.y)],
        model="axisymmetric",
    )


def pressed_halves(radius: float, law: Elastic, load: float, **kind: Any) -> Callable[[], Problem]:
    """Two equal halves of spheres or cylinders of one law, a pressure `load` on the upper one."""
    return lambda: Problem(
        geometry=disc_on_disc(radius, radius),
        materials={"upper|lower": law},
        displacement={"bottom": (None, 0)},
        traction={"top": (0, -load)},
        contact=[Contact("upper_arc", "lower_arc", direction=(0, -1))],
        **kind,
    )


def punch() -> Problem:
    """A quarter of a punch on a quarter of its foundation, mm and MPa, the axis along y."""
    return Problem(
        geometry=quarter(rounded_punch(40.0, 10.0, height=100.0, width=100.0, depth=200.0)),
        materials={"indenter": Elastic(E=210e3, nu=0.3), "block": Elastic(E=70e3, nu=0.3)},
        displacement={"block_bottom": (0, 0, 0)},
        traction={"indenter_top": 100.0},
        sliding="cut",
        contact=[Contact("end", "block_top", direction=(0, -1, 0))],
    )


def patch() -> Problem:
    """Two blocks, one on the other, whose nodes do not face each other; m and Pa."""
    lower, upper = Rectangle(1, 1).Face(), Rectangle(1, 1).Face().Move((0, 1, 0))
    for face, name, cells in ((lower, "lower", 5), (upper, "upper", 7)):
        face.faces.name = name
        face.edges.name = f"{name}_side"
        face.edges.Min(Y).name, face.edges.Max(Y).name = f"{name}_bottom", f"{name}_top"
        line = face.edges.Max(Y) if name == "lower" else face.edges.Min(Y)
        line.partition = [k / cells for k in range(1, cells)]
    return Problem(
        geometry=OCCGeometry(Compound([lower, upper]), dim=2),
        materials={"lower|upper": Elastic(E=2e6, nu=0.0)},
        displacement={"lower_bottom": (0, 0), "upper_top": (0, -0.1)},
        contact=[Contact("upper_bottom", "lower_top")],
    )


RINGS = {  # E and nu, density in t/mm^3, outer radius, inner radius
    "outer": (206e3, 0.29, 7850e-12, 35.0, 24.988),
    "middle": (70e3, 0.33, 2770e-12, 24.988, 14.995),
    "inner": (206e3, 0.29, 7850e-12, 14.995, 10.0),
}


def rotating_rings() -> Problem:
    """Quarters of three rings, mm and MPa."""
    faces, speed = [], 420.0
    for name, (*_, outside, inside) in RINGS.items():
        path = WorkPlane().MoveTo(inside, 0).LineTo(outside, 0, "cut").Direction(0, 1)
        path.Arc(outside, 90, f"{name}_outside").LineTo(0, inside, "cut").Direction(1, 0)
        face = path.Arc(inside, -90, f"{name}_inside").Face()
        face.faces.name = name
        faces.append(face)
    radius = ng.sqrt(ng.x**2 + ng.y**2)
    return Problem(
        geometry=OCCGeometry(Compound(faces), dim=2),
        materials={name: Elastic(E=E, nu=nu) for name, (E, nu, *_) in RINGS.items()},
        sliding="cut",
        traction={
            "outer_outside": (-150 * ng.x / radius, -150 * ng.y / radius),
            "inner_inside": (30 * ng.x / radius, 30 * ng.y / radius),
        },
        force={
            name: (density * speed**2 * ng.x, density * speed**2 * ng.y)
            for name, (_, _, density, *_) in RINGS.items()
        },
        contact=[
            Contact("middle_outside", "outer_inside", gap=-0.025),
            Contact("inner_outside", "middle_inside", gap=-0.010),
        ],
        model="plane stress",
    )


KRATOS = Hertz(5e5 * np.pi * 6.1237**2, 6.1237, 1e8 / (1 - 0.29**2))

PUBLISHED: dict[str, Published] = {
    "roller": Published(
        title="Cylinder roller",
        source="NAFEMS benchmark tests for contact, CGS-1 (A. Konter, Advanced Finite Element "
        "Contact Benchmarks, 2006); Code_Aster SSNP154 (v6.03.154)",
        statement="Cylinder R = 50 mm, E = 210 GPa, on a block 200 mm x 200 mm, E = 70 GPa, both "
        "nu = 0.3, plane strain; 35 kN per mm of length.",
        problem=roller,
        figures=(
            Figure("peak pressure, MPa", 3585.37, peak(), 5e-3),
            Figure("half-width, mm", 6.2146, half_width(), 5e-3),
        ),
        why="Hertz's formulas hold for half-spaces; a/R is 0.12 here.",
    ),
    "crushed spheres": Published(
        title="Two spheres",
        source="Code_Aster SSNV104 (v6.04.104), reference solution",
        statement="Two spheres R = 50 mm, E = 20 000 MPa, nu = 0.3; planes of the equators "
        "approach each other by 4 mm.",
        problem=crushed_spheres,
        figures=(Figure("peak pressure, MPa", 2798.3, peak(), 6e-2),),
        why="The source sets Hertz's approach of two half-spaces equal to that of the equators. "
        "Hemispheres whose equators stay plane give way less than half-spaces do down to infinity, "
        "and at a/R = 0.2 a circle is no parabola: the pressure is larger.",
    ),
    "rounded punch": Published(
        title="Punch with rounded edges",
        source="NAFEMS benchmark tests for contact, CGS-2 (A. Konter, 2006); Code_Aster SSNA122 "
        "(v6.01.122), quadratic elements without friction",
        statement="Solids, a quarter: a punch of radius 50 mm, height 100 mm, edge rounded by "
        "10 mm, E = 210 GPa, on a cylinder of radius 100 mm, height 200 mm, E = 70 GPa, held at "
        "its bottom, both nu = 0.3; 100 MPa on the punch.",
        problem=punch,
        figures=(
            Figure("sinking of the middle, mm", 0.132941, lambda s: -below(s)[0], 1.5e-2),
            Figure("pressure there, MPa", 94.1221, lambda s: -below(s)[1], 8e-2),
        ),
        why="Code_Aster's are figures of coarse meshes, the pressure is extrapolated from stresses "
        "and its uncertainty called large; linear elements give it 0.130734 and 91.1006. Bodies of "
        "revolution of order 4 with 19 572 unknowns have 0.13398 and 87.3 here.",
        levels=(2, 50_000),
    ),
    "sphere on plane": Published(
        title="Sphere on a rigid plane, R = 8 mm",
        source="Ansys course Hertz contact mechanics (Cornell University, SimCafe)",
        statement="Sphere R = 8 mm, E = 1000 MPa, nu = 0.3, on a rigid plane; 60 pi N.",
        problem=sphere_on_plane(8.0, Elastic(E=1000.0, nu=0.3), 60 / 8**2),
        figures=(Figure("radius of contact, mm", 1.010, half_width(), 5e-3),),
        why="The published figure has four digits; a/R is 0.13.",
    ),
    "sphere of Kratos": Published(
        title="Sphere on a rigid plane, R = 6.12 m",
        source="Kratos Multiphysics, Examples, contact_structural_mechanics/validation/hertz",
        statement="Sphere of diameter 12.2474 m, E = 1e8 Pa, nu = 0.29, on a rigid plane; 5e5 Pa "
        "on its equator. Figures are Hertz's, with which the source compares its own.",
        problem=sphere_on_plane(6.1237, Elastic(E=1e8, nu=0.29), 5e5),
        figures=(
            Figure("radius of contact, m", KRATOS.sphere()[0], half_width(), 2e-2),
            Figure("peak pressure, MPa", KRATOS.sphere()[1] / 1e6, peak(unit=1e6), 2e-2),
        ),
        why="a/R is 0.22, where the parabola of Hertz and a circle differ.",
    ),
    "spheres of MOOSE": Published(
        title="Two spheres under a force",
        source="MOOSE, modules/contact/test/tests/hertz_spherical, comments of hertz_contact_rz.i",
        statement="Spheres R = 2, E = 1.40625e7, nu = 0.25; F = 10 000.",
        problem=pressed_halves(
            2.0, Elastic(E=1.40625e7, nu=0.25), 1e4 / (np.pi * 2**2), model="axisymmetric"
        ),
        figures=(
            Figure("radius of contact", 0.1, half_width(), 5e-3),
            Figure("peak pressure", Hertz(1e4, 1.0, 7.5e6).sphere()[1], peak(), 5e-3),
        ),
        why="a/R is 0.05; the source states a, and F from which Hertz's pressure follows.",
    ),
    "cylinders of GetFEM": Published(
        title="Two cylinders",
        source="GetFEM, Python example of Hertz contact between two cylinders",
        statement="Cylinders R = 5 mm, E = 200 GPa, nu = 0.3, plane strain; 20 MPa on the "
        "equator, 200 N per mm. The figures are Hertz's.",
        problem=pressed_halves(5.0, Elastic(E=200e3, nu=0.3), 20.0, sliding="axis"),
        figures=(
            Figure("half-width, mm", Hertz(200, 2.5, 1e5 / 0.91).cylinder()[0], half_width(), 2e-3),
            Figure("peak pressure, MPa", Hertz(200, 2.5, 1e5 / 0.91).cylinder()[1], peak(), 2e-3),
        ),
        why="a/R is 0.015.",
    ),
    "patch test": Published(
        title="Contact patch test",
        source="Code_Aster SSNP121 (v6.03.121), after El-Abbasi, Bathe, Computers & Structures "
        "79 (2001) 1473",
        statement="Two blocks of height 1 m with meshes that do not match (5 to 7 segments), "
        "nu = 0; the top moves down by 0.1 m. With E = 2e6 Pa the pressure is 1e5 Pa.",
        problem=patch,
        figures=(
            Figure("largest pressure, Pa", 1e5, peak(), 1e-9),
            Figure("mean pressure, Pa", 1e5, mean_pressure(0), 1e-9),
        ),
        why="The solution is linear, and exact to round-off.",
    ),
    "rotating rings": Published(
        title="Three shrunk rings that rotate",
        source="Croccolo, Vincenzi, A generalized theory for shaft-hub couplings (2009), as "
        "computed by eng-tools.dev, A3 thick-walled cylinder",
        statement="Steel, aluminium, steel: radii 35 / 24.988 / 14.995 / 10 mm, E = 206, 70, 206 "
        "GPa, nu = 0.29, 0.33, 0.29, densities 7850, 2770, 7850 kg/m^3; radial interferences "
        "0.025 and 0.010 mm, 150 MPa outside, 30 MPa in the bore, 420 rad/s; plane stress.",
        problem=rotating_rings,
        figures=(
            Figure("outer pressure, MPa", 161.4, mean_pressure(0), 5e-4),
            Figure("inner pressure, MPa", 175.0, mean_pressure(1), 5e-4),
        ),
        why="The published figures have four digits.",
    ),
}


Name: TypeAlias = Literal[
    "roller",
    "crushed spheres",
    "rounded punch",
    "sphere on plane",
    "sphere of Kratos",
    "spheres of MOOSE",
    "cylinders of GetFEM",
    "patch test",
    "rotating rings",
]
HEAD = """# Published problems

Problems that other codes publish, frictionless and at small strains, stated as their sources state
them. `python -m drivers.published --page docs/published.md` solves them adaptively (order {order},
at most {max_dofs} unknowns, solids as told) and writes this page. Differences are relative.
"""


def solved(published: Published, order: int, max_dofs: int) -> Solution:
    """The last level of an adaptive run."""
    order, max_dofs = published.levels or (order, max_dofs)
    *_, last = adapt(published.problem(), order=order, max_dofs=max_dofs)
    return last


def rows_of(figures: Sequence[Figure], solution: Solution) -> list[tuple[str, float, float, float]]:
    """Name, published and computed number, relative difference of each figure."""
    rows = []
    for figure in figures:
        ours = figure.measure(solution)
        rows.append((figure.name, figure.published, ours, ours / figure.published - 1))
    return rows


def section(published: Published, solution: Solution) -> str:
    """One problem on the page."""
    rows = (
        (name, f"{theirs:.6g}", f"{ours:.6g}", f"{difference:+.1e}")
        for name, theirs, ours, difference in rows_of(published.figures, solution)
    )
    unknowns, error = solution.displacement.space.ndof, solution.relative_error_estimate
    degree = f" of order {solution.order}" if published.levels else ""
    return (
        f"\n## {published.title}\n\n{published.statement}\n\n"
        f"{table(('', 'published', 'ours', 'difference'), rows)}\n\n"
        f"{unknowns} unknowns{degree}, estimated error {error:.1e}. {published.why}\n\n"
        f"Source: {published.source}."
    )


def main(
    names: Sequence[Name] = get_args(Name),
    *,
    order: Order = 3,
    max_dofs: Count = 15_000,
    page: Path | None = None,
) -> dict[str, Solution]:
    """Published problems, one after the other.

    Parameters
    ----------
    names : sequence of str
        Problems, by name.
    order : int
        Degree of the displacement on each element, 1 to 4.
    max_dofs : int
        Number of unknowns that no level exceeds.
    page : path, optional
        File in which the table is written as a page.

    Returns
    -------
    dict
        The last level of each problem.
    """
    solutions: dict[str, Solution] = {}
    sections = []
    for name in names:
        started = time.perf_counter()
        solutions[name] = solved(PUBLISHED[name], order, max_dofs)
        sections.append(section(PUBLISHED[name], solutions[name]))
        print(sections[-1], f"\n({time.perf_counter() - started:.1f} s)")
    if page is not None:
        page.write_text(HEAD.format(order=order, max_dofs=max_dofs) + "\n".join(sections) + "\n")
    return solutions


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
