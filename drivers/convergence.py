"""Errors against exact solutions under uniform refinement, every discrete problem of the paper.

Prints, for each case, element and order: unknowns, relative energy-norm error, rate in h, Newton
steps and the worst residual of the discrete identities.

    python -m drivers.convergence
    python -m drivers.convergence S1 S9 --levels 4
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

import ngsolve as ng
import numpy as np

from drivers.command_line import Count, run
from drivers.reference import cases
from drivers.reference.cases import Case
from drivers.reference.curved import Rings
from drivers.reference.straight import relative_energy_error
from ngcontact import Solution, solve
from ngcontact.adaptivity import refined
from ngcontact.mesh import first_mesh


@dataclass(frozen=True)
class Level:
    """One row of a table.

    Attributes
    ----------
    unknowns : int
    error : float
        Relative error in the energy norm.
    rate : float
        Exponent of the mesh size since the level before.
    steps : int
        Newton steps from a cold start.
    identities : float
        Worst residual of `identities`.
    """

    unknowns: int
    error: float
    rate: float
    steps: int
    identities: float


def identities(solution: Solution) -> float:
    """Worst relative residual of the exact discrete identities, round-off on every mesh.

    Loads and reactions balance in force and, where V_h holds rotations, in moment; the energy
    identity u'Au = f'u + r'u - g'force; the optimality conditions. The forces of a contact pair
    cancel in the sums over both bodies.
    """
    d = solution.discrete
    trace, space, reaction = d.space.trace, d.space, solution.nodal_reaction
    u = solution.displacement.vec.FV().NumPy()
    rigid = ng.GridFunction(space.V)
    position = np.zeros_like(reaction)
    segment, s = trace.at_nodes(np.arange(len(trace.region)))
    position[trace.nodes.ravel()] = trace.point(segment, s)
    motions = [(ng.CF((1, 0)), reaction[:, 0]), (ng.CF((0, 1)), reaction[:, 1])]
    if solution.element == "isoparametric":
        moment = position[:, 0] * reaction[:, 1] - position[:, 1] * reaction[:, 0]
        motions.append((ng.CF((-ng.y, ng.x)), moment))
    size = np.abs(reaction).sum() + np.abs(solution.force).sum()
    worst = max(solution.residuals.values())
    for motion, resisting in motions:
        rigid.Set(motion, dual=solution.element != "physical")
        load = space.f @ rigid.vec.FV().NumPy()
        worst = max(worst, abs(load + resisting.sum()) / size)
    strain_energy = u @ (space.A @ u)
    nodal = d.basis.T @ solution.minimiser.u
    work = space.f @ u + reaction.T.ravel() @ nodal - solution.force @ d.program.g
    return float(max(worst, abs(strain_energy - work) / strain_energy))


def study(
    case: Case, *, order: int, element: str = "isoparametric", maxh: float, levels: int
) -> Iterator[tuple[Solution, Level]]:
    """Solve on uniformly refined meshes; yield each solution with its row of the table."""
    mesh = first_mesh(case.problem, maxh)
    previous = math.nan
    for _ in range(levels):
        solution = solve(case.problem, mesh, order=order, element=element)
        error = relative_energy_error(solution, case.exact)
        unknowns = solution.displacement.space.ndof
        rate = math.log2(previous / error)  # every refinement halves the mesh size
        previous = error
        yield solution, Level(unknowns, error, rate, len(solution.steps), identities(solution))
        mesh = refined(case.problem, solution.mesh)


def mean_rate(rows: Sequence[Level], levels: int = 3) -> float:
    """Least-squares exponent of the mesh size over the last levels."""
    errors = np.log2([row.error for row in rows[-levels:]])
    if len(errors) < 2:
        return math.nan
    return float(-np.polyfit(np.arange(len(errors)), errors, 1)[0])


Part: TypeAlias = Literal["patch", "S1", "S3", "S7", "S8", "S9"]
LEVELS = 5  # of order 1, one less at order 2: about 30k unknowns at the end

# Title and case; element, order, size of the first mesh.
STRAIGHT = [("isoparametric", 1, 0.28), ("isoparametric", 2, 0.28)]
TABLES: dict[Part, tuple[str, Callable[[], Case], list[tuple[str, int, float]]]] = {
    "S1": ("S1 one transition", cases.one_transition, STRAIGHT),
    "S3": ("S3 Hertz, a = 0.3", cases.hertz_contact, STRAIGHT),
    "S7": ("S7 clamped transition", cases.clamped_transition, STRAIGHT),
    "S8": (
        "S8 curved lines",
        cases.curved_lines,
        [("superparametric", 1, 0.16), ("isoparametric", 1, 0.16)],
    ),
    "S9": (
        "S9 rings, q_n = 0.3",
        cases.ring_in_ring,
        [("physical", 1, 0.24), ("isoparametric", 1, 0.24), ("isoparametric", 2, 0.24)],
    ),
}
PATCHES: dict[str, tuple[Callable[[], Case], int]] = {
    "S6 constant pressure": (cases.pressure_patch, 1),
    "S6 linear pressure": (lambda: cases.pressure_patch(p1=0.5), 2),
    "polygonal line, -p I": (cases.polygonal_patch, 1),
}


def print_patches() -> dict[str, list[Level]]:
    """Print patch tests, one level each; their rows by title."""
    print(f"{'patch test':28s} order  unknowns  error     steps  identities")
    found = {}
    for name, (make, order) in PATCHES.items():
        found[name] = [row for _, row in study(make(), order=order, maxh=0.3, levels=1)]
        for row in found[name]:
            print(
                f"{name:28s} {order:5d}  {row.unknowns:8d}  {row.error:.2e}  {row.steps:5d}  "
                f"{row.identities:.1e}"
            )
    return found


def print_table(
    title: str, case: Case, order: int, element: str, maxh: float, levels: int
) -> list[Level]:
    """Print the rows of one study as they come, then its mean rate and, of rings, P0 and Pn."""
    print(f"\n{title}")
    print("unknowns  error      rate  steps  identities")
    rows = []
    for solved, row in study(case, order=order, element=element, maxh=maxh, levels=levels):
        solution = solved
        rows.append(row)
        print(
            f"{row.unknowns:8d}  {row.error:.3e}  {row.rate:4.2f}  {row.steps:5d}  "
            f"{row.identities:.1e}"
        )
    print(f"rate of the last three levels: {mean_rate(rows):.2f}")
    if isinstance(case.exact, Rings):
        mean, amplitude = cases.harmonics(solution, radius=1.0, n=2)
        print(
            f"pressure: P0 {mean:.7f} (error {mean / case.exact.P0 - 1:+.1e}), "
            f"P2 {amplitude:.7f} (error {amplitude / case.exact.Pn - 1:+.1e})"
        )
    return rows


def main(
    parts: Sequence[Part] = get_args(Part), *, levels: Count = LEVELS
) -> dict[str, list[Level]]:
    """Errors against exact solutions under uniform refinement, one table a problem and element.

    Prints unknowns, relative error in the energy norm, its rate in the mesh size, Newton steps and
    the worst residual of identities that hold on every mesh.

    Parameters
    ----------
    parts : sequence of str
        Patch tests, which need one mesh, and problems with exact solutions.
    levels : int
        Number of meshes of order 1, each of half the size of the one before; one less at order 2.

    Returns
    -------
    dict of list of Level
        Rows by title of the table.
    """
    found: dict[str, list[Level]] = {}
    for part in parts:
        if part == "patch":
            found |= print_patches()
            continue
        name, make, runs = TABLES[part]
        for element, order, maxh in runs:
            title = f"{name}, {element}, order {order}"
            count = max(1, levels + 1 - order)
            found[title] = print_table(title, make(), order, element, maxh, count)
    return found


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
