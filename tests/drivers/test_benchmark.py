"""The other codes of `drivers.benchmark` on small meshes, against the references."""

import ast
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import ngcontact
from drivers.adaptive_study.runs import smallest_angle
from drivers.benchmark.__main__ import PARTS, Part, main
from drivers.benchmark.engines import NotInstalledError, Run, kratos, needed, ngsolve
from drivers.benchmark.scenes.meshes import KINDS, made
from drivers.benchmark.scenes.plane import contact_end, peak, weights
from drivers.benchmark.scenes.problems import block, disc
from drivers.benchmark.studies import overhead, processes
from ngcontact import adapt
from ngcontact.discrete import MULTIGRID

COMMON = {"disc": disc(), "block": block()}
QUANTITIES = ("force", "peak", "half_width", "energy")

# Relative errors allowed at 1000 unknowns on graded meshes: about twice the largest measured of
# the active set and the penalty method. The block's force is given by equilibrium.
ALLOWED = {
    ("disc", 1): {"force": 1e-2, "peak": 1.2e-2, "half_width": 1.5e-2, "energy": 1e-2},
    ("disc", 2): {"force": 3e-4, "peak": 1.5e-3, "half_width": 8e-3, "energy": 4e-4},
    ("block", 1): {"force": 1e-10, "peak": 7e-3, "half_width": 5e-3, "energy": 7e-3},
    ("block", 2): {"force": 1e-10, "peak": 3e-3, "half_width": 2e-3, "energy": 5e-4},
}


def errors(run: Run) -> dict[str, float]:
    reference = COMMON[run.problem].reference
    return {q: abs(getattr(run, q) / getattr(reference, q) - 1) for q in QUANTITIES}


def too_large(run: Run, **others: float) -> dict[str, float]:
    allowed = {**ALLOWED[run.problem, run.order], **others}
    # Written so that NaN is too large.
    return {q: e for q, e in errors(run).items() if not e <= allowed[q]}


@pytest.mark.parametrize("name", COMMON)
def test_active_set_finds_the_references(name: str):
    runs = list(ngsolve.ACTIVE_SET.runs(COMMON[name], ["graded"], [1000]))
    assert [run.order for run in runs] == [1, 2]
    assert [too_large(run) for run in runs] == [{}, {}]


@pytest.mark.parametrize("name", COMMON)
@pytest.mark.study(witness=["disc"])
def test_large_penalties_find_the_references(name: str):
    runs = list(ngsolve.PENALTY.runs(COMMON[name], ["graded"], [1000]))
    assert [run.order for run in runs] == [1, 1, 1, 2, 2, 2]
    stiff = [run for run in runs if run.engine == "NGSolve penalty 1000 E/h"]
    assert [too_large(run) for run in stiff] == [{}, {}]
    if name == "disc":  # theory: the error falls like 1 / penalty; measured 9e-3, 8e-4, 9e-5
        low, middle, high = (errors(run)["energy"] for run in runs[3:])
        assert 5 < low / middle < 20
        assert 5 < middle / high < 20


def test_kratos_finds_the_references_or_is_missing_by_name():
    try:
        runs = [run for c in COMMON.values() for run in kratos.MORTAR.runs(c, ["graded"], [1000])]
    except NotInstalledError as error:
        pytest.skip(str(error))
    assert [(run.problem, run.order) for run in runs] == [("disc", 1), ("block", 1)]
    # Its contact follows the bodies' motion: measured 1.4e-4 of the block's force.
    others = {"disc": {}, "block": {"force": 3e-4}}
    assert [too_large(run, **others[run.problem]) for run in runs] == [{}, {}]


def test_a_missing_package_is_named():
    with pytest.raises(NotInstalledError, match=r"Nothing needs no_such_code.*bench"):
        needed("Nothing", "math", "no_such_code")


