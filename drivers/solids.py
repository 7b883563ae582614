"""Solids in contact beside exact solutions: shells, a ball in a cup, crossed cylinders, a column.

python -m drivers.solids
python -m drivers.solids --finer 0.7
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterator
from typing import NamedTuple

import ngsolve as ng
import numpy as np
from netgen.meshing import MeshingParameters
from netgen.occ import OCCGeometry
from scipy.special import ellipe, ellipk

from drivers.command_line import Positive, run
from drivers.reference.half_spaces import plane_modulus, reduced
from drivers.tables import Columns, printed
from ngcontact import Contact, Elastic, Problem, Solution, solve
from ngcontact.geometries import ball_in_cup, crossed_cylinders, cube_on_block, shells

SOFT, HARD = Elastic(E=1.0, nu=0.3), Elastic(E=3.0, nu=0.2)
# Lame's solution of both shells: 1 and 3 of E, .3 and .2 of nu, radii .5, 1, 1.5, overlap .01.
PRESS_FIT = 0.01 / (0.55 + 7 / 19)
# Force, pressure at the axis and end of contact of the body of revolution, order 4, adaptive.
CUP = 0.007139354, 0.007938601, 0.6626341


class Row(NamedTuple):
    """A quantity beside its exact value."""

    scene: str
    order: int
    unknowns: int
    quantity: str
    computed: float
    exact: float
    seconds: float  # of the processor, for the scene

    @property
    def difference(self) -> float:
        """Relative to the exact value."""
        return self.computed / self.exact - 1


COLUMNS: Columns = {
    "scene                   ": "{0.scene}",
    "order": "{0.order}",
    "unknowns": "{0.unknowns}",
    "quantity             ": "{0.quantity}",
    "  computed": "{0.computed:.6g}",
    "     exact": "{0.exact:.6g}",
    "difference": "{0.difference:+.1e}",
    "seconds": "{0.seconds:.1f}",
}


def sized(geometry: OCCGeometry, sizes: dict[str, float], maxh: float) -> ng.Mesh:
    """Mesh with `sizes` of elements on some faces and bodies, lengths."""
    for part in (*geometry.shape.solids, *geometry.shape.faces):  # of a body, and of its faces
        part.maxh = sizes.get(part.name, maxh)
    return ng.Mesh(OCCGeometry(geometry.shape).GenerateMesh(maxh=maxh))


def rows_of(
    scene: str, problem: Problem, mesh: ng.Mesh | None, maxh: float | None, order: int
) -> tuple[Solution, list[tuple[str, float, float]], Iterator[Row]]:
    """A solution, a list to put names, values and exact values into, and the rows made of it."""
    start = time.process_time()
    solution = solve(problem, mesh, maxh=maxh, order=order)
    seconds = time.process_time() - start
    found: list[tuple[str, float, float]] = []
    unknowns = solution.displacement.space.ndof
    rows = (Row(scene, order, unknowns, q, x, exact, seconds) for q, x, exact in found)
    return solution, found, rows


def press_fit(order: int, finer: float, matched: bool) -> Iterator[Row]:
    """Shells with an overlap: a constant pressure."""
    problem = Problem(
        geometry=shells(),
        materials={"inner": SOFT, "outer": HARD},
        sliding="cut_x|cut_y|cut_z",
        contact=[Contact("inner_contact", "outer_contact", gap=-0.01)],
    )
    mesh, name = None, "press fit, matched"
    if not matched:
        inner = dict.fromkeys(("inner", "inner_contact", "hole"), 0.25 * finer)
        mesh, name = sized(problem.geometry, inner, 0.3 * finer), "press fit, unmatched"
    solution, found, rows = rows_of(name, problem, mesh, None if mesh else 0.35 * finer, order)
    weight, pressure = solution.pairs[0].line.weight, solution.pressure
    found.append(("mean pressure", float(weight @ pressure / weight.sum()), PRESS_FIT))
    found.append(("largest pressure", float(pressure.max()), PRESS_FIT))
    yield from rows


def cup(order: int, finer: float) -> Iterator[Row]:
    """A ball in a conforming cup: contact ends on a curved surface."""
    problem = Problem(
        geometry=ball_in_cup(),
        materials={"ball": SOFT, "cup": SOFT},
        displacement={"ball_top": (None, None, -0.01)},
        sliding="cut_x|cut_y|cup_bottom",
        contact=[Contact("ball_surface", "cup_surface")],
    )
    sizes = {"ball_surface": 0.12 * finer, "cup_surface": 0.12 * finer}
    mesh = sized(problem.geometry, sizes, 0.5 * finer)
    solution, found, rows = rows_of("ball in cup, normals", problem, mesh, None, order)
    line, active = solution.pairs[0].line, solution.active
    found.append(("force", 4 * float(solution.contact_force()[2]), CUP[0]))
    near = np.argsort(np.hypot(*solution.points[:, :2].T))[:4]
    found.append(("pressure at the axis", float(solution.pressure[near].mean()), CUP[1]))
    area = 4 * float(line.weight[active] @ -line.direction[active, 2])
    found.append(("end, by area", math.sqrt(area / math.pi), CUP[2]))
    yield from rows


def ellipse(A: float, B: float, force: float, modulus: float) -> tuple[float, float, float]:
    """Semi-axes and peak pressure of half-spaces whose gap is A x^2 + B y^2, A < B, by Hertz."""
    low, high = 1e-12, 1 - 1e-12  # squares of the eccentricity
    for _ in range(200):
        m = (low + high) / 2
        K, E = ellipk(m), ellipe(m)
        low, high = (m, high) if (E / (1 - m) - K) / (K - E) < B / A else (low, m)
    a = (3 * force * (K - E) / (2 * math.pi * m * A * modulus)) ** (1 / 3)
    b = a * math.sqrt(1 - m)
    return a, b, 3 * force / (2 * math.pi * a * b)


def cylinders(order: int, finer: float) -> Iterator[Row]:
    """Crossed cylinders: an ellipse, by the moments of the pressure."""
    problem = Problem(
        geometry=crossed_cylinders(radius=1.0, lower_radius=3.0, length=2.0),
        materials={"upper": SOFT, "lower": HARD},
        displacement={"bottom": (0, 0, 0), "top": (0, 0, -0.02)},
        sliding="cut_x|cut_y",
        contact=[Contact("upper_surface", "lower_surface", direction=(0, 0, -1))],
    )
    parameters = MeshingParameters(maxh=finer, grading=0.4)
    for x in np.linspace(0, 0.25, 6):
        for y in np.linspace(0, 0.15, 4):
            parameters.RestrictH(float(x), float(y), 0.0, 0.05 * finer)
    mesh = ng.Mesh(problem.geometry.GenerateMesh(mp=parameters))
    solution, found, rows = rows_of("crossed cylinders", problem, mesh, None, order)
    force = solution.force
    modulus = reduced([plane_modulus(1.0, 0.3), plane_modulus(3.0, 0.2)])
    a, b, _ = ellipse(1 / 6, 1 / 2, 4 * float(force.sum()), modulus)
    for name, x, exact in zip(
        ("semi-axis a", "semi-axis b"), solution.points.T, (a, b), strict=False
    ):
        found.append((name, math.sqrt(5 * float(force @ x**2) / float(force.sum())), exact))
    yield from rows


def column(order: int, finer: float) -> Iterator[Row]:
    """A cube without supports on a block of its width: a uniform pressure."""
    problem = Problem(
        geometry=cube_on_block(width=1.0),
        materials={"cube": SOFT, "block": HARD},
        sliding="block_bottom",
        traction={"cube_top": 0.1},
        contact=[Contact("cube_bottom", "block_top", direction=(0, 0, -1))],
    )
    solution, found, rows = rows_of("column, no supports", problem, None, 0.5 * finer, order)
    found.append(("force", float(solution.contact_force()[2]), 0.1))
    found.append(("largest pressure", float(solution.pressure.max()), 0.1))
    yield from rows


def main(*, finer: Positive = 1.0) -> list[Row]:
    """Solve solids on one mesh each and print quantities beside exact ones.

    Forces and radii of the ball in its cup are those of the body of revolution; semi-axes of
    crossed cylinders are Hertz's at the computed force, for half-spaces.

    Parameters
    ----------
    finer : float
        Factor of all sizes of elements, without unit.

    Returns
    -------
    list of Row
        What was printed.
    """

    def scenes() -> Iterator[Row]:
        for order in (1, 2, 3):
            yield from column(order, finer)
        for order, matched in ((2, True), (3, True), (2, False), (3, False)):
            yield from press_fit(order, finer, matched)
        for order in (1, 2):
            yield from cup(order, finer)
        yield from cylinders(2, finer)

    return printed(COLUMNS, scenes())


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
