"""Conditions of optimality of a quadratic program."""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp

from ..arrays import Array
from .quadratic_program import Iterate, QuadraticProgram

IN_CACHE = 1 << 14  # rows that are copied at a time: the copy stays in the cache


def terms(A: sp.csr_array, x: Array, rows: int = IN_CACHE) -> Array:
    """|A| |x| (m,), the size of the terms of A x, without a second matrix of that size.

    Parameters
    ----------
    A : sparse (m, n)
    x : ndarray (n,) or (n, k)
        With k columns the result is (m, k).
    rows : int
        Rows that are copied at a time.
    """
    x = np.abs(x)
    parts = [abs(A[start : start + rows]) @ x for start in range(0, A.shape[0], rows)]
    return np.concatenate([np.zeros((0, *x.shape[1:])), *parts])


def kkt_residuals(program: QuadraticProgram, minimiser: Iterate) -> dict[str, float]:
    """Dimensionless residuals of the Karush-Kuhn-Tucker conditions, see `Solution.residuals`.

    Parameters
    ----------
    program : QuadraticProgram
        With unit rows.
    minimiser : Iterate
        As computed.
    """
    p, y, force, active = program, minimiser.u, minimiser.force, minimiser.active
    gap = p.g - y[p.unknown]
    residual = p.b - p.K @ y - p.R.T @ force
    sizes = (p.b, terms(p.K, y), force)
    load = max(np.abs(x).max(initial=0.0) for x in sizes)
    length = max(np.abs(y).max(initial=0.0), np.abs(p.g[active]).max(initial=0.0))
    largest = np.abs(force).max(initial=0.0)
    one_sided = force[~p.equality]

    def over(value: float, scale: float) -> float:
        return float(value / scale) if value > 0 else 0.0

    return {
        "equilibrium": over(np.abs(residual[~p.fixed]).max(initial=0.0), load),
        "penetration": over(-gap.min(initial=0.0), length),
        "tension": over(-one_sided.min(initial=0.0), largest),
        "complementarity": float(np.abs(force / (largest or 1.0) * (gap / (length or 1.0))).sum()),
    }
