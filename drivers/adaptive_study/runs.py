"""Runs of one strategy and order: errors, estimates, meshes and seconds of every level."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from drivers.adaptive_study.studies import Study
from drivers.reference.straight import Hertz
from ngcontact import Problem, Solution, adapt, solve
from ngcontact.adaptivity import refined
from ngcontact.mesh import first_mesh
from ngcontact.problem import Triangulation

NEAR = 0.2  # distance from a transition, relative to the zone, that counts as near


@dataclass(frozen=True)
class Row:
    """One level of one run; see the column titles printed by `print_rows`."""

    case: str
    strategy: str
    order: int
    level: int
    unknowns: int
    error: float
    estimate: float
    effectivity: float
    near: float
    half_width: float
    angle: float
    steps: int
    seconds: float


def triangles(solution: Solution) -> np.ndarray:
    """Corners (ne, 3, 2) of the elements."""
    return Triangulation(solution.mesh).corners


def smallest_angle(corners: np.ndarray) -> float:
    """Smallest angle of all triangles, degrees."""
    sides = np.roll(corners, -1, axis=1) - corners
    lengths = np.linalg.norm(sides, axis=2)
    cosines = -(sides * np.roll(sides, 1, axis=1)).sum(axis=2) / (
        lengths * np.roll(lengths, 1, axis=1)
    )
    return float(np.degrees(np.arccos(np.clip(cosines, -1, 1)).min()))


def share_near(solution: Solution, zone: float) -> float:
    """Share of elements within `NEAR` times the zone of a transition."""
    ends = solution.transitions()
    if len(ends) == 0:
        return 0.0
    middles = triangles(solution).mean(axis=1)
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


def run_of(
    name: str,
    study: Study,
    strategy: str,
    order: int,
    error: Callable[[Solution], float],
    max_dofs: int,
) -> Iterator[tuple[Solution, Row]]:
    """One run, from the geometry on; the seconds are those of the package, not of the study."""
    if strategy == "uniform":
        levels = uniform(study.problem, order, max_dofs)
    else:
        levels = adapt(study.problem, order=order, max_dofs=max_dofs)
    seconds = 0.0
    level = 0
    started = time.process_time()
    for solution in levels:
        seconds += time.process_time() - started
        estimate = solution.relative_error_estimate
        actual = error(solution)
        yield (
            solution,
            Row(
                case=name,
                strategy=strategy,
                order=order,
                level=level,
                unknowns=solution.displacement.space.ndof,
                error=actual,
                estimate=estimate,
                effectivity=estimate / actual,
                near=share_near(solution, study.zone),
                half_width=half_width_error(study, solution),
                angle=smallest_angle(triangles(solution)),
                steps=len(solution.steps),
                seconds=seconds,
            ),
        )
        level += 1
        started = time.process_time()


def rate(rows: Sequence[Row]) -> float:
    """Least-squares exponent of the error in the unknowns over the last factor 10 in unknowns."""
    n = np.array([row.unknowns for row in rows], dtype=float)
    last = n >= n[-1] / 10
    if last.sum() < 2:
        return math.nan
    errors = np.array([row.error for row in rows])
    return float(np.polyfit(np.log(n[last]), np.log(errors[last]), 1)[0])


def seconds_to(rows: Sequence[Row], error: float) -> float:
    """Seconds from the geometry to a level with this error, NaN if none has it."""
    return next((row.seconds for row in rows if row.error <= error), math.nan)
