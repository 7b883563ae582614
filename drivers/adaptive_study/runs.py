"""Uniform against adaptive refinement, orders 1 to 4: errors, estimates, rates, meshes, seconds.

Cases: one transition (S1), Hertz contact with a wide and a narrow zone (S3), a stiff flat punch,
a disc on a block, a disc on a rigid plane. Errors are in the energy norm, relative: of the exact
stress where it is known, else from the energy above that of a much finer solution. Writes
adaptive_study.csv, a picture of errors and one of three meshes for each case.

    python -m drivers.adaptive_study
"""

from __future__ import annotations

import csv
import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import astuple, dataclass, fields
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from drivers.reference import cases
from drivers.reference.straight import Exact, Hertz, relative_energy_error
from ngcontact import Problem, Solution, adapt, solve
from ngcontact.mesh import first_mesh
from ngcontact.refine import refined

UNKNOWNS = {1: 40_000, 2: 40_000, 3: 40_000, 4: 50_000}  # order 4 is asymptotic from 10k on
REFERENCE = 60_000  # unknowns of the order 4 solution that stands for an unknown exact one
NEAR = 0.2  # distance from a transition, relative to the zone, that counts as near


@dataclass(frozen=True)
class Study:
    """A problem, its exact solution or None, and the length of its contact zone."""

    problem: Problem
    exact: Exact | None
    zone: float


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


def _exact(case: cases.Case, zone: float) -> Study:
    return Study(case.problem, case.exact, zone)


STUDIES: dict[str, Callable[[], Study]] = {
    "one transition": lambda: _exact(cases.one_transition(), 1.0),
    "hertz a=0.3": lambda: _exact(cases.hertz_contact(half_width=0.3), 0.3),
    "hertz a=0.05": lambda: _exact(cases.hertz_contact(half_width=0.05), 0.05),
    "flat punch": lambda: Study(cases.flat_punch(), None, 0.5),
    "disc on block": lambda: Study(cases.pressed_disc(), None, 0.03),
    "disc on rigid plane": lambda: Study(cases.disc_on_rigid_plane(), None, 0.05),
}


def error_measure(study: Study) -> Callable[[Solution], float]:
    """Relative error in the energy norm as a function of a solution.

    Without an exact solution by L(u_h) - L(u) = |u - u_h|^2 / 2 + <lambda, gap_h>, whose second
    part vanishes where contact is resolved.
    """
    exact = study.exact
    if exact is not None:
        return lambda solution: relative_energy_error(solution, exact)
    *_, finest = adapt(study.problem, order=4, max_dofs=REFERENCE)
    norm = finest.energy_norm
    return lambda solution: math.sqrt(2 * abs(solution.energy - finest.energy)) / norm


def triangles(solution: Solution) -> np.ndarray:
    """Corners (ne, 3, 2) of the elements."""
    ngmesh = solution.mesh.ngmesh
    nodes = ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(int) - 1
    return np.array(ngmesh.Coordinates())[:, :2][nodes]


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


def uniform(problem: Problem, order: int, max_dofs: int) -> Iterator[Solution]:
    """Solutions on uniformly refined meshes, warm started."""
    mesh, solution = first_mesh(problem), None
    while True:
        solution = solve(problem, mesh, order=order, start=solution)
        if solution.displacement.space.ndof > max_dofs:
            return
        yield solution
        mesh = refined(problem, solution.mesh)


