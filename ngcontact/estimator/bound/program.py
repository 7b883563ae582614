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

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...linalg import change_of_basis, cholesky, handed_over
from ...qp import (
    BorderedSystems,
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
QUADRATURE = (
    1e-5  # of loads on motions that nothing resists, relative to the largest: 2e-6 at most in
)
# 346 scenes, less than 1e-8 in all but 8 of them, round-off in most
DEFINITE = 1e-12  # of the diagonal, added to what is factorised: vertices where tractions depend


@dataclass(frozen=True, eq=False)
class Rows:
    """R on the multipliers of k sides and of those that they face, for j Bernstein polynomials.

    Attributes
    ----------
    facing : Facing
    own : list of ndarray (j, d)
        On each side.
    opposite : list of ndarray (j, d)
        On each side that it faces; empty without a primary.
    bound : ndarray (k, j)
        Integrals of psi_j (gap_h + r).
    mass : ndarray (k, j)
        Integrals of psi_j: the force of a unit coefficient.
    """

    facing: Facing
    own: list[Array]
    opposite: list[Array]
    bound: Array
    mass: Array


def rows_of(mu: Multipliers, facing: Facing, degree: int) -> Rows:
    """The rows of one line, with a pressure of a `degree`."""
    psi = bernstein(degree, PLACES)
    bound = ((facing.gap + facing.lift) * facing.weight) @ psi  # (3.9)
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
    def systems(self) -> BorderedSystems:
        """Its linear systems; what is factorised is the matrix made definite."""
        lower = sp.tril(self.program.K, format="csr")
        lower.setdiag((1 + DEFINITE) * self.program.diagonal)
        return bordered_systems(self.program, cholesky(handed_over(lower)))

    def __getstate__(self) -> dict[str, Any]:
        """All but the factor, which is made again."""
        return {name: value for name, value in vars(self).items() if name != "systems"}

    def nearest(self, elements: Sequence[Element], moments: Array) -> Balanced:
        """The stress and the p* >= 0 that minimise B^2 for given tractions, `moments` (d,).

        Raises
        ------
        ContactError
            Loads on a body that moves freely are not in balance.
        """
        alone, largest = exerted(elements, [e.g for e in elements])
        moments = self._resisted(moments, moments - alone)
        load = moments - alone
        load[np.abs(load) <= ROUND_OFF * largest] = 0.0  # no load where tractions depend
        program = replace(self.program, b=self.T.T @ load)
        closed = [np.repeat(x.facing.closed, x.bound.shape[1]) for x in self.lines]
        if not closed:  # one system, which need not be definite
            none = np.zeros(0)
            start = np.zeros_like(program.b), none
            return self._balanced(elements, moments, start, none.astype(bool), none, none)
        self.systems.restart(program)
        active = minimise(self.systems, np.concatenate(closed)).active
        while True:  # any p* >= 0 proves a bound: coefficients below 0 by round-off become 0
            y, force = _refined(self.systems, active)
            pulling = (force < 0) & ~program.equality
            if not pulling.any():
                low, high = np.where(program.equality, -np.inf, 0.0), np.full_like(force, np.inf)
                return self._balanced(elements, moments, (y, force), active, low, high)
            active = active & ~pulling

    def within(self, elements: Sequence[Element], limits: Sequence[Array]) -> Balanced:
        """The nearest stress without loads whose |q*| are at most `limits` (k, j) of each line.

        Coefficients that would be more stay at their limit.
        """
        alone, _ = exerted(elements, [e.g for e in elements])
        moments = self._resisted(np.zeros_like(alone), -alone)
        load = self.T.T @ (moments - alone)
        program = replace(self.program, g=np.zeros_like(self.program.g))
        every = zip(limits, self.lines, strict=True)
        limit = np.concatenate([(x * line.mass).ravel() for x, line in every] or [np.zeros(0)])
        free, force = limit > 0, np.zeros_like(limit)
        while True:
            b = load.copy()
            b[program.unknown[~free]] -= force[~free]
            self.systems.restart(replace(program, b=b))
            force[free] = self.systems.solve(free)[1][free]
            over = free & (np.abs(force) > limit)
            if not over.any():
                y, found = _refined(self.systems, free)
                force[free] = found[free]
                return self._balanced(elements, moments, (y, force), free, -limit, limit)
            force[over] = np.sign(force[over]) * limit[over]
            free = free & ~over

    def unbalanced(
        self, mu: Multipliers, elements: Sequence[Element], moments: Array, found: Balanced
    ) -> Array:
        """Forces (d,) that a stress and its pressures leave of given tractions, `moments` (d,)."""
        left = moments - exerted(elements, found.coefficients)[0]
        left -= pushed(mu, self.lines, found.pressure)
        return np.where(self.program.fixed, 0.0, left - self.idle(left))

    def idle(self, load: Array) -> Array:
        """The part (d,) of a `load` (d,) that does work on motions which nothing resists."""
        lineal = self.T @ self.program.null_space.lineal
        if lineal.shape[1] == 0:
            return np.zeros_like(load)
        return np.asarray(lineal @ np.linalg.solve(lineal.T @ lineal, lineal.T @ load))

    def _resisted(self, moments: Array, load: Array) -> Array:
        """Given tractions, `moments` (d,), without the idle part of the `load` (d,).

        That part is the error of quadrature, and round-off.
        """
        idle = self.idle(load)
        if np.abs(idle).max() > QUADRATURE * np.abs(load).max():
            raise ContactError(
                "the loads on a body that moves freely are not in balance: their work on the "
                f"motion is {np.abs(idle).max() / np.abs(load).max():.0e} of the largest; refine "
                "where they vary, or hold the body"
            )
        return np.asarray(moments - idle)

    def _balanced(
        self,
        elements: Sequence[Element],
        moments: Array,
        solution: tuple[Array, Array],
        held: Mask,
        low: Array,
        high: Array,
    ) -> Balanced:
        """The stress of a solution y, force, corrected until its tractions balance.

        Stresses of stiff bodies are small differences of multipliers. Rows that are `held` (m,)
        take what is left as their force, from `low` to `high` (m,).
        """
        p, (y, force) = self.program, solution
        change, solve, last = self.T @ y, None, np.inf
        coefficients = [e.g for e in elements]
        while True:
            coefficients = [
                c + e.answer(change) for e, c in zip(elements, coefficients, strict=True)
            ]
            total, largest = exerted(elements, coefficients)
            left = moments - total
            left = self.T.T @ (left - self.idle(left))
            left[p.fixed] = 0.0
            force = np.clip(np.where(held, left[p.unknown], force), low, high)
            left[p.unknown] -= force
            size = float(np.abs(left).max(initial=0.0))
            if not ROUND_OFF * largest < size < FALLING * last:
                break
            last = size
            if solve is None:
                free = ~p.fixed
                free[p.unknown[held]] = False
                solve = self.systems.factor(free)
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

    Parameters
    ----------
    fixed : ndarray of bool (d,)
        Multipliers of components on which no traction is given.
    motions : ndarray (d, r)
        Multipliers of rigid motions that supports leave free.
    lines : sequence of Rows
        Contact and guides.
    """
    size = int(mu.start[-1])
    K = _assembled(mu, elements)
    T, unknown, bound, equality = _basis(mu, lines, size)
    if len(unknown):
        K = K + change_of_basis(K, T)
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
    """Moments (d,) of the tractions of a stress over all triangles, and the largest of one.

    Parameters
    ----------
    coefficients : sequence of ndarray (b, m)
        Of the stress on the triangles of each element.
    """
    total, largest = np.zeros(1 + max(int(e.dofs.max()) for e in elements)), 0.0
    for e, c in zip(elements, coefficients, strict=True):
        own = e.tractions(c)
        np.add.at(total, e.dofs, own)
        largest = max(largest, float(np.abs(own).max(initial=0.0)))
    return total, largest


def _assembled(mu: Multipliers, elements: Sequence[Element]) -> sp.csr_array:
    """K (d, d): sums of N'N, written where they stand; each side has one block with each it meets.

    The rows of a side have the same columns, those of the sides of its triangles, rising.
    """
    count, wide = len(mu.degree), np.diff(mu.start)
    sides = np.concatenate([e.sides for e in elements])
    pairs = sides[:, :, None] * count + sides[:, None, :]
    blocks, number = np.unique(pairs, return_inverse=True)
    row, column = np.divmod(blocks, count)
    stop = np.cumsum(wide[column])
    last = np.searchsorted(row, np.arange(count), side="right")
    first = np.append(0, stop)[np.append(0, last[:-1])]  # of each side's columns among all
    length = stop[last - 1] - first
    largest = int((wide * length).sum())
    index = np.int32 if largest <= np.iinfo(np.int32).max else np.int64
    starts = np.append(0, np.cumsum(np.repeat(length, wide))).astype(index)
    columns = np.arange(stop[-1]) + np.repeat(mu.start[column] - stop + wide[column], wide[column])
    shift = (np.repeat(first, wide) - starts[:-1]).astype(index)
    at = np.arange(largest, dtype=index) + np.repeat(shift, np.diff(starts))
    indices = columns.astype(index)[at]
    place = starts[mu.start[row]] + stop - wide[column] - first[row]  # of each block's first entry
    data, number = np.zeros(largest), number.reshape(-1, 3, 3)
    groups = np.split(number, np.cumsum([len(e.sides) for e in elements])[:-1])
    for e, own in zip(elements, groups, strict=True):
        values, size = e.N.transpose(0, 2, 1) @ e.N, wide[e.sides[0]]
        ends = np.append(0, np.cumsum(size))
        for i, j in np.ndindex(3, 3):
            down = np.arange(size[i])[:, None] * length[e.sides[:, i], None, None]
            to = place[own[:, i, j], None, None] + down + np.arange(size[j])
            part = values[:, ends[i] : ends[i + 1], ends[j] : ends[j + 1]]
            np.add.at(data, to.ravel(), part.ravel())
    return sp.csr_array((data, indices, starts), shape=(int(mu.start[-1]),) * 2)


def pushed(mu: Multipliers, lines: Sequence[Rows], pressure: Sequence[Array]) -> Array:
    """Moments (d,) of the tractions R'p* that pressures of lines exert.

    Parameters
    ----------
    pressure : sequence of ndarray (k, j)
        Bernstein coefficients on the sides of each line.
    """
    total = np.zeros(int(mu.start[-1]))
    for line, p in zip(lines, pressure, strict=True):
        for i, side in enumerate(line.facing.side):
            total[mu.of(int(side))] += p[i] @ line.own[i]
            if line.opposite:
                total[mu.of(int(line.facing.other[i]))] += p[i] @ line.opposite[i]
    return total


def _basis(
    mu: Multipliers, lines: Sequence[Rows], count: int
) -> tuple[sp.csr_array, Index, Array, Mask]:
    """The change of basis: mu = T y with a y for each row over its `Rows.mass`.

    Its unknown, its bound, and whether it is an equation.
    """
    values, rows, columns = [], [], []
    unknown, bound, equality = [np.zeros(0, np.intp)], [np.zeros(0)], [np.zeros(0, bool)]
    plain = np.ones(count, dtype=bool)
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
    entries, to, of = (np.concatenate(x) for x in (values, rows, columns))
    G = from_triplets(entries, to, of, (count, count))
    T = G
    if steps:  # mu = G y + M mu, M from the primary's sides to the secondary's
        M = from_triplets(
            np.concatenate([b.ravel() for _, _, b in steps]),
            np.concatenate([np.repeat(i, len(j)) for i, j, _ in steps]),
            np.concatenate([np.tile(j, len(i)) for i, j, _ in steps]),
            (count, count),
        )
        term = M @ G
        while term.nnz:  # as often as bodies stand in a row
            T = T + term
            term = M @ term
    return T, np.concatenate(unknown), np.concatenate(bound), np.concatenate(equality)
