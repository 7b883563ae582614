"""A solution as one row of a table."""

from __future__ import annotations

import math

import numpy as np

from ..estimator import Measured

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
