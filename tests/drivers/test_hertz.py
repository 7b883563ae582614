"""The main job: ``drivers.hertz``."""

from __future__ import annotations

import pyvista

from drivers import hertz


def test_hertz_agrees_with_the_formulas(tmp_path, capsys):
    computed, expected = hertz.main(max_dofs=6000, folder=tmp_path)
    # The formulas hold up to O((a/R)^2) = 1e-3; required 1 %, measured 0.02 % and 0.3 % here.
    assert computed.half_width / hertz.RADIUS <= 0.03
    assert abs(computed.peak / expected.peak - 1) < 2e-3
    assert abs(computed.half_width / expected.half_width - 1) < 1e-2
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