def run(
    name: str, study: Study, strategy: str, order: int, error: Callable[[Solution], float]
) -> Iterator[tuple[Solution, Row]]:
    """One run, from the geometry on; the seconds are those of the product, not of the study."""
    most = UNKNOWNS[order]
    if study.exact is None:  # the reference has to be much finer
        most = min(most, 2 * REFERENCE // 5)
    if strategy == "uniform":
        levels = uniform(study.problem, order, most)
    else:
        levels = adapt(study.problem, order=order, max_dofs=most)
    seconds = 0.0
    level = 0
    started = time.perf_counter()
    for solution in levels:
        seconds += time.perf_counter() - started
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
        started = time.perf_counter()


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


def print_rows(rows: Sequence[Row]) -> None:
    """Print one run."""
    first = rows[0]
    print(f"\n{first.case}, {first.strategy}, order {first.order}: rate N^{rate(rows):.2f}")
    print("unknowns  error     estimate  effectivity  near  half-width  angle  steps  seconds")
    for r in rows:
        print(
            f"{r.unknowns:8d}  {r.error:.2e}  {r.estimate:.2e}  {r.effectivity:11.2f}  "
            f"{r.near:4.2f}  {r.half_width:10.1e}  {r.angle:5.1f}  {r.steps:5d}  {r.seconds:7.2f}"
        )


def draw_errors(path: Path, name: str, runs: dict[tuple[str, int], list[Row]]) -> None:
    """Log-log picture of errors against unknowns and against seconds."""
    figure = Figure(figsize=(12, 5), layout="constrained")
    left, right = figure.subplots(1, 2, sharey=True)
    for (strategy, order), rows in runs.items():
        style = {"color": f"C{order - 1}", "ls": "-" if strategy == "adaptive" else "--"}
        errors = [row.error for row in rows]
        left.loglog(
            [r.unknowns for r in rows],
            errors,
            "o",
            ms=3,
            label=f"{strategy}, order {order}",
            **style,
        )
        right.loglog([r.seconds for r in rows], errors, "o", ms=3, **style)
        if strategy == "adaptive":
            end = np.array([rows[-1].unknowns / 10, rows[-1].unknowns])
            left.loglog(
                end, 0.6 * errors[-1] * (end / end[-1]) ** (-order / 2), color="0.6", lw=0.8
            )
    left.set(title=name, xlabel="unknowns N", ylabel="relative error, energy norm")
    left.legend(fontsize=8, title="grey: N^(-p/2)", title_fontsize=8)
    right.set(title="time from geometry to solution", xlabel="seconds")
    for axes in (left, right):
        axes.grid(which="major", alpha=0.3)
    FigureCanvasAgg(figure).print_png(path)


def draw_meshes(path: Path, solutions: Sequence[Solution], zone: float) -> None:
    """Meshes of three levels, with close-ups of the zone."""
    chosen = [solutions[int(k)] for k in np.linspace(0, len(solutions) - 1, 3)]
    figure = Figure(figsize=(12, 8), layout="constrained")
    rows = figure.subplots(2, 3)
    ends = chosen[-1].transitions()
    centre = ends[np.argmax(ends[:, 0])] if len(ends) else chosen[-1].points.mean(axis=0)
    for column, solution in enumerate(chosen):
        corners = triangles(solution)
        x, y = corners[..., 0].ravel(), corners[..., 1].ravel()
        for axes in rows[:, column]:
            axes.triplot(x, y, np.arange(len(x)).reshape(-1, 3), color="C0", lw=0.4)
            axes.set_aspect("equal")
        rows[0, column].set_title(f"{solution.displacement.space.ndof} unknowns")
        rows[1, column].set(
            xlim=(centre[0] - 2 * zone, centre[0] + 2 * zone),
            ylim=(centre[1] - 2 * zone, centre[1] + 2 * zone),
        )
        if len(solution.transitions()):
            rows[1, column].plot(*solution.transitions().T, "r.", ms=6)
    rows[1, 0].set_ylabel("close-up, transition red")
    FigureCanvasAgg(figure).print_png(path)


def main(
    names: Sequence[str] = tuple(STUDIES),
    orders: Sequence[int] = (1, 2, 3, 4),
    folder: str | Path = "out",
) -> list[Row]:
    """Run the studies, print tables, write the CSV file and the pictures; return all rows."""
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    everything: list[Row] = []
    for name in names:
        study = STUDIES[name]()
        error = error_measure(study)
        runs: dict[tuple[str, int], list[Row]] = {}
        stem = name.replace(" ", "_").replace("=", "").replace(".", "")
        for order in orders:
            for strategy in ("uniform", "adaptive"):
                results = list(run(name, study, strategy, order, error))
                rows = runs[strategy, order] = [row for _, row in results]
                print_rows(rows)
                if (strategy, order) == ("adaptive", 2):
                    draw_meshes(folder / f"meshes_{stem}.png", [s for s, _ in results], study.zone)
        draw_errors(folder / f"errors_{stem}.png", name, runs)
        print(f"\n{name}: seconds to a relative error, adaptive\norder      1e-2     1e-3     1e-4")
        for order in orders:
            times = [seconds_to(runs["adaptive", order], 10.0**-k) for k in (2, 3, 4)]
            print(f"{order:5d}  " + "  ".join(f"{t:7.2f}" for t in times))
        everything += [row for rows in runs.values() for row in rows]
    with (folder / "adaptive_study.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow([field.name for field in fields(Row)])
        writer.writerows(astuple(row) for row in everything)
    return everything
