"""The dual contact problem: traces of displacements on sides, with the gap as bound.

Over all sides the tractions of `elements` add up to the given ones, K mu = b - R'p*, with

    R mu <= int psi_j (gap_h + r),    R mu = int psi_j d.(mu_secondary - mu_primary),

psi_j Bernstein polynomials: a quadratic program whose forces are the coefficients of p* >= 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ...arrays import Array, Factor, Index, Mask
from ...errors import ContactError
from ...linalg import cholesky, lower_half
from ...qp import (
    LinearSystems,
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

FALLING = 0.5  # ratio of two residuals from which more corrections take nothing off
ROUND_OFF = 1e-13  # of tractions, relative to the largest: nothing to correct
QUADRATURE = 1e-4  # of loads on motions that nothing resists, relative to the largest
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
    mass : ndarray (k, j)
        Integrals of psi_j: the force of a unit coefficient.
    """

    facing: Facing
    own: list[Array]
    opposite: list[Array]
    bound: Array
    mass: Array


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
    return Rows(facing, own, opposite, bound, facing.weight @ psi)


def _tested(mu: Multipliers, side: int, t: Array, psi: Array, load: Array) -> Array:
    """(j, d): integrals of psi (q, j) load (q, 2) times the multipliers of a side at t (q,)."""
    chi = traces(int(mu.degree[side]), t)
    return np.concatenate([psi.T @ (load[:, c, None] * chi) for c in (0, 1)], axis=1)


@dataclass(frozen=True, eq=False)
class Balanced:
    """A stress in equilibrium, and what acts on the lines.

    Attributes
    ----------
    coefficients : list of ndarray (b, m)
        Of the stress on the triangles of each `Element`.
    pressure : list of ndarray (k, j)
        Bernstein coefficients of p* on the sides of each line, per length (P1) or eta (P2).
    """

    coefficients: list[Array]
    pressure: list[Array]


