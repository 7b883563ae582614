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
from ...linalg import cholesky, lower_half, summed
from ...qp import (
    BorderedSystems,
    QuadraticProgram,
    minimise,
    no_null_space,
    pinned_null_space,
    vanishing_combinations,
)
from .elements import Element, Multipliers, Stress, traces
from .facing import POINTS, FacingSides

FALLING_RATIO = 0.5  # ratio of two residuals from which more corrections take nothing off
MOMENT_ROUND_OFF = 1e-14  # of tractions, relative to the largest: nothing to correct
# Moment on a side that holds a motion which nothing resists, relative to the largest of tractions.
# Balanced loads have one where quadrature misses a part: on meshes of curves, whose middle is not
# that of the body, and of forces with kinks. Measured on S7: 1e-5 at maxh 0.45, 9e-7 at 0.27, 2e-7
# at 0.13.
UNBALANCED_LOAD = 1e-5
# Diagonal of K relative to the largest: coordinates on the axis are 0 to round-off, measured 1e-62.
AXIS_STIFFNESS = np.finfo(float).eps ** 2
# Ratio of a force to its limit up to which it stays as it is; each one above costs a back-solve.
# With 1.1 bars of the force are up to 2.9 times smaller, by up to 8 back-solves more.
LIMIT_SLACK = 4.0
DIAGONAL_SHIFT = 1e-14  # of the diagonal, for vertices where tractions depend on each other


@dataclass(frozen=True, eq=False)
class Balanced:
    """A stress in equilibrium, with the pressures on the lines."""

    s: Stress  # in equilibrium
    pressure: list[Array]  # (k, j) each, Bernstein coefficients of p*, per length (P1), eta (P2)
    unbalanced: Array  # (d,) moments of tractions that do not balance
    free_force: float  # sum of moments that hold free motions, a force per thickness


@dataclass(frozen=True, eq=False)
class DualProgram:
    """The matrix of d multipliers, factorised once for all loads."""

    multipliers: Multipliers
    lines: Sequence[FacingSides]  # contact and guides
    R: sp.csr_array  # (m, d) all rows over their `FacingSides.mass`
    T: sp.csr_array  # (d, d) mu = T y: each row is an unknown of y
    program: QuadraticProgram  # of y, with the bounds of the lines

    @cached_property
    def systems(self) -> BorderedSystems:
        """Its linear systems, factorised when the first is solved."""
        return BorderedSystems(self.program, cholesky(lower_half(self.program.K)))

    def __getstate__(self) -> dict[str, Any]:
        """All but the factor, which is made again."""
        return {name: value for name, value in vars(self).items() if name != "systems"}

    def nearest(
        self,
        elements: Sequence[Element],
        moments: Array,
        limits: Sequence[Array] | None = None,
        start: Balanced | None = None,
    ) -> Balanced:
        """The stress that minimises B^2 for given tractions, `moments` (d,), with p* >= 0.

        With `limits` (k, j) of each line, not negative: one near to the strain without a gap, whose
        |p*| are at most `LIMIT_SLACK` times these; it may be made from another one, `start`.

        Raises
        ------
        ContactError
            Loads on a body that moves freely are not in balance.
        """
        p, s = self.program, Stress(elements, [e.g for e in elements])
        alone, largest = s.traction_moments()
        idle = self._on_free_motions(moments - alone)
        holding = float(np.abs(idle).max())
        if holding > UNBALANCED_LOAD * largest:
            raise ContactError(
                "the loads on a body that moves freely are not in balance: the force on a side "
                f"that holds the motion is {holding:.1e}, the largest on any is {largest:.1e}; "
                "refine where they vary, or hold the body"
            )
        moments, y = moments - idle, np.zeros(len(p.b))
        if limits is None:
            low, high = np.where(p.equality, -np.inf, 0.0), np.full(len(p.g), np.inf)
            active = _joined([x.pressed for x in self.lines], bool)
        else:
            high = _joined([x.mass * limit for x, limit in zip(self.lines, limits, strict=True)])
            low, active = -high, high > 0
        if start is not None:
            s = start.s
        elif limits is None and len(active):
            self.systems.restart(replace(p, b=self.T.T @ (moments - alone)))
            found = minimise(self.systems, active)
            y, active = found.u, found.active
        force, last = np.zeros(len(p.g)), np.inf
        while True:
            # Stresses of stiff bodies are small differences of multipliers: tractions show what is
            # left. Rows beyond their limits, as those that pull by round-off, stay at these.
            change = self.T @ y
            parts = zip(elements, s.coefficients, strict=True)
            s = Stress(elements, [c + e.answer(change) for e, c in parts])
            total, largest = s.traction_moments()
            left = moments - total
            left -= self._on_free_motions(left)
            force = np.where(active, (self.T.T @ left)[p.unknown], force)
            beyond = active & ((force < LIMIT_SLACK * low) | (force > LIMIT_SLACK * high))
            active, force = active & ~beyond, np.where(beyond, np.clip(force, low, high), force)
            left = np.where(p.fixed, 0.0, left - self.R.T @ force)
            right = np.where(p.fixed, 0.0, self.T.T @ left)
            size = float(np.abs(right).max(initial=0.0))
            most = np.inf if beyond.any() else FALLING_RATIO * last
            if not MOMENT_ROUND_OFF * largest < size < most:
                break
            last = size
            self.systems.restart(replace(p, b=right, g=np.zeros_like(p.g)))
            y = self.systems.approach(active)
        mass = [x.mass for x in self.lines]
        ends = np.cumsum([m.size for m in mass])[:-1]
        each = zip(np.split(force, ends), mass, strict=bool(mass))
        pressure = [f.reshape(m.shape) / m for f, m in each]
        return Balanced(s, pressure, left, float(np.abs(idle).sum()))

    def _on_free_motions(self, load: Array) -> Array:
        """The part (d,) of a `load` (d,) that does work on free motions.

        The condition on the mean of these motions balances it, for s as for sigma: by tractions
        6 t (1 - t) = 1 - P_2(2 t - 1) on each side. They are 0 at vertices, where symmetric
        stresses on four sides that lie on two lines allow no others.
        """
        lineal, mu = self.T @ self.program.null_space.lineal, self.multipliers
        if lineal.shape[1] == 0:
            return np.zeros_like(load)
        mean = np.append(mu.start[:-1], mu.start[:-1] + mu.degree + 1)
        holding = np.zeros_like(lineal)
        holding[mean], holding[mean + 2] = lineal[mean], -lineal[mean] / 5**0.5
        return np.asarray(holding @ np.linalg.solve(lineal.T @ holding, lineal.T @ load))


