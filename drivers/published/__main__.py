"""Problems that other codes publish, solved adaptively: their numbers and ours side by side.

Prints the table of docs/published.md, which --page writes.

    python -m drivers.published
    python -m drivers.published roller "patch test"
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, TypeAlias, get_args

import ngsolve as ng

from drivers.command_line import Count, Order, printed_in, run
from drivers.published.problems import PUBLISHED, Figure, Published
from drivers.tables import table
from ngcontact import Solution, adapt

Name: TypeAlias = Literal[
    "roller",
    "crushed spheres",
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
at most {max_dofs} unknowns) and writes this page. Differences are relative.
"""


def solved(published: Published, order: int, max_dofs: int) -> Solution:
    """The last level of an adaptive run."""
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
    return (
        f"\n## {published.title}\n\n{published.statement}\n\n"
        f"{table(('', 'published', 'ours', 'difference'), rows)}\n\n"
        f"{unknowns} unknowns, estimated error {error:.1e}. {published.why}\n\n"
        f"Source: {published.source}."
    )


def main(
    names: Sequence[Name] = get_args(Name),
    *,
    order: Order = 3,
    max_dofs: Count = 15_000,
    page: Path | None = None,
    out: Path | None = None,
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
    out : path, optional
        Folder in which what is printed is written, too, as published.md.

    Returns
    -------
    dict
        The last level of each problem.
    """
    solutions: dict[str, Solution] = {}
    sections = []
    with printed_in(out, "published.md"):
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
