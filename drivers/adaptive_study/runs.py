"""Problems, how errors are measured, and runs of one strategy and order, level by level."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from drivers.reference import cases
from drivers.reference.overkill import Overkill
from drivers.reference.straight import Exact, Hertz, energy_error
from ngcontact import Problem, Solution, adapt, solve
from ngcontact.adaptivity import refined
from ngcontact.mesh import first_mesh
from ngcontact.problem import MeshArrays

Name: TypeAlias = Literal[
    "one transition",
    "hertz a=0.3",
    "hertz a=0.05",
    "flat punch",
    "disc on block",
    "disc on rigid plane",
]
Strategy: TypeAlias = Literal["uniform", "adaptive"]
REFERENCE = 100_000  # unknowns of the order 4 solution that stands for an unknown exact one
SHARE = 0.25  # of them that a level of a run may have: its own error counts 6 % at order 4
NEAR = 0.2  # distance from a transition, relative to the zone, that counts as near


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
    *_, finest = adapt(study.problem, order=4, max_dofs=min(reference, study.finest))
    return Overkill(finest).energy_error


@dataclass(frozen=True)
class Row:
    """One level of one run, from the geometry on."""

    case: str
    strategy: str
    order: int
    level: int
    unknowns: int
    error: float
    estimate: float
    effectivity: float
    near: float  # share of elements near a transition
    half_width: float  # relative error
    angle: float  # smallest, degrees
    steps: int
    seconds: float  # of the package, not of the study


def smallest_angle(corners: np.ndarray) -> float:
    """Smallest angle of all triangles (ne, 3, 2), degrees."""
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    products = -(sides * np.roll(sides, 1, axis=1)).sum(axis=2)
    cosines = products / (lengths * np.roll(lengths, 1, axis=1))
    return float(np.degrees(np.arccos(np.clip(cosines, -1, 1)).min()))


def share_near(solution: Solution, zone: float) -> float:
    """Share of elements within `NEAR` times the zone of a transition."""
    ends = solution.transitions()
    if len(ends) == 0:
        return 0.0
    middles = MeshArrays(solution.mesh).corners.mean(axis=1)
    distances = np.linalg.norm(middles[:, None] - ends, axis=2).min(axis=1)
    return float((distances < NEAR * zone).mean())


def half_width_error(study: Study, solution: Solution) -> float:
    """Relative error of the worse end of a zone |x| <= a, NaN where a is not known."""
    ends = np.abs(solution.transitions()[:, 0])
    if not isinstance(study.exact, Hertz) or len(ends) == 0:
        return math.nan
    return float(np.abs(ends / study.exact.half_width - 1).max())


def uniform(
    problem: Problem, order: int, max_dofs: int, maxh: float | None = None
) -> Iterator[Solution]:
    """Solutions on uniformly refined meshes, warm started; the first one of any size."""
    solution = solve(problem, first_mesh(problem, maxh), order=order)
    while True:
        yield solution
        mesh = refined(problem, solution.mesh)
        solution = solve(problem, mesh, order=order, start=solution)
        if solution.displacement.space.ndof > max_dofs:
            return


def levels_of(
    problem: Problem, strategy: Strategy, order: int, max_dofs: int, maxh: float | None = None
) -> Iterator[Solution]:
    """The levels of a run of either strategy."""
    if strategy == "uniform":
        return uniform(problem, order, max_dofs, maxh)
    return adapt(problem, order=order, max_dofs=max_dofs, maxh=maxh)


def run_of(
    name: str,
    study: Study,
    strategy: Strategy,
    order: int,
    errors: Callable[[Solution], tuple[float, float]],
    max_dofs: int,
) -> Iterator[tuple[Solution, Row]]:
    """One run: its solutions and their rows; `errors` as `energy_errors` returns it."""
    seconds, started = 0.0, time.process_time()
    for level, solution in enumerate(levels_of(study.problem, strategy, order, max_dofs)):
        seconds += time.process_time() - started
        error, norm = errors(solution)
        row = Row(
            case=name,
            strategy=strategy,
            order=order,
            level=level,
            unknowns=solution.displacement.space.ndof,
            error=error / norm,
            estimate=solution.relative_error_estimate,
            effectivity=solution.relative_error_estimate * norm / error,
            near=share_near(solution, study.zone),
            half_width=half_width_error(study, solution),
            angle=smallest_angle(MeshArrays(solution.mesh).corners),
            steps=len(solution.steps),
            seconds=seconds,
        )
        yield solution, row
        started = time.process_time()


def rate(rows: Sequence[Any], over: float = 10) -> float:
    """Least-squares exponent of the error in the unknowns over the last factor `over` in them."""
    last = [(row.unknowns, row.error) for row in rows if row.unknowns >= rows[-1].unknowns / over]
    if len(last) < 2:
        return math.nan
    unknowns, errors = np.log(last).T
    return float(np.polyfit(unknowns, errors, 1)[0])


def seconds_to(rows: Sequence[Row], error: float) -> float:
    """Seconds from the geometry to a level with this error, NaN if none has it."""
    return next((row.seconds for row in rows if row.error <= error), math.nan)
