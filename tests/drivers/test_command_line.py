"""Command lines and tables of drivers: help, parameters that reach ``main``, what they print."""

import functools
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from shlex import split
from typing import get_args

import pytest

from drivers import convergence, published
from drivers.__main__ import drivers
from drivers.__main__ import main as listed
from drivers.adaptive_study import runs
from drivers.benchmark import __main__ as benchmark
from drivers.command_line import run
from drivers.stress import __main__ as stress
from drivers.tables import table

ROOT = Path(__file__).parents[2]


def main_of(name):
    module = importlib.import_module(f"drivers.{name}")
    if hasattr(module, "__path__"):
        module = importlib.import_module(f"drivers.{name}.__main__")
    return module.main


def test_drivers_are_listed(capsys):
    found = listed()
    assert len(found) == 11
    lines = capsys.readouterr().out.splitlines()
    for name, line in found.items():
        assert line.endswith(".")
        [shown] = [x for x in lines if x.startswith(f"python -m drivers.{name} ")]
        assert shown.endswith(line)


@pytest.mark.parametrize(
    ("names", "parts"),
    [
        (runs.Name, runs.STUDIES),
        (benchmark.Part, benchmark.PARTS),
        (convergence.Part, {"patch": convergence.PATCHES, **convergence.TABLES}),
        (published.Name, published.PUBLISHED),
        (stress.Trial, stress.TRIALS),
    ],
)
def test_every_part_can_be_asked_for(names, parts):
    assert set(get_args(names)) == set(parts)


@pytest.mark.parametrize("name", drivers())
@pytest.mark.study(witness=["stress"])
def test_help_describes_every_parameter_and_runs_nothing(name, tmp_path):
    wide = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "500"}
    command = [sys.executable, "-m", f"drivers.{name}", "--help"]
    done = subprocess.run(command, cwd=tmp_path, env=wide, capture_output=True, text=True)
    assert (done.returncode, done.stderr) == (0, "")
    lines = [line for line in done.stdout.splitlines() if "--" in line]
    for option in inspect.signature(main_of(name)).parameters:
        [line] = [line for line in lines if f"--{option.replace('_', '-')} " in line]
        assert re.search(r"[a-z]{3,} [\w,' ]+\..* \[default: ", line)  # a sentence of the docstring
    assert list(tmp_path.iterdir()) == []


def recorder(main):
    """Same parameters; returns what it is called with."""

    @functools.wraps(main)
    def called(*args, **keywords):
        return inspect.signature(main).bind(*args, **keywords).arguments

    return called


@pytest.mark.parametrize(
    ("name", "words", "expected"),
    [
        ("hertz", "--press 1e-3 --order 2 --max-dofs 5e3", {"order": 2, "max_dofs": 5000}),
        ("hertz", "--disc 1e9 0.2 --block 2e9 0.4", {"disc": (1e9, 0.2), "block": (2e9, 0.4)}),
        ("adaptive_study", "'flat punch' --out o", {"studies": ["flat punch"], "out": Path("o")}),
        ("adaptive_study", "--orders 1 2 --reference 9000", {"orders": [1, 2], "reference": 9000}),
        ("stress", "data scenes --seed 4", {"trials": ["data", "scenes"], "seed": 4}),
    ],
)
def test_parameters_reach_main(name, words, expected):
    given = run(recorder(main_of(name)), split(words))
    assert {key: given[key] for key in expected} == expected


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("hertz", "--radius nan", "Must be positive and finite"),
        ("hertz", "--disc 1e9 0.5", "nu = 0.5: Poisson's ratio must lie in -1 < nu < 1/2"),
        ("hertz", "--order 5", "Must be <= 4"),
        ("hertz", "--order 2.5", 'expected a whole number, got "2.5"'),
        ("hertz", "--radios 2", "Did you mean --radius?"),
        ("hertz", "--max-dofs 10 --out o", "832 unknowns, more than max_dofs=10; give a larger"),
        ("convergence", "S2", 'Choose from: "patch", "S1"'),
        ("stress", "--seed -1", "Must be >= 0"),
        ("benchmark", "--max-dofs 500", "Must be >= 10000"),
    ],
)
def test_bad_values_are_refused_with_a_reason(name, words, said, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "500")
    with pytest.raises(SystemExit) as stopped:
        run(main_of(name), words.split())
    assert stopped.value.code == 2
    assert said in capsys.readouterr().err


def test_a_table_has_a_line_a_row():
    found = table(("order", "error"), [(1, "2e-2"), (2, "1e-3")])
    assert found == "| order | error |\n| --- | --- |\n| 1 | 2e-2 |\n| 2 | 1e-3 |"
