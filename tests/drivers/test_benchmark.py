"""The other codes of `drivers.benchmark` on small meshes, against the references."""

import ast
from pathlib import Path

import pytest

import ngcontact
from drivers.benchmark.engines import NotInstalledError, needed, ngsolve
from drivers.benchmark.scenes.problems import block, disc
from drivers.benchmark.studies import overhead, processes

COMMON = {"disc": disc(), "block": block()}

# Relative errors allowed at 1000 unknowns on graded meshes: about twice the largest measured of
# the active set and the penalty method. The block's force is given by equilibrium.
ALLOWED = {
    ("disc", 1): {"force": 1e-2, "peak": 1.2e-2, "half_width": 1.5e-2, "energy": 1e-2},
    ("disc", 2): {"force": 3e-4, "peak": 1.5e-3, "half_width": 8e-3, "energy": 4e-4},
    ("block", 1): {"force": 1e-10, "peak": 7e-3, "half_width": 5e-3, "energy": 7e-3},
    ("block", 2): {"force": 1e-10, "peak": 3e-3, "half_width": 2e-3, "energy": 5e-4},
}


@pytest.mark.parametrize("name", COMMON)
def test_engines_of_ngsolve_find_the_references(name: str):
    runs = list(ngsolve.ACTIVE_SET.runs(COMMON[name], ["graded"], [1000]))
    if name == "disc":
        penalties = ngsolve.PENALTY.runs(COMMON[name], ["graded"], [1000])
        runs += [run for run in penalties if run.engine == "NGSolve penalty 1000 E/h"]
    assert [run.order for run in runs] == [1, 2] * (len(runs) // 2)
    for run in runs:
        for quantity, allowed in ALLOWED[name, run.order].items():
            reference = getattr(COMMON[name].reference, quantity)
            assert abs(getattr(run, quantity) / reference - 1) <= allowed, (run.engine, quantity)


def test_a_missing_package_is_named():
    with pytest.raises(NotInstalledError, match=r"Nothing needs no_such_code.*bench"):
        needed("Nothing", "math", "no_such_code")


def test_small_problems_do_not_stay_iterative():
    with pytest.raises(RuntimeError, match="1000 unknowns did not stay iterative"):
        processes.measure("block", 1, 1000, "iterative")


def test_every_stage_of_a_level_is_found():
    """Stages name functions of the package, which may move."""
    defined = {
        (path.stem, node.name)
        for path in Path(ngcontact.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }
    assert {pair for functions in overhead.STAGES.values() for pair in functions} <= defined
