"""Linear systems of a quadratic program for changing active sets, from few factorisations.

NumPy and SciPy only; the factorisation is an argument.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Factor, Index, Mask, Solve
from .quadratic_program import (
    REFINED,
    ROUGH,
    Anchor,
    Approximation,
    QuadraticProgram,
    SingularError,
    first_approximation,
)

BORDER = 16  # changed rows up to which a bordered solve is cheaper than a factorisation ...
PATIENT = 4  # ... times this for every one before: the sets that follow change less and less
DEPENDENT = 1e-14  # singular values of the border, relative to the largest, that are round-off
UNSOLVED = 1e-6  # residual, relative to the first, above which the matrix is singular
NOISE = 64 * np.finfo(float).eps  # ... unless it is round-off of values that balance each other


def _row(C: sp.csr_array, i: int) -> Array:
    """Row i of a sparse matrix, dense; what SciPy does for that takes as long as a back-solve."""
    row = np.zeros(C.shape[1])
    at = slice(C.indptr[i], C.indptr[i + 1])
    row[C.indices[at]] = C.data[at]
    return row


@dataclass(eq=False)
class Base:
    """The factorised system K_0: that of one active set, with all pins held.

    Attributes
    ----------
    active : ndarray of bool (m,)
        Its active rows, none where rows are not unit rows.
    free : ndarray of bool (n,)
        Its unknowns.
    inverse : callable
        K_0^-1.
    known : ndarray (k, n)
        Solutions K_0^-1 v of the columns v that borders have had so far.
    place : dict of int to int
        Which of them belongs to an unknown, or to row j by the key ~j.
    """

    active: Mask
    free: Mask
    inverse: Solve
    known: Array
    place: dict[int, int] = field(default_factory=dict)

    def columns(self, keys: list[int], V: sp.csr_array, back_solve: Solve) -> Index:
        """Places (k,) in `known` for the columns of a border, the rows of `V` (k, n)."""
        new = [i for i, key in enumerate(keys) if key not in self.place]
        if new:
            self.place.update({keys[i]: len(self.place) + k for k, i in enumerate(new)})
            solutions = [back_solve(_row(V, i)) for i in new]
            self.known = np.vstack([self.known, *solutions])
        return np.array([self.place[key] for key in keys], dtype=np.intp)


@dataclass(frozen=True, eq=False)
class Border:
    """One system: the base with k columns V and rows V', D below; S = V' K_0^-1 V - D.

    Attributes
    ----------
    base : Base
    active : ndarray of bool (m,)
    anchor : Anchor or None
        The system.
    at : ndarray of int (r,)
        Unknowns that the base holds and the system does not: released ones, and the pins.
    rows : ndarray of int (k - r,)
        Rows that only the system holds.
    column : ndarray of int (k,)
        Places of K_0^-1 V among the known solutions of the base.
    touched : ndarray of int (t,)
        Unknowns where V is not zero.
    V : ndarray (k, t)
        Its transpose there.
    size : ndarray (k,)
        Roots of the diagonal of S.
    S : ndarray (k, k)
        The Schur complement, over these: only so can small pivots be told, as forces stand
        beside displacements.
    """

    base: Base
    active: Mask
    anchor: Anchor | None
    at: Index
    rows: Index
    column: Index
    touched: Index
    V: Array
    size: Array
    S: Array

    def serves(self, active: Mask, anchor: Anchor | None) -> bool:
        """Whether it is the system of the rows `active` (m,) and this anchor."""
        return self.anchor is anchor and np.array_equal(self.active, active)

    def largest(self, residual: Array) -> float:
        """Largest unbalanced force of `residual` (n,) that the system is to remove."""
        parts = residual[self.base.free], residual[self.at]
        return float(max(np.abs(part).max(initial=0.0) for part in parts))


def _without_border(base: Base, active: Mask, anchor: Anchor | None, none: Index) -> Border:
    """The base itself as a system; `none` (0,) are the unknowns and rows of its border."""
    V = np.zeros((0, 0))
    return Border(base, active, anchor, none, none, none, none, V, V.diagonal(), V)


def bordered(
    p: QuadraticProgram, base: Base, active: Mask, anchor: Anchor | None, back_solve: Solve
) -> Border:
    """The system of an active set as a border of the base.

    Parameters
    ----------
    p : QuadraticProgram
    base : Base
        Learns the columns that are new.
    active : ndarray of bool (m,)
    anchor : Anchor or None
    back_solve : callable
        K_0^-1 of the base, counted.
    """
    rows = np.flatnonzero(active & ~base.active)
    at = p.null_space.pins
    if p.unit_rows:
        at = np.concatenate([p.unknown[base.active & ~active], at])
    keys = np.concatenate([at, ~rows])
    if keys.size == 0:
        return _without_border(base, active, anchor, keys)
    V = sp.vstack([p.K[at], p.R[rows]], format="csr")
    column = base.columns(keys.tolist(), V, back_solve)
    touched = np.unique(V.indices)  # few of the unknowns
    dense = V[:, touched].toarray()
    D = np.zeros((len(column), len(column)))
    D[:, : at.size] = V[:, at].toarray()
    D[: at.size] = D[:, : at.size].T
    if anchor is not None:
        pins = np.arange(at.size - p.null_space.pins.size, at.size)
        D[pins, pins] += anchor.stiffness
    S = dense @ base.known[np.ix_(column, touched)].T - D
    size = np.sqrt(np.abs(np.diagonal(S)))
    size = np.where(size > 0, size, 1.0)
    return Border(
        base=base,
        active=active,
        anchor=anchor,
        at=at,
        rows=rows,
        column=column,
        touched=touched,
        V=dense,
        size=size,
        S=S / np.outer(size, size),
    )


@dataclass(eq=False)
class BorderedSystems:
    """The linear systems of one program for changing active sets; `bordered_systems` makes them.

    One set, the base, is factorised with all pins of the null space held. Another set is reached
    by bordering that factor K_0 with one row and column for each row of R that changed state and
    for each pin, V and D, at one back-solve for each. A right side (r, w) then takes the three
    steps of Gill, Murray, Saunders, Wright (1990, A Schur-complement method for sparse quadratic
    programming):

    1. K_0 x = r
    2. S z = V'x - w with the Schur complement S = V' K_0^-1 V - D
    3. y = x - K_0^-1 V z

    Every solution corrects the one before, which leaves no residual outside of the border: the
    next one costs the back-solves of its new columns alone.

    Attributes
    ----------
    factor : Factor
        Factorises the matrix of the free unknowns (n,).
    border : int
        Changed rows up to which the first factorisation is bordered.
    approximation : Approximation
        The last solution.
    base : Base or None
        The factorisation, once there is one.
    system : Border or None
        The system of the last solution.
    factorizations, back_solves : int
        Work since the last `restart`.
    """

    factor: Factor
    border: int
    approximation: Approximation
    base: Base | None = None
    system: Border | None = None
    factorizations: int = 0
    back_solves: int = 0

    @property
    def program(self) -> QuadraticProgram:
        """The program of the last `restart`."""
        return self.approximation.program

    def restart(self, program: QuadraticProgram) -> None:
        """Begin with another load, other values or bounds; a factorisation stays."""
        closed = None if self.base is None else self.base.active
        self.approximation = first_approximation(program, closed)
        self.system = None
        self.factorizations = self.back_solves = 0

    def forget(self) -> None:
        """Give the memory of the factorisation back."""
        self.base = self.system = None

    def solve(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) with the rows `active` (m,) held at their bounds.

        The residual is 1e-11 of the first one; `refine` takes it to round-off.

        Raises
        ------
        SingularError
            The matrix is singular to working precision.
        """
        return self._settled(self._solved(active, anchor), ROUGH)

    def refine(self, active: Mask, anchor: Anchor | None = None) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) for `active` (m,), the residual at round-off."""
        return self._settled(self._roughly_solved(active, anchor), REFINED)

    def stiffness(self) -> Array:
        """Force per displacement at each row, (m,): an upper bound, infinite where unknown."""
        p, base = self.program, self.base
        if p.unit_rows:
            return p.diagonal[p.unknown]
        stiffness = np.full(p.g.size, np.inf)
        for j in range(p.g.size):
            if base is not None and ~j in base.place:
                stiffness[j] = 1 / float((p.R[j : j + 1] @ base.known[base.place[~j]])[0])
        return stiffness

    def _base_near(self, active: Mask) -> Base:
        """The base, or a new one where too many rows have changed."""
        p = self.program
        most = self.border * PATIENT ** max(self.factorizations - 1, 0)
        if self.base is not None and not (
            p.unit_rows and np.count_nonzero(active != self.base.active) > most
        ):
            return self.base
        self.forget()  # two factorisations at a time would double the memory
        free = ~p.fixed
        free[np.concatenate([p.null_space.held, p.null_space.pins])] = False
        if p.unit_rows:
            free[p.unknown[active]] = False
        self.base = Base(
            active=active.copy() if p.unit_rows else np.zeros_like(active),
            free=free,
            inverse=self.factor(free),
            known=np.zeros((0, p.b.size)),
        )
        self.factorizations += 1
        self.approximation = first_approximation(p, self.base.active)
        return self.base

    def _back_solve(self, base: Base, right: Array) -> Array:
        self.back_solves += 1
        return base.inverse(np.where(base.free, right, 0.0))

    def _solved(self, active: Mask, anchor: Anchor | None) -> Border:
        """The system of an active set, its solution in `approximation`."""
        p, base = self.program, self._base_near(active)
        system = bordered(p, base, active, anchor, lambda right: self._back_solve(base, right))
        self.system = system
        now = self.approximation
        now.force[~active] = 0.0
        if p.unit_rows:
            held = base.active & active
            now.y[p.unknown[held]] = p.g[held]
        residual = now.unbalanced(active, anchor)
        now.scale = max(now.scale, system.largest(residual))
        self._correct(system, residual, ROUGH)
        return system

    def _roughly_solved(self, active: Mask, anchor: Anchor | None) -> Border:
        """The same, that of the last solution where it serves."""
        if self.system is not None and self.system.serves(active, anchor):
            return self.system
        system = self._solved(active, anchor)
        self._settled(system, ROUGH)
        return system

    def _correct(self, system: Border, residual: Array, tolerance: float) -> None:
        """Add the solution for a residual (n,), one back-solve unless it is small outside V."""
        p, base, now = self.program, system.base, self.approximation
        x = np.zeros(p.b.size)
        if np.abs(residual[base.free]).max(initial=0.0) > tolerance * now.scale:
            x = self._back_solve(base, residual)  # step 1
        rows, at = system.rows, system.at
        below = np.concatenate([residual[at], p.g[rows] - p.R[rows] @ now.y])
        if below.size:
            right = (system.V @ x[system.touched] - below) / system.size
            z = np.linalg.lstsq(system.S, right, rcond=DEPENDENT)[0] / system.size  # step 2
            amounts = np.zeros(len(base.known))
            amounts[system.column] = z
            x -= amounts @ base.known  # step 3
            x[at] += z[: at.size]
            now.force[rows] += z[at.size :]
        now.y += x
        if p.unit_rows:
            now.y[p.unknown[system.active]] = p.g[system.active]

    def _settled(self, system: Border, tolerance: float) -> tuple[Array, Array]:
        """The solution, corrected once more if its residual asks for it."""
        p, now = self.program, self.approximation
        residual = now.unbalanced(system.active, system.anchor)
        if system.largest(residual) > tolerance * now.scale:
            self._correct(system, residual, tolerance)
            residual = now.unbalanced(system.active, system.anchor)
        # Where bounds alone drive the solution, forces come from rows or from elasticity.
        pull = now.force if p.unit_rows else p.R.T @ now.force
        terms = (pull, (p.K @ now.y)[~p.fixed])
        scale = max(now.scale, *(np.abs(x).max(initial=0.0) for x in terms))
        balanced = ~p.fixed
        if system.anchor is not None:  # its force may turn what the held unknowns hold
            balanced[p.null_space.held] = False
        left = np.abs(residual[balanced]).max(initial=0.0)
        if not left <= UNSOLVED * scale and not left <= self._noise(balanced):
            raise SingularError(
                "the system for the current active set is singular to working precision: a body "
                "can move without resistance from supports or active contact, or the moduli of "
                "the bodies are too many powers of ten apart"
            )
        return now.copies()

    def _noise(self, balanced: Mask) -> float:
        """Round-off of the forces of prescribed values on the unknowns `balanced` (n,)."""
        p = self.program
        given = abs(p.K) @ np.where(p.fixed, np.abs(p.values), 0.0)
        return NOISE * float(given[balanced].max(initial=0.0))


def bordered_systems(
    program: QuadraticProgram, factor: Factor, border: int = BORDER
) -> BorderedSystems:
    """The linear systems of a program, by few factorisations.

    Parameters
    ----------
    program : QuadraticProgram
        With n unknowns.
    factor : Factor
        Factorises the matrix of the free unknowns (n,): answers a function that solves for right
        sides (n,) which vanish at the others, as the solution does.
    border : int
        Changed rows up to which the first factorisation is bordered; a factorisation costs that
        many back-solves.
    """
    return BorderedSystems(factor=factor, border=border, approximation=first_approximation(program))
