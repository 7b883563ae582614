"""Semismooth Newton = primal-dual active set for convex quadratic programs.

The discrete problems HH81 (P_1h), (P_2h) in algebraic form: minimise 1/2 y'Ky - b'y subject to
R y <= g. The Newton derivative of force - max(0, force + c (R y - g)) turns every step into one
linear system for the current active set; when the set repeats, the iterate is the exact
minimiser (Hintermueller, Ito, Kunisch 2002, SIAM J. Optim. 13:865). The method alone can cycle
on positive definite problems that are not M-matrices; the block pivoting safeguard of Judice
and Pires (1994, Comput. Oper. Res. 21:587) makes it finite for all of them.

This module knows matrices only. The factorisation is an argument.
"""

from __future__ import annotations

import logging
from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray
from scipy.sparse.linalg import splu

from .errors import ConvergenceError

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Solve = Callable[[Array], Array]
Factor = Callable[[Mask], Solve]

log = logging.getLogger("ngcontact")

TIE = 1e-13  # relative size below which a force or a slack keeps its state
WIDEST_TIE = 1e-9  # ... and to which that grows, tenfold, each time an active set comes back
PATIENCE = 10  # full switches allowed without fewer violated rows (Judice, Pires 1994)
BORDER = 16  # changed rows up to which a bordered solve is cheaper than a factorisation


@dataclass(frozen=True, eq=False)
class Program:
    """Minimise 1/2 y'Ky - b'y subject to R y <= g and given values of some unknowns.

    Attributes
    ----------
    K : sparse (n, n)
        Symmetric, positive definite on the unknowns that are not `fixed`.
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
        Set when row j is the unit vector of unknown `unknown[j]`: an active row is then an
        unknown that leaves the system, and every factorised matrix is a principal submatrix.
    """

    K: sp.csr_matrix
    b: Array
    R: sp.csr_matrix
    g: Array
    equality: Mask
    fixed: Mask
    values: Array
    unknown: NDArray[np.intp] | None = None


@dataclass(frozen=True, eq=False)
class Minimiser:
    """Solution of a quadratic program.

    Attributes
    ----------
    u : ndarray (n,)
        Minimiser.
    force : ndarray (m,)
        Multipliers of the rows R u <= g, not negative.
    multiplier : ndarray
        Multipliers of the equations E u = e, of either sign.
    active : ndarray of bool (m,)
        Rows that hold with equality.
    steps : list of int
        Changes of the active set after each linear system; the last one is 0.
    factorizations, back_solves : int
        Work done.
    """

    u: Array
    force: Array
    active: Mask
    steps: list[int]
    multiplier: Array = field(default_factory=lambda: np.zeros(0))
    factorizations: int = 0
    back_solves: int = 0


