"""A disc pressed on a block, steel on aluminium, compared with Hertz's formulas.

The disc's top moves down by a given distance; how far the contact zone spreads is found by the
adaptive loop, from a coarse mesh that knows nothing of it. By symmetry half of each body is
computed. Writes hertz.vtu, hertz_contact.vtp and hertz.png.

    python -m drivers.hertz
    python -m drivers.hertz --radius 2 --tolerance 1e-3 --out out/
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, TypeAlias

import ngsolve as ng
import numpy as np
from cyclopts import Parameter

from drivers.command_line import Count, Order, Positive, run
from drivers.reference.half_spaces import Hertz, plane_modulus, reduced
from drivers.tables import Columns, line
from ngcontact import Contact, Elastic, Problem, Solution, adapt
from ngcontact.geometries import disc_on_block

STEEL = (210e9, 0.3)  # E, Pa, and nu
ALUMINIUM = (70e9, 0.33)


def _check(_: object, law: tuple[float, float]) -> None:
    Elastic(*law)


Law: TypeAlias = Annotated[tuple[float, float], Parameter(validator=_check)]


@dataclass(frozen=True)
class Quantities:
    """Contact `force`, of lines per thickness, `peak` pressure, and half-width or radius `a`."""

    force: float
    peak: float
    a: float


def pressed(radius: float, press: float, disc: Elastic, block: Elastic) -> Problem:
    """Disc of `radius` (m) on a clamped block; its top moves down by `press` radii."""
    return Problem(
        geometry=disc_on_block(radius=radius),
        materials={"disc": disc, "block": block},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -press * radius)},
        sliding="axis",
        contact=[Contact(secondary="disc_arc", primary="block_top", direction=(0, -1))],
    )


def computed_and_expected(
    levels: Iterable[Solution],
    columns: Columns,
    expected: Callable[[float], tuple[float, float]],
    halves: int = 1,
) -> tuple[Solution, Quantities, Quantities]:
    """The last of the levels of a run, what it says, and what Hertz does under its force.

    Every level is printed. `expected` gives a and the peak; the force counts `halves` times.
    """
    print(f"unknowns  active  steps  estimate  {'  '.join(columns)}  seconds")
    started = time.perf_counter()
    for solution in levels:
        transitions = solution.transitions()
        computed = Quantities(
            force=halves * float(solution.contact_force()[1]),
            peak=float(solution.pressure.max()),
            a=float(transitions[:, 0].max()) if len(transitions) else math.nan,
        )
        estimate, now = solution.relative_error_estimate, time.perf_counter()
        print(
            f"{solution.displacement.space.ndof:8d}  {solution.active.sum():6d}  "
            f"{len(solution.steps):5d}  {estimate:.2e}  {line(columns, computed)}  "
            f"{now - started:7.2f}"
        )
        started = now
    a, peak = expected(computed.force)
    return solution, computed, Quantities(computed.force, peak, a)


def compare(name: str, radius: float, computed: Quantities, expected: Quantities) -> None:
    """Print computed and expected values beside each other; `name` is that of a."""
    print(f"\n{f'At a/R = {computed.a / radius:.4f}':22s}   computed      Hertz  difference")
    for title, x, y in (
        ("peak pressure, MPa", computed.peak / 1e6, expected.peak / 1e6),
        (name, computed.a * 1e3, expected.a * 1e3),
    ):
        print(f"{title:22s} {x:10.4f} {y:10.4f}  {(x / y - 1) * 100:+.3f} %")


def draw(path: Path, solution: Solution, expected: Quantities, mirror: str | None = None) -> None:
    """Picture in mm and MPa, Hertz's pressure p0 (1 - (x/a)^2)^(1/2) over the computed one."""

    def pressure(x: np.ndarray) -> np.ndarray:
        return expected.peak * np.sqrt(np.maximum(1 - (x / expected.a) ** 2, 0.0))

    units = {"length": ("mm", 1e-3), "stress": ("MPa", 1e6)}
    solution.plot(path, units=units, profile={"Hertz": pressure}, mirror=mirror)


COLUMNS: Columns = {
    "   force/N/m": "{0.force:.1f}",
    "peak/MPa": lambda q: f"{q.peak / 1e6:.2f}",
    "half-width/mm": lambda q: f"{q.a * 1e3:.5f}",
}


def main(
    *,
    radius: Positive = 0.01,
    press: Positive = 2e-3,
    disc: Law = STEEL,
    block: Law = ALUMINIUM,
    order: Order = 3,
    tolerance: Positive | None = None,
    max_dofs: Count = 20_000,
    out: Path | None = Path("out"),
) -> tuple[Quantities, Quantities]:
    """A disc pressed on a block: solved adaptively, compared with Hertz's formulas.

    Prints every level and the comparison, writes hertz.vtu, hertz_contact.vtp and hertz.png.

    Parameters
    ----------
    radius : float
        Radius of the disc, m.
    press : float
        Distance by which the top of the disc moves down, in radii of the disc.
    disc : tuple of float
        Young's modulus of the disc, Pa, and its Poisson's ratio, without unit.
    block : tuple of float
        Young's modulus of the block, Pa, and its Poisson's ratio, without unit.
    order : int
        Degree of the displacement on each element, 1 to 4.
    tolerance : float, optional
        Estimated error, relative in the energy norm, that ends the refinement.
    max_dofs : int
        Number of unknowns that no level exceeds.
    out : path, optional
        Folder of the files; without one nothing is written.

    Returns
    -------
    computed, expected : Quantities
        The last level, and Hertz's formulas for its force; N/m, Pa and m.
    """
    print(
        f"A disc of radius {radius * 1e3:g} mm, E = {disc[0] / 1e9:g} GPa, nu = {disc[1]:g}, "
        f"pressed on a block, E = {block[0] / 1e9:g} GPa, nu = {block[1]:g}"
    )
    modulus = reduced([plane_modulus(*disc), plane_modulus(*block)])
    problem = pressed(radius, press, Elastic(*disc), Elastic(*block))
    solution, computed, expected = computed_and_expected(
        adapt(problem, order=order, tolerance=tolerance, max_dofs=max_dofs),
        COLUMNS,
        lambda force: Hertz(force, radius, modulus).cylinder(),
        halves=2,
    )
    compare("half-width, mm", radius, computed, expected)
    print("\nThe computed half, with errors (N/m, Pa, m):")
    print(solution.quantities())
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        solution.write(out / "hertz.vtu")
        draw(out / "hertz.png", solution, expected, mirror="axis")
        print(f"\nWritten: {out}/hertz.vtu, hertz_contact.vtp, hertz.png")
    return computed, expected


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
