"""The driver of bounds: what it measures, and what it writes."""

import csv

import pytest

from drivers.bounds import main


@pytest.mark.study
def test_bounds_are_measured_and_drawn(tmp_path, capsys):
    rows = main(["one transition"], orders=[2], max_dofs=1500, out=tmp_path)
    said = capsys.readouterr().out.splitlines()
    assert len(said) == 1 + len(rows)
    for row in rows:
        assert 1 <= row.bound <= 1.15 < 3 < row.estimate
        assert 0 < row.width <= 1.5
        assert min(row.run, row.bounding, row.quantities) > 0
    with (tmp_path / "bounds.csv").open(encoding="utf-8") as file:
        assert [int(row["unknowns"]) for row in csv.DictReader(file)] == [r.unknowns for r in rows]
    assert (tmp_path / "bounds.png").read_bytes()[:4] == b"\x89PNG"
