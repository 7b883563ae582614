"""Many solves: the same rows by every engine, on one and on two processes, close to Hertz."""

import csv
import math

import pytest

from drivers import parameter_study as study


@pytest.mark.parametrize("engine", ["processes", "joblib", "dask"])
@pytest.mark.study
def test_one_process_and_two_find_the_same(tmp_path, capsys, engine):
    if engine != "processes":
        pytest.importorskip({"joblib": "joblib", "dask": "distributed"}[engine])
    rows, worst = study.main(solves=3, engine=engine, tolerance=0.05, out=tmp_path)
    # Sums of the same terms: round-off depends on where arrays lie in memory; measured 1.3e-11 in
    # 64 peaks.
    assert worst < 1e-10
    assert len({row["contact_0_force_y"] for row in rows}) == 3
    for row in rows:
        # Measured: 6e-4 at an estimate of 5 % and a/R = 0.02.
        assert row["contact_0_peak_pressure"] == pytest.approx(row["hertz_peak"], rel=2e-3)
        assert row["relative_error_estimate"] <= 0.05
    with (tmp_path / "study.csv").open() as file:
        written = list(csv.DictReader(file))
    assert [float(row["energy"]) for row in written] == [row["energy"] for row in rows]
    assert "speed-up" in capsys.readouterr().out


def test_differences_are_noticed():
    row = {"unknowns": 2, "active": 1, "points": 3, "energy": 1.0}
    row |= {"contact_0_force_y": 2.0, "contact_0_peak_pressure": 4.0}
    assert study.difference([row], [row]) == 0
    assert study.difference([row], [row | {"energy": 1.1}]) == pytest.approx(0.1)
    assert study.difference([row], [row | {"unknowns": 4}]) == math.inf


def test_the_grid_has_as_many_points_as_asked_for():
    for solves in (1, 3, 4, 7, 64):
        grid = study.parameters(solves)
        assert len(set(grid)) == len(grid) == solves