def dual_program(
    mu: Multipliers,
    elements: Sequence[Element],
    fixed: Mask,
    motions: Array,
    lines: Sequence[FacingSides],
) -> DualProgram:
    """The program of the condensed triangles, with `lines` of contact and guides.

    Multipliers are `fixed` (d,) where no traction is given; `motions` (d, r) are those of rigid
    motions that supports leave free.
    """
    d = int(mu.start[-1])
    firsts = [mu.start[line.side, None] + np.arange(line.psi.shape[1]) for line in lines]
    unknown, null_space = _joined(firsts, np.intp), no_null_space(d)
    R, T = _basis(mu, lines, unknown)
    other = abs(T - sp.eye_array(d)).sum(axis=1) > 0
    parts = (part for e in elements for part in _of_unknowns(e, T, other))
    K = summed([(at, at, N.transpose(0, 2, 1) @ N) for at, N in parts], (d, d))
    size = K.diagonal()
    K.setdiag((1 + DIAGONAL_SHIFT) * size)
    idle = fixed | (size <= AXIS_STIFFNESS * size.max())  # on the axis there is no traction
    if motions.shape[1]:
        y = splu(T.tocsc()).solve(motions)
        y[idle] = 0.0
        lineal = vanishing_combinations(y[unknown])
        null_space = pinned_null_space(y, lineal, (y @ lineal).T, unknown, idle)
    program = QuadraticProgram(
        K=K,
        b=np.zeros(d),
        g=_joined([x.bound / x.mass for x in lines]),
        equality=_joined([np.full(x.mass.size, x.equality) for x in lines], bool),
        fixed=idle,
        values=np.zeros(d),
        unknown=unknown,
        null_space=null_space,
    )
    return DualProgram(mu, lines, R, T, program)


def _joined(parts: Sequence[Any], kind: type = float) -> Any:
    """All values of the `parts` in one array (k,) of a `kind`."""
    return np.concatenate([np.zeros(0, kind), *map(np.ravel, parts)])


def _basis(
    mu: Multipliers, lines: Sequence[FacingSides], unknown: Index
) -> tuple[sp.csr_array, sp.csr_array]:
    """`DualProgram.R` and `.T`, by the `unknown` (m,) of each row."""
    d, m, own, across, solved = int(mu.start[-1]), 0, [], [], []
    plain = np.ones(d, dtype=bool)
    for line in lines:
        means = line.psi.T * (line.weight[:, None] / line.mass[..., None])  # (k, n, j)
        load = means[:, :, None] * line.direction.swapaxes(1, 2)[:, None]
        row = m + np.arange(line.mass.size).reshape(line.mass.shape)
        m += row.size
        for degree in np.unique(mu.degree[line.side]):
            some = mu.degree[line.side] == degree
            R = (load[some] @ traces(degree, POINTS)).reshape(*row[some].shape, -1)
            at, rest = mu.of(line.side[some])[0], np.linalg.svd(R)[2][:, R.shape[1] :]
            plain[at] = False
            own.append((row[some], at, R))
            solved.append((at, at, np.linalg.inv(np.concatenate([R, rest], axis=1))))
        some = np.flatnonzero(line.other >= 0)
        at, there = mu.of(line.other[some])
        R = -(load[some] @ traces(at.shape[1] // 2 - 1, line.there[some])[:, None])
        R = R.reshape(*row[some].shape, at.shape[1]) * there[:, None]
        across.append((row[some], at, R))
    part = summed(solved, (d, d)) + sp.diags_array(plain.astype(float), format="csr")
    R = summed(across, (m, d))
    M, T = -part[:, unknown] @ R, part  # mu = part y + M mu, from the primary to the secondary
    while (part := M @ part).nnz:  # as often as bodies stand in a row
        T = T + part
    return summed(own, (m, d)) + R, T


def _of_unknowns(e: Element, T: sp.csr_array, other: Mask) -> list[tuple[Index, Array]]:
    """Unknowns y (b, k) and N T (b, m, k) of triangles: of those without rows `other`, and with.

    `other` (d,) are the rows of T that are not those of 1.
    """
    some = other[e.dofs].any(axis=1)
    b, d = e.dofs[some].shape
    rows = T[e.dofs[some].ravel()]
    of, row = np.divmod(np.repeat(np.arange(b * d), np.diff(rows.indptr)), d)
    key, place = np.unique(of * T.shape[1] + rows.indices, return_inverse=True)
    start, end = np.searchsorted(key // T.shape[1], [np.arange(b), np.arange(1, b + 1)])
    own = start[:, None] + np.arange((end - start).max(initial=0))
    own = np.where(own < end[:, None], own, start[:, None])  # more have no moments
    part = np.zeros((b, d, own.shape[1]))
    part[of, row, place - start[of]] = rows.data
    return [(e.dofs[~some], e.N[~some]), (key[own] % T.shape[1], e.N[some] @ part)]
