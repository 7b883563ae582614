"""Figures with bars: the energy's is proved, the others are held against Hertz contact."""

from __future__ import annotations

import warnings
from dataclasses import replace

import numpy as np
import pytest
from netgen.occ import Circle, Compound, OCCGeometry

from drivers.reference import cases
from ngcontact import Contact, ContactWarning, Elastic, Problem, adapt, solve
from ngcontact.estimator import Quantity
from ngcontact.estimator.equilibrated import bound


@pytest.mark.parametrize("order", [2, 4])
def test_bars_contain_the_exact_values(order):
    """Of the force on every level, of the ends where these are resolved; and are not idle."""
    case = cases.hertz_contact(half_width=0.3)
    force, ends = [], []
    for level in adapt(case.problem, order=order, max_dofs=4500):
        q = level.quantities()
        assert level.work["equilibrations"] == 1
        assert abs(q["force"].value - case.exact.P) <= q["force"].error
        assert not q["force"].guaranteed
        force.append(q["force"].error / abs(q["force"].value - case.exact.P))
        assert q["energy"].guaranteed
        low, high = level.energy_bounds
        assert q["energy"].error == max(high - level.energy, level.energy - low)
        found = [row for row in q if row.name == "end of contact, x"]
        assert sorted(np.sign(row.value) for row in found) == [-1, 1]
        ends += [row.error / abs(abs(row.value) - 0.3) for row in found]
    assert np.median(force) <= 50
    assert np.mean(np.array(ends) >= 1) >= 0.9
    assert np.median(ends) <= 100


def test_largest_stress_lies_under_the_surface():
    """Johnson 1985: the largest shear is 0.3 p0 at 0.78 a; von Mises 0.56 p0 at nu = 0.3, 0.7 a."""
    case = cases.hertz_contact(half_width=0.3)
    *_, finest = adapt(case.problem, order=4, max_dofs=4500)
    row = finest.quantities()["largest von Mises"]
    assert 0.5 * case.exact.p0 < row.value < 0.65 * case.exact.p0
    assert abs(row.place[0]) < 0.1
    assert 0.15 < abs(row.place[1]) < 0.3
    assert 0 < row.error < 0.05 * row.value


@pytest.mark.parametrize("order", [2, 3, 4])
def test_largest_stress_lies_on_the_bore_of_a_press_fit(order):
    """Lame: radial -p, hoop 5/3 p in a hub of twice the radius; full circles, resultant zero."""
    R, d, E, nu = 20.0, 0.02, 210e3, 0.3
    hub, bore = (Circle((0, 0), r).Face() for r in (2 * R, R))
    hub.edges.name, bore.edges.name = "rim", "bore"
    hub, shaft = hub - bore, Circle((0, 0), R + d).Face()
    hub.faces.name, shaft.faces.name, shaft.edges.name = "hub", "shaft", "side"
    problem = Problem(
        geometry=OCCGeometry(Compound([hub, shaft]), dim=2),
        materials={"hub|shaft": Elastic(E=E, nu=nu)},
        contact=[Contact("side", "bore")],
    )
    p = d / R * E / (1 - nu**2) / (5 / 3 + 1)  # plane strain
    q = solve(problem, maxh=6.0, order=order).quantities()
    stress = np.array([-p, 5 / 3 * p, nu * 2 / 3 * p])
    mises = np.sqrt(((stress - np.roll(stress, 1)) ** 2).sum() / 2)
    row = q["largest von Mises"]
    assert np.linalg.norm(row.place) == pytest.approx(R, rel=1e-3)
    # The gap of the drawing is closed to first order: d / R of the pressure besides.
    assert abs(row.value - mises) <= row.error + 2 * d / R * mises
    assert row.error <= 0.15 * mises  # measured 0.104 at order 2, less above
    assert q["force"].value <= 1e-6 * p * R  # by symmetry


def test_the_table_reads():
    solution = solve(cases.hertz_contact().problem, maxh=0.25, order=2)
    q = solution.quantities()
    names = [row.name for row in q]
    assert names[:2] == ["force", "peak pressure"]
    assert names[-2:] == ["energy", "largest von Mises"]
    lines = str(q).splitlines()
    assert len(lines) == len(names)
    assert all(("guaranteed" in line) == line.startswith("energy") for line in lines)
    assert all("+-" in line for line in lines)
    with pytest.raises(KeyError, match="'torque' is none of"):
        q["torque"]
    with pytest.raises(ValueError, match="pair=1 is not a contact pair"):
        solution.quantities(1)


def said_once(solution):
    """The table of a solution of which nothing is guaranteed; its warning, of two asked for."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        q, again = solution.quantities(), solution.quantities()
    (message,) = [str(w.message) for w in caught]
    assert str(q) == str(again)
    assert all(row.kind == "estimated" and row.error > 0 for row in q)
    assert str(q).splitlines()[-1] == q.note
    assert message.startswith(q.note)
    return q


def test_without_a_stress_in_equilibrium_all_rows_are_estimates(monkeypatch):
    """Residuals are called too large: the same values as ever, bars that contain the truth."""
    case = cases.hertz_contact(half_width=0.5)
    solution = solve(case.problem, maxh=0.1, order=2)
    values = [row.value for row in solution.quantities()]
    monkeypatch.setattr(bound, "SETTLED", -1.0)
    other = solve(case.problem, maxh=0.1, order=2)
    q = said_once(other)
    assert "no equilibrated stress was found" in q.note
    assert [row.value for row in q] == pytest.approx(values, rel=1e-12)
    assert abs(q["force"].value - case.exact.P) <= q["force"].error
    assert abs(q["peak pressure"].value - case.exact.p0) <= q["peak pressure"].error
    low, high = solution.energy_bounds
    assert q["energy"].value - q["energy"].error <= high
    assert q["energy"].value + q["energy"].error >= low


def test_refused_scenes_have_quantities():
    """Bodies of revolution, held by their axis alone; the force is that of the whole body."""
    problem = replace(cases.disc_on_rigid_plane(), model="axisymmetric")
    with pytest.warns(ContactWarning, match="0.25 segments long"):
        solution = solve(problem, maxh=0.5, order=2)
    q = said_once(solution)
    assert 'the model "axisymmetric"' in q.note
    assert q["force"].value == pytest.approx(np.linalg.norm(solution.contact_force()), rel=1e-12)


def test_one_element_has_no_neighbour_to_compare_with():
    """The bar of a stress that nothing is known of reads as none."""
    row = Quantity("largest von Mises", 2.0, np.nan, "none")
    assert "none" in str(row)
    assert "+-" not in str(row)
    assert not row.guaranteed
