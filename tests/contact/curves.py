"""Curves and rays that tests of their crossings share."""

import math

import numpy as np

from ngcontact.lagrange import gauss_lobatto, lagrange

UP, DOWN = np.array([0.0, 1.0]), np.array([0.0, -1.0])


def graph(f, knots, degree=1):
    """Segments of y = f(x) from left to right, x linear in s."""
    knots = np.asarray(knots, dtype=float)
    x = knots[:-1, None] + np.diff(knots)[:, None] * gauss_lobatto(degree)
    return np.stack([x, f(x)], axis=2)


def nodes_on(curve, order):
    """Parameters of the nodes of that degree on each segment."""
    return np.tile(gauss_lobatto(order), (len(curve), 1))


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
