"""Newton iteration for one active-set problem, with the safeguards that make it finite.

NumPy and SciPy only.
"""

from __future__ import annotations

import logging
from dataclasses import dataclass, field

import numpy as np

from .arrays import Array, Mask
from .bordered import Anchor, SingularError, Systems
from .errors import ConvergenceError
from .kernel import FREE

log = logging.getLogger("ngcontact")

TIE = 1e-13  # relative size below which a force or a slack keeps its state
CLEAR = 1e-9  # ... below which it is judged by the refined solution only
WIDEST_TIE = 1e-9  # ... and to which that grows, tenfold, each time an active set comes back
PATIENCE = 10  # full switches allowed without fewer violated rows (Judice, Pires 1994)


@dataclass(frozen=True, eq=False)
class Minimiser:
    """Solution of a quadratic program.

    Attributes
    ----------
    u : ndarray (n,)
        Minimiser.
    force : ndarray (m,)
        Multipliers of the rows R u <= g, not negative.
    multiplier : ndarray
        Multipliers of the equations E u = e, of either sign.
    active : ndarray of bool (m,)
        Rows that hold with equality.
    steps : list of int
        Changes of the active set after each linear system; the last one is 0.
    factorizations, back_solves : int
        Work done; large problems without factorisation count V-cycles as back-solves.
    """

    u: Array
    force: Array
    active: Mask
    steps: list[int]
    multiplier: Array = field(default_factory=lambda: np.zeros(0))
    factorizations: int = 0
    back_solves: int = 0


class Newton:
    """Newton iteration for one quadratic program with changing proximal terms."""

    def __init__(self, systems: Systems, state: Mask) -> None:
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
        return p.kernel.pins.size == 0 or p.kernel.resisted(p.unknown[self.state])

    def result(self) -> Minimiser:
        """The current iterate, with the lineal motions that its conditions ask for."""
        kernel, y = self.program.kernel, self.y
        if kernel.held.size:
            y = y - kernel.lineal @ (kernel.conditions @ y)
        return Minimiser(
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
        p, kernel = self.program, self.program.kernel
        motion = kernel.others @ np.linalg.solve(kernel.others[kernel.pins], moved)
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
