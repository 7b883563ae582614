"""The table of `python -m drivers.stress`: nothing in it may fail, and its checks can."""

import math
from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from drivers.stress import Outcome, data
from drivers.stress.__main__ import TRIALS, Trial, main
from drivers.stress.motion import Motion
from drivers.stress.scenes.drawing import KINDS, rotation, scene_of
from drivers.stress.scenes.judging import BALANCED, FACTOR, SAME, judged, named, outcome_of, summary
from drivers.stress.scenes.measures import differences, measured, penetration, residual, unbalanced
from drivers.stress.scenes.posing import answer
from drivers.stress.scenes.reference import reference
from drivers.stress.scenes.scene import Body, Pair, Scene, Side, scalar
from ngcontact import Solution


def test_every_trial_has_its_name():
    assert get_args(Trial) == tuple(TRIALS)


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


def test_a_strip_that_no_point_of_the_mesh_sees_is_not_lost():
    """Its load is integrated where it is; |u|^2 - |u_h|^2 is the squared error."""
    drawn = data.narrow_traction(np.random.default_rng(112))
    coarse, fine = (data.finest(problem, 100.0) for problem in (drawn.problem, drawn.resolved))
    error = np.sqrt(fine.energy_norm**2 - coarse.energy_norm**2)
    assert 0 < error <= coarse.error_estimate  # measured: 1.15 and 1.94
    assert error <= coarse.error_bound


SEEDS = (11, 12, 13, 25, 59, 38, 6, 29, 63, 31, 43)  # every kind and check, soon done
WHOLE = 8  # a seed whose scene is solved, has a pair on each flank and opens in part
P, E, NU = 0.01, (1.0, 3.0), (0.3, 0.2)


def box(name: str, low: float, high: float, E: float, nu: float) -> Body:
    """A block of width 2."""
    at = [(-1.0, low), (1.0, low), (1.0, high), (-1.0, high)]
    ends = zip(["bottom", "right", "top", "left"], at, at[1:] + at[:1], strict=True)
    return Body(name, tuple(Side(f"{name}_{side}", a, b) for side, a, b in ends), E, nu)


def column(finer: float) -> Scene:
    """Two blocks under a constant pressure, on a plane without friction; one mesh is finer."""
    return Scene(
        "column",
        (box("u", 0.0, 1.0, E[0], NU[0]), box("l", -0.5, 0.0, E[1], NU[1])),
        (Pair(("u_bottom",), ("l_top",)),),
        maxh=0.4,
        sliding=("l_bottom", "l_left"),
        pressure={"u_top": scalar(P)},
        finer={"u": 1.0, "l": finer},
    )


@pytest.mark.study
def test_every_kind_passes():
    verdicts = [judged(seed) for seed in SEEDS]
    assert [(v.seed, v.silent) for v in verdicts if v.silent] == []
    assert len({v.scene.kind for v in verdicts}) == len(KINDS)
    assert all(math.isfinite(f.difference) and f.allowed > 0 for v in verdicts for f in v.findings)
    checks = {f.check.split(":")[0] for v in verdicts for f in v.findings}
    every = {"balance", "equations", "penetration", "rotated", "scaled", "permuted"}
    assert every | {"swapped", "adaptive", "reference"} <= checks
    table = "\n".join(summary([outcome_of(v) for v in verdicts])).split("\n")
    assert any(line.startswith(f"| all | {len(SEEDS)} |") for line in table)


@pytest.mark.parametrize("turn", [0.0, 0.7])
def test_the_reference_reproduces_a_constant_pressure(turn):
    """Stress -p across the line everywhere: energy -p^2 (1 - nu^2) / 2E per area."""
    motion = Motion("turned", turn=rotation(turn), length=10.0, modulus=100.0)
    found = reference(column(0.37).moved(motion), 1.0).back(motion)
    areas = 2.0, 1.0
    squares = [P**2 * (1 - nu**2) / e * a for e, nu, a in zip(E, NU, areas, strict=True)]
    # Round-off of the quadratic program, whose primal tolerance is 1e-10; measured 1e-13.
    assert found.norm["u"] ** 2 == pytest.approx(squares[0], rel=1e-8)
    assert found.norm["l"] ** 2 == pytest.approx(squares[1], rel=1e-8)
    assert found.energy == pytest.approx(-sum(squares) / 2, rel=1e-8)
    assert found.force["u"] == pytest.approx([0, 2 * P], rel=1e-8, abs=1e-8 * P)
    s, force = found.along["u_bottom", 0]
    assert force.sum() == pytest.approx(2 * P)
    assert force @ s == pytest.approx(2 * P)  # in the middle


def test_the_reference_finds_no_minimum_where_there_is_none():
    lifted = replace(column(1.0), weight={"u": (0.0, 1.0)}, pressure={})
    with pytest.raises(ArithmeticError):
        reference(lifted, 1.0)
    refusal = answer(lifted).refusal
    assert refusal is not None
    assert named(lifted, refusal)


def test_a_refusal_names_its_cause():
    scene = column(1.0)
    assert named(scene, ValueError('no point of "u_bottom" faces'))
    assert not named(scene, ValueError("zero-size array to reduction operation"))
    assert not named(scene, IndexError('index of "u_bottom"'))


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


def test_checks_find_another_modulus_and_another_gap():
    scene = column(0.5)
    solution = answer(scene).solution
    assert residual(scene, solution) < BALANCED
    bodies = tuple(replace(body, E=1.01 * body.E) for body in scene.bodies)
    assert residual(replace(scene, bodies=bodies), solution) > 1e-3
    assert penetration(scene, solution) < SAME * measured(scene, solution).whole
    closer = replace(scene, pairs=(replace(scene.pairs[0], gap=scalar(-0.01)),))
    m = measured(scene, solution)
    assert penetration(closer, solution) > FACTOR * m.relative_error * m.whole + SAME


def test_rays_meet_sides_where_they_enter_the_body():
    d = np.array([[0.0, -1.0], [0.0, 1.0]])
    x = np.array([[0.3, 2.0], [0.3, 2.0]])
    straight = Side("top", (1.0, 0.5), (-1.0, 0.5))  # the body below
    t, s = straight.met(x, d)
    assert t[0] == pytest.approx(1.5)
    assert s[0] == pytest.approx(0.7)
    assert np.isnan(t[1])
    arc = Side("rim", (1.0, 0.0), (-1.0, 0.0), (0.0, 0.0))
    t, s = arc.met(x, d)
    assert t[0] == pytest.approx(2 - math.sqrt(1 - 0.09))
    assert s[0] == pytest.approx(math.acos(0.3))
    assert np.isnan(t[1])
    bore = Side("bore", (-1.0, 0.0), (1.0, 0.0), (0.0, 0.0), hole=True)  # the body outside
    t, _ = bore.met(np.array([[0.3, 0.1]]), d[1:])
    assert t[0] == pytest.approx(math.sqrt(1 - 0.09) - 0.1)
    assert arc.normal(s[:1])[0] == pytest.approx([0.3, math.sqrt(0.91)])
    assert bore.normal(np.array([bore.length / 2]))[0] == pytest.approx([0.0, -1.0], abs=1e-12)
