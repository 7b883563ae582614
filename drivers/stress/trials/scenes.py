"""Stress: random scenes, judged by checks that share no code with the package."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.stress import Outcome
from drivers.stress.scenes.checks.judging import Finding, Verdict, judged
from drivers.tables import table


@dataclass(frozen=True)
class SceneOutcome(Outcome):
    """The line of one scene: its worst finding, as a share of what is allowed."""

    verdict: Verdict

    @property
    def passed(self) -> bool:
        """Whether no finding disagrees in silence."""
        return not self.verdict.silent


def outcome_of(verdict: Verdict) -> SceneOutcome:
    """The line of a verdict."""
    solution = verdict.answer.solution
    worst = max(verdict.silent or verdict.findings, key=lambda finding: finding.ratio)
    return SceneOutcome(
        case=f"{verdict.scene.kind}, order {verdict.scene.order}, seed {verdict.seed}",
        varied=worst.check,
        steps=0 if solution is None else len(solution.steps),
        residual=0.0 if solution is None else max(solution.residuals.values()),
        error=worst.ratio,
        allowed=1.0,
        verdict=verdict,
    )


def _row(name: str, verdicts: Sequence[Verdict]) -> list[object]:
    """The row of a kind."""
    refused = sum(v.answer.solution is None for v in verdicts)
    warned = sum(v.answer.solution is not None and bool(v.answer.warned) for v in verdicts)
    findings = [f for v in verdicts for f in v.findings]
    said = sum(f.ratio > 1 and f.warned for f in findings)
    states = [len(verdicts) - warned - refused, warned, refused]
    silent = sum(len(v.silent) for v in verdicts)
    return [name, len(verdicts), *states, len(findings), said, silent]


def _what(finding: Finding) -> str:
    """A check without names of bodies and sides."""
    check, _, quantity = finding.check.partition(": ")
    return f"{check}: {quantity.split(' ')[0]}" if quantity else check


def summary(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Tables over all scenes: by kind, by check, and the causes of refusals."""
    verdicts = [o.verdict for o in outcomes if isinstance(o, SceneOutcome)]
    kinds = dict.fromkeys(v.scene.kind for v in verdicts)
    rows = [_row(k, [v for v in verdicts if v.scene.kind == k]) for k in kinds]
    yield table(
        ["kind", "scenes", "solved", "warned", "refused", "checks", "warned of", "silent"],
        [*rows, _row("all", verdicts)],
    )
    yield ""
    found: dict[str, list[float]] = {}
    for finding in (f for v in verdicts for f in v.findings):
        found.setdefault(_what(finding), []).append(finding.ratio)
    shares = ((what, sorted(ratios)) for what, ratios in sorted(found.items()))
    yield table(
        ["check", "times", "median share of the allowed", "largest"],
        [(what, len(x), f"{x[len(x) // 2]:.1e}", f"{x[-1]:.1e}") for what, x in shares],
    )
    yield ""
    refusals = Counter(
        (v.scene.kind, type(v.answer.refusal).__name__, str(v.answer.refusal).split(":")[0])
        for v in verdicts
        if v.answer.solution is None
    )
    yield table(
        ["kind", "refused with", "message", "times"],
        [[*cause, times] for cause, times in refusals.most_common()],
    )


def outcomes(seed: int = 0, count: int = 66) -> Iterator[SceneOutcome]:
    """The scenes of `count` seeds from `seed` on."""
    for number in range(seed, seed + count):
        yield outcome_of(judged(number))
