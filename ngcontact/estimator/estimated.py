"""A solution with the estimate of its error."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

from ..arrays import Array, root_of_squares
from ..solved import Solved
from .residual import Estimate, estimate


@dataclass(frozen=True, eq=False)
class Estimated(Solved):
    """Members of `Solution` that estimate its error, made when the first of them is asked for.

    Attributes
    ----------
    adaptive : bool
        Whether it is a level of `adapt`, whose estimate is needed anyway.
    """

    adaptive: bool = False

    @cached_property
    def _estimate(self) -> Estimate:
        self.work["estimates"] += 1
        return estimate(self)

    @property
    def estimated(self) -> bool:
        """Whether the error estimate has been computed already."""
        return "_estimate" in self.__dict__

    @property
    def indicators(self) -> Array:
        """Local error indicators eta_T, (ne,), root of an energy per unit thickness."""
        return self._estimate.indicators

    @property
    def estimate_parts(self) -> dict[str, Array]:
        """Squared contributions (ne,) to the indicators by origin, energy per thickness."""
        return self._estimate.parts

    @property
    def error_estimate(self) -> float:
        """Estimated A(u - u_h, u - u_h)^(1/2), root of an energy per unit thickness."""
        return root_of_squares(self.indicators)

    @property
    def relative_error_estimate(self) -> float:
        """Estimated error over the energy norm of u_h, dimensionless; 0 where both vanish."""
        if self.error_estimate == 0:
            return 0.0
        return self.error_estimate / self.energy_norm if self.energy_norm > 0 else float("inf")
