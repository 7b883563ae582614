"""Rays from contact points to facing curves: exact roots on lines and parabolas."""

import math

import numpy as np
import pytest

from ngcontact.contact.projection import MATCHED, cast, crossings, snap
from ngcontact.lagrange import gauss_lobatto
from tests.contact.curves import DOWN, at, circle, graph, rays, upward

RNG = np.random.default_rng(7)


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


def test_rays_that_meet_nothing():
    curve = graph(lambda x: 0 * x, [0, 1])
    points, directions = rays([[-0.1, 1.0], [1.1, 1.0], [0.5, 1.0]], DOWN)
    found = cast(points, directions, curve, upward(curve))
    assert found.segment.tolist() == [-1, -1, 0]
    assert np.isinf(found.distance[:2]).all()
    # From behind, and along the curve, no point faces.
    assert (cast(points, -directions, curve, upward(curve)).segment == -1).all()
    assert (cast(*rays(points, [1.0, 0.0]), curve, upward(curve)).segment == -1).all()


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
