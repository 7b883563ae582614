"""The public surface: names, signatures, import without side effects."""

import inspect
import logging
import subprocess
import sys
from pathlib import Path

import pytest

import ngcontact

ROOT = Path(__file__).parents[2]
PUBLIC = """Contact ContactError ContactWarning ConvergenceError Elastic Hooke NoEquilibriumError
Problem Solution adapt find_contacts load plot_convergence polish solve solve_qp write_film
write_series""".split()
SIGNATURES = {
    "Contact": "(secondary, primary=None, direction=None, gap=None, bilateral=False, rows='auto', "
    "roles='given')",
    "solve": "(problem, mesh=None, *, maxh=None, order=None, element='isoparametric', start=None)",
    "adapt": "(problem, *, maxh=None, order=None, element='isoparametric', theta=0.5, "
    "tolerance=None, max_dofs=100000, guaranteed=False, start=None, progress=False)",
    "polish": "(solution, digits=8)",
    "solve_qp": "(A, f, B, g, E=None, e=None, active=None)",
    "find_contacts": "(geometry, *, within)",
    "load": "(path)",
    "write_series": "(path, solutions, times=None)",
    "write_film": "(path, solutions, *, seconds=0.6, titles=None, **options)",
    "plot_convergence": "(runs, path=None, *, rates=None)",
}


def run_python(code):
    """What a fresh interpreter prints on standard output and error."""
    result = subprocess.run(
        [sys.executable, "-c", code], cwd=ROOT, capture_output=True, text=True, check=True
    )
    return result.stdout, result.stderr


def test_the_public_names_are_the_documented_ones():
    assert sorted(ngcontact.__all__) == PUBLIC
    public = {name for name in dir(ngcontact) if not name.startswith("_")}
    modules = {name for name in public if inspect.ismodule(getattr(ngcontact, name))}
    assert public - modules == set(PUBLIC)


@pytest.mark.parametrize("name", SIGNATURES)
def test_signatures(name):
    """Names, defaults, and which are given by name."""
    signature = inspect.signature(getattr(ngcontact, name))
    plain = [p.replace(annotation=p.empty) for p in signature.parameters.values()]
    assert str(inspect.Signature(plain)) == SIGNATURES[name]


def test_import_is_silent_and_light():
    heavy = "scipy pyvista vtk vtkmodules matplotlib IPython webgui_jupyter_widgets".split()
    out, err = run_python(
        f"import sys, ngcontact; print([name for name in {heavy} if name in sys.modules])"
    )
    assert out.strip() == "[]"
    assert err == ""


def test_import_leaves_logging_and_threads_to_the_caller():
    assert logging.getLogger("ngcontact").handlers == []
    out, _ = run_python(
        "import threading, logging, ngcontact; "
        "print(threading.active_count(), len(logging.getLogger().handlers))"
    )
    assert out.split() == ["1", "0"]
