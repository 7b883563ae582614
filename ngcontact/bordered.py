"""Linear systems of a quadratic program for changing active sets, from few factorisations.

NumPy and SciPy only; the factorisation is an argument.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .kernel import Kernel, no_kernel

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]
Solve = Callable[[Array], Array]
Factor = Callable[[Mask], Solve]
Columns = dict[int, tuple[Array, Array]]  # border columns and the base solutions for them

BORDER = 16  # changed rows up to which a bordered solve is cheaper than a factorisation
REFINED = 1e-14  # residual, relative to the first, above which a second solve removes it
UNSOLVED = 1e-6  # ... and above which the matrix is singular to working precision


class SingularError(ArithmeticError):
    """A factorised matrix does not solve its system: some motion meets no resistance."""


@dataclass(frozen=True, eq=False)
class Program:
    """Minimise 1/2 y'Ky - b'y subject to R y <= g and given values of some unknowns.

    Attributes
    ----------
    K : sparse (n, n)
        Symmetric; on the unknowns that are not `fixed` positive definite but for the `kernel`.
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
    kernel : Kernel, optional
        Null space of K, only with unit rows.
    """

    K: sp.csr_matrix
    b: Array
    R: sp.csr_matrix
    g: Array
    equality: Mask
    fixed: Mask
    values: Array
    unknown: Index = field(default_factory=lambda: np.zeros(0, dtype=np.intp))
    kernel: Kernel = field(default_factory=lambda: no_kernel(0))

    @property
    def unit_rows(self) -> bool:
        """Whether every row is a single unknown."""
        return len(self.unknown) == len(self.g)


@dataclass(frozen=True, eq=False)
class Anchor:
    """Proximal term stiffness / 2 |y - at|^2 on the pins, which makes every system definite."""

    stiffness: float
    at: Array


class Systems:
    """The linear systems of one program for changing active sets.

    One set, the base, is factorised with all pins of the kernel held. Another set is reached by
    bordering that factor with one row and column for each row of R that changed state and for
    each pin, and by the Schur complement of the border (Gill, Murray, Saunders, Wright 1990), at
    one back-solve for each.
    """

    def __init__(self, program: Program, factor: Factor) -> None:
        self.program = program
        self.factor = factor
        self.factorizations = 0
        self.back_solves = 0
        self.base = np.zeros(len(program.g), dtype=bool)
        self.free = ~program.fixed
        self.released: Columns = {}  # by unknown
        self.added: Columns = {}  # by row

    def _refactorise(self, active: Mask) -> None:
        p = self.program
        self.base = active.copy() if p.unit_rows else np.zeros_like(active)
        self.free = ~p.fixed
        self.free[np.concatenate([p.kernel.held, p.kernel.pins])] = False
        if p.unit_rows:
            self.free[p.unknown[active]] = False
        self._solve = self.factor(self.free)
        self.factorizations += 1
        self.released.clear()
        self.added.clear()

    def _back_solve(self, right: Array) -> Array:
        self.back_solves += 1
        return self._solve(np.where(self.free, right, 0.0))

    def _columns(self, known: Columns, M: sp.csr_matrix, rows: Index) -> None:
        """Remember the missing border columns, rows of M, and the base solutions for them."""
        for j in rows:
            if j not in known:
                column = M[j].toarray().ravel()
                known[j] = column, self._back_solve(column)

    def _border(self, at: Index, rows: Index, anchor: Anchor | None) -> None:
        """Schur complement of the unknowns released `at` and the added `rows`."""
        p = self.program
        self._columns(self.released, p.K, at)
        self._columns(self.added, p.R, rows)
        pairs = [self.released[j] for j in at] + [self.added[j] for j in rows]
        self.C = np.array([c for c, _ in pairs]).reshape(-1, p.b.size).T
        self.X = np.array([x for _, x in pairs]).reshape(-1, p.b.size).T
        D = np.zeros((len(pairs), len(pairs)))
        D[:, : at.size] = self.C[at].T
        D[: at.size] = self.C[at]
        if anchor is not None:
            pins = np.arange(at.size - p.kernel.pins.size, at.size)
            D[pins, pins] += anchor.stiffness
        schur = self.C.T @ self.X - D
        # Forces and displacements side by side: only after scaling can small pivots be told.
        size = np.sqrt(np.abs(np.diagonal(schur)))
        self.size = np.where(size > 0, size, 1.0)
        self.schur = schur / np.outer(self.size, self.size)

    def _bordered_solve(self, right: Array, below: Array) -> tuple[Array, Array]:
        x = self._back_solve(right)
        if below.size == 0:
            return x, below
        z = np.linalg.lstsq(self.schur, (self.C.T @ x - below) / self.size, rcond=1e-14)[0]
        z /= self.size
        return x - self.X @ z, z

    def residual(self, y: Array, force: Array, anchor: Anchor | None = None) -> Array:
        """Unbalanced force b - K y - R' force, (n,), with the proximal term if there is one."""
        p = self.program
        residual = p.b - p.K @ y - p.R.T @ force
        if anchor is not None:
            pins = p.kernel.pins
            residual[pins] -= anchor.stiffness * (y[pins] - anchor.at)
        return residual

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser and multipliers for one active set, rows of the set held at their bound."""
        p = self.program
        if self.factorizations == 0 or (
            p.unit_rows and np.count_nonzero(active != self.base) > BORDER
        ):
            self._refactorise(active)
        rows = np.flatnonzero(active & ~self.base)
        at = p.kernel.pins
        if p.unit_rows:
            at = np.concatenate([p.unknown[self.base & ~active], at])
        self._border(at, rows, anchor)

        y = np.where(p.fixed, p.values, 0.0)
        if p.unit_rows:
            y[p.unknown[self.base]] = p.g[self.base]
        force = np.zeros(p.g.size)
        scale = 0.0
        for refinement in range(2):
            residual = self.residual(y, force, anchor)
            below = np.concatenate([residual[at], p.g[rows] - p.R[rows] @ y])
            size = np.abs(residual[self.free]).max(initial=0.0)
            size = max(size, np.abs(residual[at]).max(initial=0.0))
            if refinement and size <= REFINED * scale:
                break
            scale = max(size, scale)
            x, z = self._bordered_solve(residual, below)
            y += x
            y[at] += z[: at.size]
            force[rows] += z[at.size :]
        if p.unit_rows:
            y[p.unknown[active]] = p.g[active]
            force[:] = 0.0
            force[active] = self.residual(y, force)[p.unknown[active]]
        residual = self.residual(y, force, anchor)[~p.fixed]
        # Where bounds alone drive the solution, forces come from rows or from elasticity.
        pull = p.R.T @ force if not p.unit_rows else force
        for terms in (pull, (p.K @ y)[~p.fixed]):
            scale = max(scale, np.abs(terms).max(initial=0.0))
        if not np.abs(residual).max(initial=0.0) <= UNSOLVED * scale:
            raise SingularError(
                "the system for the current active set is singular to working precision: a body "
                "can move without resistance from supports or active contact, or the moduli of "
                "the bodies are too many powers of ten apart"
            )
        return y, force

    def stiffness(self) -> Array:
        """Force per displacement at each row: an upper bound, or infinity where unknown."""
        p = self.program
        if p.unit_rows:
            return p.K.diagonal()[p.unknown]
        stiffness = np.full(p.g.size, np.inf)
        for j, (column, solution) in self.added.items():
            stiffness[j] = 1 / (column @ solution)
        return stiffness
