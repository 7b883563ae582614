"""The pressure p* on Gamma_K: near the discrete stress, not negative, in balance."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ....arrays import Array
from ....errors import ContactError
from ....qp import solve_qp

NEARNESS = 0.3  # weight of |p* + sigma_n|^2 h / E; measured best for the bound, and flat about it
TOTALS = 1.0  # ... of the squared sums of what forces and p* differ by, over E
STEPS = 30
UNBALANCED = 1e-12  # resultants, relative, that are met but for round-off
NEGATIVE = 1e-13  # relative, what a pressure or a multiplier must exceed to change sides


@dataclass(frozen=True, eq=False)
class Side:
    """Stress of one body at q points of Gamma_K.

    Attributes
    ----------
    p : sparse (q, m)
        Values of p* from its coefficients.
    target : ndarray (q,)
        -sigma_n of the discrete stress there.
    weight : ndarray (q,)
        Of quadrature, times size over modulus of the element.
    """

    p: sp.csr_array
    target: Array
    weight: Array


@dataclass(frozen=True, eq=False)
class Sums:
    """Moments of hats along a line, v of them, with the forces that p* stands for.

    Attributes
    ----------
    moments : sparse (v, m)
        Of p*, vertex after vertex along the line.
    forces : ndarray (v,)
        The same of the discrete forces.
    weight : ndarray (v,)
        One over a modulus and what the circumference adds to a length, past each vertex.
    """

    moments: sp.csr_array
    forces: Array
    weight: Array
    open_: bool


def best_pressure(
    sides: Sequence[Side],
    sums: Sequence[Sums],
    closing: Array,
    bounds: tuple[Array, Array],
    balance: Sequence[Array],
) -> Array:
    """Coefficients (m,) of p*.

    Parameters
    ----------
    sides, sums
        What p* shall be near to.
    closing : ndarray (m,)
        Integrals of the basis functions times the open gap.
    bounds : tuple of ndarray (m,), (m,)
        The least and the largest coefficients: not negative on unilateral pairs.
    balance : sequence of ndarray (c, m), (c,)
        Resultants that bodies without supports need.

    Raises
    ------
    ContactError
        No such pressure balances the loads.
    """
    m = len(closing)
    H, f = np.zeros((m, m)), -closing.copy()
    for side in sides:
        weighted = sp.diags_array(NEARNESS * side.weight) @ side.p
        H += (side.p.T @ weighted).toarray()
        f += weighted.T @ side.target
    for line in sums:
        C, c = np.cumsum(line.moments.toarray(), axis=0), np.cumsum(line.forces)
        if line.open_:
            C, c = C - C.mean(axis=0), c - c.mean()
        weighted = (TOTALS * line.weight[:, None] * C).T
        H += weighted @ C
        f += weighted @ c
    return _minimiser(H, f, bounds, *balance)


def _minimiser(H: Array, f: Array, bounds: tuple[Array, Array], A: Array, a: Array) -> Array:
    """The least b.Hb / 2 - f.b with A b = a within `bounds`, by primal-dual active sets."""
    m, c, (low, high) = len(f), len(a), bounds
    if m == 0:
        if np.abs(a).max(initial=0.0) > 0:
            raise ContactError("no pressure balances the loads of a body that contact alone holds")
        return np.zeros(0)
    side, b = np.zeros(m), np.zeros(m)  # at which of the bounds: -1, 0, +1
    for _ in range(STEPS):
        b = np.where(side < 0, low, np.where(side > 0, high, 0.0))
        free = np.flatnonzero(side == 0)
        K = np.zeros((len(free) + c, len(free) + c))
        K[: len(free), : len(free)] = H[np.ix_(free, free)]
        K[len(free) :, : len(free)] = A[:, free]
        K[: len(free), len(free) :] = A[:, free].T
        try:
            x = np.linalg.solve(K, np.concatenate([(f - H @ b)[free], a - A @ b]))
        except np.linalg.LinAlgError:
            break
        b[free] = x[: len(free)]
        slope = H @ b - f + A.T @ x[len(free) :]
        smallest = NEGATIVE * np.abs(b).max(), NEGATIVE * np.abs(f).max()
        under, over = b < low - smallest[0], b > high + smallest[0]
        leaving = side * slope > smallest[1]
        if not (under | over | leaving).any():
            b = np.clip(b, low, high)
            if _balances(b, A, a):  # too few are free, and K singular but for round-off
                return b
            break
        side = np.where(leaving, 0.0, side + over - 1.0 * under)
    return _surely(H, f, bounds, A, a)


def _surely(H: Array, f: Array, bounds: tuple[Array, Array], A: Array, a: Array) -> Array:
    """The same by a method that always ends, if there is a solution at all."""
    eye = sp.eye_array(len(f)).tocsr()
    low, high = (np.flatnonzero(np.isfinite(bound)) for bound in bounds)
    B = sp.vstack([-eye[low], eye[high]]).tocsr()
    g = np.concatenate([-bounds[0][low], bounds[1][high]])
    equations = (sp.csr_array(A), a) if len(a) else (None, None)
    try:
        b = solve_qp(sp.csr_array(H), f, B, g, *equations).u
    except (ContactError, ValueError) as error:
        raise ContactError(f"no pressure balances the loads: {error}") from error
    b = np.clip(b, *bounds)
    if not _balances(b, A, a):
        raise ContactError(
            "no pressure that is a polynomial of one sign on each segment balances the loads of a "
            "body that contact holds; give a finer mesh where it is held"
        )
    return b


def _balances(b: Array, A: Array, a: Array) -> bool:
    """Whether A b = a but for round-off."""
    terms = (np.abs(A) @ np.abs(b)).max(initial=0.0)
    return bool(np.abs(A @ b - a).max(initial=0.0) <= UNBALANCED * terms)
