"""What a notebook shows, in a kernel of its own: tables, progress, webgui."""

import importlib.util
import sys

import pytest

pytest.importorskip("anywidget")
pytest.importorskip("ipykernel")
nbclient = pytest.importorskip("nbclient")
nbformat = pytest.importorskip("nbformat")

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
    from tests.results.test_values import two_blocks

    solution = solve(two_blocks(), maxh=1.0)
    find = importlib.util.find_spec
    monkeypatch.setattr(
        sys.modules["ngcontact.solution"],
        "find_spec",
        lambda name: None if name == "anywidget" else find(name),
    )
    with pytest.raises(ImportError, match=r"anywidget.*ngcontact\[notebook\].*plot\(\)"):
        solution.draw()
