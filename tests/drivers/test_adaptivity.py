"""What adaptivity and bounds must show, smaller versions of the drivers."""

import csv

import numpy as np
import pytest

from drivers import bounds
from drivers.adaptive_study.__main__ import main
from drivers.adaptive_study.runs import STUDIES, energy_errors, rate, run_of

# The error of the best marking, driven by the true error, at a number of unknowns, and by how much
# it may be exceeded.
BEST = {"hertz a=0.3": (2, 14_300, 2.89e-3, 1.3), "hertz a=0.05": (1, 6620, 7.63e-2, 1.1)}


@pytest.mark.parametrize("name", ["one transition", "hertz a=0.3", "hertz a=0.05"])
@pytest.mark.parametrize(("order", "unknowns"), [(1, 8000), (2, 12_000), (3, 40_000)])
@pytest.mark.study(witness=["2-12000-hertz a=0.3", "2-12000-hertz a=0.05", "1-8000-hertz a=0.05"])
def test_levels_of_exact_solutions(name, order, unknowns):
    """Rates, effectivities, errors beside the best ones, Newton steps and factorisations."""
    study = STUDIES[name]()
    found = list(run_of(name, study, "adaptive", order, energy_errors(study), unknowns))
    rows = [row for _, row in found]
    # N^(-p/2), over the last factor 10 in N, which must not reach back to the first meshes of 2000
    # unknowns at order 3. Order 4 needs 50k unknowns and stays in the driver.
    if name != "hertz a=0.05":  # whose zone is not resolved early enough
        assert abs(rate(rows) / (-order / 2) - 1) < 0.1
    effectivities = np.array([row.effectivity for row in rows])[2:]
    assert len(effectivities) >= 2
    assert ((effectivities >= 1) & (effectivities <= 6)).all()
    assert effectivities.max() / effectivities.min() < 1.2  # measured drift at most 14 %
    p, size, best, factor = BEST.get(name, (0, 0, 0, 0))
    if p == order:
        assert rows[-1].error <= factor * best * (size / rows[-1].unknowns) ** (p / 2)
    # A level has two to four times the contact points of the one that starts it, and one run
    # a third of the levels that it takes without planning: the means are 1 to 2.5.
    steps = [row.steps for row in rows[2:]]
    assert max(steps) <= 3
    assert np.mean(steps) <= 2.5
    assert all(solution.work["factorizations"] == 1 for solution, _ in found[1:])


@pytest.mark.study
def test_punch_regains_the_rate():
    """Corner r^(-1/2): N^-1/4 uniformly, N^-1/2 adaptively, both of order 1."""
    study = STUDIES["flat punch"]()
    errors = energy_errors(study, reference=15_000)
    rates = {}
    for strategy in ("uniform", "adaptive"):
        levels = run_of("flat punch", study, strategy, 1, errors, max_dofs=10_000)
        rates[strategy] = rate([row for _, row in levels])
    assert abs(rates["uniform"] + 0.25) < 0.05
    assert abs(rates["adaptive"] + 0.5) < 0.075


@pytest.mark.study
def test_bounds_are_measured_and_drawn(tmp_path, capsys):
    rows = bounds.main(["one transition"], orders=[2], max_dofs=1500, out=tmp_path)
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 1 + len(rows)
    for row in rows:
        assert 1 <= row.bound <= 1.15 < 3 < row.estimate
        assert 0 < row.width <= 1.5
        assert min(row.run, row.bounding, row.quantities) > 0
    with (tmp_path / "bounds.csv").open(encoding="utf-8") as file:
        assert [int(row["unknowns"]) for row in csv.DictReader(file)] == [r.unknowns for r in rows]
    assert (tmp_path / "bounds.png").read_bytes()[:4] == b"\x89PNG"


@pytest.mark.study
def test_driver_writes_rows_and_pictures(tmp_path):
    sizes = {"max_dofs": 2000, "reference": 6000}
    rows = main(["disc on rigid plane"], orders=(1, 2), **sizes, out=tmp_path)
    assert max(row.unknowns for row in rows) <= 2000
    with (tmp_path / "adaptive_study.csv").open() as file:
        assert len(list(csv.DictReader(file))) == len(rows) > 8
    assert {row.strategy for row in rows} == {"uniform", "adaptive"}
    assert {"errors_disc_on_rigid_plane.png", "meshes_disc_on_rigid_plane.png"} <= {
        path.name for path in tmp_path.iterdir()
    }
    one, other = (
        rate([row for row in rows if (row.strategy, row.order) == (strategy, 2)])
        for strategy in ("uniform", "adaptive")
    )
    page = (tmp_path / "adaptive_study.md").read_text(encoding="utf-8")
    assert f"| disc on rigid plane | 2 | {one:.2f} | {other:.2f} | -1.0 |" in page
