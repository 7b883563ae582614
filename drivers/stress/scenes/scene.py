"""A contact scene as plain data, which any similarity carries along and any solver can read.

Sides of bodies, straight or arcs, and affine data are the geometry that checks rely on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from drivers.stress.motion import Motion

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


@dataclass(frozen=True)
class Body:
    """A body: its sides end to end, anticlockwise, those of a hole clockwise; its moduli."""

    name: str
    sides: tuple[Side, ...]
    E: float
    nu: float
    inner: tuple[Side, ...] = ()

    def mapped(self, side: Callable[[Side], Side], **others: Any) -> Body:
        """The body with every side mapped, and with other values."""
        sides, inner = (tuple(map(side, part)) for part in (self.sides, self.inner))
        return replace(self, sides=sides, inner=inner, **others)


@dataclass(frozen=True)
class Pair:
    """Sides of a contact pair; no primary is a rigid obstacle, with a gap."""

    secondary: tuple[str, ...]
    primary: tuple[str, ...] = ()
    direction: Point | None = None
    gap: Affine | None = None

    def swapped(self) -> Pair:
        """The pair with its roles exchanged."""
        d = None if self.direction is None else (-self.direction[0], -self.direction[1])
        return replace(self, secondary=self.primary, primary=self.secondary, direction=d)


@dataclass(frozen=True)
class Scene:
    """Bodies, supports, loads and pairs; `kind` is what was drawn.

    `finer` is the share of `maxh` for each body, whose mesh is made of it alone; by default the
    package meshes.
    """

    kind: str
    bodies: tuple[Body, ...]
    pairs: tuple[Pair, ...]
    maxh: float = 0.3  # largest element size, a length
    order: int = 1
    model: str = "plane strain"
    clamped: Mapping[str, Affine] = field(default_factory=dict)  # displacement of sides, vectors
    sliding: tuple[str, ...] = ()  # sides guided along themselves
    pressure: Mapping[str, Affine] = field(default_factory=dict)  # on sides, numbers
    weight: Mapping[str, Point] = field(default_factory=dict)  # of bodies, per area
    finer: Mapping[str, float] | None = None

    @cached_property
    def sides(self) -> dict[str, list[Side]]:
        """Sides by name."""
        found: dict[str, list[Side]] = {}
        for body in self.bodies:
            for side in (*body.sides, *body.inner):
                found.setdefault(side.name, []).append(side)
        return found

    @cached_property
    def body_of(self) -> dict[str, str]:
        """The body of each side."""
        return {s.name: body.name for body in self.bodies for s in (*body.sides, *body.inner)}

    @property
    def straight(self) -> bool:
        """Whether all sides are straight."""
        return all(side.centre is None for sides in self.sides.values() for side in sides)

    def moved(self, motion: Motion) -> Scene:
        """The scene carried along, without a shift and at the same load."""
        turn, L, E = motion.turn, motion.length, motion.modulus

        def vector(x: Point, factor: float = L) -> Point:
            a, b = factor * turn @ np.array(x)
            return float(a), float(b)

        def side(s: Side) -> Side:
            centre = None if s.centre is None else vector(s.centre)
            return replace(s, start=vector(s.start), end=vector(s.end), centre=centre)

        def number(a: Affine, factor: float) -> Affine:
            return Affine(factor * a.value, factor / L * turn @ a.slope)

        def pair(p: Pair) -> Pair:
            d = None if p.direction is None else vector(p.direction, 1.0)
            return replace(p, direction=d, gap=None if p.gap is None else number(p.gap, L))

        return replace(
            self,
            bodies=tuple(b.mapped(side, E=E * b.E) for b in self.bodies),
            pairs=tuple(map(pair, self.pairs)),
            maxh=L * self.maxh,
            clamped={
                k: Affine(L * turn @ a.value, turn @ a.slope @ turn.T)
                for k, a in self.clamped.items()
            },
            pressure={k: number(p, E) for k, p in self.pressure.items()},
            weight={k: vector(w, E / L) for k, w in self.weight.items()},
        )
