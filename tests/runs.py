"""Runs that several tests read: solutions are immutable, so are estimates and bounds made once."""

from collections.abc import Callable
from functools import lru_cache

from drivers.reference.cases import Case
from ngcontact import Problem, Solution, adapt

KEPT = 2  # runs in memory at a time: some 20 to 50 MB each at 5000 unknowns, with bounds


@lru_cache(maxsize=KEPT)
def levels(case: Callable[[], Case | Problem], order: int, max_dofs: int) -> tuple[Solution, ...]:
    """All levels of `adapt` for what `case` poses."""
    posed = case()
    problem = posed.problem if isinstance(posed, Case) else posed
    return tuple(adapt(problem, order=order, max_dofs=max_dofs))


def solved(case: Callable[[], Case | Problem], order: int, max_dofs: int) -> Solution:
    """The last of them."""
    return levels(case, order, max_dofs)[-1]
