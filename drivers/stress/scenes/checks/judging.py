"""A scene's verdict: what the package says of it, against balance, variants and other solvers."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from drivers.stress.scenes.checks.balance import penetration, residual, unbalanced
from drivers.stress.scenes.checks.measures import measured
from drivers.stress.scenes.checks.reference import reference
from drivers.stress.scenes.checks.variants import CHECKS, FACTOR, SAME, Case, Finding, named
from drivers.stress.scenes.drawing import scene_of
from drivers.stress.scenes.posing import Answer, answer
from drivers.stress.scenes.scene import Scene

BALANCED = 1e-8  # of the largest force: cancellation of moduli to 1e2 and of loads, round-off


@dataclass(frozen=True)
class Verdict:
    """What became of the scene of a seed.

    Attributes
    ----------
    seed : int
    scene : Scene
    answer : Answer
    findings : tuple of Finding
    """

    seed: int
    scene: Scene
    answer: Answer
    findings: tuple[Finding, ...]

    @property
    def worst(self) -> Finding:
        """The finding that uses most of what it is allowed."""
        return max(self.findings, key=lambda f: f.ratio)

    @property
    def silent(self) -> tuple[Finding, ...]:
        """Disagreements without a warning."""
        return tuple(f for f in self.findings if f.ratio > 1 and not f.warned)


def _always(case: Case) -> Iterator[Finding]:
    """What every solution must satisfy."""
    warned, scene, solution = bool(case.answer.warned), case.scene, case.solution
    yield Finding("optimality", max(solution.residuals.values()), BALANCED)
    yield Finding("balance", unbalanced(scene, solution), BALANCED)
    if scene.straight:
        yield Finding("equations", residual(scene, solution), BALANCED)
    over = penetration(scene, solution)
    whole = case.measures.whole
    if whole > 0:
        allowed = FACTOR * case.measures.relative_error + SAME
        yield Finding("penetration", over / whole, allowed, warned)


def judged(seed: int) -> Verdict:
    """Solve the scene of a seed and check it."""
    scene = scene_of(seed)
    first = answer(scene)
    if first.solution is None:
        return Verdict(seed, scene, first, tuple(_refused(scene, first)))
    draw = np.random.default_rng([seed, 11])
    case = Case(scene, first, measured(scene, first.solution), draw)
    findings = list(_always(case))
    for check, share in CHECKS:
        if draw.random() < share:
            findings.extend(check(case))
    return Verdict(seed, scene, first, tuple(findings))


def _refused(scene: Scene, first: Answer) -> Iterator[Finding]:
    """A refusal names its cause, and the solver that shares no code finds no minimum, either."""
    error = first.refusal
    assert error is not None
    yield Finding(f"refused: {type(error).__name__}", 0.0 if named(scene, error) else np.inf, 1.0)
    try:
        reference(scene, 1.0)
    except ArithmeticError:
        return
    yield Finding("refused what has a solution", np.inf, 1.0)
