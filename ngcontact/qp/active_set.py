"""Newton iteration for one active-set problem, with the safeguards that make it finite.

NumPy and SciPy only.
"""

from __future__ import annotations

import logging

import numpy as np

from ..arrays import Array, Mask
from ..errors import ConvergenceError
from .null_space import FREE
from .quadratic_program import Iterate
from .schur_complement import Anchor, BorderedSystems, SingularError

log = logging.getLogger("ngcontact")

TIE = 1e-13  # relative size below which a force or a slack keeps its state
CLEAR = 1e-9  # ... below which it is judged by the refined solution only
WIDEST_TIE = 1e-9  # ... and to which that grows, tenfold, each time an active set comes back
PATIENCE = 10  # full switches allowed without fewer violated rows (Judice, Pires 1994)

PROXIMAL = 1e-3  # of the stiffness at the pins, where contact leaves rigid motions free
WEAKEST = 1e-6  # of that, to which it falls, tenfold at each proximal step
RESTED = 1e-14  # force of the proximal term, relative to stiffness times displacement
STEADY = 0.9  # ratio of that force to the last from which a motion is steady, not slowing down
OUTER = 100  # proximal steps; most problems need less than five


class ActiveSetIteration:
    """Newton iteration for one quadratic program with changing proximal terms."""

    def __init__(self, systems: BorderedSystems, state: Mask) -> None:
        self.program = program = systems.program
        self.systems = systems
        self.state = state
        self.y = np.where(program.fixed, program.values, 0.0)
        self.force = np.zeros(program.g.size)
        self.steps: list[int] = []
        self.extent = 0.0  # largest displacement met so far
        self.size = np.asarray(abs(program.R).sum(axis=1)).ravel()

    def resisted(self) -> bool:
        """Whether the active rows resist all motions they can."""
        p = self.program
        return p.null_space.pins.size == 0 or p.null_space.resisted(p.unknown[self.state])

    def result(self) -> Iterate:
        """The current iterate, with the lineal motions that its conditions ask for."""
        null_space, y = self.program.null_space, self.y
        if null_space.held.size:
            y = y - null_space.lineal @ (null_space.conditions @ y)
        return Iterate(
            u=y,
            force=self.force,
            active=self.state,
            steps=self.steps,
            factorizations=self.systems.factorizations,
            back_solves=self.systems.back_solves,
        )

    def advance(self, moved: Array) -> float:
        """Activate the row that a steady rigid motion, given at the pins, meets first.

        Returns how often that motion leads there, 0 if it meets none.
        """
        p, null_space = self.program, self.program.null_space
        motion = null_space.others @ np.linalg.solve(null_space.others[null_space.pins], moved)
        approach = np.where(self.state, 0.0, motion[p.unknown])
        meets = approach > FREE * np.abs(moved).max()
        if not meets.any():
            return 0.0
        slack = p.g - self.y[p.unknown]
        steps = np.divide(slack, approach, out=np.full(slack.shape, np.inf), where=meets)
        self.state = self.state.copy()
        self.state[steps.argmin()] = True
        return float(steps.min())

    def _violated(self, tie: float) -> Mask:
        """Active rows that pull and others that penetrate, by more than ties."""
        p, stiffness = self.program, self.systems.stiffness()
        # Displacements met so far: all of them may vanish while forces tie.
        with np.errstate(divide="ignore", invalid="ignore"):
            reached = np.nanmax(np.abs(self.force) / stiffness, initial=0.0)
        self.extent = max(self.extent, np.abs(self.y).max(initial=0.0), reached)
        length = tie * self.size * self.extent
        slack = p.g - p.R @ self.y
        # Ties keep their state: hysteresis against cycling on round-off.
        with np.errstate(invalid="ignore"):
            pulling = self.force < -length * np.where(self.state, stiffness, 0.0)
            penetrating = slack < -length - tie * np.abs(p.g)
        return np.where(self.state, pulling, penetrating) & ~p.equality

    def settle(self, anchor: Anchor | None) -> None:
        """Newton steps until the active set repeats or, without anchor, leaves a motion free."""
        seen: set[bytes] = set()
        fewest, patience, tie = self.program.g.size + 1, PATIENCE, TIE
        limit = 100 + 20 * self.program.g.size
        for _ in range(limit):
            try:
                self.y, self.force = self.systems.solve(self.state, anchor)
                wrong = self._violated(CLEAR)
                if not wrong.any():
                    self.y, self.force = self.systems.refine()
                    wrong = self._violated(tie)
            except SingularError as singular:
                raise ConvergenceError(
                    f"Newton step {len(self.steps) + 1}: {singular}", iterate=self.result()
                ) from None
            count = int(np.count_nonzero(wrong))
            if count < fewest:
                fewest, patience = count, PATIENCE
            else:
                patience -= 1
            if count and patience < 0:  # Murty's least-index rule until fewer rows are violated
                wrong[: np.flatnonzero(wrong)[-1]] = False
            self.steps.append(int(np.count_nonzero(wrong)))
            log.debug(
                "Newton step %d: %d active, %d change",
                *(len(self.steps), self.state.sum(), self.steps[-1]),
            )
            if count == 0:
                return
            if (key := self.state.tobytes()) in seen:
                tie = min(10 * tie, WIDEST_TIE)
            seen.add(key)
            self.state = self.state ^ wrong
            if anchor is None and not self.resisted():
                return
        raise ConvergenceError(
            f"the active set did not settle in {limit} Newton steps ({count} rows still change); "
            "check that the matrix is symmetric and positive definite",
            iterate=self.result(),
        )


def minimise(systems: BorderedSystems, active: Mask | None = None) -> Iterate:
    """Solve a quadratic program by semismooth Newton steps.

    Parameters
    ----------
    systems : BorderedSystems
        The program, with its factorisation where there is one already.
    active : ndarray of bool (m,), optional
        First active set; the equalities alone when left out.

    Returns
    -------
    Iterate
        With `u` (n,) all unknowns and `force` (m,) the multipliers of all rows, equalities
        included.

    Raises
    ------
    ConvergenceError
        A system is singular, or the step limit was reached, to which only a matrix that is not
        positive definite is known to lead. `iterate` holds the last `Iterate`.
    """
    p = systems.program
    state = p.equality.copy() if active is None else p.equality | active
    newton = ActiveSetIteration(systems, state)
    pins = p.null_space.pins
    hardness = p.diagonal[pins]  # of bodies that may be very unlike
    share = PROXIMAL
    anchor = Anchor(share * hardness, np.zeros(pins.size))
    last = np.inf
    for _ in range(OUTER):
        if newton.resisted():
            newton.settle(None)
            if newton.resisted():
                return newton.result()
        newton.settle(anchor)
        moved = newton.y[pins] - anchor.at
        force = anchor.stiffness * np.abs(moved)
        if (force <= RESTED * hardness * newton.extent).all():
            return newton.result()
        at = newton.y[pins]
        # A steady motion: go where it leads.
        if force.max() > STEADY * last and not newton.resisted():
            at = at + newton.advance(moved) * moved
        last = force.max()
        share = max(share / 10, WEAKEST * PROXIMAL)
        anchor = Anchor(share * hardness, at)
    raise ConvergenceError(
        f"the rigid motions did not settle in {OUTER} proximal steps", iterate=newton.result()
    )
