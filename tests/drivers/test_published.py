"""Problems that other codes publish: statements, closed forms, and small runs."""

import pytest

from drivers import published as driver
from drivers.published import PUBLISHED
from drivers.reference.half_spaces import Hertz


def test_closed_forms_give_the_published_figures():
    """Four to six digits, as the sources print them."""
    roller = Hertz(35e3, 50.0, 1 / (0.91 / 210e3 + 0.91 / 70e3))
    assert roller.cylinder() == pytest.approx((6.2146, 3585.37), rel=1e-5)
    spheres = Hertz(1e4, 1.0, 7.5e6)
    assert spheres.sphere()[0] == pytest.approx(0.1, rel=1e-12)
    plane = Hertz(188.49556, 8.0, 1000 / 0.91)
    assert plane.sphere()[0] == pytest.approx(1.010, rel=5e-4)


@pytest.mark.parametrize(
    ("name", "max_dofs"),
    [("patch test", 1000), ("rotating rings", 3000), ("rounded punch", 50_000)],
)
@pytest.mark.study(witness=["patch test-1000", "rotating rings-3000"])
def test_computed_figures_are_the_published_ones(name, max_dofs):
    figures = PUBLISHED[name].figures
    solution = driver.solved(PUBLISHED[name], 2, max_dofs)
    for figure, row in zip(figures, driver.rows_of(figures, solution), strict=True):
        assert abs(row[3]) <= figure.within
