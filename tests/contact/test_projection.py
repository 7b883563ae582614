"""Rays from contact points to facing curves: exact roots on lines and parabolas."""

from __future__ import annotations

import math

import numpy as np
import pytest

from ngcontact.contact.projection import MATCHED, cast, crossings, snap
from ngcontact.contact.search import coincident
from ngcontact.lagrange import gauss_lobatto
from tests.contact.curves import DOWN, at, circle, graph, nodes_on, rays, upward

RNG = np.random.default_rng(7)


# ------------------------------------------------------------------------------------- lines


def test_vertical_rays_on_a_line():
    curve = graph(lambda x: 0.5 * x, [-1, 0, 1, 3])
    x = np.array([-0.75, 0.25, 0.5, 2.5])
    points, directions = rays(np.column_stack([x, 4 + 0 * x]), DOWN)
    found = cast(points, directions, curve, upward(curve))
    assert found.segment.tolist() == [0, 1, 1, 2]
    np.testing.assert_allclose(found.s, [0.25, 0.25, 0.5, 0.75], atol=1e-15)
    np.testing.assert_allclose(found.distance, 4 - 0.5 * x, rtol=1e-15)


def test_oblique_rays_on_a_line():
    curve = graph(lambda x: 0.5 * x, [-1, 0.2, 3])
    for angle in (-100, -80, -60, -120):
        d = np.array([math.cos(math.radians(angle)), math.sin(math.radians(angle))])
        target = np.column_stack([RNG.uniform(-0.9, 2.9, 20), np.zeros(20)])
        target[:, 1] = 0.5 * target[:, 0]
        length = RNG.uniform(-0.5, 2, 20)  # overlap included
        found = cast(*rays(target - length[:, None] * d, d), curve, upward(curve))
        np.testing.assert_allclose(at(curve, found), target, atol=1e-14)
        np.testing.assert_allclose(found.distance, length, atol=1e-14)


def test_overlap_is_a_negative_distance():
    curve = graph(lambda x: 0 * x, [0, 1])
    found = cast(*rays([[0.5, -0.25], [0.25, 0.125]], DOWN), curve, upward(curve))
    assert found.distance == pytest.approx([-0.25, 0.125], rel=1e-15)


def test_rays_that_meet_nothing():
    curve = graph(lambda x: 0 * x, [0, 1])
    points, directions = rays([[-0.1, 1.0], [1.1, 1.0], [0.5, 1.0]], DOWN)
    found = cast(points, directions, curve, upward(curve))
    assert found.segment.tolist() == [-1, -1, 0]
    assert np.isinf(found.distance[:2]).all()
    # From behind, and along the curve, no point faces.
    assert (cast(points, -directions, curve, upward(curve)).segment == -1).all()
    assert (cast(*rays(points, [1.0, 0.0]), curve, upward(curve)).segment == -1).all()


def test_nothing_given():
    curve = graph(lambda x: 0 * x, [0, 1])
    none = np.zeros((0, 2))
    for search in (
        lambda x, d, c, n: cast(x, d, c, n),
        lambda x, d, c, n: coincident(x, d, c, n, nodes_on(c, 1)),
    ):
        assert search(none, none, curve, upward(curve)).segment.shape == (0,)
        found = search(*rays([0.0, 0.0], DOWN), curve[:0], np.zeros(0))
        assert found.segment.tolist() == [-1]


# --------------------------------------------------------------------------------- parabolas


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_vertical_rays_on_a_parabola(degree):
    """The curve is exact at degree 2 and above: partner at the same x, distance by subtraction."""
    curve = graph(lambda x: x**2 / 2, [-1, -0.3, 0.4, 1], degree)
    x = RNG.uniform(-1, 1, 200)
    y = RNG.uniform(-1, 2, 200)
    found = cast(*rays(np.column_stack([x, y]), DOWN), curve, upward(curve))
    np.testing.assert_allclose(at(curve, found), np.column_stack([x, x**2 / 2]), atol=2e-15)
    np.testing.assert_allclose(found.distance, y - x**2 / 2, atol=4e-15)


def test_oblique_rays_on_a_parabola_solve_the_quadratic():
    curve = graph(lambda x: x**2, np.linspace(-1, 1, 5), 2)
    d = np.array([0.6, -0.8])
    points = np.column_stack([RNG.uniform(-1, 0, 50), np.full(50, 0.9)])
    found = cast(*rays(points, d), curve, upward(curve))
    # y0 - 0.8 t = (x0 + 0.6 t)^2, both roots face where the normal (-2x, 1) opposes d.
    x0, y0 = points.T
    a, b, c = 0.36, 1.2 * x0 + 0.8, x0**2 - y0
    root = np.sqrt(b**2 - 4 * a * c)
    expected = (-b + root) / (2 * a)
    np.testing.assert_allclose(found.distance, expected, atol=1e-14)
    np.testing.assert_allclose(at(curve, found), points + expected[:, None] * d, atol=1e-14)


