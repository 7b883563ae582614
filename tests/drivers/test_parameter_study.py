"""Many solves: the same rows by every engine, on one and on two processes, close to Hertz."""

import csv
import math

import pytest

from drivers import parameter_study as study


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
    with (tmp_path / "study.csv").open() as file:
        assert [float(row["energy"]) for row in csv.DictReader(file)] == [r["energy"] for r in rows]
