"""Errors against exact solutions under uniform refinement, every discrete problem of the paper.

Prints, for each case, element and order: unknowns, relative error, rate in h, Newton steps and the
worst residual of the discrete identities; then the rate beside the one to expect. Errors are those
of stresses, in the energy norm, or of displacements in the norm of H^1 where the paper has that.
docs/convergence.md says why which rate.

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
from drivers.reference import cases, paper
from drivers.reference.cases import Case
from drivers.reference.curved import Rings
from drivers.reference.overkill import relative_h1_error
from drivers.reference.straight import Exact, relative_energy_error
from drivers.tables import Columns, printed
from ngcontact import Solution, solve
from ngcontact.adaptivity import refined
from ngcontact.mesh import first_mesh

Norm: TypeAlias = Callable[[Solution, Exact], float]


@dataclass(frozen=True)
class Level:
    """One row of a table."""

    unknowns: int
    error: float  # relative, in the energy norm unless the table says another
    rate: float  # exponent of the mesh size since the level before
    steps: int  # Newton steps from a cold start
    identities: float  # worst residual of `identities`


COLUMNS: Columns = {
    "unknowns": "{0.unknowns}",
    "    error": "{0.error:.3e}",
    "rate": "{0.rate:.2f}",
    "steps": "{0.steps}",
    "identities": "{0.identities:.1e}",
}


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
    strain_energy = space.energy(u)
    nodal = d.basis.T @ solution.minimiser.u
    work = space.f @ u + reaction.T.ravel() @ nodal - solution.force @ d.program.g
    return float(max(worst, abs(strain_energy - work) / strain_energy))


def study(
    case: Case,
    *,
    order: int,
    element: str = "isoparametric",
    maxh: float,
    levels: int,
    norm: Norm = relative_energy_error,
) -> Iterator[tuple[Solution, Level]]:
    """Solve on uniformly refined meshes; yield each solution with its row of the table."""
    mesh = first_mesh(case.problem, maxh)
    previous = math.nan
    for _ in range(levels):
        solution = solve(case.problem, mesh, order=order, element=element)
        error = norm(solution, case.exact)
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


@dataclass(frozen=True)
class Run:
    """Element, order and size of the first mesh of one study, and the rate to expect of it."""

    element: str
    order: int
    maxh: float
    expected: float


@dataclass(frozen=True)
class Table:
    """A case with its studies."""

    title: str
    case: Callable[[], Case]
    runs: tuple[Run, ...]
    norm: Norm = relative_energy_error  # relative error of a solution against the exact one


Solid: TypeAlias = Literal["S1", "S3", "S7", "S8", "S9", "polygon", "circle"]
Theorem: TypeAlias = Literal[
    "remark 3.3", "remark 3.7", "theorem 3.2", "theorem 3.3", "theorem 3.5"
]
Part: TypeAlias = Literal["patch", Solid, Theorem]
LEVELS = 5  # of order 1, one less at order 2: about 30k unknowns at the end
ISO, SUPER, PHYSICAL = "isoparametric", "superparametric", "physical"
H1 = relative_h1_error


def _orders(maxh: float, *rates: float) -> tuple[Run, ...]:
    """Studies of isoparametric elements, of the orders 1, 2, ..., with the rate of each."""
    return tuple(Run(ISO, order, maxh, rate) for order, rate in enumerate(rates, 1))


def _elements(maxh: float, rate: float, *elements: str) -> tuple[Run, ...]:
    """Studies of order 1, one for each kind of element."""
    return tuple(Run(element, 1, maxh, rate) for element in elements)


S9_RUNS = (*_elements(0.24, 1.0, PHYSICAL, ISO), Run(ISO, 2, 0.3, 2.0))
GUIDE_RUNS = (Run(ISO, 1, 0.2, 0.5), Run(ISO, 2, 0.28, 0.5))
TABLES: dict[Part, Table] = {
    "S1": Table("S1 one transition", cases.one_transition, _orders(0.28, 1.0, 1.5)),
    "S3": Table("S3 Hertz, a = 0.3", cases.hertz_contact, _orders(0.28, 1.0, 1.5)),
    "S7": Table("S7 u = 0 above, guided below", cases.guided_transition, _orders(0.26, 1.0, 1.5)),
    "S8": Table("S8 curved lines", cases.curved_lines, _elements(0.16, 1.0, SUPER, ISO)),
    "S9": Table("S9 rings, q_n = 0.3", cases.ring_in_ring, S9_RUNS),
    "polygon": Table("three sides of a polygon", paper.polygonal_zone, _orders(0.24, 1.0)),
    "circle": Table(
        "-p I on a circle", paper.circular_patch, _elements(0.24, 1.5, SUPER, PHYSICAL)
    ),
    "remark 3.3": Table("bilateral part, H1 norm", paper.bilateral_part, _orders(0.24, 1.0), H1),
    "remark 3.7": Table("S7 again, H1 norm", cases.guided_transition, _orders(0.26, 1.0), H1),
    "theorem 3.2": Table("zone between slits", paper.slit_blocks, _orders(0.28, 0.5, 0.5)),
    "theorem 3.3": Table(
        "rings that part", paper.opening_ring, _elements(0.24, 1.0, PHYSICAL, ISO)
    ),
    "theorem 3.5": Table("end of a guide", paper.end_of_guide, GUIDE_RUNS),
}
PATCHES: dict[str, tuple[Callable[[], Case], int]] = {
    "S6 constant pressure": (cases.pressure_patch, 1),
    "S6 linear pressure": (lambda: cases.pressure_patch(p1=0.5), 2),
    "polygonal line, -p I": (cases.polygonal_patch, 1),
    "circle, -p I": (paper.circular_patch, 1),
}


def print_table(title: str, table: Table, one: Run, levels: int) -> list[Level]:
    """Print the rows of one study as they come, then its mean rate and, of rings, P0 and Pn."""
    print(f"\n{title}")
    case, last = table.case(), list[Solution]()
    solved = study(
        case,
        order=one.order,
        element=one.element,
        maxh=one.maxh,
        levels=levels,
        norm=table.norm,
    )

    def rows() -> Iterator[Level]:
        for solution, row in solved:
            last[:] = [solution]
            yield row

    found = printed(COLUMNS, rows())
    print(f"rate of the last three levels: {mean_rate(found):.2f}, to expect: {one.expected:g}")
    if isinstance(case.exact, Rings):
        mean, amplitude = cases.harmonics(last[0], radius=1.0, n=2)
        print(
            f"pressure: P0 {mean:.7f} (error {mean / case.exact.P0 - 1:+.1e}), "
            f"P2 {amplitude:.7f} (error {amplitude / case.exact.Pn - 1:+.1e})"
        )
    return found


def main(
    parts: Sequence[Part] = get_args(Part), *, levels: Count = LEVELS
) -> dict[str, list[Level]]:
    """Errors against exact solutions under uniform refinement, one table a problem and element.

    Prints unknowns, relative error (energy norm of the stress, or H1), its rate in the mesh size,
    Newton steps and the worst residual of identities that hold on every mesh.

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
            for name, (make, order) in PATCHES.items():
                print(f"\npatch test: {name}, order {order}")
                rows = study(make(), order=order, maxh=0.3, levels=1)
                found[name] = printed(COLUMNS, (row for _, row in rows))
            continue
        table = TABLES[part]
        for one in table.runs:
            title = f"{table.title}, {one.element}, order {one.order}"
            found[title] = print_table(title, table, one, max(1, levels + 1 - one.order))
    return found


if __name__ == "__main__":
    with ng.TaskManager():
        run(main)
