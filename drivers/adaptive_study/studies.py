"""Problems on which uniform and adaptive refinement are compared, and how errors are measured."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from drivers.reference import cases
from drivers.reference.straight import Exact, relative_energy_error
from ngcontact import Problem, Solution, adapt

Name: TypeAlias = Literal[
    "one transition",
    "hertz a=0.3",
    "hertz a=0.05",
    "flat punch",
    "disc on block",
    "disc on rigid plane",
]
REFERENCE = 60_000  # unknowns of the order 4 solution that stands for an unknown exact one


@dataclass(frozen=True)
class Study:
    """A problem, its exact solution or None, and the length of its contact zone."""

    problem: Problem
    exact: Exact | None
    zone: float


def _exact(case: cases.Case, zone: float) -> Study:
    return Study(case.problem, case.exact, zone)


STUDIES: dict[Name, Callable[[], Study]] = {
    "one transition": lambda: _exact(cases.one_transition(), 1.0),
    "hertz a=0.3": lambda: _exact(cases.hertz_contact(half_width=0.3), 0.3),
    "hertz a=0.05": lambda: _exact(cases.hertz_contact(half_width=0.05), 0.05),
    "flat punch": lambda: Study(cases.flat_punch(), None, 0.5),
    "disc on block": lambda: Study(cases.pressed_disc(), None, 0.03),
    "disc on rigid plane": lambda: Study(cases.disc_on_rigid_plane(), None, 0.05),
}


def error_measure(study: Study, reference: int = REFERENCE) -> Callable[[Solution], float]:
    """Relative error in the energy norm as a function of a solution.

    Without an exact solution by L(u_h) - L(u) = |u - u_h|^2 / 2 + <lambda, gap_h>, whose second
    part vanishes where contact is resolved; L(u) is that of up to `reference` unknowns.
    """
    exact = study.exact
    if exact is not None:
        return lambda solution: relative_energy_error(solution, exact)
    *_, finest = adapt(study.problem, order=4, max_dofs=reference)
    norm = finest.energy_norm
    return lambda solution: math.sqrt(2 * abs(solution.energy - finest.energy)) / norm