@pytest.mark.parametrize("slope", [0.0, 1.0])
def test_newton_s_method_stops_where_it_has_arrived(slope):
    """Through (x, 1) along (slope, -1) onto y = x^2: slope^2 r^2 + (2 x slope + 1) r + x^2 = 1."""
    curve = graph(lambda x: x**2, [0, 1], 2)
    x, calls = np.linspace(0.0, 0.4, 9), []

    class Counting(np.ndarray):
        def __getitem__(self, at):
            calls.append(at)
            return super().__getitem__(at)

    points = np.column_stack([x, np.ones_like(x)])
    across = np.tile([1.0, slope], (len(x), 1))
    segment, start = np.zeros(len(x), dtype=int), np.full(len(x), 0.5)
    s = crossings(points, across, curve.view(Counting), segment, start, 1e-8)
    # x + slope (1 - y) = s, y = s^2.
    root = (-1 + np.sqrt(1 + 4 * slope * (x + slope))) / (2 * slope) if slope else x
    assert np.asarray(s) == pytest.approx(root, rel=4e-16, abs=4e-16)
    # Two looks at the curve a step; the last step is about the square root of the last bit.
    assert len(calls) <= (2 if not slope else 5) * 2


@pytest.mark.parametrize("count", [1, 2, 5])
@pytest.mark.parametrize("degree", [2, 3, 4])
def test_rays_that_cross_a_segment_twice(count, degree):
    """Both crossings may lie in one segment, whose ends are then on one side of the ray."""
    curve = graph(lambda x: x**2, np.linspace(-1, 1, count + 1), degree)
    angle = RNG.uniform(-math.pi, 0, 400)
    d = np.column_stack([np.cos(angle), np.sin(angle)])
    points = np.column_stack([RNG.uniform(-2, 2, 400), RNG.uniform(-1, 2, 400)])
    found = cast(points, d, curve, upward(curve))
    # y0 + t dy = (x0 + t dx)^2; the normal (-2x, 1) opposes d.
    (x0, y0), (dx, dy) = points.T, d.T
    a, b, c = dx**2, 2 * x0 * dx - dy, x0**2 - y0
    root = np.sqrt(np.maximum(b**2 - 4 * a * c, 0))
    t = np.stack([-b - root, -b + root]) / (2 * a)
    x = x0 + t * dx
    meets = (b**2 > 4 * a * c) & (np.abs(x) < 1) & (-2 * x * dx + dy < 0)
    t = np.where(meets, t, np.inf)
    expected = t[np.abs(t).argmin(axis=0), np.arange(400)]
    assert (np.isfinite(expected) == (found.segment >= 0)).all()
    met = np.isfinite(expected)
    assert met.sum() > 100
    np.testing.assert_allclose(found.distance[met], expected[met], atol=1e-11)


def test_three_crossings_of_a_wave():
    """Y = x (x^2 - 1) as one segment, looked at along x: three crossings, two of them facing."""
    curve = graph(lambda x: x * (x**2 - 1), [-1.5, 1.5], 3)
    points, directions = rays([[-2.0, 0.1], [0.2, 0.1], [2.0, 0.1]], [1.0, 0.0])
    found = cast(points, directions, curve, upward(curve))  # faces where the curve rises
    roots = np.sort(np.roots([1, 0, -1, -0.1]).real)[[0, 2]]
    nearest = roots[np.abs(roots - points[:, :1]).argmin(axis=1)]
    np.testing.assert_allclose(points[:, 0] + found.distance, nearest, atol=1e-14)


def test_parametrisation_need_not_be_linear():
    """A quadratic segment whose middle node is off the middle: eta(s) = 0.4 s + 0.6 s^2."""
    s = gauss_lobatto(2)
    eta = 0.4 * s + 0.6 * s**2
    curve = np.stack([eta, 0.1 * s], axis=1)[None]
    wanted = RNG.random(40)
    x = 0.4 * wanted + 0.6 * wanted**2
    found = cast(*rays(np.column_stack([x, np.ones(40)]), DOWN), curve, upward(curve))
    np.testing.assert_allclose(found.s, wanted, atol=1e-14)
    np.testing.assert_allclose(found.distance, 1 - 0.1 * wanted, atol=1e-14)


# ---------------------------------------------------------------------------- closed curves


