"""Doerfler marking. NumPy only."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Mask

SUM_ROUND_OFF = 1e-14  # share of a sum that round-off may keep from being carried
# Binary ones in which squares are compared: those that differ by round-off are one number.
COMPARED_DIGITS = 30


def doerfler(indicators: Array, theta: float) -> Mask:
    """Smallest set of elements that carries the share `theta` of the squared indicators.

    Of equal ones the first are marked, also where round-off makes a difference: elements that are
    mirror images of each other, or parts of one, have the same indicators on any machine.

    Of `indicators` (ne,), not negative, with `theta` in (0, 1], a mask (ne,); none where all
    indicators vanish.

    Examples
    --------
    >>> doerfler(np.array([1.0, 3.0, 2.0]), 0.6)
    array([False,  True, False])
    """
    squares = (indicators / max(indicators.max(initial=0.0), np.finfo(float).tiny)) ** 2
    mantissa, exponent = np.frexp(squares)
    compared = np.ldexp(np.round(np.ldexp(mantissa, COMPARED_DIGITS)), exponent - COMPARED_DIGITS)
    order = np.argsort(-compared, kind="stable")
    carried = np.cumsum(squares[order])
    marked = np.zeros(len(indicators), dtype=bool)
    if carried.size and carried[-1] > 0:
        count = np.searchsorted(carried, theta * carried[-1] * (1 - SUM_ROUND_OFF)) + 1
        marked[order[:count]] = True
    return marked
