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
    infinite : ndarray (k, 2) or None
        Corners at which the true one is infinite; the value is the largest away from them.
    """

    name: str
    value: float
    error: float
    kind: Literal["guaranteed", "estimated", "none"]
    place: Array | None = None
    proved: float | None = None
    infinite: Array | None = None

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
        if self.infinite is not None and len(self.infinite):
            several = f" and {len(self.infinite) - 3} more" if len(self.infinite) > 3 else ""
            corners = ", ".join(map(_point, self.infinite[:3]))
            at += f"  away from where it is infinite: {corners}{several}"
        return f"{self.name:22s} {self.value:14.7g} {bar}  {self.kind:10s}{at}".rstrip()


@dataclass(frozen=True, eq=False)
class Singular:
    """Corners of infinite stress."""

    places: Array  # (k, 2), lengths
    reach: Array  # (k,), how far from each the stress is its own, or not resolved, lengths
    pressed: Mask  # (k,), corners at which bodies press on each other

    @property
    def distinct(self) -> Array:
        """Places (j, 2), each once where several bodies meet."""
        return np.unique(self.places, axis=0)

    def near(self, points: Array, pressed: bool = False) -> Mask:
        """Mask (m,) of the `points` (m, 2) within the reach of a corner."""
        result = np.zeros(len(points), dtype=bool)
        for place, r, of_contact in zip(self.places, self.reach, self.pressed, strict=True):
            if of_contact or not pressed:
                result |= np.linalg.norm(points - place, axis=1) <= r
        return result


def unknown(
    name: str, value: float, place: Array | None = None, infinite: Array | None = None
) -> Quantity:
    """A figure without a bar, at `place` (2,), infinite at `infinite` (k, 2)."""
    return Quantity(name, value, math.nan, "none", place, infinite=infinite)


def error_of_largest(value: float, samples: Array, errors: Array) -> float:
    """Largest distance of a `value` from the largest of `samples` (k,) known to `errors` (k,).

    At most: the largest lies between those of samples - errors and of samples + errors.
    """
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