@pytest.mark.parametrize("name", COMMON)
def test_references_are_those_of_the_package(name: str):
    common = COMMON[name]
    *_, solution = adapt(common.problem, order=4, max_dofs=20_000)
    found = {
        "force": common.parts * solution.force.sum(),
        "peak": solution.pressure[np.argmin(solution.points[:, 0])],
        "half_width": solution.transitions()[0, 0],
        "energy": solution.energy_norm**2 / 2,
    }
    # Twice the errors measured at 17 000 and 19 000 unknowns, of which the disc's force and
    # half-width (2.5e-9, 3.3e-6) and the block's peak and energy (9.3e-7, 2.6e-9) are larger.
    allowed = {"force": 5e-9, "peak": 2e-6, "half_width": 7e-6, "energy": 6e-9}
    difference = {q: abs(found[q] / getattr(common.reference, q) - 1) for q in QUANTITIES}
    assert {q: e for q, e in difference.items() if e > allowed[q]} == {}


@pytest.mark.parametrize("order", [1, 2])
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("name", COMMON)
@pytest.mark.study(witness=["block-uniform-2", "disc-uniform-2", "disc-uniform-1"])
def test_meshes_have_the_size_asked_for(name: str, kind: str, order: int):
    for size in (1000, 20_000):  # the larger ones are refined after meshing
        mesh = made(COMMON[name], kind, order, size)
        # Graded meshes stop at 5 %; refined ones and uniform ones come within 8 %.
        assert abs(mesh.unknowns(order) / size - 1) < 0.1
        assert (mesh.seconds > 0) == (kind == "uniform")
        corners = mesh.points[mesh.triangles]
        assert smallest_angle(corners) > 25  # measured 27 and more; slivers cost pressure
    if name == "block":
        sides = [np.unique(mesh.points[mesh.edges[f"{b}_contact"], 0]) for b in ("upper", "lower")]
        np.testing.assert_allclose(*sides, rtol=0, atol=1e-12 * sides[0][-1])


def test_readings_of_known_fields():
    x, a = np.linspace(0, 1, 41), 0.61
    gap = ((x - a) * (1 + x - a)).clip(0) ** 1.5
    force = weights(x, 1) * np.where(x < a, 2 - 3 * x**2, 0)
    # Both are parabolas where they are read, gap^(2/3) and the pressure: exact but for round-off.
    assert contact_end(x, force, gap) == pytest.approx(a, rel=1e-9)
    assert peak(x, force, 1) == pytest.approx(2, rel=1e-12)


@pytest.mark.study
def test_large_problems_take_the_path_asked_for():
    usual = MULTIGRID.large
    rows = [processes.measure("block", 1, 20_000, path) for path in processes.PATHS]
    assert len({row.unknowns for row in rows}) == 1
    assert all(row.seconds > 0 and row.memory > 0 for row in rows)
    assert MULTIGRID.large is usual
    one, other = rows
    assert one.cycles < other.cycles
    assert processes.of_large(rows).count("\n") == 2
    assert f"| {other.systems} | {other.cycles} |" in processes.of_large(rows)


def test_small_problems_do_not_stay_iterative():
    with pytest.raises(RuntimeError, match="1000 unknowns did not stay iterative"):
        processes.measure("block", 1, 1000, "iterative")


@pytest.mark.study
def test_driver_writes_the_parts_asked_for(tmp_path: Path, capsys: pytest.CaptureFixture[str]):
    found = main(["tax"], problems=["block"], rounds=1, max_dofs=10_000, out=tmp_path)
    assert list(found) == ["tax"]
    sizes = [row["unknowns"] for row in found["tax"]]
    assert len(sizes) == 2 * 2  # orders, sizes
    assert max(sizes) < 11_000
    assert all(float(row[k]) > 0 for row in found["tax"] for k in ("linear, s", "cold", "warm"))
    [path] = tmp_path.iterdir()
    assert path.name == "benchmark_tax.md"
    assert path.read_text() in capsys.readouterr().out


def test_every_part_has_its_name():
    assert get_args(Part) == tuple(PARTS)


def test_every_stage_of_a_level_is_found():
    """Stages name functions of the package, which may move."""
    defined = {
        (path.stem, node.name)
        for path in Path(ngcontact.__file__).parent.rglob("*.py")
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8")))
        if isinstance(node, ast.FunctionDef)
    }
    assert {pair for functions in overhead.STAGES.values() for pair in functions} <= defined
