"""Linear systems of a quadratic program for changing active sets, from few factorisations.

NumPy and SciPy only; the factorisation is an argument.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Factor, Mask, Solve
from .quadratic_program import QuadraticProgram

BORDER = 16  # changed rows up to which a bordered solve is cheaper than a factorisation ...
PATIENT = 4  # ... times this for every one before: the sets that follow change less and less
REFINED = 1e-14  # residual, relative to the first, above which another solve removes it
ROUGH = 1e-11  # ... before the active set is known to be the last
UNSOLVED = 1e-6  # ... and above which the matrix is singular to working precision


def _row(C: sp.csr_array, i: int) -> Array:
    """Row i of a sparse matrix, dense; what SciPy does for that takes as long as a back-solve."""
    row = np.zeros(C.shape[1])
    at = slice(C.indptr[i], C.indptr[i + 1])
    row[C.indices[at]] = C.data[at]
    return row


class SingularError(ArithmeticError):
    """A factorised matrix does not solve its system: some motion meets no resistance."""


@dataclass(frozen=True, eq=False)
class Anchor:
    """Proximal terms stiffness / 2 (y - at)^2 on the pins, which make every system definite."""

    stiffness: Array
    at: Array


class BorderedSystems:
    """The linear systems of one program for changing active sets.

    One set, the base, is factorised with all pins of the kernel held. Another set is reached by
    bordering that factor with one row and column for each row of R that changed state and for
    each pin, and by the Schur complement of the border (Gill, Murray, Saunders, Wright 1990), at
    one back-solve for each. Every solution corrects the one before, which leaves no residual
    outside of the border: the next one costs the back-solves of its new columns alone.
    """

    _solve: Solve

    def __init__(self, program: QuadraticProgram, factor: Factor) -> None:
        self.factor = factor
        self.factorised = False
        self.base = np.zeros(len(program.g), dtype=bool)
        self.restart(program)

    def restart(self, program: QuadraticProgram) -> None:
        """Begin with another load, other values or bounds; a factorisation stays."""
        self.program = program
        self.factorizations = self.back_solves = 0
        self._start()

    def forget(self) -> None:
        """Give the memory of the factorisation back."""
        if self.factorised:
            self.factorised = False
            del self._solve, self.known

    def _start(self) -> None:
        """First iterate: prescribed values, and the bounds of the base."""
        p = self.program
        self.y = np.where(p.fixed, p.values, 0.0)
        if p.unit_rows:
            self.y[p.unknown[self.base]] = p.g[self.base]
        self.force = np.zeros(p.g.size)
        self.scale = 0.0

    def _refactorise(self, active: Mask) -> None:
        p = self.program
        self.forget()  # two factorisations at a time would double the memory
        self.base = active.copy() if p.unit_rows else np.zeros_like(active)
        self.free = ~p.fixed
        self.free[np.concatenate([p.null_space.held, p.null_space.pins])] = False
        if p.unit_rows:
            self.free[p.unknown[active]] = False
        self._solve = self.factor(self.free)
        self.factorised = True
        self.factorizations += 1
        self.place: dict[int, int] = {}  # of the base solution of an unknown, or of row ~j
        self.known = np.zeros((0, p.b.size))  # base solutions
        self._start()

    def _back_solve(self, right: Array) -> Array:
        self.back_solves += 1
        return self._solve(np.where(self.free, right, 0.0))

    def _border(self) -> None:
        """Border of the unknowns `at` released from the base and of the added `rows`."""
        p = self.program
        self.rows = np.flatnonzero(self.active & ~self.base)
        self.at = p.null_space.pins
        if p.unit_rows:
            self.at = np.concatenate([p.unknown[self.base & ~self.active], self.at])
        C = sp.vstack([p.K[self.at], p.R[self.rows]], format="csr")
        keys = np.concatenate([self.at, ~self.rows]).tolist()
        new = [i for i, key in enumerate(keys) if key not in self.place]
        if new:
            self.place.update({keys[i]: len(self.place) + k for k, i in enumerate(new)})
            solutions = [self._back_solve(_row(C, i)) for i in new]
            self.known = np.vstack([self.known, *solutions])
        self.solution = np.array([self.place[key] for key in keys], dtype=np.intp)
        self.touched = np.unique(C.indices)  # few of the unknowns
        self.C = C[:, self.touched].toarray()
        D = np.zeros((len(keys), len(keys)))
        D[:, : self.at.size] = C[:, self.at].toarray()
        D[: self.at.size] = D[:, : self.at.size].T
        if self.anchor is not None:
            pins = np.arange(self.at.size - p.null_space.pins.size, self.at.size)
            D[pins, pins] += self.anchor.stiffness
        schur = self.C @ self.known[np.ix_(self.solution, self.touched)].T - D
        # Forces and displacements side by side: only after scaling can small pivots be told.
        size = np.sqrt(np.abs(np.diagonal(schur)))
        self.size = np.where(size > 0, size, 1.0)
        self.schur = schur / np.outer(self.size, self.size)

    def _correct(self, residual: Array, tolerance: float) -> None:
        """Add the bordered solution for a residual, one back-solve unless it is small outside."""
        p = self.program
        x = np.zeros(p.b.size)
        if np.abs(residual[self.free]).max(initial=0.0) > tolerance * self.scale:
            x = self._back_solve(residual)
        below = np.concatenate([residual[self.at], p.g[self.rows] - p.R[self.rows] @ self.y])
        if below.size:
            right = (self.C @ x[self.touched] - below) / self.size
            z = np.linalg.lstsq(self.schur, right, rcond=1e-14)[0] / self.size
            amounts = np.zeros(len(self.known))
            amounts[self.solution] = z
            x -= amounts @ self.known
            x[self.at] += z[: self.at.size]
            self.force[self.rows] += z[self.at.size :]
        self.y += x
        if p.unit_rows:
            self.y[p.unknown[self.active]] = p.g[self.active]

    def residual(self) -> Array:
        """Unbalanced force b - K y - R' force, (n,), with the proximal term if there is one."""
        p = self.program
        residual = p.b - p.K @ self.y
        if self.anchor is not None:
            pins = p.null_space.pins
            residual[pins] -= self.anchor.stiffness * (self.y[pins] - self.anchor.at)
        if p.unit_rows:  # active unknowns take what is left there, others must balance
            self.force[:] = 0.0
            self.force[self.active] = residual[p.unknown[self.active]]
            residual[p.unknown[self.active]] = 0.0
            return residual
        return residual - p.R.T @ self.force

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser and multipliers for one active set, rows of the set held at their bound.

        The residual is 1e-11 of the first one; `refine` takes it to round-off.
        """
        p = self.program
        changes = np.count_nonzero(active != self.base)
        most = BORDER * PATIENT ** max(self.factorizations - 1, 0)
        if not self.factorised or (p.unit_rows and changes > most):
            self._refactorise(active)
        self.active, self.anchor = active, anchor
        self._border()
        self.force[~active] = 0.0
        if p.unit_rows:
            self.y[p.unknown[self.base & active]] = p.g[self.base & active]
        residual = self.residual()
        self.scale = max(self.scale, self._size(residual))
        self._correct(residual, ROUGH)
        return self._settled(ROUGH)

    def refine(self) -> tuple[Array, Array]:
        """The last solution, its residual at round-off."""
        return self._settled(REFINED)

    def _size(self, residual: Array) -> float:
        """Largest residual that the bordered system is to remove."""
        parts = residual[self.free], residual[self.at]
        return float(max(np.abs(part).max(initial=0.0) for part in parts))

    def _settled(self, tolerance: float) -> tuple[Array, Array]:
        """The iterate, corrected once more if its residual asks for it."""
        p = self.program
        residual = self.residual()
        if self._size(residual) > tolerance * self.scale:
            self._correct(residual, tolerance)
            residual = self.residual()
        # Where bounds alone drive the solution, forces come from rows or from elasticity.
        pull = self.force if p.unit_rows else p.R.T @ self.force
        terms = (pull, (p.K @ self.y)[~p.fixed])
        scale = max(self.scale, *(np.abs(x).max(initial=0.0) for x in terms))
        balanced = ~p.fixed
        if self.anchor is not None:  # its force on the pins may turn what the held unknowns hold
            balanced[p.null_space.held] = False
        if not np.abs(residual[balanced]).max(initial=0.0) <= UNSOLVED * scale:
            raise SingularError(
                "the system for the current active set is singular to working precision: a body "
                "can move without resistance from supports or active contact, or the moduli of "
                "the bodies are too many powers of ten apart"
            )
        return self.y.copy(), self.force.copy()

    def stiffness(self) -> Array:
        """Force per displacement at each row: an upper bound, or infinity where unknown."""
        p = self.program
        if p.unit_rows:
            return p.diagonal[p.unknown]
        stiffness = np.full(p.g.size, np.inf)
        for j in range(p.g.size):
            if ~j in self.place:
                stiffness[j] = 1 / float((p.R[[j]] @ self.known[self.place[~j]])[0])
        return stiffness
