"""The dual contact problem: traces of displacements on sides, with the gap as bound.

Over all sides the tractions of `elements` add up to the given ones, K mu = b - R'p*, with

    R mu <= int psi_j (gap_h + r),    R mu = int psi_j d.(mu_secondary - mu_primary),

psi_j Bernstein polynomials: a quadratic program whose forces are the coefficients of p* >= 0.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import ngsolve as ng
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
from .cells import Cells
from .elements import Element, Multipliers, Stress, by_triangle, rigid_motions, traces
from .facing import POINTS, FacingSides
from .lifting import Prescribed
from .oscillation import EQUILIBRIUM_RESIDUAL, oscillation_norms, residuals
from .tractions import BoundaryData

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
class AdmissibleStress:
    """An admissible stress s on n triangles, compared with C e of a displacement u_h."""

    s: Stress  # in equilibrium
    force: Array  # (m,) of all rows
    pressure: list[Array]  # (k, j) each, Bernstein coefficients of p*, per length (P1), eta (P2)
    distance: Array  # (n,) |s - C e|, root of an energy per thickness
    loads: Array  # (n,) norms of what s misses of the data, the same
    work: float  # <s n, u_D - u_h> - int p* gap_h, an energy per thickness
    residual: float  # of equilibrium, relative to the largest stress
    free_force: float  # sum of moments that hold free motions, a force per thickness

    @property
    def size(self) -> float:
        """|s - C e| with what is missed, root of an energy per thickness."""
        return float(np.linalg.norm(self.distance + self.loads))


@dataclass(frozen=True, eq=False)
class DualProblem:
    """The dual contact problem on n cells with d multipliers, for the strain of a displacement."""

    cells: Cells
    given: BoundaryData
    prescribed: Sequence[Prescribed]  # u_D - u_h
    multipliers: Multipliers
    elements: Sequence[Element]
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

    def of_strain(self, strain: ng.CoefficientFunction) -> DualProblem:
        """The same for a displacement of another `strain` without loads, with the same factor."""
        found = replace(
            self,
            given=replace(self.given, loads=np.zeros_like(self.given.loads)),
            elements=[e.of_strain(e.places.evaluate(strain)) for e in self.elements],
        )
        vars(found)["systems"] = self.systems
        return found

    def nearest(
        self,
        least: float = 0.0,
        pressed: Array | None = None,
        limit: Callable[[float], float] | None = None,
    ) -> AdmissibleStress:
        """The admissible stress that minimises B^2, with p* >= 0.

        With `pressed` (m,), forces of another one: one near to the strain without a gap. Its forces
        are at most `LIMIT_SLACK` kappa times these, kappa as `limit` makes it of |s - C e|; any
        where they have any sign. Residuals are relative to the largest stress, which counts as
        `least` at the least.

        Raises
        ------
        ContactError
            Loads on a body that moves freely are not in balance, or no equilibrium is found.
        """
        p, moments = self.program, self.given.moments(self.multipliers)
        s = Stress(self.elements, [e.g for e in self.elements])
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
        one_sided, high = ~p.equality, np.full(len(p.g), np.inf)
        low = np.where(one_sided & (pressed is None), 0.0, -np.inf)
        if pressed is not None:
            active = p.equality | (pressed > 0)
        elif len(active := _joined([x.pressed for x in self.lines], bool)):
            self.systems.restart(replace(p, b=self.T.T @ (moments - alone)))
            found = minimise(self.systems, active)
            y, active = found.u, found.active
        force, last = np.zeros(len(p.g)), np.inf
        while True:
            # Stresses of stiff bodies are small differences of multipliers: tractions show what is
            # left. Rows beyond their limits, as those that pull by round-off, stay at these.
            change = self.T @ y
            parts = zip(self.elements, s.coefficients, strict=True)
            s = Stress(self.elements, [c + e.answer(change) for e, c in parts])
            total, largest = s.traction_moments()
            left = moments - total
            left -= self._on_free_motions(left)
            force = np.where(active, (self.T.T @ left)[p.unknown], force)
            if pressed is not None and limit is not None and last < np.inf:
                kappa, limit = limit(float(np.linalg.norm(s.norms()[0]))), None
                high[one_sided] = kappa * pressed[one_sided]
                low[one_sided] = -high[one_sided]
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
        return self._admissible(s, force, left, least, float(np.abs(idle).sum()))

    def _admissible(
        self, s: Stress, force: Array, left: Array, least: float, free_force: float
    ) -> AdmissibleStress:
        """A stress with a `force` (m,) on the rows, which leaves moments `left` (d,) unbalanced."""
        cells, given = self.cells, self.given
        distance, largest = s.norms()
        scale = max(largest, least)
        residual = float(residuals(cells, self.multipliers, left, scale).max())
        if not residual <= EQUILIBRIUM_RESIDUAL:
            raise ContactError(
                f"no equilibrated stress was found: the residual relative to the largest stress is "
                f"{residual:.1e}"
            )
        mass = [x.mass for x in self.lines]
        parts = np.split(force, np.cumsum([m.size for m in mass])[:-1]) if mass else []
        pressure = [part.reshape(m.shape) / m for part, m in zip(parts, mass, strict=True)]
        have = s.tractions(cells.owner[given.side], given.x, given.normal)
        missed = given.missed(have, self.lines, pressure, scale)
        forces, moduli = (
            by_triangle(self.elements, [getattr(e, name) for e in self.elements])
            for name in ("missed", "modulus")
        )
        loads = oscillation_norms(cells, forces, moduli, missed)
        work = sum(given.work(have, x.side, x.direction, x.amount) for x in self.prescribed)
        for line, p in zip(self.lines, pressure, strict=True):
            work -= float((line.force(p) * line.gap).sum())
        return AdmissibleStress(s, force, pressure, distance, loads, work, residual, free_force)

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


def dual_problem(
    cells: Cells,
    given: BoundaryData,
    prescribed: Sequence[Prescribed],
    mu: Multipliers,
    elements: Sequence[Element],
    lines: Sequence[FacingSides],
) -> DualProblem:
    """The problem of the condensed triangles, with `lines` of contact and guides."""
    d, fixed = int(mu.start[-1]), given.fixed(mu)
    firsts = [mu.start[line.side, None] + np.arange(line.psi.shape[1]) for line in lines]
    unknown, null_space = _joined(firsts, np.intp), no_null_space(d)
    turned = np.zeros(d, dtype=bool)  # multipliers whose rows of T are not those of 1
    for line in lines:
        turned[mu.of(line.side)[0]] = True
    R, T = _basis(mu, lines, unknown, turned)
    blocks, concerned = list[tuple[Index, Index, Array]](), list[tuple[Index, Index, Array]]()
    for e in elements:
        some = turned[e.dofs].any(axis=1)
        for parts, own in ((blocks, ~some), (concerned, some)):
            N, at = e.N[own], e.dofs[own]
            parts.append((at, at, N.transpose(0, 2, 1) @ N))
    part = (T.T @ summed(concerned, (d, d)) @ T).tocoo()
    K = summed([*blocks, (part.row[:, None], part.col[:, None], part.data[:, None, None])], (d, d))
    size = K.diagonal()
    K.setdiag((1 + DIAGONAL_SHIFT) * size)
    idle = fixed | (size <= AXIS_STIFFNESS * size.max())  # on the axis there is no traction
    motions = rigid_motions(cells, mu, fixed)
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
    return DualProblem(cells, given, prescribed, mu, elements, lines, R, T, program)


def _joined(parts: Sequence[Any], kind: type = float) -> Any:
    """All values of the `parts` in one array (k,) of a `kind`."""
    return np.concatenate([np.zeros(0, kind), *map(np.ravel, parts)])


def _basis(
    mu: Multipliers, lines: Sequence[FacingSides], unknown: Index, turned: Mask
) -> tuple[sp.csr_array, sp.csr_array]:
    """`DualProblem.R` and `.T`, by the `unknown` (m,) of each row and the `turned` ones (d,)."""
    d, m, own, across, solved = int(mu.start[-1]), 0, [], [], []
    for line in lines:
        means = line.psi.T * (line.weight[:, None] / line.mass[..., None])  # (k, n, j)
        load = means[:, :, None] * line.direction.swapaxes(1, 2)[:, None]
        row = m + np.arange(line.mass.size).reshape(line.mass.shape)
        m += row.size
        for degree in np.unique(mu.degree[line.side]):
            some = mu.degree[line.side] == degree
            R = (load[some] @ traces(degree, POINTS)).reshape(*row[some].shape, -1)
            at, rest = mu.of(line.side[some])[0], np.linalg.svd(R)[2][:, R.shape[1] :]
            own.append((row[some], at, R))
            solved.append((at, at, np.linalg.inv(np.concatenate([R, rest], axis=1))))
        some = np.flatnonzero(line.other >= 0)
        at, there = mu.of(line.other[some])
        R = -(load[some] @ traces(at.shape[1] // 2 - 1, line.there[some])[:, None])
        R = R.reshape(*row[some].shape, at.shape[1]) * there[:, None]
        across.append((row[some], at, R))
    part = summed(solved, (d, d)) + sp.diags_array((~turned).astype(float), format="csr")
    R = summed(across, (m, d))
    M, T = -part[:, unknown] @ R, part  # mu = part y + M mu, from the primary to the secondary
    while (part := M @ part).nnz:  # as often as bodies stand in a row
        T = T + part
    return summed(own, (m, d)) + R, T
