"""A figure with a bar of its error, tables of them, and corners where figures are infinite."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ...arrays import Array, Mask

POINT_ROUND_OFF = 1e-12  # of coordinates that are printed, relative to the largest


@dataclass(frozen=True, eq=False)
class Singular:
    """Corners of infinite stress."""

    places: Array  # (k, 2), lengths
    reach: Array  # (k,), how far from each the stress is its own, lengths
    pressed: Mask  # (k,), corners at which bodies press on each other

    def distinct(self, chosen: Mask) -> Singular:
        """The `chosen` (k,), each place once where several bodies meet."""
        places, number = np.unique(self.places[chosen], axis=0, return_inverse=True)
        reach, pressed = np.zeros(len(places)), np.zeros(len(places), dtype=bool)
        np.maximum.at(reach, number.ravel(), self.reach[chosen])
        np.logical_or.at(pressed, number.ravel(), self.pressed[chosen])
        return Singular(places, reach, pressed)

    def near(self, points: Array, step: Array | float = 0.0) -> Mask:
        """Mask (m,) of the `points` (m, 2) within the reach of a corner, less a `step` (m,)."""
        result = np.zeros(len(points), dtype=bool)
        for place, r in zip(self.places, self.reach, strict=True):
            result |= np.hypot(*(points - place).T) + step <= r
        return result

    def __str__(self) -> str:
        """How far from which of them a value is the largest."""
        k, (low, high) = len(self.places) - 3, (self.reach.min(), self.reach.max())
        away = f"{low:.3g}" if low == high else f"{low:.3g} to {high:.3g}"
        corners = ", ".join(map(_point, self.places[:3])) + (f" and {k} more" if k > 0 else "")
        return f"{away} away from where it is infinite: {corners}"


@dataclass(frozen=True, eq=False)
class Quantity:
    """One figure and its bar.

    Attributes
    ----------
    name : str
        What it is.
    value : float
        In the units of the data, forces and energies per unit thickness.
    error : float
        At most or about so far from the truth, in the same unit; see `kind`.
    kind : str
        "guaranteed": the true value of the problem lies within `error` of `value`; "estimated": as
        a rule it does; "none": nothing is known of the error, which is NaN.
    place : ndarray (d,) or None
        Where it is.
    proved : float or None
        The proved error beside an estimated one; None where none is proved.
    singular : Singular or None
        Corners at which the true one is infinite, and their `reach` (k,), a tenth of the way to
        the next corner of the drawing: the value is the largest farther away.
    """

    name: str
    value: float
    error: float = math.nan
    kind: Literal["guaranteed", "estimated", "none"] = "none"
    place: Array | None = None
    proved: float | None = None
    singular: Singular | None = None

    @property
    def guaranteed(self) -> bool:
        """Whether `error` is proved."""
        return self.kind == "guaranteed"

    def with_proof(self, proved: float) -> Quantity:
        """With a proved error, the error itself where the estimate is no less."""
        if self.kind == "estimated" and self.error < proved:
            return replace(self, proved=proved)
        return replace(self, error=proved, kind="guaranteed", proved=proved)

    def __str__(self) -> str:
        """One line: value, bar, how sure it is, where."""
        bar = " " * 11 if self.kind == "none" else f"+- {self.error:8.2g}"
        at = "" if self.place is None else f"  at {_point(self.place)}"
        if self.kind == "estimated" and self.proved is not None:
            at += f"  (guaranteed +- {self.proved:.2g})"
        if self.singular is not None and len(self.singular.places):
            at += f"  {self.singular}"
        return f"{self.name:22s} {self.value:14.7g} {bar}  {self.kind:10s}{at}".rstrip()


def error_of_largest(value: float, samples: Array, errors: Array) -> float:
    """How far a `value` is at most from the largest of `samples` (k,) known to `errors` (k,)."""
    above, below = (samples + errors).max() - value, value - (samples - errors).max()
    return float(max(above, below))


def _point(x: Array) -> str:
    """A point `x` (d,) in brackets, round-off of its largest coordinate as 0."""
    x = np.where(np.abs(x) > POINT_ROUND_OFF * np.abs(x).max(), x, 0.0)
    return f"({', '.join(f'{value:.6g}' for value in x)})"


@dataclass(frozen=True, eq=False)
class Quantities:
    """The quantities of one pair; printed as a table, found by name.

    Attributes
    ----------
    rows : tuple of Quantity
        In order.
    note : str
        Remarks on all: why nothing is guaranteed, along which direction the force is given.
    """

    rows: tuple[Quantity, ...]
    note: str = ""

    def __iter__(self) -> Iterator[Quantity]:
        """Rows in order."""
        return iter(self.rows)

    def __getitem__(self, name: str) -> Quantity:
        """The first row of that name."""
        for row in self.rows:
            if row.name == name:
                return row
        raise KeyError(f"{name!r} is none of {[row.name for row in self.rows]}")

    def __str__(self) -> str:
        """A table, with the note below."""
        return "\n".join([*map(str, self.rows), *([self.note] if self.note else [])])

    __repr__ = __str__
