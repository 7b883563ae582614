"""Problems on which uniform and adaptive refinement are compared, and how errors are measured."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

from drivers.reference import cases
from drivers.reference.overkill import Overkill
from drivers.reference.straight import Exact, energy_error
from ngcontact import Problem, Solution, adapt

Name: TypeAlias = Literal[
    "one transition",
    "hertz a=0.3",
    "hertz a=0.05",
    "flat punch",
    "disc on block",
    "disc on rigid plane",
]
REFERENCE = 100_000  # unknowns of the order 4 solution that stands for an unknown exact one
SHARE = 0.25  # of them that a level of a run may have: its own error counts 6 % at order 4


@dataclass(frozen=True)
class Study:
    """A problem, its exact solution or None, and the length of its contact zone.

    `finest` is the most unknowns that a solution in place of the exact one may have: where segments
    at the end of contact come below 1e-6, the geometry kernel's digits end.
    """

    problem: Problem
    exact: Exact | None
    zone: float
    finest: int = REFERENCE

    def reference(self, most: int) -> int:
        """Unknowns that the solution in place of the exact one does not exceed."""
        return min(most, self.finest)


def _exact(case: cases.Case, zone: float) -> Study:
    return Study(case.problem, case.exact, zone)


STUDIES: dict[Name, Callable[[], Study]] = {
    "one transition": lambda: _exact(cases.one_transition(), 1.0),
    "hertz a=0.3": lambda: _exact(cases.hertz_contact(half_width=0.3), 0.3),
    "hertz a=0.05": lambda: _exact(cases.hertz_contact(half_width=0.05), 0.05),
    "flat punch": lambda: Study(cases.flat_punch(), None, 0.5),
    "disc on block": lambda: Study(cases.pressed_disc(), None, 0.03),
    "disc on rigid plane": lambda: Study(cases.disc_on_rigid_plane(), None, 0.05, 60_000),
}


def error_measure(study: Study, reference: int = REFERENCE) -> Callable[[Solution], float]:
    """Relative error of stresses in the energy norm, as a function of a solution."""
    errors = energy_errors(study, reference)

    def relative(solution: Solution) -> float:
        error, norm = errors(solution)
        return error / norm

    return relative


def energy_errors(
    study: Study, reference: int = REFERENCE
) -> Callable[[Solution], tuple[float, float]]:
    """Error of stresses in the energy norm, and the norm itself, as a function of a solution.

    Against the exact stress, or against that of an adaptive solution of order 4 with up to
    `reference` unknowns.
    """
    exact = study.exact
    if exact is not None:
        return lambda solution: energy_error(solution, exact)
    *_, finest = adapt(study.problem, order=4, max_dofs=study.reference(reference))
    return Overkill(finest).energy_error
