"""Checks of geometry parameters: the message says what, the value, and what would be right.

Values of another type raise ``TypeError``, values out of range ``ValueError``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from numbers import Integral, Real

import numpy as np


def finite(name: str, value: object) -> float:
    """Finite real number."""
    if not isinstance(value, Real) or isinstance(value, bool):
        raise TypeError(f"{name} = {value!r}: expected a real number, not {type(value).__name__}")
    number = float(value)
    if not math.isfinite(number):
        raise ValueError(f"{name} = {value!r}: expected a finite number")
    return number


def positive(name: str, value: object) -> float:
    """Finite real number above zero."""
    number = finite(name, value)
    if number <= 0:
        raise ValueError(f"{name} = {value!r}: expected a positive length")
    return number


def above(name: str, value: object, limit_name: str, limit: float) -> float:
    """Finite real number strictly above a limit that another parameter sets."""
    number = finite(name, value)
    if number <= limit:
        raise ValueError(f"{name} = {value!r}: expected more than {limit_name} = {limit!r}")
    return number


def flag(name: str, value: object) -> bool:
    """Truth value."""
    if not isinstance(value, bool | np.bool_):
        raise TypeError(f"{name} = {value!r}: expected True or False")
    return bool(value)


def count(name: str, value: object, least: int) -> int:
    """Whole number, at least `least`."""
    if not isinstance(value, Integral) or isinstance(value, bool):
        raise TypeError(f"{name} = {value!r}: expected a whole number")
    if value < least:
        raise ValueError(f"{name} = {value!r}: expected at least {least}")
    return int(value)


def increasing_line(name: str, value: object) -> list[tuple[float, float]]:
    """Two or more vertices (x, y) of a polygonal line that runs strictly to the right."""
    right = "expected at least two vertices (x, y) with strictly increasing x"
    if not isinstance(value, Sequence | np.ndarray) or isinstance(value, str):
        raise TypeError(f"{name} = {value!r}: {right}")
    line: list[tuple[float, float]] = []
    for k, vertex in enumerate(value):
        if not isinstance(vertex, Sequence | np.ndarray) or len(vertex) != 2:
            raise TypeError(f"{name}[{k}] = {vertex!r}: {right}")
        x, y = (finite(f"{name}[{k}][{i}]", vertex[i]) for i in range(2))
        if line and x <= line[-1][0]:
            raise ValueError(f"{name}[{k}] = {vertex!r} follows x = {line[-1][0]!r}: {right}")
        line.append((x, y))
    if len(line) < 2:
        raise ValueError(f"{name} = {value!r}: {right}")
    return line
