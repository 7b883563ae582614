"""The table of `python -m drivers.stress`: nothing in it may fail."""

import math
from typing import get_args

import numpy as np
import pytest

from drivers.stress import Outcome, data
from drivers.stress.__main__ import TRIALS, Trial, main
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
def test_estimates_of_data_that_hurt(seed):
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
