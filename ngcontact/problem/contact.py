"""Contact pairs Gamma_K."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import wraps
from typing import Any, TypeAlias

import ngsolve as ng
import numpy as np

from .values import region_name, scalar_data, unit_vector

Gap: TypeAlias = float | ng.CoefficientFunction | Callable[..., np.ndarray]

NO_FRICTION = (
    "contact is frictionless, so that Contact takes no friction={!r}: leave it out; "
    "docs/topics/limits.md says what that means and which codes have friction"
)
ROWS = ("auto", "nodal", "dual")
ROLES = ("given", "auto")


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
        zone HH81 (3.9'); kept as a unit vector. A triple for solids.
    gap
        None: measured from the geometry along d. A number, a scalar CoefficientFunction or a
        function of the coordinate arrays x, y (n,), of solids x, y, z, that returns (n,)
        overrides it; a length.
    bilateral
        Equality in place of the inequality, HH81 Remark 3.3.
    rows
        "nodal": at nodes, HH81 (2.3), (2.10), right where nodes face nodes. "dual": weighted means
        over the facing segments, right on any pair of meshes. "auto": nodal wherever nodes face
        nodes, dual elsewhere.
    roles
        "given": the first boundary is the secondary. "auto": the side that is wholly covered by the
        other becomes the secondary, of two the finer, of equal ones the convex one.

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
    rows: str = "auto"
    roles: str = "given"

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
        who = f'contact of "{self.secondary}": '
        if self.direction is not None:
            object.__setattr__(self, "direction", unit_vector(self.direction, f"{who}direction"))
        if isinstance(self.gap, ng.CoefficientFunction) or not callable(self.gap):
            gap = None if self.gap is None else scalar_data(self.gap, f"{who}gap")
            object.__setattr__(self, "gap", gap)
        if not isinstance(self.bilateral, bool):
            raise TypeError(f"{who}bilateral = {self.bilateral!r}: give True or False")
        for what, value, known in (("rows", self.rows, ROWS), ("roles", self.roles, ROLES)):
            if value not in known:
                raise ValueError(f"{who}{what} = {value!r}: choose one of {known}")
        if self.roles == "auto" and self.primary is None:
            raise ValueError(
                f'{who}roles = "auto" with primary=None: a rigid obstacle has no other side'
            )

    @property
    def sides(self) -> list[str]:
        """Its boundaries, the secondary first."""
        return [self.secondary] if self.primary is None else [self.secondary, self.primary]

    def named(self) -> str:
        """Both sides, as a user knows them."""
        other = "a rigid obstacle" if self.primary is None else f'"{self.primary}"'
        return f'"{self.secondary}" with {other}'

    def swapped(self) -> Contact:
        """The pair with its roles exchanged; a gap stays where it is measured or given."""
        if self.primary is None:
            raise ValueError("a rigid obstacle (primary=None) cannot be the secondary")
        back = None if self.direction is None else tuple(-x for x in self.direction)
        return replace(self, secondary=self.primary, primary=self.secondary, direction=back)


def _without_friction(initialise: Callable[..., None]) -> Callable[..., None]:
    """`Contact.__init__`, which says what to do about friction before it refuses unknown names."""

    @wraps(initialise)
    def initialised(self: Contact, *values: Any, **options: Any) -> None:
        if "friction" in options:
            raise TypeError(NO_FRICTION.format(options["friction"]))
        initialise(self, *values, **options)

    return initialised


Contact.__init__ = _without_friction(Contact.__init__)  # type: ignore[method-assign]
