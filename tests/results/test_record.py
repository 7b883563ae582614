"""Solutions as rows of a table, as lines of progress, and in a notebook."""

import importlib.util
import json
import math
import sys

import pytest

from drivers.reference import cases
from ngcontact import adapt, solve
from tests.results.test_archive import ROOT
from tests.results.test_values import two_blocks


def test_a_record_holds_plain_numbers():
    solution = solve(cases.pressed_disc(), maxh=0.4, order=2)
    row = solution.record()
    assert {type(value) for value in row.values()} == {int, float}
    assert all(isinstance(name, str) for name in row)
    assert json.loads(json.dumps(row)).keys() == row.keys()
    assert row["unknowns"] == solution.displacement.space.ndof
    assert row["contact_0_force_y"] == solution.contact_force()[1]
    assert row["contact_0_peak_pressure"] == solution.pressure.max()
    energies = [row["energy"], row["energy_norm"]]
    assert energies == pytest.approx([solution.energy, solution.energy_norm], rel=1e-12)
    # Equilibrium of the disc, from the record alone.
    assert row["reaction_disc_top_y"] == pytest.approx(-row["contact_0_force_y"], rel=1e-9)


def test_columns_do_not_depend_on_what_was_asked_before():
    solution = solve(cases.pressed_disc(), maxh=0.4, order=2)
    before = solution.record()
    assert math.isnan(before["error_estimate"])
    assert math.isnan(before["relative_error_bound"])
    assert before["work_estimates"] == 0  # a record costs no estimate
    assert solution.error_estimate > 0
    assert solution.error_bound > 0
    after = solution.record()
    assert list(after) == list(before)
    assert after["error_estimate"] == solution.error_estimate
    assert after["relative_error_bound"] == solution.relative_error_bound


def lines(capsys):
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()


def test_a_run_is_quiet_unless_asked(capsys):
    options = {"order": 2, "max_dofs": 1500}
    quiet = list(adapt(cases.partly_opening_block(), **options))
    assert lines(capsys) == []
    told = list(adapt(cases.partly_opening_block(), **options, progress=True))
    rows = lines(capsys)
    assert len(told) == len(rows) == len(quiet)
    for k, (row, solution) in enumerate(zip(rows, told, strict=True)):
        assert row.startswith(f"level {k}: {solution}, ")
        assert float(row.split()[-2]) >= 0
    with pytest.raises(TypeError, match="progress='yes'"):
        adapt(cases.partly_opening_block(), progress="yes")


CELLS = [
    """
import numpy as np
from drivers.reference import cases
from ngcontact import adapt
before = np.geterr()
""",
    "for solution in adapt(cases.pressed_disc(), tolerance=2e-2, progress=True): print(solution)",
    "solution.draw()",
    "solution",
    "assert np.geterr() == before",
]


def test_a_notebook_shows_lines_and_a_widget():
    """A line a level as progress, one for a solution; `draw` leaves NumPy's settings alone."""
    for name in ("anywidget", "ipykernel"):
        pytest.importorskip(name)
    nbclient, nbformat = map(pytest.importorskip, ("nbclient", "nbformat"))
    cells = [nbformat.v4.new_code_cell(code) for code in CELLS]
    notebook = nbformat.v4.new_notebook(cells=cells)
    here = {"metadata": {"path": ROOT}}
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3", resources=here).execute()
    _, levels, drawn, [solution], _ = (cell.outputs for cell in notebook.cells)
    told, printed = (
        "".join(out["text"] for out in levels if out["name"] == name).splitlines()
        for name in ("stderr", "stdout")
    )
    assert len(told) == len(printed) > 1
    kind = "application/vnd.jupyter.widget-view+json"
    [view] = [out["data"][kind] for out in drawn if kind in out.get("data", {})]
    assert view["model_id"]
    assert solution["data"]["text/plain"].startswith("order 4")


def test_without_the_extra_draw_says_what_to_install(monkeypatch):
    from ngcontact import solve

    solution = solve(two_blocks(), maxh=1.0)
    find = importlib.util.find_spec
    monkeypatch.setattr(
        sys.modules["ngcontact.solution"],
        "find_spec",
        lambda name: None if name == "anywidget" else find(name),
    )
    with pytest.raises(ImportError, match=r"anywidget.*ngcontact\[notebook\].*plot\(\)"):
        solution.draw()
