"""Numerical stability under stress: every module of `trials` tries one kind of it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # trials of algebra run without NGSolve
    from ngcontact import Solution

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


def solved(case: str, varied: str, solution: Solution, error: float, allowed: float) -> Outcome:
    """Outcome of a solve whose `error` against a reference may reach `allowed`."""
    residual = max(solution.residuals.values())
    return Outcome(case, varied, len(solution.steps), residual, float(error), allowed)


def refused(
    case: str, varied: str, kind: type[Exception], naming: str, run: Callable[[], object]
) -> Outcome:
    """Outcome of a call that must raise `kind` with a message that contains `naming`.

    Its error is 0 if it does, infinite if it returns or the message says something else.
    """
    error = float("inf")
    try:
        run()
    except kind as failure:
        error = 0.0 if naming in str(failure) else error
    return Outcome(case, f"{varied}: {kind.__name__}", 0, 0.0, error, 0.0)
