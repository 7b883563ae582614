"""Drivers as a whole, on small meshes: what they find, print and write; published problems."""

import math
from functools import partial

import pytest
import pyvista

from drivers import bounds, convergence, hertz, laws, published, spheres
from drivers import parameter_study as study
from drivers.adaptive_study.__main__ import main as adaptive_study
from drivers.benchmark.__main__ import main as benchmark
from drivers.published import PUBLISHED
from drivers.reference.half_spaces import Hertz

DISC = ["disc on rigid plane"]
ONE_BLOCK = {"problems": ["block"], "rounds": 1, "max_dofs": 10_000}
RUNS = {
    "adaptive_study": partial(adaptive_study, DISC, orders=[2], max_dofs=2000, reference=6000),
    "benchmark": partial(benchmark, ["tax"], **ONE_BLOCK),
    "bounds": partial(bounds.main, ["one transition"], orders=[2], max_dofs=1500),
    "laws": partial(laws.main, ["layers"], contrasts=[1e2], orders=[1], max_dofs=400),
    "convergence": partial(convergence.main, levels=2),
}
FILES = {
    "adaptive_study": {"adaptive_study.csv", "adaptive_study.md"}
    | {f"{kind}_disc_on_rigid_plane.png" for kind in ("errors", "meshes")},
    "benchmark": {"benchmark_tax.md"},
    "bounds": {"bounds.csv", "bounds.png"},
}


@pytest.mark.parametrize("name", RUNS)
@pytest.mark.study
def test_what_is_found_is_printed_and_written(name, tmp_path, capsys):
    found = RUNS[name](**({"out": tmp_path} if name in FILES else {}))
    rows = [row for part in found.values() for row in part] if isinstance(found, dict) else found
    assert len(rows) > 1
    assert len(capsys.readouterr().out.splitlines()) > len(found)
    assert {path.name for path in tmp_path.iterdir()} == FILES.get(name, set())
    for table in tmp_path.glob("*.csv"):
        assert len(table.read_text().splitlines()) == 1 + len(rows)


@pytest.mark.parametrize(
    ("driver", "most", "difference"),
    # The formulas hold up to O((a/R)^2) = 1e-3; required 1 %, of pressure and radius measured
    # 0.02 % and 0.3 % of the disc, 0.05 % of the balls.
    [(hertz, 6000, (2e-3, 1e-2)), (spheres, 4500, (3e-3, 3e-3))],
    ids=["hertz", "spheres"],
)
def test_demonstrations_agree_with_hertz_s_formulas(driver, most, difference, tmp_path, capsys):
    computed, expected = driver.main(max_dofs=most, out=tmp_path)
    assert computed.a / 0.01 <= 0.03  # radii
    assert abs(computed.peak / expected.peak - 1) < difference[0]
    assert abs(computed.a / expected.a - 1) < difference[1]
    printed = capsys.readouterr().out
    unknowns = [int(line.split()[0]) for line in printed.splitlines() if line[:8].strip().isdigit()]
    assert unknowns == sorted(unknowns)
    assert unknowns[-1] <= most
    name = driver.__name__.rpartition(".")[2]
    endings = [".vtu", "_contact.vtp", ".png"]
    endings += ["_revolved.vtu", "_revolved_contact.vtp"] if driver is spheres else []
    assert {path.name for path in tmp_path.iterdir()} == {name + end for end in endings}
    contact = pyvista.read(tmp_path / f"{name}_contact.vtp")
    assert contact["pressure"].max() == computed.peak


@pytest.mark.parametrize("engine", ["processes", "joblib", "dask"])
@pytest.mark.study
def test_one_process_and_two_find_the_same(tmp_path, engine):
    if engine != "processes":
        pytest.importorskip({"joblib": "joblib", "dask": "distributed"}[engine])
    rows, worst = study.main(solves=3, engine=engine, tolerance=0.05, out=tmp_path)
    # Sums of the same terms: round-off depends on where arrays lie in memory; measured 1.3e-11 in
    # 64 peaks.
    assert worst < 1e-10
    assert study.difference(rows, [row | {"energy": 1.1 * row["energy"]} for row in rows]) > 0.09
    assert study.difference(rows, [row | {"unknowns": 4} for row in rows]) == math.inf
    for row in rows:
        # Measured: 6e-4 at an estimate of 5 % and a/R = 0.02.
        assert row["contact_0_peak_pressure"] == pytest.approx(row["hertz_peak"], rel=2e-3)
    assert len((tmp_path / "study.csv").read_text().splitlines()) == 1 + len(rows)


def test_a_page_of_published_problems_is_written(tmp_path):
    published.main(("patch test",), order=1, max_dofs=500, page=tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text()
    assert "| mean pressure, Pa | 100000 | 100000 |" in text


def test_closed_forms_give_the_published_figures():
    """Four to six digits, as the sources print them."""
    roller = Hertz(35e3, 50.0, 1 / (0.91 / 210e3 + 0.91 / 70e3))
    assert roller.cylinder() == pytest.approx((6.2146, 3585.37), rel=1e-5)
    spheres = Hertz(1e4, 1.0, 7.5e6)
    assert spheres.sphere()[0] == pytest.approx(0.1, rel=1e-12)
    plane = Hertz(188.49556, 8.0, 1000 / 0.91)
    assert plane.sphere()[0] == pytest.approx(1.010, rel=5e-4)


@pytest.mark.parametrize(
    ("name", "max_dofs"),
    [("patch test", 1000), ("rotating rings", 3000), ("rounded punch", 50_000)],
)
@pytest.mark.study(witness=["patch test-1000", "rotating rings-3000"])
def test_computed_figures_are_the_published_ones(name, max_dofs):
    figures = PUBLISHED[name].figures
    solution = published.solved(PUBLISHED[name], 2, max_dofs)
    for figure, row in zip(figures, published.rows_of(figures, solution), strict=True):
        assert abs(row[3]) <= figure.within
