"""A scene's verdict: balance, variants that must agree with it, and another solver."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from drivers.stress import Outcome
from drivers.stress.motion import Motion, moved_mesh
from drivers.stress.scenes.drawing import rotation, scene_of
from drivers.stress.scenes.measures import (
    Measures,
    differences,
    measured,
    penetration,
    residual,
    unbalanced,
)
from drivers.stress.scenes.posing import Answer, adapted, answer
from drivers.stress.scenes.reference import reference
from drivers.stress.scenes.scene import Pair, Scene
from drivers.tables import table
from ngcontact import ContactError, Solution

BALANCED = 1e-8  # of the largest force: cancellation of moduli to 1e2 and of loads, round-off
FACTOR = 3.0  # of the sum of both estimates, above which two solutions disagree
SAME = 1e-6  # relative difference of one discrete problem posed in two ways; ties need not be alike
NODES = 2000  # of the finer mesh of the reference, about
UNITS = 1e9  # by which lengths and moduli are multiplied


@dataclass(frozen=True)
class Finding:
    """One check of one scene: what was compared, and the difference found and allowed."""

    check: str
    difference: float
    allowed: float
    warned: bool = False  # whether a solution compared came with a ContactWarning

    @property
    def ratio(self) -> float:
        """Difference over what is allowed; infinite if it is not a number."""
        ratio = self.difference / self.allowed if self.allowed > 0 else np.inf
        return float(ratio) if ratio == ratio else np.inf


@dataclass(frozen=True)
class Case:
    """A scene that was solved, for its checks."""

    scene: Scene
    answer: Answer
    measures: Measures
    draw: np.random.Generator

    @property
    def solution(self) -> Solution:
        """The solution."""
        assert self.answer.solution is not None
        return self.answer.solution

    @cached_property
    def without_geometry(self) -> Case | None:
        """The same straight mesh without geometry, which knows corners by their angle or names."""
        mesh, *_ = moved_mesh(self.solution.mesh, Motion("as it is"))
        other = answer(self.scene, mesh)
        m = _there(self.scene, other)
        return None if m is None else replace(self, answer=other, measures=m)


def named(scene: Scene, error: Exception) -> bool:
    """Whether a refusal says what it is about: a class of the package's own kind, and a name."""
    names = {*scene.body_of, *scene.body_of.values(), *(str(j) for j in range(len(scene.pairs)))}
    told = any(f'"{name}' in str(error) or f"contact[{name}]" in str(error) for name in names)
    return isinstance(error, ValueError | ContactError) and told


def close(scene: Scene, what: str, case: Case, other: Answer, m: Measures | None) -> list[Finding]:
    """Findings against another solution with an estimate; `m` are its measures in this frame."""
    warned = bool(case.answer.warned or other.warned)
    if m is None:
        error = other.refusal
        wrong = 0.0 if error is not None and named(scene, error) else np.inf
        return [Finding(f"{what}: {type(error).__name__}", wrong, 1.0, warned)]
    allowed = FACTOR * (case.measures.relative_error + m.relative_error) + SAME
    found = differences(case.scene, case.measures, m)
    return [Finding(f"{what}: {k}", d, allowed, warned) for k, d in found.items()]


def equal(what: str, case: Case | None, other: Answer, m: Measures | None) -> list[Finding]:
    """Findings against the same discrete problem: both are solved, or both refused."""
    if case is None and m is None:
        return []
    if case is None or m is None:
        return [Finding(f"{what}: {type(other.refusal).__name__}", np.inf, SAME)]
    found = differences(case.scene, case.measures, m)
    found["energy"] = found.get("energy", 0.0) ** 2
    return [Finding(f"{what}: {k}", d, SAME) for k, d in found.items()]


def _there(scene: Scene, other: Answer) -> Measures | None:
    return None if other.solution is None else measured(scene, other.solution)


