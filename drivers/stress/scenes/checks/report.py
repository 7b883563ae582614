"""Lines and tables of what became of random scenes."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from drivers.markdown import table
from drivers.stress import Outcome
from drivers.stress.scenes.checks.judging import Verdict
from drivers.stress.scenes.checks.variants import Finding


@dataclass(frozen=True)
class SceneOutcome(Outcome):
    """The line of one scene: its worst finding, as a share of what is allowed.

    Attributes
    ----------
    verdict : Verdict
        All findings.
    """

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


def _state(verdict: Verdict) -> str:
    if verdict.answer.solution is None:
        return "refused"
    return "warned" if verdict.answer.warned else "solved"


def _kind(name: str, verdicts: Sequence[Verdict]) -> list[object]:
    """The row of a kind."""
    state = Counter(map(_state, verdicts))
    findings = [f for v in verdicts for f in v.findings]
    said = sum(1 for f in findings if f.ratio > 1 and f.warned)
    silent = sum(len(v.silent) for v in verdicts)
    states = [state[s] for s in ("solved", "warned", "refused")]
    return [name, len(verdicts), *states, len(findings), said, silent]


def _what(finding: Finding) -> str:
    """A check without names of bodies and sides."""
    check, _, quantity = finding.check.partition(": ")
    return f"{check}: {quantity.split(' ')[0]}" if quantity else check


def _check(what: str, findings: Sequence[Finding]) -> list[object]:
    ratio = sorted(f.ratio for f in findings)
    middle, worst = ratio[len(ratio) // 2], ratio[-1]
    return [what, len(findings), f"{middle:.1e}", f"{worst:.1e}"]


def summary(outcomes: Sequence[Outcome]) -> Iterator[str]:
    """Tables over all scenes: by kind, by check, and the causes of refusals."""
    verdicts = [o.verdict for o in outcomes if isinstance(o, SceneOutcome)]
    kinds = dict.fromkeys(v.scene.kind for v in verdicts)
    rows = [_kind(k, [v for v in verdicts if v.scene.kind == k]) for k in kinds]
    yield table(
        ["kind", "scenes", "solved", "warned", "refused", "checks", "warned of", "silent"],
        [*rows, _kind("all", verdicts)],
    )
    yield ""
    found: dict[str, list[Finding]] = {}
    for finding in (f for v in verdicts for f in v.findings):
        found.setdefault(_what(finding), []).append(finding)
    yield table(
        ["check", "times", "median share of the allowed", "largest"],
        [_check(what, found[what]) for what in sorted(found)],
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
