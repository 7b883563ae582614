"""The table of `python -m drivers.stress`: nothing in it may fail."""

from __future__ import annotations

import importlib
import math

import pytest

from drivers.stress import refused
from drivers.stress.__main__ import main, modules
from drivers.stress.differences import differences
from drivers.stress.motion import Motion, posed
from drivers.stress.trials.symmetry import parting
from ngcontact import solve

# The slow ones run with the driver; what they found has tests with the modules concerned.
QUICK = ("algebra", "gaps", "held", "shapes")


def test_modules_are_found():
    assert set(QUICK) <= set(modules())


@pytest.mark.parametrize("name", QUICK)
def test_outcomes(name):
    trial = importlib.import_module(f"drivers.stress.trials.{name}")
    failed = [outcome for outcome in trial.outcomes() if not outcome.passed]
    assert not failed


def test_the_exit_status_tells_of_failures(monkeypatch, capsys):
    held = importlib.import_module("drivers.stress.trials.held")
    wrong = refused("nothing", "is refused", ValueError, "it", lambda: None)
    assert math.isinf(wrong.error)
    monkeypatch.setattr(held, "outcomes", lambda: iter([wrong]))
    assert main(["held"]) == 1
    assert "1 cases, 1 failed" in capsys.readouterr().out


@pytest.mark.parametrize("length", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("modulus", [1e-9, 1.0, 1e9])
def test_units_change_nothing(length, modulus):
    scene = parting()
    first = solve(posed(scene, Motion("as it is"))[0], order=2)
    motion = Motion("units", length=length, modulus=modulus)
    problem, vertex, triangle = posed(scene, motion)
    other = solve(problem, order=2)
    assert other.steps == first.steps
    # 1e-10 is the figure asked for; measured 6e-15.
    assert max(differences(first, other, motion, vertex, triangle).values()) <= 1e-10
    wrong = Motion("another load", length=length, modulus=modulus, load=1.001)
    assert max(differences(first, other, wrong, vertex, triangle).values()) > 1e-4
