"""What a solution says of each contact pair: gap, force, pressure and state of its points."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TypeVar

import numpy as np

from ..arrays import Array, Mask
from .line import ContactLine
from .transitions import Transitions, transitions_on

Values = TypeVar("Values", Array, Mask)


@dataclass(frozen=True, eq=False)
class ContactState:
    """One pair after deformation, at the m points of its line. Any consistent units.

    Attributes
    ----------
    line : ContactLine
        The pair and its points.
    gap : ndarray (m,)
        Along the direction of each point, a length; >= 0 up to round-off.
    force : ndarray (m,)
        lambda_j, not negative unless the pair is bilateral; a force per unit thickness.
    active : ndarray of bool (m,)
        Points in contact.
    """

    line: ContactLine
    gap: Array
    force: Array
    active: Mask

    @property
    def pressure(self) -> Array:
        """-T_n per unit length (P1), -T_xi per unit eta (P2), (m,): units of stress."""
        return self.force / self.line.weight  # (3.10), (3.10')

    @cached_property
    def transitions(self) -> Transitions:
        """Where contact turns from binding to non-binding."""
        return transitions_on(self.line, self.gap, self.active)


def by_line(lines: Sequence[ContactLine], values: Values) -> list[Values]:
    """Parts (m_i,) of an array over the points of all lines in order, one for each line."""
    stops = np.cumsum([len(line.node) for line in lines])
    return np.split(values, stops[:-1]) if len(lines) else []


def contact_states(
    lines: Sequence[ContactLine], gap: Array, force: Array, active: Mask
) -> list[ContactState]:
    """The state of each line; `gap`, `force` and `active` (m,) are over the points of all."""
    parts = by_line(lines, gap), by_line(lines, force), by_line(lines, active)
    return [ContactState(*of_line) for of_line in zip(lines, *parts, strict=True)]
