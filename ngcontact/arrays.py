"""Types of arrays, factorisations as functions, and squares that stay in the range of numbers."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

Array: TypeAlias = NDArray[np.float64]
Index: TypeAlias = NDArray[np.intp]
Mask: TypeAlias = NDArray[np.bool_]
Integers: TypeAlias = NDArray[np.integer]
Solve = Callable[[Array], Array]
Factor = Callable[[Mask], Solve]


def power_of_two(values: Array) -> float:
    """The power of 2 below the largest in size of `values` (...,); 1 where all vanish."""
    largest = float(np.abs(values).max(initial=0.0))
    if not 0 < largest < math.inf:
        return 1.0
    return math.ldexp(1.0, max(math.frexp(largest)[1] - 1, -1000))  # its inverse is finite, too


def root_of_squares(values: Array) -> float:
    """Root of the sum of squares of `values` (...,), in their unit.

    The squares may be too large or too small for a float.
    """
    unit = power_of_two(values)
    return unit * float(np.sqrt(((values / unit) ** 2).sum()))
