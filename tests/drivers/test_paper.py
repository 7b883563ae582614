"""Exact solutions of single theorems and remarks, and of any law: elasticity, conditions, data."""

import math

import numpy as np
import pytest

from drivers.laws import main
from drivers.reference import cases, paper
from drivers.reference.laws import bent_fibres, fibres, graded, layers, stiff_and_soft
from drivers.reference.manufactured import slits
from ngcontact import Elastic
from tests.drivers.test_exact import assert_contact, at

FIRST, SECOND = cases.FIRST, cases.SECOND


def on_side(start, end, n=41):
    """Points (n, 2) of a side, without its ends, and its unit tangent."""
    t = np.linspace(0, 1, n + 2)[1:-1, None]
    start, end = np.asarray(start), np.asarray(end)
    return start + t * (end - start), (end - start) / math.dist(start, end)


@pytest.mark.parametrize("make", [paper.polygonal_zone, paper.bilateral_part])
def test_conditions_on_a_polygonal_line(make):
    exact = make().exact
    boxes, opened = dict.fromkeys(("upper", "lower"), (-1.1, 1.1, -1.1, 1.1)), 0
    for start, end in zip(cases.LINE[:-1], cases.LINE[1:], strict=True):
        points, tangent = on_side(start, end)
        x, y = points.T
        normal = np.tile((tangent[1], -tangent[0]), (len(x), 1))  # n' points down
        assert_contact(exact, boxes, x, y, normal, x, 1e-13)  # (3.9) to (3.11), to round-off
        opened += (exact.gap(x) > 0).sum()
    assert opened > 10
    # Tension: on the bilateral part alone.
    pressures = exact.pressure(np.linspace(-1, 1, 401))
    assert (pressures.min() < -0.9) == (make is paper.bilateral_part)
    assert pressures.min() >= (-1.001 if make is paper.bilateral_part else 0)


def test_conditions_on_a_circle():
    exact = paper.opening_ring().exact
    theta = np.linspace(0, math.pi / 2, 61)
    e = np.transpose([np.cos(theta), np.sin(theta)])
    box = (-0.1, 2.1, -0.1, 2.1)
    assert exact.pressure(theta).min() >= 0
    assert exact.gap(theta).max() > 0.005
    end = math.acos(-0.3) / 4
    inside = (theta > end) & (theta < math.pi / 2 - end)
    np.testing.assert_array_equal(exact.gap(theta) > 0, inside)
    assert_contact(exact, {"inner": box, "outer": box}, *e.T, e, theta, 1e-13)
    for body in ("outer", "inner"):
        # Guides on both axes: no displacement across, no shear.
        r = np.linspace(0.5, 2, 16)
        for x, y, across in ((r, 0 * r, 1), (0 * r, r, 0)):
            u, s = (at(f[body], box, x, y) for f in (exact.displacement, exact.stress))
            assert np.abs(u[:, across]).max() < 1e-15
            assert np.abs(s[:, 0, 1]).max() < 1e-13
    rim = at(exact.displacement["outer"], box, *(2 * e.T))
    assert np.abs(rim).max() < 1e-15  # clamped


def test_slits_are_a_flat_punch_on_each_body():
    exact, a = slits(FIRST, SECOND, half_width=0.5, force=2.0), 0.5
    s, w = np.polynomial.chebyshev.chebgauss(20)
    total = a * np.sum(w * np.sqrt(1 - s**2) * exact.pressure(a * s))
    assert total == pytest.approx(2.0, rel=1e-14)
    x = np.linspace(-0.9, 0.9, 12)  # none at the ends of the slits
    for body, box in (("upper", (-1, 1, 0, 1)), ("lower", (-1, 1, -1, 0))):
        u, stress = (at(f[body], box, x, 0 * x) for f in (exact.displacement, exact.stress))
        touching = np.abs(x) < a
        assert np.abs(u[touching, 1]).max() < 1e-15
        p = np.zeros(12)
        p[touching] = exact.pressure(x[touching])
        np.testing.assert_allclose(stress[:, 1, 1], -p, rtol=0, atol=1e-14)
        np.testing.assert_allclose(stress[:, 0, 1], 0, atol=1e-14)
        ends = at(exact.displacement[body], box, [-a, a], [0, 0])
        assert np.isfinite(ends).all()


def test_end_of_a_guide():
    case = paper.end_of_guide()
    exact, box = case.exact, (0, 2, -1, 0)
    u, stress, force = (f["lower"] for f in (exact.displacement, exact.stress, exact.force))
    size = np.abs(at(stress, box, [1.2], [-1])).max()
    x = np.linspace(1.05, 2, 20)  # guided
    assert np.abs(at(u, box, x, 0 * x - 1)[:, 1]).max() < 1e-14
    assert np.abs(at(stress, box, x, 0 * x - 1)[:, 0, 1]).max() < 1e-13 * size
    y = np.linspace(-1, 0, 20)  # the axis
    assert np.abs(at(u, box, 0 * y, y)[:, 0]).max() < 1e-14
    assert np.abs(at(stress, box, 0 * y, y)[:, 0, 1]).max() < 1e-13 * size
    # Towards the end: displacements as r^(1/2), stresses as r^(-1/2) but for the free part's
    # tractions, which vanish as the force stays.
    for r, power in ((1e-4, 0.5), (1e-6, 0.5)):
        ahead, behind = (at(stress, box, [1 + sign * r], [-1])[0] for sign in (1, -1))
        assert ahead[1, 1] * r**power == pytest.approx(0.2, rel=1e-3)
        assert np.abs(behind[:, 1]).max() * r**power < 1e-3
        assert np.abs(at(force, box, [1 + r], [-1 + r])).max() < 10
    top = at(exact.displacement["upper"], (0, 2, 0, 1), [0, 1, 2], [1, 1, 1])
    assert np.abs(top).max() < 1e-15


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
def test_the_study_prints_a_table(capsys):
    found = main(["layers"], contrasts=[1e2], orders=[1], max_dofs=400)
    assert set(found) == {f"layers, 100, order 1, {s}" for s in ("uniform", "adaptive")}
    for rows in found.values():
        assert all(1 <= row.estimate <= 10 and row.bound >= 1 for row in rows)
    printed = capsys.readouterr().out
    assert printed.count("| layers, 100 | 1 |") == 2
    assert math.isfinite(float(printed.splitlines()[-1].split("|")[6]))
