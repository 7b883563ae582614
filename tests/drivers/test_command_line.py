"""Command lines of the drivers: help that runs nothing, parameters that reach ``main``."""

from __future__ import annotations

import functools
import importlib
import inspect
import os
import subprocess
import sys
from dataclasses import astuple
from pathlib import Path
from typing import Literal

import pytest

from drivers import hertz
from drivers.__main__ import drivers
from drivers.__main__ import main as listed
from drivers.command_line import Count, Positive, run

ROOT = Path(__file__).parents[2]

# Of each parameter what the help has to say: its unit or what it is, and its default.
HELP = {
    "hertz": {
        "radius": ("m.", "0.01"),
        "press": ("radii", "0.002"),
        "disc": ("Pa", "2.1e+11 0.3"),
        "block": ("Pa", "7e+10 0.33"),
        "order": ("1 to 4", "3"),
        "tolerance": ("relative in the energy norm", "none"),
        "max-dofs": ("Number of unknowns", "20000"),
        "out": ("Folder", "out"),
    },
    "spheres": {
        "radius": ("upper ball, m.", "0.01"),
        "lower-radius": ("lower ball, m.", "0.02"),
        "press": ("radii", "0.0005"),
        "upper": ("Pa", "2.1e+11 0.3"),
        "lower": ("Pa", "7e+10 0.33"),
        "order": ("1 to 4", "3"),
        "tolerance": ("relative in the energy norm", "none"),
        "max-dofs": ("Number of unknowns", "6000"),
        "out": ("Folder", "out"),
    },
    "parameter_study": {
        "solves": ("Number of problems", "64"),
        "processes": ("Number of workers", "2"),
        "engine": ("joblib or Dask", "processes"),
        "order": ("1 to 4", "3"),
        "tolerance": ("relative in the energy norm", "0.01"),
        "out": ("Folder", "out"),
    },
    "published": {
        "names": ("Problems", "roller 'crushed spheres'"),
        "order": ("1 to 4", "3"),
        "max-dofs": ("Number of unknowns", "15000"),
        "page": ("File", "none"),
        "out": ("Folder", "none"),
    },
    "bounds": {
        "studies": ("Problems", "'one transition' 'hertz a=0.3' 'flat punch'"),
        "orders": ("1 to 4", "2 4"),
        "max-dofs": ("Unknowns", "15000"),
        "reference": ("Unknowns", "40000"),
        "out": ("Folder", "out"),
    },
    "convergence": {
        "parts": ("problems", "patch S1 S3 S7 S8 S9"),
        "levels": ("Number of meshes", "5"),
        "out": ("Folder", "none"),
    },
    "laws": {
        "studies": ("layers of two stiffnesses", "'pressed fibres' 'bent fibres' layers graded"),
        "contrasts": ("largest modulus over the smallest", "1 100 10000 1e+06"),
        "orders": ("1 to 4", "1 2 3 4"),
        "max-dofs": ("Number of unknowns", "10000"),
        "out": ("Folder", "none"),
    },
    "adaptive_study": {
        "studies": ("Problems", "'one transition' 'hertz a=0.3' 'hertz a=0.05'"),
        "orders": ("1 to 4", "1 2 3 4"),
        "max-dofs": ("Number of unknowns", "40000"),
        "reference": ("Number of unknowns", "100000"),
        "out": ("Folder", "out"),
    },
    "stress": {
        "trials": ("Kinds of stress", "data scenes"),
        "seed": ("Number", "0"),
        "scenes": ("How many", "66"),
    },
    "benchmark": {
        "parts": ("Tables", "tax levels growth large accuracy skip stages"),
        "problems": ("Common problems", "disc block"),
        "rounds": ("Number of times", "5"),
        "max-dofs": ("Number of unknowns", "3000000"),
        "out": ("Folder", "out"),
    },
}


def main_of(name):
    module = importlib.import_module(f"drivers.{name}")
    if hasattr(module, "__path__"):
        module = importlib.import_module(f"drivers.{name}.__main__")
    return module.main


def python(folder, *words):
    """A command line in an empty folder."""
    wide = {**os.environ, "PYTHONPATH": str(ROOT), "COLUMNS": "500"}
    command = [sys.executable, "-m", *words]
    return subprocess.run(command, cwd=folder, env=wide, capture_output=True, text=True)


def recorder(main):
    """Same parameters; returns what it is called with."""

    @functools.wraps(main)
    def called(*args, **keywords):
        return inspect.signature(main).bind(*args, **keywords).arguments

    return called


def test_drivers_are_listed(capsys):
    found = listed()
    assert set(found) == set(HELP)
    lines = capsys.readouterr().out.splitlines()
    for name, line in found.items():
        assert line.endswith(".")
        [shown] = [x for x in lines if x.startswith(f"python -m drivers.{name} ")]
        assert shown.endswith(line)


def test_the_list_is_a_command(tmp_path):
    done = python(tmp_path, "drivers")
    assert done.returncode == 0
    for name in drivers():
        assert f"python -m drivers.{name} " in done.stdout


