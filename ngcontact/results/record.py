"""A solution as a row of a table and in one line; the progress of a run."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Generator, Iterator
from typing import TypeVar

import numpy as np

from ..estimator import Guaranteed

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
    }
    for name, made in (("estimate", estimated), ("bound", solution.bounded)):
        for error in (f"error_{name}", f"relative_error_{name}"):
            row[error] = float(getattr(solution, error)) if made else math.nan
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
    """One line, see `Solution`; of one width in a run but for the last entries."""
    active = f"{np.count_nonzero(solution.active)}/{solution.active.size}"
    entries = [
        f"order {solution.order}",
        f"{solution.displacement.space.ndof:7d} unknowns",
        f"{active:>9} active",
        f"{len(solution.steps):2d} steps",
    ]
    if solution.estimated or solution.adaptive:
        entries.append(f"estimate {solution.relative_error_estimate:.2e}")
    if solution.bounded:
        entries.append(f"bound {solution.relative_error_bound:.2e}")
    contact = solution.problem.contact
    # Always six digits, that columns of neighbouring lines agree.
    sizes = [
        f"{math.hypot(*solution.contact_force(k)):#.6g}".rstrip(".") for k in range(len(contact))
    ]
    if len(contact) > 1:
        sizes = [f"{pair.secondary} {size}" for pair, size in zip(contact, sizes, strict=True)]
    if sizes:
        entries.append("force " + ", ".join(sizes))
    motions = solution.free_motions
    if len(motions) > MOTIONS_NAMED:
        entries.append(f"free: {len(motions)} rigid motions (free_motions)")
    elif motions:
        entries.append("free: " + "; ".join(map(str, motions)))
    return ", ".join(entries)


def with_progress(solutions: Iterator[Level]) -> Generator[Level]:
    """The levels as they come, each with a line of `sys.stderr` when it is done."""
    started = time.perf_counter()
    for number, solution in enumerate(solutions):
        seconds = time.perf_counter() - started
        sys.stderr.write(f"level {number}: {line_of(solution)}, {seconds:.2f} s\n")
        sys.stderr.flush()
        yield solution
        started = time.perf_counter()  # what the caller does in between does not count
