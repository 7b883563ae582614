"""Partner points: exact roots of rays on parabolas, and nodes at the same place."""

import math

import numpy as np
import pytest

from ngcontact.contact.projection import cast, coincident, feet
from ngcontact.lagrange import gauss_lobatto, lagrange

RNG = np.random.default_rng(7)
DOWN = np.array([0.0, -1.0])


def graph(f, knots, degree=1):
    """Segments of y = f(x) from left to right, x linear in s."""
    knots = np.asarray(knots, dtype=float)
    x = knots[:-1, None] + np.diff(knots)[:, None] * gauss_lobatto(degree)
    return np.stack([x, f(x)], axis=2)


def upward(curve):
    """Sides for a body below a curve that runs to the right: the outward normal points up."""
    return -np.ones(len(curve))


def rays(points, direction):
    points = np.atleast_2d(np.asarray(points, dtype=float))
    return points, np.tile(direction, (len(points), 1))


def at(curve, found):
    """Partner points."""
    degree = curve.shape[1] - 1
    return np.einsum("ki,kid->kd", lagrange(degree, found.s), curve[found.segment])


def circle(radius=1.0, count=12, degree=2, centre=(0.0, 0.0)):
    """A closed curve, counterclockwise; its points are on the circle at equal angles."""
    turns = np.linspace(0, 2 * math.pi, count + 1)
    theta = turns[:-1, None] + np.diff(turns)[:, None] * gauss_lobatto(degree)
    return np.asarray(centre) + radius * np.stack([np.cos(theta), np.sin(theta)], axis=2)


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


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_coincident_nodes(order):
    curve = graph(lambda x: 0.3 * x, [0, 0.4, 1])
    normal = np.array([-0.3, 1.0]) / math.hypot(0.3, 1)
    nodes = np.einsum("ji,qid->qjd", lagrange(1, gauss_lobatto(order)), curve).reshape(-1, 2)
    lift = np.zeros(len(nodes))
    lift[::2] = 1e-11
    points = nodes + lift[:, None] * normal
    normals, reach = np.tile(normal, (len(nodes), 1)), np.full(len(nodes), 4e-10)
    found = coincident(points, -normals, nodes, normals, reach)
    np.testing.assert_array_equal(nodes[found], nodes)
    beyond = coincident(points + 1e-9, -normals, nodes, normals, reach)
    assert (beyond == -1).all()
    assert (coincident(points, normals, nodes, normals, reach) == -1).all()  # from behind


@pytest.mark.parametrize("radius", [0.1, 0.5, 0.9, 1.1, 2.0, 3.0])
def test_feet_of_far_points_lie_on_their_radii(radius):
    """On a circle of radius 1; Gauss's and Newton's method diverges from a distance of that on."""
    angle = np.linspace(0.01, 6.0, 13)
    ray = np.column_stack([np.cos(angle), np.sin(angle)])
    curve = circle(count=24, degree=4)
    segment, s = feet(radius * ray, curve, None)
    assert len(segment) == len(angle)
    places = np.einsum("ki,kid->kd", lagrange(4, s), curve[segment])
    turns = np.sort(np.arctan2(places[:, 1], places[:, 0]) % (2 * math.pi)) - angle
    # Normals of these curves of degree 4 turn by 2.3e-7 from those of the circle: measured.
    assert np.abs(turns).max() < 3e-7 * abs(radius - 1) / radius
