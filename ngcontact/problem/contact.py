"""Contact pairs Gamma_K."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeAlias

import ngsolve as ng
import numpy as np

from .values import region_name, scalar_data, unit_vector

Gap: TypeAlias = float | ng.CoefficientFunction | Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True, eq=False)
class Contact:
    """A pair of boundaries Gamma_K that may touch: d.(v_secondary - v_primary) <= gap.

    Parameters
    ----------
    secondary
        Name or pattern of the boundary that carries the contact points.
    primary
        Name or pattern of the boundary it meets; None is a rigid obstacle and needs `gap`.
    direction
        None: d is the outward normal of the secondary at each point, the bounded zone HH81 (3.9).
        A pair: the fixed direction xi from the secondary body to the primary one, the enlarging
        zone HH81 (3.9'); kept as a unit vector.
    gap
        None: measured from the geometry along d. A number, a scalar CoefficientFunction or a
        function of the coordinate arrays x, y (n,) that returns (n,) overrides it; a length.
    bilateral
        Equality in place of the inequality, HH81 Remark 3.3.

    Raises
    ------
    TypeError, ValueError
        If a value has the wrong type, length or range, with the value and what would be right.
    """

    secondary: str
    primary: str | None = None
    direction: Sequence[float] | None = None
    gap: Gap | None = None
    bilateral: bool = False

    def __post_init__(self) -> None:
        """Validate and normalise."""
        region_name(self.secondary, "secondary")
        if self.primary is not None:
            region_name(self.primary, "primary")
        elif self.gap is None:
            raise ValueError(
                f'contact of "{self.secondary}" has primary=None and gap=None: a rigid obstacle '
                "(primary=None) needs gap"
            )
        if self.direction is not None:
            object.__setattr__(self, "direction", unit_vector(self.direction))
        if isinstance(self.gap, ng.CoefficientFunction) or not callable(self.gap):
            gap = None if self.gap is None else scalar_data(self.gap, "gap")
            object.__setattr__(self, "gap", gap)
        if not isinstance(self.bilateral, bool):
            raise TypeError(f"bilateral = {self.bilateral!r}: give True or False")
