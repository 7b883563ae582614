"""The table of `python -m drivers.stress`: nothing in it may fail."""

from __future__ import annotations

import math
from itertools import islice
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

from drivers.stress import __path__ as folder
from drivers.stress import refused
from drivers.stress.__main__ import RANDOM, Trial, line, main, outcomes
from drivers.stress.trials import algebra, data, held
from ngcontact import Solution

# The slow ones run with the driver; what they found has tests with the modules concerned.
QUICK = ("algebra", "held")
FIRST = 3  # outcomes of each of those that are looked at without the rest


def test_every_module_has_its_name():
    [path] = folder
    modules = {file.stem for file in Path(path).glob("trials/[a-z]*.py")}
    assert modules == set(get_args(Trial))
    assert set(QUICK) < modules


def test_seeds_draw_other_quadratic_programs():
    def programs(seed):
        return [line(outcome) for outcome in algebra.random_programs(count=2, seed=seed)]

    assert programs(0) == programs(0)
    assert programs(0) != programs(1)
    assert set(RANDOM) == {"algebra", "data", "scenes"}


@pytest.mark.parametrize(
    ("name", "count"), [(name, count) for name in QUICK for count in (FIRST, None)]
)
@pytest.mark.study(witness=[f"{name}-{FIRST}" for name in QUICK])
def test_outcomes(name, count):
    found = list(islice(outcomes(name, seed=0), count))
    assert found
    assert [outcome for outcome in found if not outcome.passed] == []


def test_the_exit_status_tells_of_failures(monkeypatch, capsys):
    wrong = refused("nothing", "is refused", ValueError, "it", lambda: None)
    assert math.isinf(wrong.error)
    monkeypatch.setattr(held, "outcomes", lambda: iter([wrong, wrong]))
    assert main(["held"]) == 2
    assert "2 cases, 2 failed" in capsys.readouterr().out


@pytest.mark.parametrize("seed", [0, 2, 3, 5, 6, 7, 8])  # the quick kinds
@pytest.mark.study(witness=["0", "7", "3"])
def test_estimates_of_data_that_hurt(seed):
    assert data.outcome(seed).passed


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
