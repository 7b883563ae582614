"""One row of a table: plain numbers, the same columns for every solution of a problem."""

import json
import math

import pytest

from drivers.reference import cases
from ngcontact import solve


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
