"""Quadratic programs for users with matrices of their own: checked, factorised by SciPy, solved.

The discrete problems HH81 (P_1h), (P_2h) in algebraic form; `active_set` holds the method.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import splu

from ..arrays import Array, Factor, Mask, Solve
from .active_set import minimise
from .quadratic_program import Iterate, QuadraticProgram
from .schur_complement import bordered_systems

SYMMETRIC = 1e-10  # difference of A and its transpose, relative to the largest entry

Matrix: TypeAlias = sp.sparray | sp.spmatrix | ArrayLike  # a dense one may be a list of rows


def _matrix(name: str, M: Matrix, columns: int | None) -> sp.csr_array:
    """`M` as a CSR array, checked."""
    matrix = sp.csr_array(M if sp.issparse(M) else np.atleast_2d(M), dtype=float)
    if matrix.ndim != 2:  # SciPy has sparse vectors, too
        raise ValueError(f"{name} has shape {matrix.shape}; it must have rows and columns")
    if columns is not None and matrix.shape[1] != columns:
        raise ValueError(
            f"{name} has {matrix.shape[1]} columns; it must have {columns}, one per unknown"
        )
    if not np.isfinite(matrix.data).all():
        raise ValueError(f"{name} has entries that are NaN or infinite; all must be finite numbers")
    return matrix


def _vector(name: str, v: object, size: int) -> Array:
    """`v` as a vector, checked."""
    v = np.asarray(v, dtype=float)
    if v.shape != (size,):
        raise ValueError(f"{name} has shape {v.shape}; it must be ({size},)")
    if not np.isfinite(v).all():
        raise ValueError(f"{name} has entries that are NaN or infinite; all must be finite numbers")
    return v


def _factor(K: sp.csr_array) -> Factor:
    """Factorisation of the whole of K, all of whose unknowns are free."""

    def factor(free: Mask) -> Solve:
        lu = splu(
            K.tocsc(),
            permc_spec="MMD_AT_PLUS_A",
            diag_pivot_thresh=0.0,
            options={"SymmetricMode": True},
        )
        if (lu.U.diagonal() <= 0).any() or (lu.perm_r != lu.perm_c).any():
            raise ValueError("A is not positive definite; all its eigenvalues must be positive")
        return lu.solve

    return factor


def _program(
    A: Matrix, f: ArrayLike, B: Matrix, g: ArrayLike, E: Matrix | None, e: ArrayLike | None
) -> QuadraticProgram:
    """The program, inequalities before equations, of data that are checked here."""
    K = _matrix("A", A, None)
    n = K.shape[1]
    if K.shape[0] != n:
        raise ValueError(f"A has shape {K.shape}; it must be square")
    if abs(K - K.T).max() > SYMMETRIC * abs(K).max():
        raise ValueError("A is not symmetric; it must equal its transpose")
    rows, equations = _matrix("B", B, n), sp.csr_array((0, n)) if E is None else _matrix("E", E, n)
    (m, _), (k, _) = rows.shape, equations.shape
    load, bounds = _vector("f", f, n), _vector("g", g, m)
    values = _vector("e", np.zeros(0) if e is None else e, k)
    return QuadraticProgram(
        K=K,
        b=load,
        R=sp.vstack([rows, equations], format="csr"),
        g=np.concatenate([bounds, values]),
        equality=np.arange(m + k) >= m,
        fixed=np.zeros(n, dtype=bool),
        values=np.zeros(n),
    )


def solve_qp(
    A: Matrix,
    f: ArrayLike,
    B: Matrix,
    g: ArrayLike,
    E: Matrix | None = None,
    e: ArrayLike | None = None,
    active: ArrayLike | None = None,
) -> Iterate:
    """Minimise 1/2 u'Au - f'u subject to B u <= g and E u = e, in any consistent units.

    Parameters
    ----------
    A : sparse or dense (n, n)
        Symmetric and positive definite.
    f : array (n,)
        Load.
    B : (m, n)
        Left sides of inequalities; rows that can be active together are independent, with those
        of E, too.
    g : (m,)
        Their right sides.
    E : (k, n), optional
        Left sides of equations.
    e : (k,), optional
        Their right sides.
    active : array of bool (m,), optional
        First active set; empty when left out.

    Returns
    -------
    Iterate
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
    program = _program(A, f, B, g, E, e)
    m = np.count_nonzero(~program.equality)
    start = np.zeros(m, dtype=bool) if active is None else np.asarray(active)
    if start.shape != (m,) or start.dtype != bool:
        raise ValueError(f"active is {active!r}; it must be {m} booleans, one per row of B")
    first = np.concatenate([start, program.equality[m:]])
    result = minimise(bordered_systems(program, _factor(program.K)), first)
    force, multiplier = np.split(result.force, [m])
    return replace(result, force=force, multiplier=multiplier, active=result.active[:m])
