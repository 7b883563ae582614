"""Solids in contact beside exact solutions: shells, balls, cylinders, half-spaces.

Shells and the ball in a cup on one mesh each, the others by `adapt`.

python -m drivers.solids
python -m drivers.solids --finer 0.7 --max-dofs 110000
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator
from typing import NamedTuple

import netgen.occ as occ
import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry
from scipy.special import ellipe, ellipk

from drivers.command_line import Count, Positive, run
from drivers.reference.half_spaces import plane_modulus, reduced
from drivers.reference.solids import quarter, quarter_cubes
from drivers.tables import Columns, printed
from ngcontact import Contact, Elastic, Hooke, Problem, Solution, adapt, solve
from ngcontact.arrays import Array, Mask
from ngcontact.geometries import (
    ball_in_cup,
    ball_on_block,
    crossed_cylinders,
    disc,
    disc_on_block,
    shells,
)
from ngcontact.geometries.solids import body, compound

SOFT, HARD = Elastic(E=1.0, nu=0.3), Elastic(E=3.0, nu=0.2)
# Lame's solution of both shells: 1 and 3 of E, .3 and .2 of nu, radii .5, 1, 1.5, overlap .01.
PRESS_FIT = 0.01 / (0.55 + 7 / 19)
# Force, pressure at the axis and end of contact of the body of revolution, order 4, adaptive.
CUP = 0.007139354, 0.007938601, 0.6626341
STEP = 0.4  # of `theta`: so small that the last level comes near the most unknowns
STEEL = Elastic(E=210e3, nu=0.3)  # MPa
# c11, c12, c13, c33, c44 about an axis along z, and what takes the place of E / (1 - nu^2) under a
# load along it, 2 sqrt((c31^2 - c13^2) / c11 / (1 / c44 + 2 / (c31 + c13))), c31 = sqrt(c11 c33):
# Delafargue, Ulm 2004, Int. J. Solids Struct. 41:7351.
LAYERED, LAYERED_MODULUS = (1.6, 0.6, 0.5, 2.4, 0.3), 1.4712200


class Row(NamedTuple):
    """A quantity beside its exact value."""

    scene: str
    order: int
    unknowns: int
    quantity: str
    computed: float
    exact: float
    solves: int  # back-solves or V-cycles, of the last level
    seconds: float  # of the processor, for the scene, all levels

    @property
    def difference(self) -> float:
        """Relative to the exact value; of what should vanish the value."""
        return self.computed / self.exact - 1 if self.exact else self.computed


COLUMNS: Columns = {
    "scene                   ": "{0.scene}",
    "order": "{0.order}",
    "unknowns": "{0.unknowns}",
    "quantity             ": "{0.quantity}",
    "  computed": "{0.computed:.6g}",
    "     exact": "{0.exact:.6g}",
    "difference": "{0.difference:+.1e}",
    "solves": "{0.solves}",
    "seconds": "{0.seconds:.1f}",
}


def sized(geometry: OCCGeometry, sizes: dict[str, float], maxh: float) -> ng.Mesh:
    """Mesh with `sizes` of elements on some faces and bodies, lengths."""
    for part in (*geometry.shape.solids, *geometry.shape.faces):  # of a body, and of its faces
        part.maxh = sizes.get(part.name, maxh)
    return ng.Mesh(OCCGeometry(geometry.shape).GenerateMesh(maxh=maxh))


def rows_of(
    scene: str,
    problem: Problem,
    order: int,
    *,
    mesh: ng.Mesh | None = None,
    maxh: float | None = None,
    max_dofs: int | None = None,
) -> tuple[Solution, Callable[[str, float, float], Row]]:
    """A solution, and the row of a quantity: its name, its value and the exact one.

    The last level of `adapt` where `max_dofs` are given.
    """
    start = time.process_time()
    if max_dofs is None:
        solution = solve(problem, mesh, maxh=maxh, order=order)
    else:
        levels = adapt(problem, maxh=maxh, order=order, max_dofs=max_dofs, theta=STEP)
        *_, solution = levels
    seconds = time.process_time() - start
    unknowns, solves = solution.displacement.space.ndof, solution.work["back_solves"]

    def row(quantity: str, computed: float, exact: float) -> Row:
        return Row(scene, order, unknowns, quantity, computed, exact, solves, seconds)

    return solution, row


def rms(solution: Solution, inside: Mask, off: Array) -> float:
    """Root of the mean over the area `inside` (m,) of squared differences `off` (m,) at points."""
    weight = solution.pairs[0].line.weight[inside]
    return math.sqrt(float(weight @ off[inside] ** 2 / weight.sum()))


def radius_of(area: float) -> float:
    """Radius of the circle of a quarter of which this is the area."""
    return math.sqrt(4 * area / math.pi)


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
    solution, row = rows_of(name, problem, order, mesh=mesh, maxh=None if mesh else 0.35 * finer)
    weight, pressure = solution.pairs[0].line.weight, solution.pressure
    yield row("mean pressure", float(weight @ pressure / weight.sum()), PRESS_FIT)
    yield row("largest pressure", float(pressure.max()), PRESS_FIT)


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
    solution, row = rows_of("ball in cup, normals", problem, order, mesh=mesh)
    line, active = solution.pairs[0].line, solution.active
    yield row("force", 4 * float(solution.contact_force()[2]), CUP[0])
    near = np.argsort(np.hypot(*solution.points[:, :2].T))[:4]
    yield row("pressure at the axis", float(solution.pressure[near].mean()), CUP[1])
    area = float(line.weight[active] @ -line.direction[active, 2])
    yield row("end, by area", radius_of(area), CUP[2])


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


def semi_axes(
    solution: Solution, A: float, B: float, modulus: float
) -> list[tuple[str, float, float]]:
    """Names, values, and what Hertz says at the computed force, of a quarter of an ellipse.

    Semi-axes by the second moments of the forces: of an ellipse a^2 / 5.
    """
    force, (x, y, _) = solution.force, solution.points.T
    a, b, p0 = ellipse(A, B, 4 * float(force.sum()), modulus)
    axes = (math.sqrt(5 * float(force @ at**2) / float(force.sum())) for at in (x, y))
    square = 1 - (x / a) ** 2 - (y / b) ** 2
    off = solution.pressure / p0 - np.sqrt(np.maximum(square, 0.0))
    within = square > 0.36  # .8 of the semi-axes
    return [
        *zip(("semi-axis a", "semi-axis b"), axes, (a, b), strict=True),
        ("area", 4 * solution.contact_area(), math.pi * a * b),
        ("pressure of points, rms", rms(solution, within, off), 0.0),
    ]


def cylinders(order: int, max_dofs: int) -> Iterator[Row]:
    """Crossed steel cylinders of radii 10 and 20, 1000 N: an ellipse (mm, MPa)."""
    problem = Problem(
        geometry=crossed_cylinders(radius=10.0, lower_radius=20.0, length=6.0),
        materials={"upper|lower": STEEL},
        displacement={"bottom": (0, 0, 0)},
        traction={"top": (0, 0, -250 / (6 * 10))},
        sliding="cut_x|cut_y",
        contact=[Contact("upper_surface", "lower_surface", direction=(0, 0, -1))],
    )
    solution, row = rows_of("crossed cylinders", problem, order, max_dofs=max_dofs)
    modulus = reduced([plane_modulus(STEEL.E, STEEL.nu)] * 2)
    yield from (row(*quantity) for quantity in semi_axes(solution, 1 / 40, 1 / 20, modulus))


def blocks(order: int, max_dofs: int) -> Iterator[Row]:
    """Two cubes with a gap A x^2 + B y^2, B / A = 4, as data."""
    A, B = 0.1, 0.4
    gap = A * ng.x**2 + B * ng.y**2 - 0.005
    problem = Problem(
        geometry=quarter_cubes(),
        materials={"upper": SOFT, "lower": HARD},
        displacement={"upper_outer|lower_outer": (0, 0, 0)},
        sliding="x|y",
        contact=[Contact("lower_contact", "upper_contact", direction=(0, 0, 1), gap=gap)],
    )
    solution, row = rows_of("ellipse, B/A = 4", problem, order, maxh=0.4, max_dofs=max_dofs)
    modulus = reduced([plane_modulus(law.E, law.nu) for law in (SOFT, HARD)])
    yield from (row(*quantity) for quantity in semi_axes(solution, A, B, modulus))


def layered(order: int, max_dofs: int) -> Iterator[Row]:
    """A rigid ball of radius 1 on a transversely isotropic block: a circle."""
    c11, c12, c13, c33, c44 = LAYERED
    C = np.diag([c11, c11, c33, c44, c44, (c11 - c12) / 2])
    C[[0, 0, 1, 1, 2, 2], [1, 2, 0, 2, 0, 1]] = c12, c13, c12, c13, c13, c13
    block = occ.Box((0, 0, -2), (2, 2, 0))
    block.faces.name = "outer"
    block.faces.Min(occ.X).name, block.faces.Min(occ.Y).name = "cut_x", "cut_y"
    block.faces.Max(occ.Z).name = "top"
    ball = Contact("top", direction=(0, 0, 1), gap=lambda x, y, z: (x**2 + y**2) / 2 - 0.02)
    problem = Problem(
        geometry=compound(body("block", block)),
        materials={"block": Hooke(C)},
        displacement={"outer": (0, 0, 0)},
        sliding="cut_x|cut_y",
        contact=[ball],
    )
    solution, row = rows_of("layered half-space", problem, order, maxh=0.5, max_dofs=max_dofs)
    force, (x, y, _) = solution.force, solution.points.T
    total = float(force.sum())
    radius = (0.75 * 4 * total / LAYERED_MODULUS) ** (1 / 3)
    yield row("radius by area", radius_of(solution.contact_area()), radius)
    by_moments = math.sqrt(2.5 * float(force @ (x**2 + y**2)) / total)
    yield row("radius by moments", by_moments, radius)


def meridian(depth: float) -> Solution:
    """The ball on a block as bodies of revolution, pressed together by `depth`, order 4."""
    problem = Problem(
        geometry=disc_on_block(),
        materials={"disc": SOFT, "block": HARD},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -depth)},
        contact=[Contact("disc_arc", "block_top", direction=(0, -1))],
        model="axisymmetric",
    )
    *_, solution = adapt(problem, order=4, max_dofs=8000)
    return solution


def ball(order: int, max_dofs: int) -> Iterator[Row]:
    """A ball on a block, beside the bodies of revolution."""
    depth = 0.02
    problem = Problem(
        geometry=ball_on_block(),
        materials={"ball": SOFT, "block": HARD},
        displacement={"block_bottom": (0, 0, 0), "ball_top": (0, 0, -depth)},
        sliding="cut_x|cut_y",
        contact=[Contact("ball_surface", "block_top", direction=(0, 0, -1))],
    )
    exact = meridian(depth)
    solution, row = rows_of("ball on block", problem, order, max_dofs=max_dofs)
    [end], r = exact.transitions(), np.hypot(*solution.points[:, :2].T)
    rising, peak = np.argsort(exact.points[:, 0]), float(exact.pressure.max())
    expected = np.interp(r, exact.points[rising, 0], exact.pressure[rising])
    inside, off = r < 0.8 * end[0], (solution.pressure - expected) / peak
    force, axial = 4 * solution.contact_force()[2], exact.contact_force()[1]
    yield row("force", float(force), float(axial))
    yield row("end, by area", radius_of(solution.contact_area()), float(end[0]))
    yield row("pressure of points, rms", rms(solution, inside, off), 0.0)
    yield row("pressure of points, max", float(np.abs(off[inside]).max()), 0.0)


def balls(order: int, max_dofs: int) -> Iterator[Row]:
    """Code_Aster's SSNV104, two balls of one law, by one on a rigid plane: Hertz (mm, MPa)."""
    problem = Problem(
        geometry=quarter(disc(50.0)),
        materials={"disc": Elastic(E=20e3, nu=0.3)},
        displacement={"top": (None, -2, None)},
        sliding="cut",
        contact=[Contact("arc", direction=(0, -1, 0), gap=ng.y)],
    )
    solution, row = rows_of("SSNV104, two balls", problem, order, max_dofs=max_dofs)
    peak = solution.quantities()["peak pressure"].value
    yield row("largest pressure", peak, 2798.3)
    radius = radius_of(solution.contact_area())
    force = 4 * float(solution.force.sum())
    modulus = reduced([plane_modulus(20e3, 0.3)] * 2)
    yield row("radius, at its force", radius, (0.75 * force * 25 / modulus) ** (1 / 3))


def main(*, finer: Positive = 1.0, max_dofs: Count = 30_000) -> list[Row]:
    """Solve solids and print quantities beside exact ones.

    Of balls on a block and in a cup those of bodies of revolution; semi-axes and radii are Hertz's
    at the computed force, for half-spaces, and the peak of SSNV104 is that of half-spaces.

    Parameters
    ----------
    finer : float
        Factor of sizes of elements where one mesh is given, without unit.
    max_dofs : int
        Unknowns of adaptive levels.

    Returns
    -------
    list of Row
        What was printed.
    """

    def scenes() -> Iterator[Row]:
        for order, matched in ((2, True), (3, True), (2, False), (3, False)):
            yield from press_fit(order, finer, matched)
        for order in (1, 2):
            yield from cup(order, finer)
        for scene in (ball, blocks, cylinders, layered, balls):
            yield from scene(2, max_dofs)

    return printed(COLUMNS, scenes())


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
