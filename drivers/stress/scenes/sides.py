"""Sides of bodies, straight or arcs, and affine data: the geometry that checks rely on."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Point = tuple[float, float]

PARALLEL = 1e-9  # sine of the angle up to which a ray runs along a straight side


@dataclass(frozen=True)
class Affine:
    """Scalar or vector x -> value + slope x: `value` () or (2,), `slope` (2,) or (2, 2)."""

    value: Array
    slope: Array

    def __call__(self, x: Array) -> Array:
        """Values (k,) or (k, 2) at points `x` (k, 2)."""
        return self.value + x @ self.slope.T


def scalar(value: float, slope: Sequence[float] = (0.0, 0.0)) -> Affine:
    """An affine number."""
    return Affine(np.array(value), np.array(slope))


def vector(value: Sequence[float], tilt: float = 0.0) -> Affine:
    """A displacement: a constant and a small rotation about the origin."""
    return Affine(np.array(value), tilt * np.array([[0.0, -1.0], [1.0, 0.0]]))


@dataclass(frozen=True)
class Side:
    """Straight side or arc of a circle from `start` to `end`, the body to its left.

    An arc turns about `centre`, anticlockwise where it bounds a disc, clockwise a hole.
    """

    name: str
    start: Point
    end: Point
    centre: Point | None = None
    hole: bool = False

    @cached_property
    def _polar(self) -> tuple[Array, float, float, float]:
        """Centre, radius, first angle, and turn, with its sign."""
        c = np.array(self.centre)
        a, b = np.array(self.start) - c, np.array(self.end) - c
        first, last = math.atan2(a[1], a[0]), math.atan2(b[1], b[0])
        turn = (first - last if self.hole else last - first) % (2 * math.pi)
        return c, float(np.hypot(*a)), first, -turn if self.hole else turn

    @cached_property
    def length(self) -> float:
        """Its length."""
        if self.centre is None:
            return math.dist(self.start, self.end)
        _, radius, _, turn = self._polar
        return radius * abs(turn)

    def point(self, s: Array) -> Array:
        """Points (k, 2) at arc lengths `s` (k,)."""
        if self.centre is None:
            along = np.subtract(self.end, self.start) / self.length
            return np.array(self.start) + s[:, None] * along
        c, radius, first, turn = self._polar
        angle = first + s / self.length * turn
        return c + radius * np.column_stack([np.cos(angle), np.sin(angle)])

    def normal(self, s: Array) -> Array:
        """Outward unit normals (k, 2) at arc lengths `s` (k,)."""
        if self.centre is None:
            x, y = np.subtract(self.end, self.start) / self.length
            return np.tile([y, -x], (len(s), 1))
        c, radius, *_ = self._polar
        outward = (self.point(s) - c) / radius
        return -outward if self.hole else outward

    def arc_length(self, x: Array) -> tuple[Array, Array]:
        """Arc lengths (k,) of the points nearest to `x` (k, 2), and distances (k,)."""
        if self.centre is None:
            along = np.subtract(self.end, self.start) / self.length
            s = (x - self.start) @ along
        else:
            c, _, first, turn = self._polar
            angle = np.arctan2(x[:, 1] - c[1], x[:, 0] - c[0])
            ahead = (angle - first) * math.copysign(1.0, turn)
            middle = abs(turn) / 2
            s = (ahead - middle + math.pi) % (2 * math.pi) - math.pi + middle
            s = s / abs(turn) * self.length
        s = np.clip(s, 0.0, self.length)
        return s, np.linalg.norm(self.point(s) - x, axis=1)

    def met(self, x: Array, d: Array) -> tuple[Array, Array]:
        """Where lines through `x` (k, 2) along unit vectors `d` (k, 2) enter the body here.

        Returns signed distances (k,), NaN where they do not, and arc lengths (k,).
        """
        if self.centre is None:
            along = np.subtract(self.end, self.start) / self.length
            sine = d[:, 0] * along[1] - d[:, 1] * along[0]
            offset = np.array(self.start) - x
            with np.errstate(divide="ignore", invalid="ignore"):
                t = (offset[:, 0] * along[1] - offset[:, 1] * along[0]) / sine
            t[np.abs(sine) < PARALLEL] = np.nan
        else:
            c, radius, *_ = self._polar
            b = ((x - c) * d).sum(axis=1)
            with np.errstate(invalid="ignore"):
                root = np.sqrt(b**2 - ((x - c) ** 2).sum(axis=1) + radius**2)
            t = -b + root if self.hole else -b - root  # where it enters the body
        s, distance = self.arc_length(x + t[:, None] * d)
        faces = (self.normal(s) * d).sum(axis=1) < -PARALLEL
        with np.errstate(invalid="ignore"):
            t[~faces | ~(distance <= PARALLEL * self.length)] = np.nan
        return t, s
