"""The quadratic program of a discrete contact problem: arrays only. NumPy and SciPy only."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask
from .null_space import NullSpace, no_null_space


@dataclass(frozen=True, eq=False)
class QuadraticProgram:
    """Minimise 1/2 y'Ky - b'y subject to R y <= g and given values of some unknowns.

    Attributes
    ----------
    K : sparse (n, n)
        Symmetric; on the unknowns that are not `fixed` positive definite but for `null_space`.
    b : ndarray (n,)
        Load.
    R : sparse (m, n)
        Rows, linearly independent on the unknowns that are not `fixed`.
    g : ndarray (m,)
        Bounds.
    equality : ndarray of bool (m,)
        Rows that hold with equality, R y = g.
    fixed : ndarray of bool (n,)
        Unknowns with given values.
    values : ndarray (n,)
        The given values; only those of `fixed` unknowns are read.
    unknown : ndarray of int (m,), optional
        Given when row j is the unit vector of unknown `unknown[j]`: an active row is then an
        unknown that leaves the system, and every factorised matrix is a principal submatrix.
    null_space : NullSpace, optional
        Null space of K, only with unit rows.
    """

    K: sp.csr_array
    b: Array
    R: sp.csr_array
    g: Array
    equality: Mask
    fixed: Mask
    values: Array
    unknown: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    null_space: NullSpace = field(default_factory=lambda: no_null_space(0))

    @cached_property
    def diagonal(self) -> Array:
        """Diagonal (n,) of K."""
        return np.asarray(self.K.diagonal())

    @property
    def unit_rows(self) -> bool:
        """Whether every row is a single unknown."""
        return len(self.unknown) == len(self.g)


@dataclass(frozen=True, eq=False)
class Iterate:
    """Solution of a quadratic program, in any consistent units.

    Attributes
    ----------
    u : ndarray (n,)
        Minimiser.
    force : ndarray (m,)
        Multipliers of the rows R u <= g, not negative.
    multiplier : ndarray (k,)
        Multipliers of the equations E u = e, of either sign.
    active : ndarray of bool (m,)
        Rows that hold with equality.
    steps : list of int
        Changes of the active set after each linear system; the last one is 0.
    factorizations : int
        Number of factorisations.
    back_solves : int
        Number of back-solves; V-cycles of large problems without factorisation count as such.
    """

    u: Array
    force: Array
    active: Mask
    steps: list[int]
    multiplier: Array = field(default_factory=lambda: np.zeros(0))
    factorizations: int = 0
    back_solves: int = 0
