"""Contact rows of several pairs together, HH81 (2.3), (2.5), (2.10)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp

from ..arrays import Index
from ..constraints import Rows, concatenated, no_rows
from ..fem import BoundaryTrace
from ..lagrange import lagrange
from ..triplets import from_triplets
from .line import ContactLine, without
from .projection import snap
from .state import by_line


def _coupling(line: ContactLine, trace: BoundaryTrace) -> sp.csr_array:
    """Basis functions (m, n) of the facing nodes at the partner points; none of an obstacle."""
    share = lagrange(trace.order, snap(line.partner_s, trace.order))
    share[line.partner < 0] = 0.0
    row, place = np.nonzero(share)
    facing = trace.nodes[line.partner[row], place]
    return from_triplets(share[row, place], row, facing, (len(share), trace.space.ndof))


def _rows(line: ContactLine, trace: BoundaryTrace) -> Rows:
    """Rows of one contact line."""
    return Rows(
        node=line.node,
        direction=line.direction,
        coupling=_coupling(line, trace),
        g=line.gap,  # (2.10): eps(C_j); (2.3), (2.5): 0 where the bodies touch
        equality=np.full(len(line.node), line.contact.bilateral),
    )


def joined(lines: list[ContactLine], trace: BoundaryTrace) -> Rows:
    """Rows of all lines, in order, on the nodes of the trace's space."""
    if not lines:
        return no_rows(trace.space.ndof)
    return concatenated([_rows(line, trace) for line in lines])


def kept_lines(lines: list[ContactLine], kept: Index) -> list[ContactLine]:
    """The lines with the points that carry the rows `kept` (k,) of all lines together."""
    dropped = np.ones(sum(len(line.node) for line in lines), dtype=bool)
    dropped[kept] = False
    parts = zip(lines, by_line(lines, dropped), strict=True)
    return [without(line, np.flatnonzero(part)) for line, part in parts]


def merged(lines: list[ContactLine], rows: Rows) -> tuple[list[ContactLine], Rows]:
    """Lines and rows with one row for each left side: the tightest of those that repeat it."""
    number = rows.repeated()
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