@pytest.mark.parametrize("name", HELP)
@pytest.mark.study(witness=["stress"])
def test_help_states_units_and_defaults_and_runs_nothing(name, tmp_path):
    done = python(tmp_path, f"drivers.{name}", "--help")
    assert done.returncode == 0
    assert done.stderr == ""
    assert f"Usage: python -m drivers.{name} " in done.stdout
    assert inspect.getdoc(main_of(name)).partition("\n")[0] in done.stdout
    lines = [line for line in done.stdout.splitlines() if "--" in line]
    assert len(lines) == len(HELP[name]) == len(inspect.signature(main_of(name)).parameters)
    for option, (unit, default) in HELP[name].items():
        [line] = [line for line in lines if f"--{option} " in line]
        described, _, rest = line.partition("[default: ")
        assert unit in described
        assert rest.startswith(default)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("name", "words", "expected"),
    [
        ("hertz", "--radius 2 --tolerance 1e-3 --out o", {"radius": 2, "tolerance": 1e-3}),
        ("hertz", "--press 1e-3 --order 2 --max-dofs 5e3", {"order": 2, "max_dofs": 5000}),
        ("hertz", "--disc 1e9 0.2 --block 2e9 0.4", {"disc": (1e9, 0.2), "block": (2e9, 0.4)}),
        ("convergence", "S1 S9 --levels 3", {"parts": ["S1", "S9"], "levels": 3}),
        ("adaptive_study", "--orders 1 2 --reference 9000", {"orders": [1, 2], "reference": 9000}),
        ("stress", "data scenes --seed 4", {"trials": ["data", "scenes"], "seed": 4}),
        ("benchmark", "tax --rounds 2 --max-dofs 1e5", {"parts": ["tax"], "max_dofs": 100_000}),
    ],
)
def test_parameters_reach_main(name, words, expected):
    given = run(recorder(main_of(name)), words.split())
    assert {key: given[key] for key in expected} == expected


def test_names_with_spaces():
    words = ["flat punch", "hertz a=0.3", "--out", "here"]
    given = run(recorder(main_of("adaptive_study")), words)
    assert given == {"studies": words[:2], "out": Path("here")}


@pytest.mark.study
def test_numbers_come_back(tmp_path, capsys):
    words = "--radius 0.02 --order 1 --max-dofs 300".split()
    computed, _ = run(hertz.main, [*words, "--out", str(tmp_path / "results")])
    again, _ = hertz.main(radius=0.02, order=1, max_dofs=300, out=None)
    assert astuple(computed) == pytest.approx(astuple(again), rel=1e-9)
    assert (tmp_path / "results" / "hertz.vtu").exists()
    assert "radius 20 mm" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("name", "words", "said"),
    [
        ("hertz", "--radius -1", '"-1.0" for --radius. Must be positive'),
        ("hertz", "--radius nan", "Must be positive and finite"),
        ("hertz", "--radius wide", '"wide"'),
        ("hertz", "--disc 1e9 0.5", "nu = 0.5: Poisson's ratio must lie in -1 < nu < 1/2"),
        ("hertz", "--disc 1e9", "--disc requires 2"),
        ("hertz", "--order 5", "Must be <= 4"),
        ("hertz", "--order 2.5", 'expected a whole number, got "2.5"'),
        ("hertz", "--radios 2", "Did you mean --radius?"),
        (
            "hertz",
            "--max-dofs 10 --out o",
            "832 unknowns, more than max_dofs=10; give a larger",
        ),
        ("convergence", "S2", 'Choose from: "patch", "S1"'),
        ("adaptive_study", "--orders 1 7", "Must be <= 4"),
        ("adaptive_study", "--orders", "--orders requires at least 1"),
        ("stress", "dato", 'Did you mean "data"?'),
        ("stress", "--seed -1", "Must be >= 0"),
        ("benchmark", "--max-dofs 500", "Must be >= 10000"),
        ("benchmark", "--rounds inf", 'expected a whole number, got "inf"'),
    ],
)
def test_bad_values_are_refused_with_a_reason(name, words, said, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "500")
    with pytest.raises(SystemExit) as stopped:
        run(main_of(name), words.split())
    assert stopped.value.code == 2
    assert said in capsys.readouterr().err


def test_help_does_not_call_main(capsys):
    def main(*, length: Positive = 1.0, kind: Literal["a", "b"] = "a", count: Count = 2) -> float:
        """Something.

        Parameters
        ----------
        length : float
            Its length, m.
        """
        raise AssertionError

    with pytest.raises(SystemExit) as stopped:
        run(main, ["--help"])
    assert stopped.value.code == 0
    printed = capsys.readouterr().out
    assert "Its length, m. [default: 1]" in printed
    assert "[choices: a, b] [default: a]" in printed


def test_bad_input_found_by_main_is_a_message(monkeypatch, capsys):
    def main(*, x: float = 1.0) -> float:
        """Something."""
        raise ValueError(f"x={x} is too large")

    with pytest.raises(SystemExit) as stopped:
        run(main, ["--x", "3"])
    assert stopped.value.code == 2
    assert "x=3.0 is too large" in capsys.readouterr().err
