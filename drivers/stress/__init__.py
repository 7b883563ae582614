"""Numerical stability under stress: random `trials`, and problems that tests share with them."""

from __future__ import annotations

from dataclasses import dataclass

RESIDUAL = 1e-10  # of the optimality conditions, dimensionless; round-off leaves 1e-16 to 1e-12


@dataclass(frozen=True)
class Outcome:
    """One line of the table: what was solved and what was varied, with what came of it.

    `steps` of Newton's method are 0 where an error was expected, `residual` is the worst one of the
    optimality conditions (`Solution.residuals`), `error` the one against the reference and
    `allowed` the largest that passes, all dimensionless.
    """

    case: str
    varied: str
    steps: int
    residual: float
    error: float
    allowed: float

    @property
    def passed(self) -> bool:
        """Whether both the residual and the error are small enough; NaN is not."""
        return self.residual <= RESIDUAL and self.error <= self.allowed
