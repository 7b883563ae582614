"""Command lines and tables of drivers: help, parameters that reach ``main``, what they print."""

import functools
import importlib
import inspect
import os
import re
import subprocess
import sys
from pathlib import Path
from shlex import quote, split

import pytest

from drivers.__main__ import drivers
from drivers.__main__ import main as listed
from drivers.command_line import run
from drivers.hertz import computed_and_expected
from drivers.reference.cases import touching_blocks
from drivers.tables import table
from ngcontact import solve

ROOT = Path(__file__).parents[2]

# What the help has to say of parameters of these names, in any driver: the unit, or what it is.
UNITS = {
    "radius": "m.",
    "lower-radius": "m.",
    "press": "radii",
    **dict.fromkeys(("disc", "block", "upper", "lower"), "Pa"),
    **dict.fromkeys(("order", "orders"), "1 to 4"),
    "tolerance": "relative in the energy norm",
    **dict.fromkeys(("max-dofs", "reference"), "nknowns"),
    **dict.fromkeys(("solves", "processes", "levels", "seed", "rounds"), "umber of"),
    "scenes": "How many",
    "contrasts": "largest modulus over the smallest",
    "out": "Folder",
    "page": "File",
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
    assert len(found) == 11
    lines = capsys.readouterr().out.splitlines()
    for name, line in found.items():
        assert line.endswith(".")
        [shown] = [x for x in lines if x.startswith(f"python -m drivers.{name} ")]
        assert shown.endswith(line)


@pytest.mark.parametrize("name", drivers())
@pytest.mark.study(witness=["stress"])
def test_help_states_units_and_defaults_and_runs_nothing(name, tmp_path):
    done = python(tmp_path, f"drivers.{name}", "--help")
    assert done.returncode == 0
    assert done.stderr == ""
    assert f"Usage: python -m drivers.{name} " in done.stdout
    assert inspect.getdoc(main_of(name)).partition("\n")[0] in done.stdout
    lines = [line for line in done.stdout.splitlines() if "--" in line]
    parameters = inspect.signature(main_of(name)).parameters.values()
    assert len(lines) == len(parameters)
    for parameter in parameters:
        option = parameter.name.replace("_", "-")
        [line] = [line for line in lines if f"--{option} " in line]
        described, _, rest = line.partition(f"[default: {shown(parameter.default)}")
        assert rest
        assert UNITS.get(option, "") in described
        assert re.search(r"[a-z]{3,} [\w,' ]+\.", described)  # a sentence from the docstring
    assert list(tmp_path.iterdir()) == []


def shown(value):
    """The beginning of a default as it is written on the command line."""
    first = value[0] if isinstance(value, tuple) else value
    return (
        "none" if first is None else f"{first:g}" if isinstance(first, float) else quote(str(first))
    )


@pytest.mark.parametrize(
    ("name", "words", "expected"),
    [
        ("hertz", "--radius 2 --tolerance 1e-3 --out o", {"radius": 2, "tolerance": 1e-3}),
        ("hertz", "--press 1e-3 --order 2 --max-dofs 5e3", {"order": 2, "max_dofs": 5000}),
        ("hertz", "--disc 1e9 0.2 --block 2e9 0.4", {"disc": (1e9, 0.2), "block": (2e9, 0.4)}),
        ("adaptive_study", "'flat punch' --out o", {"studies": ["flat punch"], "out": Path("o")}),
        ("convergence", "S1 S9 --levels 3", {"parts": ["S1", "S9"], "levels": 3}),
        ("adaptive_study", "--orders 1 2 --reference 9000", {"orders": [1, 2], "reference": 9000}),
        ("stress", "data scenes --seed 4", {"trials": ["data", "scenes"], "seed": 4}),
        ("benchmark", "tax --rounds 2 --max-dofs 1e5", {"parts": ["tax"], "max_dofs": 100_000}),
    ],
)
def test_parameters_reach_main(name, words, expected):
    given = run(recorder(main_of(name)), split(words))
    assert {key: given[key] for key in expected} == expected


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


def test_levels_are_printed_as_they_are_and_the_last_one_is_returned(capsys):
    problem = touching_blocks({"bottom": (0, 0), "top": (0, -0.01)})
    levels = [solve(problem, maxh=h) for h in (1.0, 0.5)]
    columns = {" force": "{0.force:.3f}", "in mN": lambda found: f"{1e3 * found.force:.0f}"}
    last, found, _ = computed_and_expected(levels, columns, lambda force: (0.0, 0.0))
    assert last is levels[1]
    assert found.force == last.contact_force()[1]
    head, *rows = capsys.readouterr().out.splitlines()
    assert head.split()[-4:] == ["force", "in", "mN", "seconds"]
    for level, row in zip(levels, rows, strict=True):
        pushed = level.contact_force()[1]
        assert len(row) == len(head)
        assert row.split()[0] == str(level.displacement.space.ndof)
        assert row.split()[4:6] == [f"{pushed:.3f}", f"{1e3 * pushed:.0f}"]


def test_a_table_has_a_line_a_row():
    found = table(("order", "error"), [(1, "2e-2"), (2, "1e-3")])
    assert found == "| order | error |\n| --- | --- |\n| 1 | 2e-2 |\n| 2 | 1e-3 |"
    assert table(("order",), []) == "| order |\n| --- |"
