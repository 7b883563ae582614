"""Linear systems of a quadratic program for changing active sets, from few factorisations.

NumPy and SciPy only; the factorisation is an argument.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import scipy.sparse as sp
from scipy.optimize import nnls

from ..arrays import Array, Factor, Index, Mask, Solve
from .quadratic_program import Anchor, QuadraticProgram, SingularError

COARSE_RESIDUAL = 1e-11  # relative to the largest met, at which the next active set is chosen
FINE_RESIDUAL = 1e-14  # ... and of the last system
LOOSE_RESIDUAL = 1e-8  # ... that a step of another iteration may leave: rows change more than that
BORDER = 20  # back-solves that cost as much as a factorisation: measured 17 to 25
BORDER_ROUND_OFF = 1e-14  # of its singular values, relative to the largest
WEAK_RESISTANCE = 1e-2  # singular value, of motions of size 1, up to which a factor loses digits
WEAK = 1e-9  # stiffness of pins, compliance of rows in dense programs, that may be singular
SINGULAR_RESIDUAL = 1e-6  # residual, relative to the first, above which the matrix is singular
# ... unless it is that of values that balance each other.
BALANCE_ROUND_OFF = 64 * np.finfo(float).eps


@dataclass(eq=False)
class Base:
    """The factorised system K_0: that of one active set, with pins of motions it hardly resists."""

    active: Mask  # (m,) its active rows, none where rows are not unit rows
    pinned: Mask  # (q,) pins that it holds
    free: Mask  # (n,) its unknowns
    inverse: Solve  # K_0^-1
    # (k, n) solutions K_0^-1 v of the columns v so far, less 1 at the unknown that one releases:
    known: Array
    switched: Mask  # (m,) rows that have had such columns
    columns: list[tuple[Index, Array]] = field(default_factory=list)  # unknowns, values of v, (t,)
    # Which of them belongs to an unknown, or to row j by the key ~j:
    place: dict[int, int] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Border:
    """One system: the base with k columns V and rows V', D below; S = V' K_0^-1 V - D."""

    base: Base
    active: Mask  # (m,)
    anchor: Anchor | None
    at: Index  # (r,) unknowns that the base alone holds: released ones, and its pins
    rows: Index  # (k - r,) rows that only the system holds
    place: list[int]  # k places of V among the known columns of the base
    columns: list[tuple[Index, Array]]  # their unknowns and values (t,)
    size: Array  # (k,) roots of the diagonal of S
    # (k, k) the Schur complement, over these: only so are small pivots seen, as forces stand
    # beside displacements.
    S: Array

    def largest(self, residual: Array) -> float:
        """Largest unbalanced force of `residual` (n,) that the system is to remove."""
        return max(_largest(residual[self.base.free]), _largest(residual[self.at]))


class BorderedSystems:
    """The systems K y + R' force = b, R y = g on the active rows, force = 0 on the others.

    One set, the base, is factorised with pins held for all rigid motions that it hardly resists.
    Another set is reached by bordering that factor K_0 with one row and column for each row of R
    that changed state and for each of these pins, V and D, at one back-solve for each. A right side
    (r, w) then takes the three steps of Gill, Murray, Saunders, Wright (1990, A Schur-complement
    method for sparse quadratic programming):

    1. K_0 x = r
    2. S z = V'x - w with the Schur complement S = V' K_0^-1 V - D
    3. y = x - K_0^-1 V z

    Every solution corrects the one before, which leaves no residual outside of the border: the
    next one costs the back-solves of its new columns alone.

    Parameters
    ----------
    program : QuadraticProgram
        With n unknowns and m rows.
    factor : Factor
        Factorises the matrix of the free unknowns (n,): answers a function that solves for right
        sides (n,) which vanish at the others, as the solution does.
    border : int
        Back-solves for changed rows after which the next set is factorised: they cost as much.
    """

    program: QuadraticProgram  # that of the last `restart`
    y: Array  # (n,) the last solution
    force: Array  # (m,) its multipliers
    reaction: Array  # (q,) forces of its pins that are prescribed
    asked: Array  # (n,) the last solution of which `unbalanced` was asked ...
    internal: Array  # (n,) and K y of it
    scale: float  # largest force that a system was to balance
    factorizations: int  # since the last `restart`
    back_solves: int  # likewise; V-cycles count as such

    def __init__(self, program: QuadraticProgram, factor: Factor, border: int = BORDER) -> None:
        self.factor, self.border = factor, border
        self.base: Base | None = None
        self.system: Border | None = None
        self.restart(program)

    def restart(self, program: QuadraticProgram) -> None:
        """Begin with another load, other values or bounds; a factorisation stays."""
        self.program, self.system = program, None
        self.factorizations = self.back_solves = 0
        self._start(None if self.base is None else self.base.active)

    def _start(self, closed: Mask | None) -> None:
        """Start from prescribed values, and the bounds of the unit rows `closed` (m,)."""
        p = self.program
        self.y = np.where(p.fixed, p.values, 0.0)
        if closed is not None and p.R is None:
            self.y[p.unknown[closed]] = p.g[closed]
        self.force, self.asked, self.scale = np.zeros(p.g.size), np.zeros(0), 0.0
        self.reaction = np.zeros(p.null_space.pins.size)

    def forget(self) -> None:
        """Give the memory of the factorisation back; it is made again when asked for."""
        self.base = self.system = None

    def solve(
        self, active: Mask, anchor: Anchor | None = None, *, refined: bool = False
    ) -> tuple[Array, Array]:
        """Minimiser (n,) and multipliers (m,) with the rows `active` (m,) held at their bounds.

        The residual is 1e-11 of the first one, or `refined` to round-off. A matrix that is singular
        to working precision is a `SingularError`.
        """
        system = self.system
        if system is None or system.anchor is not anchor or (system.active != active).any():
            system = self._reach(active, anchor)
        self._improve(system, FINE_RESIDUAL if refined else COARSE_RESIDUAL)
        return self.y.copy(), self.force.copy()

    def approach(self, active: Mask) -> Array:
        """Minimiser (n,) for `active` (m,) after one correction, as a step of another iteration.

        That leaves residuals of `LOOSE_RESIDUAL` outside of the border to its next step.
        """
        self._reach(active, None, LOOSE_RESIDUAL)
        return self.y.copy()

    def unbalanced(self, active: Mask, anchor: Anchor | None = None) -> Array:
        """Unbalanced force b - K y - R' force, (n,), less that of the proximal terms.

        The unit rows `active` (m,) first take as their force what is left at their unknowns.
        """
        p = self.program
        if not np.array_equal(self.y, self.asked):  # it costs a quarter of a back-solve
            self.asked, self.internal = self.y.copy(), p.K @ self.y
        residual = p.b - self.internal
        if anchor is not None:
            pins = p.null_space.pins
            residual[pins] -= anchor.pull(self.y[pins])
            self.reaction = np.where(anchor.rigid, residual[pins], 0.0)
            residual[pins] -= self.reaction
        if p.R is None:
            self.force[:] = 0.0
            self.force[active] = residual[p.unknown[active]]
            residual[p.unknown[active]] = 0.0
            return residual
        return residual - p.pull(self.force)

    def complementary(self, wrong: Mask) -> Mask:
        """Active set (m,) that is right for the rows `wrong` (m,) and all that switched before.

        The other rows keep their state in the base. With the Schur complement C of these rows their
        slacks t minimise 1/2 t'C t + c't, t >= 0: a problem of nonnegative least squares. Where
        that does not end, all `wrong` rows switch.
        """
        p, system = self.program, self.system
        assert system is not None
        base, residual = system.base, self.unbalanced(system.active, system.anchor)
        border = self._bordered(base, base.active ^ (base.switched | wrong), system.anchor)
        r, held = border.at.size, np.flatnonzero(base.active & base.switched)
        row = np.concatenate([held, np.full(r - held.size, -1), border.rows])
        force, slack = self.force[row] * (row >= 0), (p.g - p.left_sides(self.y))[row]
        size = np.concatenate([np.sqrt(p.diagonal[border.at]), border.size[r:]])
        share = border.size / size
        S = border.S * share * share[:, None]
        # Of S z + w, forces at unknowns and slacks of added rows, the rows that the base does not
        # hold are inverted, for z = -t of the others and w = t of these.
        w = np.concatenate([force[:r] + residual[border.at], slack[r:]]) / size
        at, free = np.arange(row.size) >= held.size, (row >= 0) & ~p.equality[row]
        S.flat[:: row.size + 1] += WEAK * at * np.sign(row + 0.5)
        inverse = np.linalg.inv(S[at][:, at])
        across = S[:, at] @ inverse
        N = S - across @ S[at]
        N[:, at], N[at] = across, -across.T
        N[held.size :, held.size :] = inverse
        c = N @ np.where(at, -w, slack * size) + np.where(at, force * size, w)
        values, vectors = np.linalg.eigh((N * np.where(at, 1.0, -1.0))[free][:, free])
        root = np.sqrt(np.maximum(values, BORDER_ROUND_OFF * values[-1]))
        try:
            t, _ = nnls((vectors * root).T, -(vectors.T @ c[free]) / root)
        except RuntimeError:  # after three steps for each row
            return system.active ^ wrong
        active = system.active.copy()
        active[row[free]] = t == 0
        return active

    def stiffness(self) -> Array:
        """Force per displacement at each row, (m,): an upper bound, infinite where unknown."""
        p, base = self.program, self.base
        if p.R is None:
            return p.diagonal[p.unknown]
        stiffness = np.full(p.g.size, np.inf)
        if base is not None:
            for j, place in ((~key, place) for key, place in base.place.items() if key < 0):
                stiffness[j] = 1 / p.left_sides(base.known[place])[j]
        return stiffness

    def _reach(
        self, active: Mask, anchor: Anchor | None, tolerance: float = COARSE_RESIDUAL
    ) -> Border:
        """The system of an active set, after one correction."""
        p, base = self.program, self._base_near(active, anchor)
        self.system = system = self._bordered(base, active, anchor)
        self.force[~active] = 0.0
        if p.R is None:
            held = base.active & active
            self.y[p.unknown[held]] = p.g[held]
        if anchor is not None:
            self.y[p.null_space.pins[anchor.rigid]] = anchor.at[anchor.rigid]
        residual = self.unbalanced(active, anchor)
        self.scale = max(self.scale, system.largest(residual))
        self._correct(system, residual, tolerance)
        return system

    def _base_near(self, active: Mask, anchor: Anchor | None) -> Base:
        """The base, or a new one where rows have cost enough, or anchors pull at other pins."""
        p, base = self.program, self.base
        pulled = np.zeros(p.null_space.pins.size) if anchor is None else anchor.stiffness
        if base is not None and p.R is not None:
            return base
        if base is not None and not pulled[~base.pinned].any():
            added, at = self._changed(base, active, anchor)
            columns = base.place.keys() | {*at.tolist(), *(~added).tolist()}
            k = len(columns)
            if k <= self.border + np.count_nonzero(base.pinned) or k == len(base.place):
                return base
        self.forget()  # two factorisations at a time would double the memory
        closed = active & (p.R is None)
        held = p.unknown[closed] if p.R is None else p.unknown  # of other rows none
        weak = p.null_space.unresisted(held, WEAK_RESISTANCE)
        pinned = p.null_space.held_by(weak) | (pulled > 0)
        free = ~p.fixed
        free[np.concatenate([p.null_space.held, p.null_space.pins[pinned], held])] = False
        known, none = np.zeros((0, p.b.size)), np.zeros_like(closed)
        self.base = Base(closed, pinned, free, self.factor(free), known, none)
        self.factorizations += 1
        self._start(closed)
        return self.base

    def _changed(self, base: Base, active: Mask, anchor: Anchor | None) -> tuple[Index, Index]:
        """Rows that only the system of `active` (m,) holds, unknowns that only the base holds."""
        p = self.program
        pinned = base.pinned if anchor is None else base.pinned & ~anchor.rigid
        at = p.null_space.pins[pinned]
        if p.R is None:
            at = np.concatenate([p.unknown[base.active & ~active], at])
        return np.flatnonzero(active & ~base.active), at

    def _back_solve(self, base: Base, right: Array) -> Array:
        self.back_solves += 1
        return base.inverse(np.where(base.free, right, 0.0))

    def _bordered(self, base: Base, active: Mask, anchor: Anchor | None) -> Border:
        """The system of an active set as a border of the base, which learns its new columns."""
        p = self.program
        rows, at = self._changed(base, active, anchor)
        keys = np.concatenate([at, ~rows]).tolist()
        base.switched |= active ^ base.active
        known = [base.known]
        for key in [key for key in keys if key not in base.place]:
            if key < 0 and p.R is None:
                unknowns, values = p.unknown[[~key]], np.ones(1)
            else:
                unknowns, values = _row(p.K, key) if key >= 0 else _row(p.R, ~key)
            base.place[key] = len(base.columns)
            base.columns.append((unknowns, values))
            right = np.zeros(p.b.size)
            right[unknowns] = values
            known.append(self._back_solve(base, right))
            if key >= 0:
                known[-1][key] -= 1.0
        base.known = np.vstack(known)
        place = [base.place[key] for key in keys]
        columns = [base.columns[k] for k in place]
        S = np.zeros((len(keys), len(keys)))
        for row, (unknowns, values) in zip(S, columns, strict=True):
            row[:] = (base.known[:, unknowns] @ values)[place]
        if anchor is not None:
            stiffness = anchor.stiffness[base.pinned & ~anchor.rigid]
            pins = np.arange(at.size - stiffness.size, at.size)
            S[pins, pins] -= stiffness
        size = np.sqrt(np.abs(np.diagonal(S)))
        size = np.where(size > 0, size, 1.0)
        S /= np.outer(size, size)
        return Border(base, active, anchor, at, rows, place, columns, size, S)

    def _correct(self, system: Border, residual: Array, tolerance: float) -> None:
        """Add the solution for a residual (n,), one back-solve unless it is small outside V."""
        p, base, rows, at = self.program, system.base, system.rows, system.at
        x = np.zeros(p.b.size)
        if np.abs(residual[base.free]).max(initial=0.0) > tolerance * self.scale:
            x = self._back_solve(base, residual)  # step 1
        below = np.concatenate([residual[at], (p.g - p.left_sides(self.y))[rows]])
        if below.size:
            across = [values @ x[unknowns] for unknowns, values in system.columns]
            z = (
                np.linalg.lstsq(system.S, (across - below) / system.size, rcond=BORDER_ROUND_OFF)[0]
                / system.size
            )  # step 2
            x -= z @ base.known[system.place]  # step 3
            self.force[rows] += z[at.size :]
        self.y += x
        if p.R is None:
            self.y[p.unknown[system.active]] = p.g[system.active]

    def _improve(self, system: Border, tolerance: float) -> None:
        """Correct the solution once more if its residual is large."""
        p = self.program
        residual = self.unbalanced(system.active, system.anchor)
        if system.largest(residual) > tolerance * self.scale:
            self._correct(system, residual, tolerance)
            residual = self.unbalanced(system.active, system.anchor)
        # Where bounds alone drive the solution, forces come from rows or from elasticity.
        scale = max(self.scale, _largest(p.pull(self.force)), _largest(self.internal[~p.fixed]))
        balanced = ~p.fixed
        if system.anchor is not None:  # its force may turn what the held unknowns hold
            balanced[p.null_space.held] = False
        left = np.abs(residual[balanced]).max(initial=0.0)
        if not left <= SINGULAR_RESIDUAL * scale and not left <= self._round_off(balanced):
            raise SingularError(
                "the system for the current active set is singular to working precision: a body "
                "can move without resistance from supports or active contact, or bends over some "
                "1000 times its thickness, or moduli are too many powers of ten apart"
            )

    def _round_off(self, balanced: Mask) -> float:
        """Round-off of the forces of prescribed values on the unknowns `balanced` (n,)."""
        p = self.program
        given = abs(p.K) @ np.where(p.fixed, np.abs(p.values), 0.0)
        return BALANCE_ROUND_OFF * _largest(given[balanced])


def _row(C: sp.csr_array, i: int) -> tuple[Index, Array]:
    """Columns and values of row i; what SciPy does for that takes as long as a back-solve."""
    at = slice(C.indptr[i], C.indptr[i + 1])
    return C.indices[at], C.data[at]


def _largest(values: Array) -> float:
    return float(np.abs(values).max(initial=0.0))
