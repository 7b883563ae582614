"""Edges that follow the graph of a function: segment, Bezier curve or quintic spline.

In all three x is linear in the parameter of the edge, so that a point of given x is found at once.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from netgen.occ import BezierCurve, BSplineCurve, Edge, Pnt
from numpy.typing import NDArray
from scipy.interpolate import make_interp_spline
from scipy.special import comb

from ngcontact.geometries.check import finite
from ngcontact.geometries.region import Point, segment

Graph = Callable[[float], float]

DEGREE = 5  # of the spline: error about (spacing of the samples)^6
HIGHEST_POLYNOMIAL = 8  # power-law punches x^2 ... x^8 stay exact
ROUND_OFF = 64 * np.finfo(float).eps  # part of the largest coordinate
RESOLVED = 1e-4  # largest deviation between samples, part of the departure from a straight line


@dataclass(frozen=True, eq=False)
class GraphCurve:
    """Control points of an edge along a graph.

    Attributes
    ----------
    poles : (n, 2) array
        From left to right: of a Bezier curve of degree n - 1 if `degree` is n - 1, else of a
        spline with uniform simple knots.
    degree : int
        Polynomial degree in x.
    lowest, highest : float
        Extreme values of the function at the places where it was evaluated.
    """

    poles: NDArray[np.float64]
    degree: int
    lowest: float
    highest: float

    @property
    def left(self) -> Point:
        """End point on the left."""
        point = self.edge().start
        return point.x, point.y

    @property
    def right(self) -> Point:
        """End point on the right."""
        point = self.edge().end
        return point.x, point.y

    def edge(self, *, leftward: bool = False) -> Edge:
        """Edge along the curve, rightward unless `leftward`."""
        poles = self.poles[::-1] if leftward else self.poles
        if len(poles) == 2:
            return segment(tuple(poles[0]), tuple(poles[1]))
        points = [Pnt(x, y, 0) for x, y in poles]
        if len(poles) == self.degree + 1:
            return BezierCurve(points)
        return BSplineCurve(points, self.degree)


def follow(name: str, f: Graph, a: float, b: float, samples: int) -> GraphCurve:
    """Curve along y = f(x), a <= x <= b, through `samples` points of the graph.

    A polynomial of degree 8 or less is reproduced to round-off by the curve of its degree.

    Raises
    ------
    TypeError
        If `f` does not map a number to a number.
    ValueError
        If a value is not finite, or the curve between two samples misses the graph by more than
        1e-4 of the departure of the graph from a straight line.
    """
    intervals = samples - DEGREE
    knots = np.arange(-DEGREE, samples + 1, dtype=float)
    # Knot averages of the clamped spline as sites: one per pole, always solvable, ends included.
    sites = _knot_averages(np.clip(knots, 0, intervals))
    t = sites / intervals
    x = np.concatenate([[a], a + (b - a) * t[1:-1], [b]])
    y = _values(name, f, x)
    round_off = ROUND_OFF * max(abs(a), abs(b), float(np.abs(y).max()))
    heights = _polynomial(t, y, round_off)
    if heights is not None:
        degree = len(heights) - 1
        places = np.linspace(0, 1, degree + 1)
    else:
        degree = DEGREE
        places = _knot_averages(knots) / intervals
        heights = make_interp_spline(sites, y, DEGREE, t=knots).c
    between = (x[1:] + x[:-1]) / 2
    expected = _values(name, f, between)
    seen = np.concatenate([y, expected])
    poles = np.column_stack([a + (b - a) * places, heights])
    curve = GraphCurve(poles, degree, float(seen.min()), float(seen.max()))
    straight = np.polynomial.Polynomial.fit(x, y, 1)
    allowed = RESOLVED * float(np.abs(y - straight(x)).max()) + round_off
    _check_resolved(name, curve.edge(), (between - a) / (b - a), expected, allowed)
    return curve


def _values(name: str, f: Graph, x: NDArray[np.float64]) -> NDArray[np.float64]:
    """Values of `f`, called with one number at a time: it need not take arrays."""
    y = []
    for at in map(float, x):
        try:
            value = f(at)
        except TypeError as error:
            raise TypeError(
                f"{name} = {f!r}: expected a function of one number x ({error})"
            ) from error
        try:
            number = float(value)
        except (TypeError, ValueError) as error:
            raise TypeError(f"{name}({at!r}) = {value!r}: expected a real number") from error
        y.append(finite(f"{name}({at!r})", number))
    return np.array(y)


def _polynomial(
    t: NDArray[np.float64], y: NDArray[np.float64], tolerance: float
) -> NDArray[np.float64] | None:
    """Bernstein coefficients over [0, 1] of the lowest polynomial through all (t, y), if any."""
    for degree in range(1, HIGHEST_POLYNOMIAL + 1):
        k = np.arange(degree + 1)
        basis = comb(degree, k) * t[:, None] ** k * (1 - t[:, None]) ** (degree - k)
        heights = np.linalg.lstsq(basis, y, rcond=None)[0]
        if np.abs(basis @ heights - y).max() <= tolerance:
            heights[[0, -1]] = y[[0, -1]]
            return heights
    return None


def _check_resolved(
    name: str, edge: Edge, t: NDArray[np.float64], expected: NDArray[np.float64], allowed: float
) -> None:
    """Refuse an edge that misses the graph between its samples; t in [0, 1] along the edge."""
    start, end = edge.parameter_interval
    points = [edge.Value(parameter) for parameter in start + (end - start) * t]
    deviation = np.abs([point.y for point in points] - expected)
    worst = int(deviation.argmax())
    if deviation[worst] > allowed:
        raise ValueError(
            f"{name}: the edge misses the graph by {deviation[worst]:.1e} at x = "
            f"{points[worst].x:.6g}, expected at most {allowed:.1e}: raise samples if the graph "
            "is smooth; use blocks(line=...) if it has corners"
        )


def _knot_averages(knots: NDArray[np.float64]) -> NDArray[np.float64]:
    """Averages of DEGREE consecutive inner knots, one per pole: poles there make x linear."""
    return np.lib.stride_tricks.sliding_window_view(knots[1:-1], DEGREE).mean(axis=1)
