"""A steel disc pressed on an aluminium block, compared with Hertz's formulas.

The disc's top moves down by a given distance; how far the contact zone spreads is found by the
adaptive loop, from a coarse mesh that knows nothing of it. By symmetry half of each body is
computed. Writes hertz.vtu, hertz_contact.vtp and hertz.png.

    python -m drivers.hertz
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from pathlib import Path

import ngsolve as ng

from ngcontact import Contact, Elastic, Problem, Solution, adapt
from ngcontact.geometries import disc_on_block

STEEL = Elastic(E=210e9, nu=0.3)  # Pa
ALUMINIUM = Elastic(E=70e9, nu=0.33)
RADIUS = 0.01  # m


@dataclass(frozen=True)
class Quantities:
    """Contact `force` per unit thickness, `peak` pressure and `half_width` of a line contact."""

    force: float
    peak: float
    half_width: float


def press(distance: float = 2.0e-5) -> Problem:
    """Disc on a block whose bottom is clamped; its top moves down by `distance` (m)."""
    return Problem(
        geometry=disc_on_block(radius=RADIUS),
        materials={"disc": STEEL, "block": ALUMINIUM},
        displacement={"block_bottom": (0, 0), "disc_top": (0, -distance)},
        sliding="axis",
        contact=[Contact(secondary="disc_arc", primary="block_top", direction=(0, -1))],
    )


def measured(solution: Solution) -> Quantities:
    """What the computed half says about the whole contact."""
    transitions = solution.transitions()
    return Quantities(
        force=2 * float(solution.contact_force()[1]),
        peak=float(solution.pressure.max()),
        half_width=float(transitions[:, 0].max()) if len(transitions) else math.nan,
    )


def hertz(force: float) -> Quantities:
    """Hertz's line contact of a cylinder and a half-space under the same force (Johnson 1985)."""
    stiffness = 1 / sum((1 - m.nu**2) / m.E for m in (STEEL, ALUMINIUM))
    return Quantities(
        force=force,
        peak=math.sqrt(force * stiffness / (math.pi * RADIUS)),
        half_width=math.sqrt(4 * force * RADIUS / (math.pi * stiffness)),
    )


def main(
    order: int = 3, max_dofs: int = 20_000, folder: str | Path | None = "out"
) -> tuple[Quantities, Quantities]:
    """Solve adaptively, print levels and the comparison, write results to `folder`.

    Returns
    -------
    computed, expected : Quantities
        The last level, and Hertz's formulas for its force.
    """
    print("A steel disc pressed on an aluminium block")
    print(
        "unknowns  active  steps  estimate     force/N/m  peak/MPa  half-width/mm  seconds",
    )
    started = time.perf_counter()
    for solution in adapt(press(), order=order, max_dofs=max_dofs):
        estimate = solution.relative_error_estimate
        computed = measured(solution)
        now = time.perf_counter()
        print(
            f"{solution.displacement.space.ndof:8d}  {solution.active.sum():6d}  "
            f"{len(solution.steps):5d}  {estimate:.2e}  {computed.force:12.1f}  "
            f"{computed.peak / 1e6:8.2f}  {computed.half_width * 1e3:13.5f}  {now - started:7.2f}"
        )
        started = now
    expected = hertz(computed.force)
    print(f"\nAt a/R = {computed.half_width / RADIUS:.4f}   computed    Hertz  difference")
    for name, a, b, unit in (
        ("peak pressure, MPa", computed.peak, expected.peak, 1e6),
        ("half-width, mm", computed.half_width, expected.half_width, 1e-3),
    ):
        print(f"{name:20s} {a / unit:10.4f} {b / unit:10.4f}  {(a / b - 1) * 100:+.3f} %")
    if folder is not None:
        folder = Path(folder)
        folder.mkdir(parents=True, exist_ok=True)
        solution.write(folder / "hertz.vtu")
        solution.plot(folder / "hertz.png")
        print(f"\nWritten: {folder}/hertz.vtu, hertz_contact.vtp, hertz.png")
    return computed, expected


if __name__ == "__main__":
    with ng.TaskManager():
        main()
