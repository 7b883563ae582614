"""Progress of an adaptive run, level by level, in a terminal or a notebook."""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Generator, Iterator
from typing import Any, TypeVar

from ..estimator import Measured
from ..problem import table

HEAD = ("level", "unknowns", "estimate", "seconds")
WIDTH = 20  # characters of a bar


Level = TypeVar("Level", bound=Measured)


def with_progress(
    solutions: Iterator[Level], tolerance: float | None, max_dofs: float
) -> Generator[Level]:
    """The same levels, each told when it is done.

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
    """How much of the way is done, in [0, 1]: of the digits asked for, or of the unknowns."""
    if tolerance is None:
        return min(used, 1.0)
    if not error > tolerance:
        return 1.0
    return min(max(math.log(first / error) / math.log(first / tolerance), 0.0), 1.0)


def _terminal(rows: list[tuple[str, ...]], share: float) -> None:
    """The last of the rows as a line, after a head."""
    done = round(WIDTH * share)
    lines = [HEAD] if len(rows) == 1 else []
    for row in [*lines, rows[-1]]:
        bar = "" if row is HEAD else "#" * done + "." * (WIDTH - done)
        sys.stderr.write("{:>5s} {:>9s} {:>9s} {:>8s}  {}\n".format(*row, bar))
    sys.stderr.flush()


def _notebook() -> Any:
    """What shows rows in the notebook that runs this, or None."""
    shell = sys.modules["IPython"].get_ipython() if "IPython" in sys.modules else None
    if type(shell).__name__ != "ZMQInteractiveShell":
        return None
    from IPython.display import HTML, display

    handle = display(HTML(""), display_id=True)

    def show(rows: list[tuple[str, ...]], share: float) -> None:
        bar = f'<progress value="{share:.3f}" max="1"></progress>'
        handle.update(HTML(table(HEAD, rows) + bar))

    return show