def _carried(case: Case, what: str, motion: Motion) -> list[Finding]:
    """Findings against the scene moved: straight ones on their mesh, others on a new one."""
    scene, mesh = case.scene.moved(motion), None
    if case.scene.straight:
        mesh, *_ = moved_mesh(case.solution.mesh, motion)
    other = answer(scene, mesh)
    m = None if other.solution is None else measured(scene, other.solution).back(motion)
    if mesh is None:
        return close(scene, what, case, other, m)
    return equal(what, case.without_geometry, other, m)


def rotated(case: Case) -> list[Finding]:
    """Any other angle, bodies and sides of straight ones numbered in another order."""
    angle, seed = float(case.draw.uniform(0, 2 * np.pi)), int(case.draw.integers(2**32))
    return _carried(case, "rotated", Motion("rotated", turn=rotation(angle), seed=seed))


def scaled(case: Case) -> list[Finding]:
    """Lengths and moduli times 1e9 or 1e-9; curved sides need lengths that the CAD kernel takes."""
    power = case.draw.choice([-1, 1], 2)
    length = UNITS ** float(power[0]) if case.scene.straight else 1.0
    motion = Motion("scaled", length=length, modulus=UNITS ** float(power[1]))
    return _carried(case, "scaled", motion)


def permuted(case: Case) -> list[Finding]:
    """Pairs, and the sides that they name, in the other order."""

    def turned(pair: Pair) -> Pair:
        return replace(pair, secondary=pair.secondary[::-1], primary=pair.primary[::-1])

    scene = replace(case.scene, pairs=tuple(turned(p) for p in case.scene.pairs[::-1]))
    other = answer(scene, case.solution.mesh)
    return equal("permuted", case, other, _there(scene, other))


def swapped(case: Case) -> list[Finding]:
    """The primary carries the points."""
    if any(pair.gap is not None or not pair.primary for pair in case.scene.pairs):
        return []

    scene = replace(case.scene, pairs=tuple(pair.swapped() for pair in case.scene.pairs))
    other = answer(scene, case.solution.mesh)
    return close(scene, "swapped", case, other, _there(scene, other))


def other_order(case: Case) -> list[Finding]:
    """The next order on the same mesh."""
    order = case.scene.order + 1 if case.scene.order < 4 else 3
    other = answer(case.scene, case.solution.mesh, order)
    return close(case.scene, f"order {order}", case, other, _there(case.scene, other))


def refined(case: Case) -> list[Finding]:
    """An adaptive run to twice the unknowns."""
    other = adapted(case.scene, 2 * case.solution.displacement.space.ndof)
    return close(case.scene, "adaptive", case, other, _there(case.scene, other))


def referred(case: Case) -> list[Finding]:
    """The order-1 solver that shares no code, on two meshes whose energies tell its error."""
    triangles, order = case.solution.mesh.ne, case.scene.order
    factor = min(1.0 / order, (triangles / NODES) ** 0.5)
    for finer in (1.0, 0.5):  # a coarse mesh may not hold what corners hold
        try:
            coarse, fine = (reference(case.scene, k * factor * finer) for k in (2.0, 1.0))
        except ArithmeticError:
            continue
        error = abs(2 * (coarse.energy - fine.energy)) ** 0.5
        m = replace(fine, error=error)
        return close(case.scene, "reference", case, Answer(None), m)
    return [Finding("reference: no minimum", np.inf, 1.0, bool(case.answer.warned))]


CHECKS: tuple[tuple[Callable[[Case], list[Finding]], float], ...] = (
    (rotated, 0.3),
    (scaled, 0.25),
    (permuted, 0.25),
    (swapped, 0.4),
    (other_order, 0.4),
    (refined, 0.25),
    (referred, 0.25),
)


@dataclass(frozen=True)
class Verdict:
    """What became of the scene of a seed."""

    seed: int
    scene: Scene
    answer: Answer
    findings: tuple[Finding, ...]

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
