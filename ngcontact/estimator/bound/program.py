"""The dual contact problem: traces of displacements on sides, with the gap as bound.

Over all sides the tractions of `elements` add up to the given ones, K mu = b - R'p*, with

    R mu <= int psi_j (gap_h + r),    R mu = int psi_j d.(mu_secondary - mu_primary),

psi_j Bernstein polynomials: a quadratic program whose forces are the coefficients of p* >= 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy.sparse as sp

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...linalg import cholesky, lower_half
from ...qp import (
    NullSpace,
    QuadraticProgram,
    bordered_systems,
    minimise,
    no_null_space,
    pinned_null_space,
    vanishing_combinations,
)
from ...triplets import from_triplets
from .elements import Element, Multipliers, traces
from .facing import PLACES, Facing, bernstein

REFINED = 8  # steps of refinement of the stress, at most ...
ROUND_OFF = 1e-12  # ... until what does not balance is that little
QUADRATURE = 1e-4  # of loads on motions that nothing resists, relative to their terms
DEFINITE = 1e-13  # of the diagonal, added to what is factorised: vertices where tractions depend


@dataclass(frozen=True, eq=False)
class Rows:
    """R on the multipliers of k sides and of those that they face, for pressures of j functions.

    Attributes
    ----------
    facing : Facing
    own : list of ndarray (j, d)
        On each side.
    opposite : list of ndarray (j, d)
        On each side that it faces; empty without a primary.
    bound : ndarray (k, j)
    """

    facing: Facing
    own: list[Array]
    opposite: list[Array]
    bound: Array


def rows_of(mu: Multipliers, facing: Facing, degree: int) -> Rows:
    """The rows of one line, with a pressure of a degree."""
    psi = bernstein(degree, PLACES)
    bound = ((facing.gap + facing.lift) * facing.weight) @ psi
    load = facing.weight[..., None] * facing.direction
    own = [_tested(mu, side, PLACES, psi, f) for side, f in zip(facing.side, load, strict=True)]
    opposite = [
        -_tested(mu, side, t, psi, f)
        for side, t, f in zip(facing.other, facing.there, load, strict=True)
        if side >= 0
    ]
    return Rows(facing, own, opposite, bound)


def _tested(mu: Multipliers, side: int, t: Array, psi: Array, load: Array) -> Array:
    """(j, d): integrals of psi (q, j) load (q, 2) times the multipliers of a side at t (q,)."""
    chi = traces(int(mu.degree[side]), t)
    return np.concatenate([psi.T @ (load[:, c, None] * chi) for c in (0, 1)], axis=1)


@dataclass(frozen=True, eq=False)
class Solved:
    """The solution.

    Attributes
    ----------
    mu : ndarray (d,)
        All multipliers.
    coefficients : list of ndarray (b, m)
        Those of the stress in each group of triangles.
    pressure : list of ndarray (k, j)
        Coefficients of p* on each line.
    residual : ndarray (d,)
        Moments of tractions that do not balance.
    steps : int
    """

    mu: Array
    coefficients: list[Array]
    pressure: list[Array]
    residual: Array
    steps: int


def assembled(elements: Sequence[Element], size: int) -> tuple[sp.csr_array, Array]:
    """K, and what s without multipliers exerts on the sides (size,)."""
    values, rows, columns = [], [], []
    load = np.zeros(size)
    for e in elements:
        G = e.N.transpose(0, 2, 1) @ e.N
        d = e.dofs.shape[1]
        values.append(G.ravel())
        rows.append(np.repeat(e.dofs, d, axis=1).ravel())
        columns.append(np.tile(e.dofs, (1, d)).ravel())
        np.add.at(load, e.dofs, e.own + np.einsum("bmd,bm->bd", e.N, e.g))
    K = from_triplets(*(np.concatenate(x) for x in (values, rows, columns)), (size, size))
    return K, load


def solved(
    mu: Multipliers,
    elements: Sequence[Element],
    given: Array,
    fixed: Mask,
    motions: Array,
    lines: Sequence[Rows],
) -> Solved:
    """Minimise over the multipliers.

    Parameters
    ----------
    given : ndarray (d,)
        Moments of the given tractions.
    fixed : ndarray of bool (d,)
        Multipliers of components on which no traction is given.
    motions : ndarray (d, r)
        Those of rigid motions that supports leave free.
    """
    size = int(mu.start[-1])
    K, load = assembled(elements, size)
    T, unknown, bound, equality, start, mass = _basis(mu, lines, size)
    K, b = (T.T @ K @ T).tocsr(), T.T @ (given - load)
    diagonal = K.diagonal()
    null_space = _null_space(motions, T, unknown, fixed, diagonal <= 0)
    fixed = fixed | (diagonal <= 0)
    # Work on motions that nothing resists: quadrature leaves it, and the mesh of a curved body.
    idle = _left_over(null_space.lineal, b)
    if np.abs(idle).max(initial=0.0) > QUADRATURE * np.abs(b).max(initial=0.0):
        raise ContactError("the loads on a body that moves freely are not in balance")
    b = b - idle
    program = QuadraticProgram(
        K=K,
        b=b,
        R=from_triplets(
            np.ones(len(unknown)), np.arange(len(unknown)), unknown, (len(unknown), size)
        ),
        g=bound,
        equality=equality,
        fixed=fixed,
        values=np.zeros(size),
        unknown=unknown,
        null_space=null_space,
    )
    factor = cholesky(lower_half((K + sp.diags_array(DEFINITE * diagonal)).tocsr()))
    found = minimise(bordered_systems(program, factor), start)
    y, force = found.u, np.where(equality, found.force, np.maximum(found.force, 0.0))
    coefficients = [e.coefficients(T @ y) for e in elements]
    closed = equality | (force > 0)
    free = ~fixed
    free[unknown[closed]] = False
    solve = None
    for step in range(REFINED + 1):
        exerted, largest = np.zeros(size), 0.0
        for e, c in zip(elements, coefficients, strict=True):
            each = e.tractions(c)
            largest = max(largest, float(np.abs(each).max()))
            np.add.at(exerted, e.dofs, each)
        left = np.where(fixed, 0.0, T.T @ (given - exerted))
        force[closed] = left[unknown[closed]]
        force = np.where(equality, force, np.maximum(force, 0.0))
        left[unknown] -= force
        left -= _left_over(null_space.lineal, left)
        if step == REFINED or np.abs(left[free]).max(initial=0.0) <= ROUND_OFF * largest:
            break
        # Stresses of stiff bodies are small differences of multipliers.
        solve = solve or factor(free)
        change = T @ solve(np.where(free, left, 0.0))
        coefficients = [c + e.answer(change) for e, c in zip(elements, coefficients, strict=True)]
    sizes = [line.bound.size for line in lines]
    parts = np.split(force / mass, np.cumsum(sizes)[:-1]) if lines else []
    pressure = [p.reshape(line.bound.shape) for p, line in zip(parts, lines, strict=True)]
    return Solved(T @ y, coefficients, pressure, left, len(found.steps))


def _null_space(
    motions: Array, T: sp.csr_array, unknown: Index, fixed: Mask, idle: Mask
) -> NullSpace:
    """Rigid motions (d, r) in the unknowns, where multipliers are not `idle` (d,)."""
    if motions.shape[1] == 0:
        return no_null_space(len(motions))
    y = sp.linalg.splu(T.tocsc()).solve(motions)
    y[fixed | idle] = 0.0
    lineal = vanishing_combinations(y[unknown])
    return pinned_null_space(y, lineal, (y @ lineal).T, unknown, fixed | idle)


def _left_over(lineal: Array, b: Array) -> Array:
    """The part (n,) of a load `b` (n,) that does work on motions `lineal` (n, l)."""
    if lineal.shape[1] == 0:
        return np.zeros(len(b))
    return np.asarray(lineal @ np.linalg.solve(lineal.T @ lineal, lineal.T @ b))


def _basis(
    mu: Multipliers, lines: Sequence[Rows], size: int
) -> tuple[sp.csr_array, Index, Array, Mask, Mask, Array]:
    """Mu = T y with a y for each row over the integral of psi_j.

    Its unknown, bound, whether it is an equation, and closed; that integral.
    """
    values, rows, columns, unknown, bound, equality, start = [], [], [], [], [], [], []
    masses = [np.zeros(0)]
    plain = np.ones(size, dtype=bool)
    steps = []

    def put(i: Index, j: Index, block: Array) -> None:
        values.append(block.ravel())
        rows.append(np.repeat(i, len(j)))
        columns.append(np.tile(j, len(i)))

    for line in lines:
        j = line.bound.shape[1]
        mass = line.facing.weight @ bernstein(j - 1, PLACES)
        masses.append(mass.ravel())
        for i, side in enumerate(line.facing.side):
            own = mu.of(int(side))
            plain[own] = False
            left, sizes, right = np.linalg.svd(line.own[i] / mass[i, :, None])
            inverse = right[:j].T @ (left.T / sizes[:, None])
            put(own, own[:j], inverse)
            put(own, own[j:], right[j:].T)
            if line.opposite:
                opposite = line.opposite[i] / mass[i, :, None]
                steps.append((own, mu.of(int(line.facing.other[i])), -inverse @ opposite))
            unknown.append(own[:j])
        bound.append((line.bound / mass).ravel())
        equality.append(np.full(line.bound.size, line.facing.equality))
        start.append(np.repeat(line.facing.closed, j))
    rest = np.flatnonzero(plain)
    values.append(np.ones(len(rest)))
    rows.append(rest)
    columns.append(rest)
    G = from_triplets(*(np.concatenate(x) for x in (values, rows, columns)), (size, size))
    T = G
    if steps:  # mu = G y + M mu, M from the primary's sides to the secondary's
        M = from_triplets(
            np.concatenate([b.ravel() for _, _, b in steps]),
            np.concatenate([np.repeat(i, len(j)) for i, j, _ in steps]),
            np.concatenate([np.tile(j, len(i)) for i, j, _ in steps]),
            (size, size),
        )
        term = M @ G
        while term.nnz:  # as often as bodies stand in a row
            T = T + term
            term = M @ term
    if not lines:
        none = np.zeros(0)
        return T, none.astype(np.intp), none, none.astype(bool), none.astype(bool), none
    return T, *(np.concatenate(x) for x in (unknown, bound, equality, start, masses))
