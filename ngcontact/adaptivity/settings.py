"""How a sequence of levels is refined, and when it ends."""

from __future__ import annotations

from dataclasses import dataclass, replace
from numbers import Real

from ..fem import ORDERS, check_element

FIRST = 3  # order that is chosen at least: a first level of order 2 costs as much, and sees less
GROWTH = 2.0  # of the unknowns up to which the next level is planned at first


def _number(name: str, value: object) -> float:
    """`value`, or a TypeError unless it is a real number."""
    if isinstance(value, bool) or not isinstance(value, Real):
        raise TypeError(f"{name}={value!r} is not a number")
    return float(value)


def best_order(error: float) -> int:
    """The order that reaches a relative error with the fewest unknowns.

    On one mesh orders p have errors c^p, c < 1, and numbers of unknowns ~ p^2; refined from there
    N ~ error^(-2/p). So p + 1 needs fewer than p where the error is less than
    (p / (p + 1))^(p (p + 1)): 0.09 for 3 instead of 2, 0.03 for 4 instead of 3.
    """
    return next((p for p in ORDERS[:-1] if error > (p / (p + 1)) ** (p * (p + 1))), ORDERS[-1])


def truth(name: str, value: object) -> None:
    """Raise a TypeError unless `value` is True or False."""
    if not isinstance(value, bool):
        raise TypeError(f"{name}={value!r}: give True or False")


@dataclass(frozen=True)
class Refinement:
    """How a sequence of levels is refined, and when it ends.

    Raises `ValueError` or `TypeError` with the offending value and what would be right.

    Parameters
    ----------
    order, element, theta, tolerance, max_dofs, guaranteed
        As in `adapt`.
    ending : float
        Size from which elements in which contact ends are refined: their segment's length over
        that of its contact line, relative to the relative estimate.
    growth : float
        Of the unknowns up to which the next level is planned at first, and at most; with a
        tolerance, at which planning stops anyway, at most its square. 1 marks once a level.
    rising : bool
        Whether levels have higher orders than the first where that is sooner.
    """

    order: int
    element: str
    theta: float
    tolerance: float | None
    max_dofs: float
    guaranteed: bool = False
    ending: float = 0.1
    growth: float = GROWTH
    rising: bool = False

    def __post_init__(self) -> None:
        """Validate."""
        object.__setattr__(self, "order", check_element(self.order, self.element))
        if not 0 < _number("theta", self.theta) <= 1:
            raise ValueError(f"theta={self.theta} must lie in (0, 1]; 0.5 is usual")
        if self.tolerance is not None and not 0 < _number("tolerance", self.tolerance) < 1:
            raise ValueError(
                f"tolerance={self.tolerance} is the error in the energy norm relative to that norm "
                "and must lie between 0 and 1, like 1e-3 (0.1 %); or None"
            )
        if not _number("max_dofs", self.max_dofs) > 0:
            raise ValueError(f"max_dofs={self.max_dofs} must be positive, like 100_000")
        truth("guaranteed", self.guaranteed)
        if self.guaranteed and self.tolerance is None:
            raise ValueError("guaranteed=True with tolerance=None: give a tolerance, like 1e-3")

    def choosing(self, start: int | None) -> Refinement:
        """The same with the order that is best: that of a `start`, or for the tolerance.

        Without both the first levels have order 3, and later ones 4. `element` "physical" has 1.
        """
        if self.element == "physical":
            return self
        if start is not None:
            return replace(self, order=start)
        if self.tolerance is None:
            return replace(self, order=FIRST, rising=True)
        return replace(self, order=max(FIRST, best_order(self.tolerance)))

    def next_order(self, order: int, error: float) -> int:
        """The order of the level after one of an `order` and relative `error`."""
        return max(order, best_order(error)) if self.rising else order
