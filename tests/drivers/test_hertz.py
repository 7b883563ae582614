"""The main job: ``drivers.hertz``."""

import pytest
import pyvista

from drivers import hertz
from drivers.hertz import Quantities, compare


def test_hertz_agrees_with_the_formulas(tmp_path, capsys):
    computed, expected = hertz.main(max_dofs=6000, out=tmp_path)
    # The formulas hold up to O((a/R)^2) = 1e-3; required 1 %, measured 0.02 % and 0.3 % here.
    assert computed.a / 0.01 <= 0.03  # radii
    assert abs(computed.peak / expected.peak - 1) < 2e-3
    assert abs(computed.a / expected.a - 1) < 1e-2
    printed = capsys.readouterr().out
    unknowns = [int(line.split()[0]) for line in printed.splitlines() if line[:8].strip().isdigit()]
    assert unknowns == sorted(unknowns)
    assert unknowns[-1] <= 6000
    assert {path.name for path in tmp_path.iterdir()} == {
        "hertz.vtu",
        "hertz_contact.vtp",
        "hertz.png",
    }
    bodies = pyvista.read(tmp_path / "hertz.vtu")
    assert bodies.n_cells > 100
    assert {"displacement", "stress", "von_mises"} <= set(bodies.point_data)
    contact = pyvista.read(tmp_path / "hertz_contact.vtp")
    assert contact["pressure"].max() == computed.peak


@pytest.mark.study
def test_similar_discs_have_the_same_pressure():
    options = {"order": 2, "max_dofs": 2000, "out": None}
    (one, _), (other, formulas) = (hertz.main(radius=r, **options) for r in (0.01, 0.04))
    assert other.peak == pytest.approx(one.peak, rel=1e-9)  # the same problem in other units
    assert other.a == pytest.approx(4 * one.a, rel=1e-9)
    assert formulas.force == pytest.approx(4 * one.force, rel=1e-9)
    softer, _ = hertz.main(disc=(21e9, 0.3), block=(7e9, 0.33), **options)
    assert softer.peak == pytest.approx(one.peak / 10, rel=1e-9)


def test_a_tolerance_ends_the_refinement(capsys):
    hertz.main(order=2, tolerance=0.5, out=None)
    levels = [line for line in capsys.readouterr().out.splitlines() if line[:8].strip().isdigit()]
    assert float(levels[-1].split()[3]) <= 0.5 < float(levels[-2].split()[3])


def test_a_comparison_gives_the_difference_in_percent(capsys):
    compare("radius", 1.0, Quantities(1.0, 1.02e6, 3e-3), Quantities(1.0, 1e6, 4e-3))
    _, head, first, second = capsys.readouterr().out.splitlines()
    assert "0.0030" in head
    assert first.split()[-2:] == ["+2.000", "%"]
    assert second.split() == ["radius", "3.0000", "4.0000", "-25.000", "%"]
