"""Contact rows of several pairs together, HH81 (2.3), (2.5), (2.10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..arrays import Index
from ..constraints import Rows
from ..fem import BoundaryTrace
from ..lagrange import lagrange
from .line import ContactLine, without
from .projection import snap
from .state import by_line


def _rows(line: ContactLine, trace: BoundaryTrace) -> Rows:
    """Rows of one contact line."""
    share = lagrange(trace.order, snap(line.partner_s, trace.order))
    share[line.partner < 0] = 0.0
    return Rows(
        node=line.node,
        direction=line.direction,
        partner=trace.nodes[line.partner],
        share=share,
        g=line.gap,
        equality=np.full(len(line.node), line.contact.bilateral),
    )


def joined(lines: list[ContactLine], trace: BoundaryTrace) -> Rows:
    """Rows of all lines, in order."""
    rows = [_rows(line, trace) for line in lines]
    if rows:
        return Rows(
            *(np.concatenate([getattr(r, name) for r in rows]) for name in Rows.__annotations__)
        )
    none = np.zeros(0, dtype=np.intp)
    shape = (0, trace.order + 1)
    return Rows(
        node=none,
        direction=np.zeros((0, 2)),
        partner=np.zeros(shape, dtype=np.intp),
        share=np.zeros(shape),
        g=np.zeros(0),
        equality=np.zeros(0, dtype=bool),
    )


def kept_lines(lines: list[ContactLine], kept: Index) -> list[ContactLine]:
    """The lines with the points that carry the rows `kept` of all lines together."""
    dropped = np.ones(sum(len(line.node) for line in lines), dtype=bool)
    dropped[kept] = False
    parts = zip(lines, by_line(lines, dropped), strict=True)
    return [without(line, np.flatnonzero(part)) for line, part in parts]


def merged(lines: list[ContactLine], rows: Rows, n: int) -> tuple[list[ContactLine], Rows]:
    """Lines and rows with one row for each left side: the tightest of those that repeat it."""
    number = rows.repeated(n)
    first = np.unique(number)
    if len(first) == len(number):
        return lines, rows
    g, weight = rows.g.copy(), np.concatenate([line.weight for line in lines])
    equality = np.zeros(len(g), dtype=bool)
    np.logical_or.at(equality, number, rows.equality)
    # An equality is the tightest; what another pair at that node asks for follows or is refused.
    tight = np.where(rows.equality | ~equality[number], rows.g, np.inf)
    g[first] = np.inf
    np.minimum.at(g, number, tight)
    repeated = number != np.arange(len(number))
    np.add.at(weight, number[repeated], weight[repeated])
    parts = zip(lines, by_line(lines, weight), strict=True)
    lines = [replace(line, weight=part) for line, part in parts]
    return kept_lines(lines, first), replace(rows, g=g, equality=equality).select(first)
