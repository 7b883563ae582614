"""A contact scene as plain data, which any similarity carries along and any solver can read."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from drivers.stress.motion import Motion
from drivers.stress.scenes.sides import Affine, Point, Side


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

    def renamed(self, new: Mapping[str, str]) -> Scene:
        """The scene with other names of bodies and sides."""

        def keys(data: Mapping[str, Any]) -> dict[str, Any]:
            return {new[k]: v for k, v in sorted(data.items(), key=lambda item: new[item[0]])}

        def names(old: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(new[name] for name in old)

        data: dict[str, Any] = {
            k: keys(getattr(self, k)) for k in ("clamped", "pressure", "weight")
        }
        return replace(
            self,
            bodies=tuple(
                b.mapped(lambda s: replace(s, name=new[s.name]), name=new[b.name])
                for b in self.bodies
            ),
            pairs=tuple(
                replace(p, secondary=names(p.secondary), primary=names(p.primary))
                for p in self.pairs
            ),
            sliding=names(self.sliding),
            finer=None if self.finer is None else keys(self.finer),
            **data,
        )
