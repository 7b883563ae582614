"""Solutions as rows of a table, as short tables, as lines of progress, and in a notebook."""

import importlib.util
import json
import math
import re
import sys
from types import SimpleNamespace

import ngsolve as ng
import numpy as np
import pytest

from drivers.reference import cases
from ngcontact import Contact, Elastic, Hooke, adapt, solve
from ngcontact.problem.values import described
from ngcontact.results import with_progress
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


def level(unknowns, error, bound=None):
    return SimpleNamespace(
        displacement=SimpleNamespace(space=SimpleNamespace(ndof=unknowns)),
        relative_error_estimate=error,
        bounded=bound is not None,
        relative_error_bound=bound,
    )


def lines(capsys):
    out, err = capsys.readouterr()
    assert out == ""
    return err.splitlines()


def test_a_run_is_quiet_unless_asked(capsys):
    options = {"order": 2, "max_dofs": 1500}
    quiet = list(adapt(cases.partly_opening_block(), **options))
    assert lines(capsys) == []
    told = list(adapt(cases.partly_opening_block(), **options, progress=True))
    head, *rows = lines(capsys)
    assert head.split() == ["level", "unknowns", "estimate", "seconds"]
    assert [int(row.split()[1]) for row in rows] == [s.displacement.space.ndof for s in quiet]
    assert len(told) == len(rows)
    estimates = [f"{s.relative_error_estimate:.2e}" for s in told]
    assert [row.split()[2] for row in rows] == estimates
    with pytest.raises(TypeError, match="progress='yes'"):
        adapt(cases.partly_opening_block(), progress="yes")


def test_the_bar_counts_digits_towards_the_tolerance(capsys):
    """From 1e-1 to 1e-3: 1e-2 is half of the way."""
    levels = [level(10, 1e-1), level(20, 1e-2), level(40, 1e-3)]
    assert list(with_progress(iter(levels), 1e-3, 100)) == levels
    assert [row.count("#") for row in lines(capsys)[1:]] == [0, 10, 20]


def test_a_bound_counts_where_there_is_one(capsys):
    list(with_progress(iter([level(10, 1e-1), level(10, 1e-2, bound=1e-3)]), 1e-3, 100))
    assert lines(capsys)[-1].split()[2] == "1.00e-03"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (None, "free"),
        (ng.CF(-2e9), "-2e+09"),
        (ng.CF((0.1, -3.0)), "(0.1, -3)"),
        ((ng.CF(0.5), None), "(0.5, free)"),
        (ng.CF((0, 0)), "(0, 0)"),
        (ng.x * 2, "function"),
        (2 * ng.CF(3.0) + ng.Parameter(1.0), "function"),
        (lambda x, y: x, "function"),
    ],
)
def test_values_in_a_few_characters(value, text):
    assert described(value) == text


def cells(html):
    return re.findall(r"<t[dh]>(.*?)</t[dh]>", html)


def problem():
    return cases.touching_blocks(
        {"bottom": (0, 0), "top": (None, -0.1)},
        materials={"upper": Elastic(1.0, 0.3), "lower": Hooke(np.diag([2.0, 2.0, 0.5]))},
        sliding="upper_left",
        force={"upper": (0, ng.x)},
        traction={"lower_left": 0.5, "upper_right": (1.0, 0.0)},
        contact=[Contact("upper_contact", "lower_contact", gap=0.01, bilateral=True)],
    )


def test_a_problem_shows_all_of_its_data():
    html = problem()._repr_html_()
    assert len(html) < 1500
    shown = cells(html)
    for text in (
        *("plane strain", "E = 1, nu = 0.3", "(0, 0)", "(free, -0.1)", "upper_left"),
        *("function", "pressure 0.5", "(1, 0)", "along the normal, gap 0.01, bilateral"),
        "C = (2, 0, 0), (0, 2, 0), (0, 0, 0.5)",
        "&quot;upper_contact&quot; with &quot;lower_contact&quot;",
    ):
        assert text in shown


def test_a_solution_shows_every_pair():
    solution = solve(two_blocks(), maxh=1.0, order=2)
    shown = cells(solution._repr_html_())
    assert str(solution.displacement.space.ndof) in shown
    x, y = solution.contact_force() + 0.0
    assert f"({x:.6g}, {y:.6g})" in shown
    assert f"{solution.pressure.max():.6g}" in shown
    assert f"{solution.active.sum()}/{solution.active.size}" in shown
    assert "estimate" not in shown
    assert solution.relative_error_estimate > 0
    assert "estimate" in cells(solution._repr_html_())


CELLS = [
    """
import numpy as np
from ngcontact import Contact, Elastic, Problem, adapt
from ngcontact.geometries import disc_on_block
steel = Elastic(E=210e9, nu=0.3)
problem = Problem(
    geometry=disc_on_block(radius=1.0),
    materials={"disc": steel, "block": steel},
    displacement={"block_bottom": (0, 0), "disc_top": (0, -0.02)},
    sliding="axis",
    contact=[Contact("disc_arc", "block_top", direction=(0, -1))],
)
before = np.geterr()
""",
    "for solution in adapt(problem, tolerance=2e-2, progress=True): pass",
    "solution.draw()",
    "problem",
    "solution",
    "assert np.geterr() == before",
]


@pytest.fixture(scope="module")
def outputs():
    for name in ("anywidget", "ipykernel"):
        pytest.importorskip(name)
    nbclient, nbformat = map(pytest.importorskip, ("nbclient", "nbformat"))
    cells = [nbformat.v4.new_code_cell(code) for code in CELLS]
    notebook = nbformat.v4.new_notebook(cells=cells)
    nbclient.NotebookClient(notebook, timeout=120, kernel_name="python3").execute()
    return [cell.outputs for cell in notebook.cells]


def shown(outputs, kind):
    return [out["data"][kind] for out in outputs if kind in out.get("data", {})]


def test_progress_is_one_table_that_grows(outputs):
    [table] = shown(outputs[1], "text/html")
    assert table.count("<tr>") > 2  # the head and more than one level
    assert '<progress value="1.000"' in table
    assert "".join(out.get("text", "") for out in outputs[1]) == ""


def test_draw_shows_a_widget(outputs):
    [view] = shown(outputs[2], "application/vnd.jupyter.widget-view+json")
    assert view["model_id"]


def test_problem_and_solution_are_tables(outputs):
    [problem] = shown(outputs[3], "text/html")
    assert "210000000000" not in problem
    assert "E = 2.1e+11, nu = 0.3" in problem
    [solution] = shown(outputs[4], "text/html")
    assert "disc_arc" in solution


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
