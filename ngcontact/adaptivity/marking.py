"""Doerfler marking. NumPy only."""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Mask

SPARE = 1e-14  # share of a sum that round-off may keep from being carried


def doerfler(indicators: Array, theta: float) -> Mask:
    """Smallest set of elements that carries the share `theta` of the squared indicators.

    Parameters
    ----------
    indicators : ndarray (ne,)
        Local error indicators, not negative.
    theta : float
        Share in (0, 1].

    Returns
    -------
    ndarray of bool (ne,)
        The marked elements; none where all indicators vanish.

    Examples
    --------
    >>> doerfler(np.array([1.0, 3.0, 2.0]), 0.6)
    array([False,  True, False])
    """
    squares = (indicators / max(indicators.max(initial=0.0), np.finfo(float).tiny)) ** 2
    order = np.argsort(-squares, kind="stable")
    carried = np.cumsum(squares[order])
    marked = np.zeros(len(indicators), dtype=bool)
    if carried.size and carried[-1] > 0:
        count = np.searchsorted(carried, theta * carried[-1] * (1 - SPARE)) + 1
        marked[order[:count]] = True
    return marked
