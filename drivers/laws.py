"""Estimates, bounds and rates under any law: stiff fibres, layers, moduli that vary.

Exact solutions, errors of stresses in the energy norm, relative. Of every case, order and strategy:
unknowns of the last level, its error, the rate in N and the one of the order, and the least and
the largest ratio of estimate and bound to the error over all levels. Rates are least squares over
the last factor 16 in N, without the first mesh: its triangles are better than bisected ones.

    python -m drivers.laws
    python -m drivers.laws layers graded --orders 2 4
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, get_args

from drivers.adaptive_study.runs import Strategy, levels_of, rate
from drivers.command_line import Count, Order, Positive, run
from drivers.reference.cases import Case
from drivers.reference.laws import bent_fibres, graded, pressed_fibres, stiff_and_soft
from drivers.reference.straight import energy_error
from drivers.tables import table
from ngcontact import ContactWarning

Name: TypeAlias = Literal["pressed fibres", "bent fibres", "layers", "graded"]
ANGLES = (0.0, 30.0, 71.0)  # of fibres to x, degrees
CONTRASTS = (1.0, 1e2, 1e4, 1e6)
MAXH = 0.4  # of the first mesh
RANGE = 16  # of unknowns over which rates are taken
TITLES = ("case", "order", "strategy", "levels", "N", "error", "rate", "optimal")


@dataclass(frozen=True)
class Level:
    """Unknowns and relative error of one level; estimate and bound over the error."""

    unknowns: int
    error: float
    estimate: float
    bound: float


def cases(name: Name, contrasts: Sequence[float]) -> Iterator[tuple[str, Case]]:
    """The cases of a study with their titles; fibres turned where they are stiffer."""
    for contrast in contrasts:
        if name in ("layers", "graded"):
            make = graded if name == "graded" else stiff_and_soft
            yield f"{name}, {contrast:g}", make(contrast)
            continue
        fibrous = pressed_fibres if name == "pressed fibres" else bent_fibres
        for angle in ANGLES if contrast > 1 else ANGLES[:1]:
            title = f"{name}, {contrast:g}, {angle:g} degrees"
            yield title, fibrous(contrast, math.radians(angle))


def levels(case: Case, strategy: Strategy, order: int, max_dofs: int) -> list[Level]:
    """All levels of one run."""
    found = []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ContactWarning)  # strains are as large as they come
        for solution in levels_of(case.problem, strategy, order, max_dofs, MAXH):
            error, norm = energy_error(solution, case.exact)
            ratios = (solution.error_estimate / error, solution.error_bound / error)
            found.append(Level(solution.displacement.space.ndof, error / norm, *ratios))
    return found


def main(
    studies: Sequence[Name] = get_args(Name),
    *,
    contrasts: Sequence[Positive] = CONTRASTS,
    orders: Sequence[Order] = (1, 2, 3, 4),
    max_dofs: Count = 10_000,
) -> dict[str, list[Level]]:
    """Estimates, bounds and rates under any law, uniform and adaptive, against exact solutions.

    Prints a table in Markdown as it comes. All of it is 224 runs of some 8 s of processor
    time each, as measured on the first eleven.

    Parameters
    ----------
    studies : sequence of str
        Fibres that the stress stretches, fibres that bend only, layers of two stiffnesses, moduli
        that vary smoothly.
    contrasts : sequence of float
        Stiffness of the fibres over that across them; largest modulus over the smallest.
    orders : sequence of int
        Degrees of the displacement on each element, 1 to 4.
    max_dofs : int
        Number of unknowns that no level exceeds.

    Returns
    -------
    dict of list of Level
        All levels, by case, order and strategy.
    """
    found = {}
    runs = (
        (title, case, order, strategy)
        for name in studies
        for title, case in cases(name, contrasts)
        for order in orders
        for strategy in get_args(Strategy)
    )
    print(table((*TITLES, "estimate", "bound"), []))
    for title, case, order, strategy in runs:
        rows = levels(case, strategy, order, max_dofs)
        found[f"{title}, order {order}, {strategy}"] = rows
        print(line(title, order, strategy, rows), flush=True)
    return found


def line(title: str, order: int, strategy: Strategy, rows: Sequence[Level]) -> str:
    """One line of the table."""
    last = rows[-1]
    ranges = []
    for ratios in ([row.estimate for row in rows], [row.bound for row in rows]):
        ranges.append(f"{min(ratios):.3g} - {max(ratios):.3g}, last {ratios[-1]:.3g}")
    figures = (f"{last.error:.1e}", f"{rate(rows[1:] or rows, RANGE):.2f}", f"{-order / 2:.1f}")
    cells = (title, order, strategy, len(rows), last.unknowns, *figures, *ranges)
    return "| " + " | ".join(map(str, cells)) + " |"


if __name__ == "__main__":
    run(main)
