"""Errors against exact solutions under uniform refinement, every discrete problem of the paper.

Prints, for each case, element and order: unknowns, relative energy-norm error, rate in h, Newton
steps and the worst residual of the discrete identities.

    python -m drivers.convergence
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from drivers import cases
from drivers.cases import Case
from drivers.exact import relative_energy_error
from ngcontact import Solution, solve
from ngcontact.mesh import first_mesh
from ngcontact.refine import refined


@dataclass(frozen=True)
class Level:
    """One row of a table: `unknowns`, relative `error`, `rate` in h, `steps`, `identities`."""

    unknowns: int
    error: float
    rate: float
    steps: int
    identities: float


def identities(solution: Solution) -> float:
    """Worst relative residual of the exact discrete identities.

    Per problem: loads + reactions + contact forces = 0 (which cancel between bodies); the
    energy identity u'Au = f'u + r'u - g'force; and the optimality conditions.
    """
    d = solution.discrete
    u = solution.displacement.vec.FV().NumPy()
    n = d.space.basis.shape[1] // 2
    load = (d.space.basis.T @ d.space.f).reshape(2, n)
    # A rigid translation has value 1 at vertices and boundary nodes, 0 elsewhere.
    translation = np.zeros(n)
    translation[: solution.mesh.nv] = 1.0
    translation[np.unique(d.space.trace.nodes)] = 1.0
    total = load @ translation + sum(solution.reactions.values(), np.zeros(2))
    size = sum(np.abs(r).sum() for r in solution.reactions.values()) + np.abs(solution.force).sum()
    reaction = solution._nodal_reaction.T.ravel()
    nodal = d.basis.T @ solution.minimiser.u
    strain_energy = u @ (d.space.A @ u)
    work = d.space.f @ u + reaction @ nodal - solution.force @ d.program.g
    return max(
        np.abs(total).max() / size,
        abs(strain_energy - work) / strain_energy,
        *solution.residuals.values(),
    )


def study(
    case: Case, *, order: int, element: str = "isoparametric", maxh: float, levels: int
) -> Iterator[tuple[Solution, Level]]:
    """Solve on uniformly refined meshes; yield each solution with its row of the table."""
    mesh = first_mesh(case.problem, maxh)
    previous = None
    for _ in range(levels):
        solution = solve(case.problem, mesh, order=order, element=element)
        error = relative_energy_error(solution, case.exact)
        unknowns = solution.displacement.space.ndof
        rate = math.nan
        if previous is not None:
            rate = 2 * math.log(previous[1] / error) / math.log(unknowns / previous[0])
        previous = unknowns, error
        yield solution, Level(unknowns, error, rate, len(solution.steps), identities(solution))
        mesh = refined(case.problem, solution.mesh)


# Case, elements and orders, size of the first mesh and levels: about 30k unknowns at the end.
TABLE = {
    "S1 one transition": (
        cases.one_transition,
        [("isoparametric", 1, 0.28, 5), ("isoparametric", 2, 0.28, 4)],
    ),
    "S3 Hertz, a = 0.3": (
        cases.hertz_contact,
        [("isoparametric", 1, 0.28, 5), ("isoparametric", 2, 0.28, 4)],
    ),
    "S7 clamped transition": (cases.clamped_transition, [("isoparametric", 1, 0.28, 5)]),
    "S8 curved lines": (
        cases.curved_lines,
        [("superparametric", 1, 0.16, 5), ("isoparametric", 1, 0.16, 5)],
    ),
    "S9 rings, q_n = 0.3": (
        cases.ring_in_ring,
        [("physical", 1, 0.28, 5), ("isoparametric", 1, 0.28, 5), ("isoparametric", 2, 0.28, 4)],
    ),
}
PATCHES = {
    "S6 constant pressure": (cases.pressure_patch, 1),
    "S6 linear pressure": (lambda: cases.pressure_patch(p1=0.5), 2),
    "polygonal line, -p I": (cases.polygonal_patch, 1),
}


def main() -> None:
    """Print all tables."""
    print(f"{'patch test':28s} order  unknowns  error     steps  identities")
    for name, (make, order) in PATCHES.items():
        for _, row in study(make(), order=order, maxh=0.3, levels=1):
            print(
                f"{name:28s} {order:5d}  {row.unknowns:8d}  {row.error:.2e}  {row.steps:5d}  "
                f"{row.identities:.1e}"
            )
    for name, (make, runs) in TABLE.items():
        for element, order, maxh, levels in runs:
            print(f"\n{name}, {element}, order {order}")
            print("unknowns  error      rate  steps  identities")
            for _, row in study(make(), order=order, element=element, maxh=maxh, levels=levels):
                print(
                    f"{row.unknowns:8d}  {row.error:.3e}  {row.rate:4.2f}  {row.steps:5d}  "
                    f"{row.identities:.1e}"
                )


if __name__ == "__main__":
    with ng.TaskManager():
        main()
