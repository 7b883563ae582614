"""Runs that several tests read, made once as solutions are immutable; what a run calls."""

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import lru_cache
from types import CodeType

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


@contextmanager
def recorded() -> Iterator[list[CodeType]]:
    """The code of every Python function called, in order."""
    calls, before = list[CodeType](), sys.getprofile()
    sys.setprofile(lambda frame, event, _: calls.append(frame.f_code) if event == "call" else None)
    try:
        yield calls
    finally:
        sys.setprofile(before)
