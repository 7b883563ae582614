"""A solution as one row of a table, in one line, and as a table in a notebook."""

from __future__ import annotations

import math

import numpy as np

from ..estimator import Measured
from ..problem import table

Number = int | float


def record_of(solution: Measured) -> dict[str, Number]:
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
        x, y = (solution.contact_force(number) + 0.0).tolist()  # no -0.0
        row |= {
            f"contact_{number}_force_x": x,
            f"contact_{number}_force_y": y,
            f"contact_{number}_peak_pressure": float(pair.pressure.max(initial=0.0)),
            f"contact_{number}_active": int(np.count_nonzero(pair.active)),
            f"contact_{number}_points": int(pair.gap.size),
        }
    for name, reaction in solution.reactions.items():
        x, y = (reaction + 0.0).tolist()
        row |= {f"reaction_{name}_x": x, f"reaction_{name}_y": y}
    row |= {f"residual_{name}": float(value) for name, value in solution.residuals.items()}
    return row | {f"work_{name}": int(count) for name, count in solution.work.items()}


def line_of(solution: Measured) -> str:
    """Unknowns, active points, steps, forces of all pairs; estimate and bound where known."""
    return ", ".join(f"{name} {value}" if name else value for name, value in facts(solution))


def forces(solution: Measured) -> str:
    """Sizes of the forces of all pairs, with the names of the secondaries if there are several."""
    contact = solution.problem.contact
    sizes = [_six_digits(np.hypot(*solution.contact_force(k))) for k in range(len(contact))]
    if len(contact) < 2:
        return "".join(sizes)
    return ", ".join(f"{pair.secondary} {size}" for pair, size in zip(contact, sizes, strict=True))


def _six_digits(size: float) -> str:
    """Always so many, that columns of neighbouring lines agree."""
    return f"{size:#.6g}".rstrip(".")


def facts(solution: Measured) -> list[tuple[str, str]]:
    """What is worth a word, by name; of one width in all lines of a run but for the last ones."""
    active = f"{np.count_nonzero(solution.active)}/{solution.active.size}"
    told = [
        ("order", f"{solution.order}"),
        ("", f"{solution.displacement.space.ndof:7d} unknowns"),
        ("", f"{active:>9} active"),
        ("", f"{len(solution.steps):2d} steps"),
    ]
    if solution.estimated or solution.adaptive:
        told.append(("estimate", f"{solution.relative_error_estimate:.2e}"))
    if solution.bounded:
        told.append(("bound", f"{solution.relative_error_bound:.2e}"))
    if solution.problem.contact:
        told.append(("force", forces(solution)))
    if solution.free_motions:
        told.append(("free:", "; ".join(map(str, solution.free_motions))))
    return told


def html_of(solution: Measured) -> str:
    """What a notebook shows: facts, then a line for each pair."""
    rows = [(name, value.strip()) for name, value in _named(solution)]
    about = table(("", ""), rows)
    if not solution.problem.contact:
        return about
    lines = []
    for number, (pair, contact) in enumerate(
        zip(solution.pairs, solution.problem.contact, strict=True)
    ):
        x, y = solution.contact_force(number) + 0.0
        peak = float(pair.pressure.max(initial=0.0))
        active = f"{np.count_nonzero(pair.active)}/{pair.gap.size}"
        force = f"({x:.6g}, {y:.6g})"
        lines.append((str(number), contact.named(), force, f"{peak:.6g}", active))
    return about + table(("contact", "of", "force", "peak pressure", "active"), lines)


def _named(solution: Measured) -> list[tuple[str, str]]:
    """Facts with a name each, without those of pairs."""
    words = (
        (name, value) if name else tuple(reversed(value.strip().split(" ", 1)))
        for name, value in facts(solution)
        if name != "force"
    )
    return [(name.rstrip(":"), value) for name, value in words]
