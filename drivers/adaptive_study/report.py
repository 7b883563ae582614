"""The tables of docs/adaptivity.md from the rows of all runs."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

from drivers.adaptive_study.runs import Row, rate, seconds_to
from drivers.tables import table

Runs = dict[tuple[str, int, str], list[Row]]


def tables(rows: Sequence[Row]) -> Iterator[str]:
    """Yield the tables in Markdown: rates, seconds, effectivities, half-widths."""
    runs: Runs = {}
    for row in rows:
        runs.setdefault((row.case, row.order, row.strategy), []).append(row)
    yield _rates(runs)
    yield _seconds(runs)
    yield _effectivities(runs)
    yield _half_widths(runs)


def _rates(runs: Runs) -> str:
    """Exponents of N, both strategies side by side."""
    lines = []
    for (case, order, strategy), rows in runs.items():
        if strategy == "adaptive":
            uniform = rate(runs[case, order, "uniform"])
            lines.append((case, order, f"{uniform:.2f}", f"{rate(rows):.2f}", f"{-order / 2:.1f}"))
    return table(("case", "order", "uniform", "adaptive", "optimal"), lines)


def _seconds(runs: Runs) -> str:
    """Seconds of adaptive runs to relative errors of 1e-2, 1e-3 and 1e-4, orders 2 and above."""
    lines = []
    for (case, order, strategy), rows in runs.items():
        if strategy == "adaptive" and order > 1:
            times = [seconds_to(rows, 10.0**-k) for k in (2, 3, 4)]
            lines.append((case, order, *("-" if math.isnan(t) else f"{t:.2f}" for t in times)))
    return table(("case", "order", "1e-2", "1e-3", "1e-4"), lines)


def _effectivities(runs: Runs) -> str:
    """Least and greatest ratio of estimate to error after the third level of adaptive runs."""
    orders = sorted({order for _, order, _ in runs})
    lines = []
    for case in dict.fromkeys(case for case, _, _ in runs):
        ranges = []
        for order in orders:
            values = [row.effectivity for row in runs[case, order, "adaptive"][3:]]
            ranges.append(f"{min(values):.1f} - {max(values):.1f}" if values else "-")
        lines.append((case, *ranges))
    return table(("case", *(f"order {order}" for order in orders)), lines)


def _half_widths(runs: Runs) -> str:
    """Relative errors of the half-width, some levels of each order, where it is known."""
    lines = []
    for (case, order, strategy), rows in runs.items():
        if case == "hertz a=0.3" and strategy == "adaptive" and order > 1:
            known = [row for row in rows if row.half_width == row.half_width]
            for row in known[len(known) // 2 :: 2]:
                lines.append((order, row.unknowns, f"{row.half_width:.1e}"))
    return table(("order", "N", "relative error"), lines)
