"""Stress: random scenes, judged by checks that share no code with the package."""

from __future__ import annotations

from collections.abc import Iterator

from drivers.stress.scenes.checks.judging import judged
from drivers.stress.scenes.checks.report import SceneOutcome, outcome_of


def outcomes(seed: int = 0, count: int = 66) -> Iterator[SceneOutcome]:
    """The scenes of `count` seeds from `seed` on."""
    for number in range(seed, seed + count):
        yield outcome_of(judged(number))
