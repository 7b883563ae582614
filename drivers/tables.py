"""What the demonstrations print: every level of an adaptive run, and a comparison at its end."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping
from typing import TypeVar

from ngcontact import Solution

Q = TypeVar("Q")


def last_level(
    levels: Iterable[Solution],
    measured: Callable[[Solution], Q],
    columns: Mapping[str, Callable[[Q], str]],
) -> tuple[Solution, Q]:
    """Print all levels as they come; the last one and what is `measured` of it.

    `columns` have a heading and an entry each, which may be wider.
    """
    headings = "  ".join(columns)
    print(f"unknowns  active  steps  estimate  {headings}  seconds")
    started = time.perf_counter()
    for solution in levels:
        estimate = solution.relative_error_estimate
        computed = measured(solution)
        now = time.perf_counter()
        entries = "  ".join(f"{entry(computed):>{len(head)}}" for head, entry in columns.items())
        print(
            f"{solution.displacement.space.ndof:8d}  {solution.active.sum():6d}  "
            f"{len(solution.steps):5d}  {estimate:.2e}  {entries}  {now - started:7.2f}"
        )
        started = now
    return solution, computed


def print_comparison(ratio: float, rows: Mapping[str, tuple[float, float]]) -> None:
    """Print computed and expected values beside each other, at a `ratio` a/R."""
    width = max(map(len, rows))
    print(f"\n{f'At a/R = {ratio:.4f}':{width}s}   computed      Hertz  difference")
    for name, (a, b) in rows.items():
        print(f"{name:{width}s} {a:10.4f} {b:10.4f}  {(a / b - 1) * 100:+.3f} %")
