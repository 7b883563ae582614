"""Primal-dual active set method: semismooth Newton steps, with the safeguards that end them.

The steps of Hintermueller, Ito, Kunisch (2002, SIAM J. Optim. 13:865): (i) choose y and force;
(ii) rows with force + c (R y - g) > 0 are active, the others not; (iii) solve the linear system of
that set; (iv) stop when the set repeats, the iterate is the exact minimiser, else go to (ii). The
method alone can cycle on positive definite problems that are not M-matrices: where the wrong rows
do not become fewer, the small dense program of all rows that were wrong so far is solved in place
of (ii). As each step brings a row to it, or is the last one, the method is finite. A semidefinite
matrix, of bodies that supports do not hold, is met by exact proximal steps (Rockafellar 1976, SIAM
J. Control Optim. 14:877). NumPy and SciPy only.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import scipy.sparse as sp
from numpy.typing import ArrayLike
from scipy.sparse.linalg import splu

from ..arrays import Array, Factor, Mask, Solve, dense
from ..errors import ConvergenceError
from .quadratic_program import (
    NULL_SPACE_TOLERANCE,
    Anchor,
    Iterate,
    QuadraticProgram,
    SingularError,
    prescribing,
)
from .schur_complement import BorderedSystems

Matrix: TypeAlias = sp.sparray | sp.spmatrix | ArrayLike  # a dense one may be a list of rows

log = logging.getLogger("ngcontact")

SYMMETRIC = 1e-10  # difference of A and its transpose, relative to the largest entry
TIE = 1e-13  # relative size below which a force or a slack keeps its state
CLEAR_TIE = 1e-9  # ... below which it is judged by the refined solution only
WIDEST_TIE = 1e-9  # ... and to which that grows, tenfold, each time an active set comes back
ROW_RESIDUAL = 1e-8  # of active rows, relative to their terms: in vain in dependent ones

PROXIMAL = 1e-3  # of the stiffness at the pins, where contact leaves rigid motions free
MIN_PROXIMAL = 1e-6  # of that, to which it falls, tenfold at each proximal step
REST_FORCE = 1e-14  # force of the proximal term, relative to stiffness times displacement
REST_REACTION = 1e-12  # ... and that which prescribes a pin: round-off of a body's forces
IDLE_WORK = 1e-12  # work of a load on a motion, relative to that of its parts
STEADY_RATIO = 0.9  # of that force to the last, from which a motion is not slowing down
MAX_PROXIMAL = 100  # proximal steps; most problems need less than five


@dataclass(eq=False)
class ActiveSetIteration:
    """The iterate of one quadratic program."""

    systems: BorderedSystems  # of n unknowns and m rows
    active: Mask  # (m,) current active set
    size: Array  # (m,) sums of the sizes of the rows' coefficients
    y: Array  # (n,) solution of the last linear system
    force: Array  # (m,) its multipliers
    steps: list[int] = field(default_factory=list)  # changes after each linear system
    extent: float = 0.0  # largest displacement met so far

    def idle(self, anchor: Anchor | None = None) -> Mask | None:
        """Pins (q,), as many as motions that neither active rows nor an `anchor` resist.

        None if the load does work on one of these motions.
        """
        p = self.systems.program
        pins = p.null_space.pins
        held = np.zeros(pins.size, dtype=bool) if anchor is None else anchor.stiffness > 0
        if pins.size == 0 or held.all():
            return np.zeros(pins.size, dtype=bool)
        at = np.concatenate([p.unknown[self.active], pins[held]])
        combinations, (work, most) = p.null_space.unresisted(at), p.work
        if (np.abs(work @ combinations) > IDLE_WORK * (most @ np.abs(combinations))).any():
            return None
        return p.null_space.held_by(combinations)

    def rests(self, anchor: Anchor) -> bool:
        """Whether an anchor pulls at no pin."""
        p = self.systems.program
        pins = p.null_space.pins
        force = np.abs(self.systems.reaction) + np.abs(anchor.pull(self.y[pins]))
        limit = np.where(anchor.rigid, REST_REACTION, REST_FORCE) * p.diagonal[pins]
        return bool((force <= limit * self.extent).all())

    def result(self) -> Iterate:
        """The current iterate, with the lineal motions that its conditions require."""
        null_space, y = self.systems.program.null_space, self.y
        if null_space.held.size:
            y = y - null_space.lineal @ (null_space.conditions @ y)
        return Iterate(
            u=y,
            force=self.force,
            active=self.active,
            steps=self.steps,
            factorizations=self.systems.factorizations,
            back_solves=self.systems.back_solves,
        )

    def advance(self, moved: Array) -> float:
        """Activate the row that a steady rigid motion, `moved` (q,) at the pins, meets first.

        Returns how often that motion leads there, 0 if it meets none.
        """
        p = self.systems.program
        null_space = p.null_space
        at_pins = dense(null_space.others[null_space.pins])
        motion = null_space.others @ np.linalg.solve(at_pins, moved)
        approach = np.where(self.active, 0.0, motion[p.unknown])
        meets = approach > NULL_SPACE_TOLERANCE * np.abs(moved).max()
        if not meets.any():
            return 0.0
        slack = p.g - self.y[p.unknown]
        steps = np.divide(slack, approach, out=np.full(slack.shape, np.inf), where=meets)
        self.active = self.active.copy()
        self.active[steps.argmin()] = True
        return float(steps.min())

    def settle(self, anchor: Anchor | None) -> tuple[Anchor | None, bool]:
        """Newton steps until the active set repeats.

        Pins of idle motions that become free are prescribed, too. The anchor with these, and
        whether no other motion became free. Rows on the wrong side change theirs, all of them until
        solving the dense program costs less than full switches that left no fewer have cost.
        """
        fewest, wasted, small = np.inf, 0, False
        seen: set[bytes] = set()
        tie, limit = TIE, 100 + 2 * self.active.size
        for _ in range(limit):
            wrong = self._solved(anchor, tie)
            count = int(np.count_nonzero(wrong))
            self.steps.append(count)
            step = len(self.steps), self.active.sum(), count
            log.debug("Newton step %d: %d active, %d change", *step)
            if count == 0:
                return anchor, True  # (iv)
            wasted += self.systems.border * (count >= fewest)
            fewest = min(count, fewest)
            small = self.systems.system is not None and (small or count <= wasted)
            switched = self.systems.complementary if small else self.active.__xor__
            self.active = switched(wrong)  # (ii)
            if (key := self.active.tobytes()) in seen:  # by a cycle, or by round-off
                if small and tie == WIDEST_TIE:  # a motion is hardly resisted: see the caller
                    break
                tie = min(10 * tie, WIDEST_TIE)
            seen.add(key)
            if (idle := self.idle(anchor)) is None:
                return anchor, False
            anchor = prescribing(idle, anchor)
        held = 0 if anchor is None else np.count_nonzero(anchor.stiffness)
        if held < self.systems.program.null_space.pins.size:
            return anchor, False
        raise ConvergenceError(
            f"the active set did not settle in {len(self.steps)} Newton steps ({count} "
            "rows still change); check that the matrix is symmetric and positive definite",
            iterate=self.result(),
        )

    def _solved(self, anchor: Anchor | None, tie: float) -> Mask:
        """Solve the system of the active set; answer the rows (m,) that are on the wrong side."""
        try:
            self.y, self.force = self.systems.solve(self.active, anchor)  # (iii)
            wrong = self._violated(CLEAR_TIE)
            if not wrong.any():
                self.y, self.force = self.systems.solve(self.active, anchor, refined=True)
                wrong = self._violated(tie)
        except SingularError as singular:
            raise ConvergenceError(
                f"Newton step {len(self.steps) + 1}: {singular}", iterate=self.result()
            ) from None
        return wrong

    def _violated(self, tie: float) -> Mask:
        """Active rows that pull and others that penetrate, by more than ties."""
        p, stiffness = self.systems.program, self.systems.stiffness()
        # Displacements met so far: all of them may vanish while forces tie.
        with np.errstate(divide="ignore", invalid="ignore"):
            reached = np.nanmax(np.abs(self.force) / stiffness, initial=0.0)
        self.extent = max(self.extent, np.abs(self.y).max(initial=0.0), reached)
        length = tie * self.size * self.extent
        slack = p.g - p.left_sides(self.y)
        # Ties keep their state: hysteresis against cycling on round-off.
        with np.errstate(invalid="ignore"):
            pulling = self.force < -length * np.where(self.active, stiffness, 0.0)
            penetrating = slack < -length - tie * np.abs(p.g)
        return np.where(self.active, pulling, penetrating) & ~p.equality


def minimise(systems: BorderedSystems, active: Mask | None = None) -> Iterate:
    """Solve the quadratic program of `systems` by semismooth Newton steps.

    They begin with the first active set `active` (m,), the equalities alone when left out. The
    result has the multipliers of all rows, equalities included. A singular system, and the step
    limit, to which only a matrix that is not positive definite is known to lead, is a
    `ConvergenceError` with the last `Iterate`.
    """
    p = systems.program
    current = ActiveSetIteration(  # (i)
        systems=systems,
        active=p.equality.copy() if active is None else p.equality | active,
        size=np.ones(p.g.size) if p.R is None else np.asarray(abs(p.R).sum(axis=1)).ravel(),
        y=np.where(p.fixed, p.values, 0.0),
        force=np.zeros(p.g.size),
    )
    pins = p.null_space.pins
    hardness = p.diagonal[pins]  # of bodies that may be very unlike
    anchor = Anchor(PROXIMAL * hardness, np.zeros(pins.size))
    share, last = PROXIMAL, np.inf
    for _ in range(MAX_PROXIMAL):
        # On motions that stay free the load does no work: pins that hold them alone carry nothing.
        before = pins.size + 1
        while (idle := current.idle()) is not None and np.count_nonzero(idle) < before:
            held, settled = current.settle(prescribing(idle))
            if not settled:
                break
            if held is None or current.rests(held):
                return current.result()
            before = min(before - 1, int(np.count_nonzero(held.rigid)))
        # Rockafellar: the next y minimises L(y) + 1/2 stiffness (y - at)^2, until that force rests.
        current.settle(anchor)
        if current.rests(anchor):
            return current.result()
        at = current.y[pins]
        moved = at - anchor.at
        force = anchor.stiffness * np.abs(moved)
        # A steady motion: go where it leads.
        if force.max() > STEADY_RATIO * last:
            if not p.null_space.resisted(p.unknown[current.active]):
                at = at + current.advance(moved) * moved
        last = force.max()
        share = max(share / 10, MIN_PROXIMAL * PROXIMAL)
        anchor = Anchor(share * hardness, at)
    raise ConvergenceError(
        f"the rigid motions did not settle in {MAX_PROXIMAL} proximal steps",
        iterate=current.result(),
    )


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
        definite, rows that are active together and depend on or contradict each other.
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
    assert program.R is not None
    m = np.count_nonzero(~program.equality)
    start = np.zeros(m, dtype=bool) if active is None else np.asarray(active)
    if start.shape != (m,) or start.dtype != bool:
        raise ValueError(f"active is {active!r}; it must be {m} booleans, one per row of B")
    first = np.concatenate([start, program.equality[m:]])
    systems = BorderedSystems(program, _factor(program.K))
    result = minimise(systems, first)
    excess = program.left_sides(result.u) - program.g
    excess = np.where(result.active, np.abs(excess), excess)
    free = systems.approach(np.zeros_like(first))  # without rows: the solution may be 0
    length = max(np.abs(result.u).max(initial=0.0), np.abs(free).max(initial=0.0))
    excess -= ROW_RESIDUAL * (abs(program.R).sum(axis=1) * length + np.abs(program.g))
    if (excess > 0).any():
        raise ValueError(
            f"row {int(excess.argmax())} of B, E is missed by {excess.max():.3g}: active rows "
            "contradict or depend on each other"
        )
    force, multiplier = np.split(result.force, [m])
    return replace(result, force=force, multiplier=multiplier, active=result.active[:m])
