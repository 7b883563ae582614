"""The table of `python -m drivers.stress`: nothing in it may fail, and its checks can."""

import math
from dataclasses import replace

import pytest

from drivers.stress import Outcome, data
from drivers.stress.__main__ import main
from drivers.stress.scenes.drawing import KINDS, scene_of
from drivers.stress.scenes.judging import BALANCED, judged
from drivers.stress.scenes.measures import differences, measured, unbalanced
from drivers.stress.scenes.posing import answer
from ngcontact import Solution


def test_the_exit_status_tells_of_failures(monkeypatch, capsys):
    wrong = Outcome("nothing", "is right", 0, 0.0, math.inf, 1.0)
    monkeypatch.setattr(data, "outcomes", lambda seed, count: iter([wrong, wrong]))
    assert main(["data"]) == 2
    assert "2 cases, 2 failed" in capsys.readouterr().out


@pytest.mark.parametrize("seed", [0, 2, 3, 5, 6, 7, 8])  # the quick kinds
@pytest.mark.study(witness=["0", "7", "3"])
def test_estimates_of_unresolved_data(seed):
    assert data.outcome(seed).passed


def test_waves_that_no_bound_is_known_for():
    """A displacement with twenty waves on elements of 0.14: a warning, and a refused bound."""
    found = data.outcome(12)
    assert found.passed
    assert found.warned
    assert found.refused


@pytest.mark.parametrize("name", ["error_estimate", "error_bound"])
def test_an_estimate_or_bound_below_the_error_fails(monkeypatch, name):
    monkeypatch.setattr(Solution, name, property(lambda solution: 1e-6))
    assert not data.outcome(2).passed


SEEDS = (11, 12, 13, 25, 59, 38, 6, 29, 63, 31, 43)  # every kind and check, soon done
WHOLE = 8  # a seed whose scene is solved, has a pair on each flank and opens in part


@pytest.mark.study
def test_every_kind_passes():
    verdicts = [judged(seed) for seed in SEEDS]
    assert [(v.seed, v.silent) for v in verdicts if v.silent] == []
    assert len({v.scene.kind for v in verdicts}) == len(KINDS)
    assert all(math.isfinite(f.difference) and f.allowed > 0 for v in verdicts for f in v.findings)
    checks = {f.check.split(":")[0] for v in verdicts for f in v.findings}
    every = {"balance", "equations", "penetration", "rotated", "scaled", "permuted"}
    assert every | {"swapped", "adaptive", "reference"} <= checks


def test_checks_find_another_load():
    scene = scene_of(WHOLE)
    solution = answer(scene).solution
    first = measured(scene, solution)
    other = {body: (1.001 * x, 1.001 * y) for body, (x, y) in scene.weight.items()}
    heavier = replace(scene, weight=other)
    assert unbalanced(scene, solution) < BALANCED < 1e-4 < unbalanced(heavier, solution)
    pushed = measured(heavier, answer(heavier).solution)
    found = differences(scene, first, pushed)
    # Forces follow the load, energies its square and, as contact grows, more: 1e-3 and above.
    assert found["force on d"] == pytest.approx(1e-3, rel=0.01)
    assert found["energy"] > 0.03
    assert max(differences(scene, first, first).values()) == 0