class _Systems:
    """The linear systems of one program for changing active sets.

    One set, the base, is factorised. Another set is reached by bordering that factor with one
    row and column for each row of R that changed state, and by the Schur complement of the
    border (Gill, Murray, Saunders, Wright 1990), at one back-solve for each change.
    """

    def __init__(self, program: Program, factor: Factor) -> None:
        self.program = program
        self.factor = factor
        self.factorizations = 0
        self.back_solves = 0
        self.base: Mask | None = None

    def _refactorise(self, active: Mask) -> None:
        p = self.program
        self.base = active.copy() if p.unknown is not None else np.zeros_like(active)
        self.free = ~p.fixed
        if p.unknown is not None:
            self.free[p.unknown[active]] = False
        self._solve = self.factor(self.free)
        self.factorizations += 1
        self.columns: dict[int, tuple[Array, Array]] = {}

    def _back_solve(self, right: Array) -> Array:
        self.back_solves += 1
        return self._solve(np.where(self.free, right, 0.0))

    def _column(self, j: int) -> tuple[Array, Array]:
        """Border column of row j and the base solution for it, both (n,)."""
        if j not in self.columns:
            p = self.program
            if self.base[j]:
                column = p.K[p.unknown[j]].toarray().ravel()
            else:
                column = p.R[j].toarray().ravel()
            self.columns[j] = column, self._back_solve(column)
        return self.columns[j]

    def _border(self, changed: NDArray[np.intp]) -> None:
        """Columns, their base solutions and the Schur complement for the changed rows."""
        n = self.program.b.size
        pairs = [self._column(j) for j in changed]
        self.C = np.array([c for c, _ in pairs]).reshape(-1, n).T
        self.X = np.array([x for _, x in pairs]).reshape(-1, n).T
        released = self.base[changed]
        D = np.zeros((changed.size, changed.size))
        if released.any():
            at = self.program.unknown[changed[released]]
            D[:, released] = self.C[at].T
            D[released] = self.C[at]
        self.schur = self.C.T @ self.X - D

    def _bordered_solve(self, right: Array, below: Array) -> tuple[Array, Array]:
        x = self._back_solve(right)
        if below.size == 0:
            return x, below
        z = np.linalg.lstsq(self.schur, self.C.T @ x - below, rcond=1e-14)[0]
        return x - self.X @ z, z

    def solve(self, active: Mask) -> tuple[Array, Array]:
        """Minimiser and multipliers for one active set, rows of the set held at their bound."""
        p = self.program
        if self.base is None or (
            p.unknown is not None and np.count_nonzero(active != self.base) > BORDER
        ):
            self._refactorise(active)
        changed = np.flatnonzero(active != self.base)
        self._border(changed)
        released = self.base[changed]

        y = np.where(p.fixed, p.values, 0.0)
        if p.unknown is not None:
            y[p.unknown[self.base]] = p.g[self.base]
        force = np.zeros(p.g.size)
        scale = 0.0
        for refinement in range(2):
            residual = p.b - p.K @ y - p.R.T @ force
            below = p.g[changed] - p.R[changed] @ y
            if released.any():
                below[released] = residual[p.unknown[changed[released]]]
            size = np.abs(residual[self.free]).max(initial=0.0)
            if refinement and size <= 1e-14 * scale:
                break
            scale = max(size, scale)
            x, z = self._bordered_solve(residual, below)
            y += x
            if released.any():
                y[p.unknown[changed[released]]] += z[released]
            force[changed[~released]] += z[~released]
        if p.unknown is not None:
            y[p.unknown[active]] = p.g[active]
            force[:] = 0.0
            force[active] = (p.b - p.K @ y)[p.unknown[active]]
        return y, force

    def stiffness(self) -> Array:
        """Force per displacement at each row: an upper bound, or infinity where unknown."""
        p = self.program
        if p.unknown is not None:
            return p.K.diagonal()[p.unknown]
        stiffness = np.full(p.g.size, np.inf)
        for j, (column, solution) in self.columns.items():
            stiffness[j] = 1 / (column @ solution)
        return stiffness


def minimise(program: Program, factor: Factor, active: Mask | None = None) -> Minimiser:
    """Solve a quadratic program by semismooth Newton steps.

    Parameters
    ----------
    program : Program
        The problem.
    factor : callable
        ``factor(free)`` factorises K restricted to the unknowns of the mask `free` and returns
        a function that solves with it; its result is zero outside of `free`.
    active : ndarray of bool (m,), optional
        First active set; the equalities alone when left out.

    Returns
    -------
    Minimiser
        With `u` (n,) all unknowns and `force` (m,) the multipliers of all rows, equalities
        included.

    Raises
    ------
    ConvergenceError
        The step limit was reached; `iterate` holds the last `Minimiser`. Round-off of a matrix
        that is not positive definite is the only known way there.
    """
    p = program
    systems = _Systems(p, factor)
    active = p.equality.copy() if active is None else active | p.equality
    size = np.asarray(abs(p.R).sum(axis=1)).ravel()
    seen: set[bytes] = set()
    steps: list[int] = []
    fewest, patience, tie = p.g.size + 1, PATIENCE, TIE
    limit = 100 + 20 * p.g.size
    for _ in range(limit):
        y, force = systems.solve(active)
        length = tie * size * np.abs(y).max(initial=0.0)
        slack = p.g - p.R @ y
        # Ties keep their state: hysteresis against cycling on round-off.
        with np.errstate(invalid="ignore"):
            pulling = force < -length * np.where(active, systems.stiffness(), 0.0)
            penetrating = slack < -length - tie * np.abs(p.g)
        wrong = np.where(active, pulling, penetrating) & ~p.equality
        count = np.count_nonzero(wrong)
        if count < fewest:
            fewest, patience = count, PATIENCE
        else:
            patience -= 1
        if patience < 0:  # Murty's least-index rule until fewer rows are violated
            wrong[: np.flatnonzero(wrong)[-1]] = False
        steps.append(int(np.count_nonzero(wrong)))
        log.debug("Newton step %d: %d active, %d change", len(steps), active.sum(), steps[-1])
        if count == 0:
            break
        if (key := active.tobytes()) in seen:
            tie = min(10 * tie, WIDEST_TIE)
        seen.add(key)
        active = active ^ wrong
    result = Minimiser(
        u=y,
        force=force,
        active=active,
        steps=steps,
        factorizations=systems.factorizations,
        back_solves=systems.back_solves,
    )
    if count:
        raise ConvergenceError(
            f"the active set did not settle in {limit} Newton steps ({count} rows still change); "
            "check that the matrix is symmetric and positive definite",
            iterate=result,
        )
    return result


