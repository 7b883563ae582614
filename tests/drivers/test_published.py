"""Problems that other codes publish: statements, closed forms, and small runs."""

from typing import get_args

import numpy as np
import pytest

from drivers import published as driver
from drivers.published import PUBLISHED, RINGS
from drivers.reference.half_spaces import Hertz


def lame() -> tuple[float, float]:
    """Pressures between three rotating rings in plane stress, by Lame's formulas.

    u = A r + B / r - c r^3 with c = (1 - nu^2) rho omega^2 / (8 E) on each of the rings.
    """
    speed, M, b = 420.0, np.zeros((6, 6)), np.zeros(6)

    def radial(k: int, r: float) -> tuple[float, float, float, float]:
        """Coefficients of A, B and 1 in sigma_rr at `r`, and c r^3."""
        E, nu, density, *_ = list(RINGS.values())[k]
        c, factor = (1 - nu**2) * density * speed**2 / (8 * E), E / (1 - nu**2)
        load = -factor * (3 + nu) * c * r**2
        return factor * (1 + nu), -factor * (1 - nu) / r**2, load, c * r**3

    radii = [(outside, inside) for *_, outside, inside in RINGS.values()]
    for row, (k, r, given) in enumerate(((0, radii[0][0], 150.0), (2, radii[2][1], 30.0))):
        *M[row, 2 * k : 2 * k + 2], load, _ = radial(k, r)
        b[row] = -given - load
    for k, interference in enumerate((0.025, 0.010)):
        r = radii[k][1]
        (a, b1, load, c), (a2, b2, load2, c2) = radial(k, r), radial(k + 1, r)
        M[2 + k, 2 * k : 2 * k + 4] = a, b1, -a2, -b2
        b[2 + k] = load2 - load
        M[4 + k, 2 * k : 2 * k + 4] = r, 1 / r, -r, -1 / r
        b[4 + k] = interference + c - c2
    x = np.linalg.solve(M, b)

    def pressure(k: int) -> float:
        """Inside ring `k`."""
        a, b1, load, _ = radial(k, radii[k][1])
        return float(-(a * x[2 * k] + b1 * x[2 * k + 1] + load))

    return pressure(0), pressure(1)


def test_every_problem_can_be_asked_for_and_has_its_source():
    assert get_args(driver.Name) == tuple(PUBLISHED)
    assert len(PUBLISHED) >= 8
    for problem in PUBLISHED.values():
        assert len(problem.source) > 20
        assert problem.why.endswith(".")
        assert problem.figures


def test_closed_forms_give_the_published_figures():
    """Four to six digits, as the sources print them."""
    roller = Hertz(35e3, 50.0, 1 / (0.91 / 210e3 + 0.91 / 70e3))
    assert roller.cylinder() == pytest.approx((6.2146, 3585.37), rel=1e-5)
    spheres = Hertz(1e4, 1.0, 7.5e6)
    assert spheres.sphere()[0] == pytest.approx(0.1, rel=1e-12)
    plane = Hertz(188.49556, 8.0, 1000 / 0.91)
    assert plane.sphere()[0] == pytest.approx(1.010, rel=5e-4)
    assert lame() == pytest.approx((161.4, 175.0), rel=2e-4)


@pytest.mark.parametrize(("name", "max_dofs"), [("patch test", 1000), ("rotating rings", 3000)])
def test_computed_figures_are_the_published_ones(name, max_dofs):
    published = PUBLISHED[name]
    solution = driver.solved(published, 2, max_dofs)
    for figure, (_, _, _, difference) in zip(
        published.figures, driver.rows_of(published.figures, solution), strict=True
    ):
        assert abs(difference) <= figure.within


def test_a_page_is_written(tmp_path, capsys):
    driver.main(("patch test",), order=1, max_dofs=500, page=tmp_path / "page.md")
    text = (tmp_path / "page.md").read_text()
    assert "| mean pressure, Pa | 100000 | 100000 |" in text
    assert PUBLISHED["patch test"].source in text
    assert "Contact patch test" in capsys.readouterr().out
