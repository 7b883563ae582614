"""How a picture is made: what a user chooses, checked before any work."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import ngsolve as ng
import numpy as np

from ...arrays import Array

# Colours of Okabe and Ito, told apart with any colour vision, and marks for those who print grey.
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
MARKS = ("o", "s", "^", "D", "v", "P", "X")
RISING, SIGNED = "viridis", "RdBu_r"  # colour maps, told apart with any colour vision
KINDS = ("length", "stress")  # what has a unit

Unit = str | tuple[str, float]
Profile = Callable[[Array], Any] | tuple[Any, Any]


@dataclasses.dataclass(frozen=True, eq=False)
class Style:
    """What a picture shows, and how.

    Attributes
    ----------
    scale : float, optional
        Factor of the displacement; None chooses one.
    field : str or ng.CoefficientFunction
        What colours show.
    limits : tuple of float, optional
        Ends of the colour scale, in the unit of the data; None chooses them.
    units : mapping
        Of "length" and "stress": a name, or a name and its size in the unit of the data.
    profile : mapping
        What is drawn over the pressure, by label: functions of the coordinate (k,) with pressures
        (k,) as values, or two arrays, coordinates and pressures, in the unit of the data.
    mesh : bool
        Whether edges of elements are drawn.
    mirror : str, optional
        Boundary at which bodies are mirrored, a line of symmetry.
    """

    scale: float | None = None
    field: str | ng.CoefficientFunction = "von_mises"
    limits: tuple[float, float] | None = None
    units: Mapping[str, Unit] = dataclasses.field(default_factory=dict)
    profile: Mapping[str, Profile] = dataclasses.field(default_factory=dict)
    mesh: bool = True
    mirror: str | None = None

    def __post_init__(self) -> None:
        """Raise ``ValueError`` or ``TypeError`` where a choice is none."""
        if self.scale is not None and not np.isfinite(self.scale):
            raise ValueError(
                f"scale = {self.scale}: give a finite factor, or None to have one chosen"
            )
        if self.limits is not None and not (
            len(self.limits) == 2
            and np.isfinite(self.limits).all()
            and self.limits[0] < self.limits[1]
        ):
            raise ValueError(f"limits = {self.limits}: give two finite numbers, the smaller first")
        for kind in self.units:
            if kind not in KINDS:
                raise ValueError(f'units: "{kind}" is none of {", ".join(KINDS)}')
            name, size = self.unit(kind)
            if not isinstance(name, str) or not (np.isfinite(size) and size > 0):
                raise ValueError(
                    f'units["{kind}"] = {self.units[kind]}: give a name, or a name and its size in '
                    'the unit of the data, as ("MPa", 1e6)'
                )
        for label, profile in self.profile.items():
            if not callable(profile) and not _two_arrays(profile):
                raise TypeError(
                    f'profile["{label}"]: give a function of the coordinate, or two arrays of one '
                    "length, coordinates and pressures"
                )

    def unit(self, kind: str) -> tuple[str, float]:
        """Name and size of the unit of a `kind`, "" and 1 where none is given."""
        chosen = self.units.get(kind, "")
        return (chosen, 1.0) if isinstance(chosen, str) else (chosen[0], float(chosen[1]))

    def title(self, text: str, kind: str) -> str:
        """`text` with the unit of its `kind` in brackets."""
        name, _ = self.unit(kind)
        return f"{text} [{name}]" if name else text


def _two_arrays(profile: Any) -> bool:
    """Whether it is a pair of arrays (k,)."""
    try:
        one, other = (np.asarray(values, dtype=float) for values in profile)
    except (TypeError, ValueError):
        return False
    return one.ndim == 1 and one.shape == other.shape
