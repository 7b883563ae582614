"""A solution as one row of a table."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Protocol

import numpy as np

from ..arrays import Array
from ..contact import ContactState
from .values import Solved


class _Recorded(Solved, Protocol):
    """What of a solution stands in its record."""

    @property
    def pairs(self) -> Sequence[ContactState]: ...
    @property
    def steps(self) -> list[int]: ...
    @property
    def energy(self) -> float: ...
    @property
    def energy_norm(self) -> float: ...
    @property
    def adaptive(self) -> bool: ...
    @property
    def bounded(self) -> bool: ...
    @property
    def error_estimate(self) -> float: ...
    @property
    def relative_error_estimate(self) -> float: ...
    @property
    def error_bound(self) -> float: ...
    @property
    def relative_error_bound(self) -> float: ...
    @property
    def reactions(self) -> dict[str, Array]: ...
    @property
    def residuals(self) -> dict[str, float]: ...
    @property
    def work(self) -> dict[str, int]: ...
    def contact_force(self, pair: int = 0) -> Array: ...


Number = int | float


def record_of(solution: _Recorded) -> dict[str, Number]:
    """A flat dict of numbers; see `Readable.record`."""
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