def test_far_side_of_a_closed_curve_is_not_taken():
    """Inside a disc that overlaps: up and down are equally good rays, the facing side counts."""
    curve = circle()
    side = np.ones(len(curve))  # counterclockwise: outward is to the right
    points, directions = rays([[0.1, -0.9], [0.1, 0.2], [0.1, 1.7]], DOWN)
    found = cast(points, directions, curve, side)
    partner = at(curve, found)
    assert (partner[:, 1] > 0.9).all()
    np.testing.assert_allclose(partner[:, 0], 0.1, atol=1e-14)
    np.testing.assert_allclose(found.distance, points[:, 1] - partner[:, 1], atol=1e-14)
    # A hole faces with its far side.
    hole = cast(points, directions, curve, -side)
    assert (at(curve, hole)[:, 1] < -0.9).all()
    assert (hole.distance[:2] > 0).all()


def test_nearest_of_several_facing_curves():
    upper = graph(lambda x: 0 * x, [0, 1])
    lower = graph(lambda x: 0 * x - 1, [0, 1])
    curve = np.concatenate([lower, upper])
    points, directions = rays([[0.5, 0.2], [0.5, -0.2], [0.5, -0.8], [0.5, -1.1]], DOWN)
    found = cast(points, directions, curve, upward(curve))
    assert found.segment.tolist() == [1, 1, 0, 0]
    np.testing.assert_allclose(found.distance, [0.2, -0.2, 0.2, -0.1], atol=1e-15)


# ---------------------------------------------------------------------------------- vertices


@pytest.mark.parametrize("degree", [1, 2, 3])
def test_rays_through_vertices_find_the_vertex(degree):
    knots = np.array([-1, -0.3, 0.1, 0.7, 1])
    curve = graph(lambda x: x**2 / 2, knots, degree)
    for shift in (0.0, 1e-11, -1e-11):  # within MATCHED of the segments' lengths
        points, directions = rays(np.column_stack([knots + shift, np.ones(5)]), DOWN)
        found = cast(points, directions, curve, upward(curve))
        assert (found.segment >= 0).all()
        assert np.isin(found.s, (0.0, 1.0)).all()
        np.testing.assert_allclose(at(curve, found)[:, 0], knots, atol=1e-15)
        np.testing.assert_allclose(found.distance, 1 - knots**2 / 2, atol=1e-15)
    beyond = cast(*rays([[1 + 1e-6, 1.0]], DOWN), curve, upward(curve))
    assert beyond.segment.tolist() == [-1]


def test_vertex_at_the_end_of_the_facing_side():
    """Only one of the two segments at the vertex faces the ray: that one is taken."""
    corner = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [1.0, -1.0]]])
    found = cast(*rays([[1.0, 0.5]], DOWN), corner, -np.ones(2))
    assert (found.segment.tolist(), found.s.tolist()) == ([0], [1.0])
    found = cast(*rays([[1.5, 0.0]], [-1.0, 0.0]), corner, -np.ones(2))
    assert (found.segment.tolist(), found.s.tolist()) == ([1], [0.0])


def test_blocks_of_points_give_the_same():
    curve = graph(lambda x: x**2 / 2, np.linspace(-1, 1, 9), 2)
    points, directions = rays(RNG.uniform(-1, 1, (57, 2)), DOWN)
    whole = cast(points, directions, curve, upward(curve))
    parts = cast(points, directions, curve, upward(curve), pairs_at_once=40)
    assert (whole.segment == parts.segment).all()
    # Products of other sizes take other kernels: round-off of a few products.
    np.testing.assert_allclose(parts.s, whole.s, rtol=0, atol=1e-14)
    np.testing.assert_allclose(parts.distance, whole.distance, rtol=0, atol=1e-14)


def test_scale_does_not_matter():
    curve = graph(lambda x: x**2 / 2, [-1, 0.25, 1], 2)
    points, directions = rays(RNG.uniform(-1, 1, (20, 2)), DOWN)
    one = cast(points, directions, curve, upward(curve))
    for scale in (2.0**-40, 2.0**40):  # powers of two: every product is exact
        other = cast(scale * points, directions, scale * curve, upward(curve))
        assert (other.segment == one.segment).all()
        assert (other.distance == scale * one.distance).all()


# -------------------------------------------------------------------------------------- snap


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_snap(order):
    nodes = gauss_lobatto(order)

    def on(s):
        return np.tile(nodes, (len(s), 1))

    assert (snap(nodes, on(nodes)) == nodes).all()
    assert (snap(nodes + 0.9 * MATCHED, on(nodes + 0.9 * MATCHED)) == nodes).all()
    away = nodes + 1.1 * MATCHED
    assert (snap(away, on(away)) == away).all()
    assert snap(np.zeros(0), on(np.zeros(0))).shape == (0,)
