"""What proves a bound."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from ....arrays import Array
from ....problem import Problem
from ..data import Discrete, EdgeConditions, Partition, Units
from ..guides import Reactions
from ..liftings import Gap
from ..remainders import Strip


@dataclass(frozen=True, eq=False)
class Norms:
    """Norms on n triangles and ne elements.

    Attributes
    ----------
    partition : Partition
        The triangles.
    constitutive, loads, curves : ndarray (n,)
        By what they are of.
    lifting : ndarray (ne,)
        |w|.
    """

    partition: Partition
    constitutive: Array
    loads: Array
    curves: Array
    lifting: Array

    def bound(self, closed: float, units: Units) -> float:
        """B, in the units of the data."""
        both = self.constitutive + self.loads + self.curves
        square = float(both @ both + self.lifting @ self.lifting) + 2 * closed
        return math.sqrt(square) * units.root


@dataclass(frozen=True, eq=False)
class Proof:
    """What proves a bound, in units of its own.

    Attributes
    ----------
    discrete : Discrete
        The discrete solution on n triangles.
    conditions : EdgeConditions
        Of e edges.
    given : ndarray (e, 2, r)
        Tractions asked for.
    raw : ndarray (n, 3, m)
        Coefficients of the stress.
    gaps : sequence of Gap
        The pairs.
    pressures : sequence of ndarray (m,)
        Coefficients of p* of each.
    guides : Reactions or None
        What turning guides exert.
    strips : sequence of Strip
        Tractions asked for on curves, on Gamma_K and on turning guides.
    norms : Norms
        On the triangles.
    bound : float
        B, in the units of the data.
    units : Units
        Of the data.
    problem : Problem
        The problem.
    sampled : sequence of ndarray (r, q, v)
        The v components of the discrete stress at points of sampled triangles, units of stress; by
        their rules of quadrature.
    """

    discrete: Discrete
    conditions: EdgeConditions
    given: Array
    raw: Array
    gaps: Sequence[Gap]
    pressures: Sequence[Array]
    guides: Reactions | None
    strips: Sequence[Strip]
    norms: Norms
    bound: float
    units: Units
    problem: Problem
    sampled: Sequence[Array]
