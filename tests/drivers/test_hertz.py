"""The demonstrations ``drivers.hertz`` and ``drivers.spheres``: whole bodies against Hertz."""

import pytest
import pyvista

from drivers import hertz, spheres


@pytest.mark.parametrize(
    ("driver", "most", "difference"),
    # The formulas hold up to O((a/R)^2) = 1e-3; required 1 %, of pressure and radius measured
    # 0.02 % and 0.3 % of the disc, 0.05 % of the balls.
    [(hertz, 6000, (2e-3, 1e-2)), (spheres, 4500, (3e-3, 3e-3))],
    ids=["hertz", "spheres"],
)
def test_drivers_agree_with_the_formulas(driver, most, difference, tmp_path, capsys):
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
    bodies = pyvista.read(tmp_path / f"{name}.vtu")
    assert {"displacement", "stress", "von_mises"} <= set(bodies.point_data)
    contact = pyvista.read(tmp_path / f"{name}_contact.vtp")
    assert contact["pressure"].max() == computed.peak