@dataclass(frozen=True, eq=False)
class DualProgram:
    """The matrix of the multipliers, factorised once, for several loads.

    Attributes
    ----------
    lines : sequence of Rows
    T : sparse (d, d)
        mu = T y: each row is an unknown of y.
    program : QuadraticProgram
        Of y, with the bounds of the lines.
    """

    lines: Sequence[Rows]
    T: sp.csr_array
    program: QuadraticProgram

    @cached_property
    def factor(self) -> Factor:
        """Of the matrix, made definite."""
        K = self.program.K
        return cholesky(lower_half((K + sp.diags_array(DEFINITE * K.diagonal())).tocsr()))

    def __getstate__(self) -> dict[str, Any]:
        """All but the factor, which is made again."""
        return {name: value for name, value in vars(self).items() if name != "factor"}

    def nearest(self, elements: Sequence[Element], moments: Array) -> Balanced:
        """The stress and the p* >= 0 that minimise B^2 for given tractions, `moments` (d,)."""
        alone, _ = exerted(elements, [e.alone() for e in elements])
        moments = self.resisted(moments, moments - alone)
        program = replace(self.program, b=self.T.T @ (moments - alone))
        closed = np.concatenate(
            [np.repeat(x.facing.closed, x.bound.shape[1]) for x in self.lines] or [[]]
        )
        if not closed.size:  # one system, which need not be definite
            none = np.zeros(0, dtype=bool)
            start = np.zeros_like(program.b), np.zeros(0)
            return self._balanced(elements, moments, start, none, none)
        systems = bordered_systems(program, self.factor)
        active = minimise(systems, closed.astype(bool)).active
        while True:  # any p* >= 0 proves a bound: coefficients below 0 by round-off become 0
            y, force = _refined(systems, active)
            pulling = (force < 0) & ~program.equality
            if not pulling.any():
                signed = ~program.equality
                return self._balanced(elements, moments, (y, force), active, signed)
            active = active & ~pulling

    def within(self, elements: Sequence[Element], limits: Sequence[Array]) -> Balanced:
        """The nearest stress without loads whose |q*| are at most `limits` (k, j) of each line.

        Coefficients that would be more stay at their limit.
        """
        alone, _ = exerted(elements, [e.alone() for e in elements])
        moments = self.resisted(np.zeros_like(alone), -alone)
        load = self.T.T @ (moments - alone)
        program = replace(self.program, g=np.zeros_like(self.program.g))
        every = zip(limits, self.lines, strict=True)
        limit = np.concatenate([(x * line.mass).ravel() for x, line in every] or [np.zeros(0)])
        free, force = limit > 0, np.zeros_like(limit)
        while True:
            b = load.copy()
            b[program.unknown] -= np.where(free, 0.0, force)
            rows = np.flatnonzero(free)
            some = replace(
                program,
                b=b,
                R=program.R[rows],
                g=program.g[rows],
                equality=np.ones(len(rows), dtype=bool),
                unknown=program.unknown[rows],
            )
            every = np.ones(len(rows), dtype=bool)
            y, force[rows] = _refined(bordered_systems(some, self.factor), every)
            over = free & (np.abs(force) > limit)
            if not over.any():
                none = np.zeros_like(free)
                return self._balanced(elements, moments, (y, force), free, none)
            force[over] = np.sign(force[over]) * limit[over]
            free &= ~over

    def resisted(self, moments: Array, load: Array) -> Array:
        """Given tractions, `moments` (d,), without the work of a load (d,) on free motions.

        Nothing resists these motions; what a load does there is the error of quadrature.
        """
        lineal = self.T @ self.program.null_space.lineal
        if lineal.shape[1] == 0:
            return moments
        idle = lineal @ np.linalg.solve(lineal.T @ lineal, lineal.T @ load)
        if np.abs(idle).max() > QUADRATURE * np.abs(load).max():
            raise ContactError("the loads on a body that moves freely are not in balance")
        return np.asarray(moments - idle)

    def _balanced(
        self,
        elements: Sequence[Element],
        moments: Array,
        solution: tuple[Array, Array],
        held: Mask,
        signed: Mask,
    ) -> Balanced:
        """The stress of a solution y, force, corrected until its tractions balance.

        Stresses of stiff bodies are small differences of multipliers. Rows that are `held` (m,)
        take what is left as their force, those that are `signed` (m,) none below 0.
        """
        p, (y, force) = self.program, solution
        change, solve, last = self.T @ y, None, np.inf
        coefficients = [e.alone() for e in elements]
        while True:
            coefficients = [
                c + e.answer(change) for e, c in zip(elements, coefficients, strict=True)
            ]
            total, largest = exerted(elements, coefficients)
            left = self.T.T @ (self.resisted(moments, moments - total) - total)
            left[p.fixed] = 0.0
            force = np.where(held, left[p.unknown], force)
            force = np.where(signed, np.maximum(force, 0.0), force)
            left[p.unknown] -= force
            size = float(np.abs(left).max(initial=0.0))
            if not ROUND_OFF * largest < size < FALLING * last:
                break
            last = size
            if solve is None:
                free = ~p.fixed
                free[p.unknown[held]] = False
                solve = self.factor(free)
            change = self.T @ solve(np.where(free, left, 0.0))
        shapes = [x.bound.shape for x in self.lines]
        parts = np.split(force, np.cumsum([a * b for a, b in shapes]))[:-1]
        pressure = [
            q.reshape(x.mass.shape) / x.mass for q, x in zip(parts, self.lines, strict=True)
        ]
        return Balanced(coefficients, pressure)


def _refined(systems: LinearSystems, active: Mask) -> tuple[Array, Array]:
    """The solution for the rows `active` (m,), corrected as long as that takes the residual down.

    What is factorised is definite, which the matrix need not be.
    """
    p, last = systems.program, np.inf
    while True:
        y, force = systems.refine(active)
        left = p.b - p.K @ y
        left[p.unknown] -= force
        left[p.fixed] = 0.0
        size = float(np.abs(left).max(initial=0.0))
        if not 0 < size < FALLING * last:
            return y, force
        last = size


