"""Two balls pressed on each other, steel on aluminium, compared with Hertz's formulas.

Half of the upper ball and half of the lower one by their meridian sections, each held or moved on
its plane of symmetry; how far the circle of contact spreads is found by the adaptive loop. Writes
spheres.vtu, spheres_contact.vtp, spheres_revolved.vtu, spheres_revolved_contact.vtp, spheres.png.

    python -m drivers.spheres
    python -m drivers.spheres --lower-radius 0.02 --tolerance 1e-3 --out out/
"""

from __future__ import annotations

from pathlib import Path

import ngsolve as ng

from drivers.command_line import Count, Order, Positive, run
from drivers.hertz import ALUMINIUM, STEEL, Law, Quantities, compare, computed_and_expected, draw
from drivers.reference.half_spaces import Hertz, plane_modulus, reduced
from drivers.tables import Columns
from ngcontact import Contact, Elastic, Problem, adapt
from ngcontact.geometries import disc_on_disc


def pressed(radii: tuple[float, float], approach: float, upper: Elastic, lower: Elastic) -> Problem:
    """Balls of two `radii` (m), whose middles approach each other by a distance (m)."""
    return Problem(
        geometry=disc_on_disc(*radii),
        materials={"upper": upper, "lower": lower},
        displacement={"bottom": (None, 0), "top": (None, -approach)},
        contact=[Contact(secondary="upper_arc", primary="lower_arc", direction=(0, -1))],
        model="axisymmetric",
    )


COLUMNS: Columns = {
    "     force/N": "{0.force:.4f}",
    "peak/MPa": lambda q: f"{q.peak / 1e6:.2f}",
    "  radius/mm": lambda q: f"{q.a * 1e3:.6f}",
}


def main(
    *,
    radius: Positive = 0.01,
    lower_radius: Positive = 0.02,
    press: Positive = 5e-4,
    upper: Law = STEEL,
    lower: Law = ALUMINIUM,
    order: Order = 3,
    tolerance: Positive | None = None,
    max_dofs: Count = 6000,
    out: Path | None = Path("out"),
) -> tuple[Quantities, Quantities]:
    """Two balls pressed on each other: solved adaptively, compared with Hertz's formulas.

    Prints every level and the comparison, writes spheres.vtu, spheres_contact.vtp,
    spheres_revolved.vtu, the body of revolution, and spheres.png.

    Parameters
    ----------
    radius : float
        Radius of the upper ball, m.
    lower_radius : float
        Radius of the lower ball, m.
    press : float
        Distance by which the middles of the balls approach each other, in radii of the upper ball.
    upper : tuple of float
        Young's modulus of the upper ball, Pa, and its Poisson's ratio, without unit.
    lower : tuple of float
        Young's modulus of the lower ball, Pa, and its Poisson's ratio, without unit.
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
        The last level, and Hertz's formulas for its force; N, Pa and m.
    """
    radii = (radius, lower_radius)
    print(
        f"A ball of radius {radius * 1e3:g} mm, E = {upper[0] / 1e9:g} GPa, nu = {upper[1]:g}, on "
        f"one of radius {lower_radius * 1e3:g} mm, E = {lower[0] / 1e9:g} GPa, nu = {lower[1]:g}"
    )
    modulus = reduced([plane_modulus(*upper), plane_modulus(*lower)])
    problem = pressed(radii, press * radius, Elastic(*upper), Elastic(*lower))
    solution, computed, expected = computed_and_expected(
        adapt(problem, order=order, tolerance=tolerance, max_dofs=max_dofs),
        COLUMNS,
        lambda force: Hertz(force, reduced(radii), modulus).sphere(),
    )
    compare("radius of contact, mm", min(radii), computed, expected)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        solution.write(out / "spheres.vtu")
        solution.revolved(out / "spheres_revolved.vtu")
        draw(out / "spheres.png", solution, expected)
        print(f"\nWritten: {out}/spheres.vtu, _contact.vtp, _revolved.vtu, spheres.png")
    return computed, expected


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
