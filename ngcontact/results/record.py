"""A solution as a row of a table, in one line and in a notebook; the progress of a run."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Generator, Iterator
from typing import Any, TypeVar

import numpy as np

from ..estimator import Guaranteed
from ..problem import table

HEAD = ("level", "unknowns", "estimate", "seconds")
BAR_WIDTH = 20  # characters
MOTIONS_NAMED = 3  # free motions that a line names, at most
AXES = "xyz"

Number = int | float
Level = TypeVar("Level", bound=Guaranteed)


def record_of(solution: Guaranteed) -> dict[str, Number]:
    """A flat dict of numbers; see `Solution.record`."""
    solution.discrete.space.require_mesh()
    estimated = solution.estimated or solution.adaptive
    row: dict[str, Number] = {
        "order": int(solution.order),
        "elements": int(solution.mesh.ne),
        "unknowns": int(solution.displacement.space.ndof),
        "points": len(solution.points),
        "active": int(np.count_nonzero(solution.active)),
        "steps": len(solution.steps),
        "energy": float(solution.energy),
        "energy_norm": float(solution.energy_norm),
        "error_estimate": float(solution.error_estimate) if estimated else math.nan,
        "relative_error_estimate": (
            float(solution.relative_error_estimate) if estimated else math.nan
        ),
        "error_bound": float(solution.error_bound) if solution.bounded else math.nan,
        "relative_error_bound": (
            float(solution.relative_error_bound) if solution.bounded else math.nan
        ),
    }
    for number, pair in enumerate(solution.pairs):
        force = (solution.contact_force(number) + 0.0).tolist()  # no -0.0
        row |= {f"contact_{number}_force_{axis}": x for axis, x in zip(AXES, force, strict=False)}
        row |= {
            f"contact_{number}_peak_pressure": float(pair.pressure.max(initial=0.0)),
            f"contact_{number}_active": int(np.count_nonzero(pair.active)),
            f"contact_{number}_points": int(pair.gap.size),
        }
    for name, reaction in solution.reactions.items():
        parts = zip(AXES, (reaction + 0.0).tolist(), strict=False)
        row |= {f"reaction_{name}_{axis}": x for axis, x in parts}
    row |= {f"residual_{name}": float(value) for name, value in solution.residuals.items()}
    return row | {f"work_{name}": int(count) for name, count in solution.work.items()}


def line_of(solution: Guaranteed) -> str:
    """Unknowns, active points, steps, forces of all pairs; estimate and bound where known."""
    return ", ".join(f"{name} {value}" if name else value for name, value in facts(solution))


def facts(solution: Guaranteed) -> list[tuple[str, str]]:
    """Facts about a solution by name; of one width in all lines of a run but for the last ones."""
    active = f"{np.count_nonzero(solution.active)}/{solution.active.size}"
    entries = [
        ("order", f"{solution.order}"),
        ("", f"{solution.displacement.space.ndof:7d} unknowns"),
        ("", f"{active:>9} active"),
        ("", f"{len(solution.steps):2d} steps"),
    ]
    if solution.estimated or solution.adaptive:
        entries.append(("estimate", f"{solution.relative_error_estimate:.2e}"))
    if solution.bounded:
        entries.append(("bound", f"{solution.relative_error_bound:.2e}"))
    contact = solution.problem.contact
    # Always six digits, that columns of neighbouring lines agree.
    sizes = [
        f"{math.hypot(*solution.contact_force(k)):#.6g}".rstrip(".") for k in range(len(contact))
    ]
    if len(contact) > 1:
        sizes = [f"{pair.secondary} {size}" for pair, size in zip(contact, sizes, strict=True)]
    if sizes:
        entries.append(("force", ", ".join(sizes)))
    motions = solution.free_motions
    if len(motions) > MOTIONS_NAMED:
        entries.append(("free:", f"{len(motions)} rigid motions (free_motions)"))
    elif motions:
        entries.append(("free:", "; ".join(map(str, motions))))
    return entries


def html_of(solution: Guaranteed) -> str:
    """Table for notebooks: facts, then a line for each pair."""
    rows = []
    for name, value in facts(solution):
        if not name:  # as "12 steps"
            value, name = value.strip().split(" ", 1)
        if name != "force":
            rows.append((name.rstrip(":"), value.strip()))
    about = table(("", ""), rows)
    if not solution.problem.contact:
        return about
    lines = []
    for number, (pair, contact) in enumerate(
        zip(solution.pairs, solution.problem.contact, strict=True)
    ):
        force = ", ".join(f"{x:.6g}" for x in solution.contact_force(number) + 0.0)
        peak = float(pair.pressure.max(initial=0.0))
        active = f"{np.count_nonzero(pair.active)}/{pair.gap.size}"
        lines.append((str(number), contact.named(), f"({force})", f"{peak:.6g}", active))
    return about + table(("contact", "of", "force", "peak pressure", "active"), lines)


def with_progress(
    solutions: Iterator[Level], tolerance: float | None, max_dofs: float
) -> Generator[Level]:
    """The levels as they come, each reported when it is done.

    A line of `sys.stderr` each, or one table in a notebook that grows; with a bar that is full at
    the tolerance, or at `max_dofs` where there is none.
    """
    rows: list[tuple[str, ...]] = []
    show = _notebook() or _terminal
    first = math.nan
    started = time.perf_counter()
    for solution in solutions:
        unknowns, error = solution.displacement.space.ndof, solution.relative_error_estimate
        if solution.bounded:
            error = solution.relative_error_bound
        first = first if rows else error
        now = time.perf_counter()
        row = (str(len(rows)), str(unknowns), f"{error:.2e}", f"{now - started:.2f}")
        rows.append(row)
        show(rows, _share(unknowns / max_dofs, first, error, tolerance))
        yield solution
        started = time.perf_counter()  # what the caller does in between does not count


def _share(used: float, first: float, error: float, tolerance: float | None) -> float:
    """Share of the run that is done, in [0, 1]: of `tolerance`'s digits, or of the unknowns."""
    if tolerance is None:
        return min(used, 1.0)
    if not error > tolerance:
        return 1.0
    return min(max(math.log(first / error) / math.log(first / tolerance), 0.0), 1.0)


def _terminal(rows: list[tuple[str, ...]], share: float) -> None:
    """The last of the rows as a line, after a head."""
    done = round(BAR_WIDTH * share)
    lines = [HEAD] if len(rows) == 1 else []
    for row in [*lines, rows[-1]]:
        bar = "" if row is HEAD else "#" * done + "." * (BAR_WIDTH - done)
        sys.stderr.write("{:>5s} {:>9s} {:>9s} {:>8s}  {}\n".format(*row, bar))
    sys.stderr.flush()


def _notebook() -> Any:
    """Display of rows in the notebook that runs this, or None."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if type(shell).__name__ != "ZMQInteractiveShell":
        return None
    from IPython.display import HTML, display

    handle = display(HTML(""), display_id=True)

    def show(rows: list[tuple[str, ...]], share: float) -> None:
        bar = f'<progress value="{share:.3f}" max="1"></progress>'
        handle.update(HTML(table(HEAD, rows) + bar))

    return show