def dual_program(
    mu: Multipliers,
    elements: Sequence[Element],
    fixed: Mask,
    motions: Array,
    lines: Sequence[Rows],
) -> DualProgram:
    """The program of the condensed triangles.

    `fixed` (d,) are multipliers of components on which no traction is given, `motions` (d, r) those
    of rigid motions that supports leave free.
    """
    size = int(mu.start[-1])
    values, rows, columns = [], [], []
    for e in elements:
        d = e.dofs.shape[1]
        values.append((e.N.transpose(0, 2, 1) @ e.N).ravel())
        rows.append(np.repeat(e.dofs, d, axis=1).ravel())
        columns.append(np.tile(e.dofs, (1, d)).ravel())
    K = from_triplets(*(np.concatenate(x) for x in (values, rows, columns)), (size, size))
    T, unknown, bound, equality = _basis(mu, lines, size)
    if len(unknown):
        K = (T.T @ K @ T).tocsr()
    m, idle = len(unknown), fixed | (K.diagonal() <= 0)  # on the axis there is no traction
    program = QuadraticProgram(
        K=K,
        b=np.zeros(size),
        R=from_triplets(np.ones(m), np.arange(m), unknown, (m, size)),
        g=bound,
        equality=equality,
        fixed=idle,
        values=np.zeros(size),
        unknown=unknown,
        null_space=_null_space(motions, T, unknown, idle),
    )
    return DualProgram(lines, T, program)


def _null_space(motions: Array, T: sp.csr_array, unknown: Index, fixed: Mask) -> NullSpace:
    """Rigid motions, multipliers (d, r), in the unknowns."""
    if motions.shape[1] == 0:
        return no_null_space(len(motions))
    y = splu(T.tocsc()).solve(motions)
    y[fixed] = 0.0
    lineal = vanishing_combinations(y[unknown])
    return pinned_null_space(y, lineal, (y @ lineal).T, unknown, fixed)


def exerted(elements: Sequence[Element], coefficients: Sequence[Array]) -> tuple[Array, float]:
    """Moments (d,) of the tractions of a stress over all triangles, and the largest of one."""
    total, largest = np.zeros(1 + max(int(e.dofs.max()) for e in elements)), 0.0
    for e, c in zip(elements, coefficients, strict=True):
        own = e.tractions(c)
        np.add.at(total, e.dofs, own)
        largest = max(largest, float(np.abs(own).max(initial=0.0)))
    return total, largest


def pushed(mu: Multipliers, lines: Sequence[Rows], pressure: Sequence[Array]) -> Array:
    """Moments (d,) of the tractions R'p that pressures of lines exert."""
    total = np.zeros(int(mu.start[-1]))
    for line, p in zip(lines, pressure, strict=True):
        for i, side in enumerate(line.facing.side):
            total[mu.of(int(side))] += p[i] @ line.own[i]
            if line.opposite:
                total[mu.of(int(line.facing.other[i]))] += p[i] @ line.opposite[i]
    return total


def _basis(
    mu: Multipliers, lines: Sequence[Rows], size: int
) -> tuple[sp.csr_array, Index, Array, Mask]:
    """The change of basis: mu = T y with a y for each row over its `Rows.mass`.

    Its unknown, its bound, and whether it is an equation.
    """
    values, rows, columns = [], [], []
    unknown, bound, equality = [np.zeros(0, np.intp)], [np.zeros(0)], [np.zeros(0, bool)]
    plain = np.ones(size, dtype=bool)
    steps = []

    def put(i: Index, j: Index, block: Array) -> None:
        values.append(block.ravel())
        rows.append(np.repeat(i, len(j)))
        columns.append(np.tile(j, len(i)))

    for line in lines:
        j = line.bound.shape[1]
        for i, side in enumerate(line.facing.side):
            own = mu.of(int(side))
            plain[own] = False
            left, size_of, right = np.linalg.svd(line.own[i] / line.mass[i, :, None])
            inverse = right[:j].T @ (left.T / size_of[:, None])
            put(own, own[:j], inverse)
            put(own, own[j:], right[j:].T)
            if line.opposite:
                block = -inverse @ (line.opposite[i] / line.mass[i, :, None])
                steps.append((own, mu.of(int(line.facing.other[i])), block))
            unknown.append(own[:j])
        bound.append((line.bound / line.mass).ravel())
        equality.append(np.full(line.bound.size, line.facing.equality))
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
    return T, np.concatenate(unknown), np.concatenate(bound), np.concatenate(equality)