def _matrix(name: str, M: object, columns: int | None) -> sp.csr_matrix:
    """`M` as a CSR matrix, checked."""
    M = sp.csr_matrix(M, dtype=float)
    if columns is not None and M.shape[1] != columns:
        raise ValueError(f"{name} has {M.shape[1]} columns; it must have {columns}, one per unknown")
    if not np.isfinite(M.data).all():
        raise ValueError(f"{name} has entries that are NaN or infinite; all must be finite numbers")
    return M


def _vector(name: str, v: object, size: int) -> Array:
    """`v` as a vector, checked."""
    v = np.asarray(v, dtype=float)
    if v.shape != (size,):
        raise ValueError(f"{name} has shape {v.shape}; it must be ({size},)")
    if not np.isfinite(v).all():
        raise ValueError(f"{name} has entries that are NaN or infinite; all must be finite numbers")
    return v


def solve_qp(
    A: sp.spmatrix,
    f: Array,
    B: sp.spmatrix,
    g: Array,
    E: sp.spmatrix | None = None,
    e: Array | None = None,
    active: Mask | None = None,
) -> Minimiser:
    """Minimise 1/2 u'Au - f'u subject to B u <= g and E u = e.

    Parameters
    ----------
    A : sparse or dense (n, n)
        Symmetric and positive definite.
    f : array (n,)
        Load.
    B, g : (m, n) and (m,)
        Inequalities; the rows that can be active together, with those of E, are independent.
    E, e : (k, n) and (k,), optional
        Equations.
    active : array of bool (m,), optional
        First active set; empty when left out.

    Returns
    -------
    Minimiser
        With `u` (n,), `force` (m,) >= 0, `multiplier` (k,), `active` (m,) and `steps`: the
        KKT conditions A u + B' force + E' multiplier = f, force >= 0, B u <= g,
        force' (B u - g) = 0 hold to round-off.

    Raises
    ------
    ValueError
        Shapes that do not fit, entries that are not finite, A not symmetric or not positive
        definite.
    ConvergenceError
        See `minimise`.

    Notes
    -----
    A is factorised once; an active row costs one back-solve, once.

    Examples
    --------
    >>> result = solve_qp([[2.0, 0.0], [0.0, 2.0]], [2.0, 2.0], [[1.0, 0.0]], [0.25])
    >>> result.u.round(12).tolist(), result.force.round(12).tolist(), result.steps
    ([0.25, 1.0], [1.5], [1, 0])
    """
    A = _matrix("A", A, None)
    n = A.shape[1]
    if A.shape[0] != n:
        raise ValueError(f"A has shape {A.shape}; it must be square")
    if abs(A - A.T).max() > 1e-10 * abs(A).max():
        raise ValueError("A is not symmetric; it must equal its transpose")
    B = _matrix("B", B, n)
    f, g = _vector("f", f, n), _vector("g", g, B.shape[0])
    E = sp.csr_matrix((0, n)) if E is None else _matrix("E", E, n)
    e = _vector("e", np.zeros(0) if e is None else e, E.shape[0])
    m = g.size
    start = np.zeros(m, dtype=bool) if active is None else np.asarray(active)
    if start.shape != (m,) or start.dtype != bool:
        raise ValueError(f"active is {active!r}; it must be {m} booleans, one per row of B")

    def factor(free: Mask) -> Solve:
        lu = splu(A.tocsc(), permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0,
                  options={"SymmetricMode": True})
        if (lu.U.diagonal() <= 0).any() or (lu.perm_r != lu.perm_c).any():
            raise ValueError("A is not positive definite; all its eigenvalues must be positive")
        return lu.solve

    program = Program(
        K=A,
        b=f,
        R=sp.vstack([B, E], format="csr"),
        g=np.concatenate([g, e]),
        equality=np.arange(m + e.size) >= m,
        fixed=np.zeros(n, dtype=bool),
        values=np.zeros(n),
    )
    result = minimise(program, factor, np.concatenate([start, np.zeros(e.size, dtype=bool)]))
    return Minimiser(
        u=result.u,
        force=result.force[:m],
        multiplier=result.force[m:],
        active=result.active[:m],
        steps=result.steps,
        factorizations=result.factorizations,
        back_solves=result.back_solves,
    )
