"""A figure with a bar of its error, and tables of them."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

from ...arrays import Array


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
    place : ndarray (2,) or None
        Where it is.
    """

    name: str
    value: float
    error: float
    kind: Literal["guaranteed", "estimated", "none"]
    place: Array | None = None

    @property
    def guaranteed(self) -> bool:
        """Whether the error is proved."""
        return self.kind == "guaranteed"

    def __str__(self) -> str:
        """One line: value, bar, how sure it is, where."""
        bar = " " * 11 if self.kind == "none" else f"+- {self.error:8.2g}"
        at = "" if self.place is None else f"  at ({self.place[0]:.6g}, {self.place[1]:.6g})"
        return f"{self.name:22s} {self.value:14.7g} {bar}  {self.kind:10s}{at}".rstrip()


@dataclass(frozen=True, eq=False)
class Quantities:
    """The quantities of one pair; printed as a table, found by name.

    Attributes
    ----------
    rows : tuple of Quantity
        In order.
    note : str
        Why nothing is guaranteed; empty where something is.
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
