"""Exact solutions of any law, and the study of estimates with them."""

import math

import numpy as np
import pytest

from drivers.laws import main
from drivers.reference.laws import bent_fibres, fibres, graded, layers, stiff_and_soft
from ngcontact import Elastic
from tests.drivers.test_paper import at

BOX = (-1, 1, -1, 1)
X = np.linspace(-0.9, 0.9, 13)
TURNED = {"lower": fibres(1e4, 0.5), "cap": fibres(1e2, 1.2), "upper": Elastic(3.0, 0.1)}


@pytest.mark.parametrize(
    ("case", "lines"),
    [
        (stiff_and_soft(1e6), {-0.4: ("base", "lower"), 0.0: ("lower", "upper")}),
        (stiff_and_soft(1e2), {0.5: ("upper", "cap")}),
        (layers(TURNED, (-1, 0, 0.3, 1)), {0.0: ("lower", "cap"), 0.3: ("cap", "upper")}),
        (graded(1e6), {0.0: ("lower", "upper")}),
    ],
)
def test_regions_meet(case, lines):
    """Displacements are continuous, tractions those of the pressure 1, on every line."""
    exact = case.exact
    for y, regions in lines.items():
        u, s = (
            [at(f[r], BOX, X, 0 * X + y) for r in regions]
            for f in (exact.displacement, exact.stress)
        )
        for stress in s:
            np.testing.assert_allclose(stress[:, 1, 1], -1, rtol=1e-11)
            assert np.abs(stress[:, 0, 1]).max() < 1e-11
        across = u[0] - u[1] if y or len(exact.stress) > 2 else (u[0] - u[1])[:, 1]
        assert np.abs(across).max() < 1e-14 * max(1.0, np.abs(u[0]).max())


def test_bent_fibres_do_not_stretch():
    """Their stress does not depend on their stiffness."""
    x, y = np.random.default_rng(0).uniform(0, 1, (2, 50))
    soft, stiff = (
        at(bent_fibres(a, 0.7).exact.stress["body"], (0, 1, 0, 1), x, y) for a in (1, 1e6)
    )
    assert np.abs(soft).max() > 1
    np.testing.assert_allclose(stiff, soft, atol=1e-9)  # 1e6 times round-off


@pytest.mark.study
def test_the_study_prints_a_table(capsys, tmp_path):
    found = main(["layers"], contrasts=[1e2], orders=[1], max_dofs=400, out=tmp_path / "out")
    assert set(found) == {f"layers, 100, order 1, {s}" for s in ("uniform", "adaptive")}
    for rows in found.values():
        assert all(1 <= row.estimate <= 10 and row.bound >= 1 for row in rows)
    printed = capsys.readouterr().out
    assert (tmp_path / "out" / "laws.md").read_text() == printed
    assert printed.count("| layers, 100 | 1 |") == 2
    assert math.isfinite(float(printed.splitlines()[-1].split("|")[6]))
