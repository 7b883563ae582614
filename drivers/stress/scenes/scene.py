"""A contact scene as plain data, which any similarity carries along and any solver can read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

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


@dataclass(frozen=True)
class Pair:
    """Sides of a contact pair; no primary is a rigid obstacle, with a gap."""

    secondary: tuple[str, ...]
    primary: tuple[str, ...] = ()
    direction: Point | None = None
    gap: Affine | None = None


@dataclass(frozen=True)
class Scene:
    """Bodies, supports, loads and pairs.

    Attributes
    ----------
    kind : str
        What was drawn.
    bodies : tuple of Body
    pairs : tuple of Pair
    maxh : float
        Largest element size, a length.
    order : int
    model : str
    clamped : mapping
        Displacement of sides, affine vectors.
    sliding : tuple of str
        Sides guided along themselves.
    pressure : mapping
        Affine numbers on sides.
    traction, weight : mapping
        Constant vectors on sides, and per area of bodies.
    finer : mapping, optional
        Share of `maxh` for each body: the mesh is made of each body alone. None: by the package.
    """

    kind: str
    bodies: tuple[Body, ...]
    pairs: tuple[Pair, ...]
    maxh: float = 0.3
    order: int = 1
    model: str = "plane strain"
    clamped: Mapping[str, Affine] = field(default_factory=dict)
    sliding: tuple[str, ...] = ()
    pressure: Mapping[str, Affine] = field(default_factory=dict)
    traction: Mapping[str, Point] = field(default_factory=dict)
    weight: Mapping[str, Point] = field(default_factory=dict)
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
        """The scene carried along; without a shift, `load` scales displacements and loads."""
        turn, L, E = motion.turn, motion.length, motion.modulus

        def point(x: Point) -> Point:
            a, b = L * turn @ np.array(x)
            return float(a), float(b)

        def direction(x: Point, factor: float = 1.0) -> Point:
            a, b = factor * turn @ np.array(x)
            return float(a), float(b)

        def side(s: Side) -> Side:
            centre = None if s.centre is None else point(s.centre)
            return replace(s, start=point(s.start), end=point(s.end), centre=centre)

        def body(b: Body) -> Body:
            sides, inner = (tuple(side(s) for s in part) for part in (b.sides, b.inner))
            return replace(b, sides=sides, inner=inner, E=E * b.E)

        def number(a: Affine, factor: float) -> Affine:
            return Affine(factor * a.value, factor / L * turn @ a.slope)

        def pair(p: Pair) -> Pair:
            d = None if p.direction is None else direction(p.direction)
            return replace(p, direction=d, gap=None if p.gap is None else number(p.gap, L))

        return replace(
            self,
            bodies=tuple(body(b) for b in self.bodies),
            pairs=tuple(pair(p) for p in self.pairs),
            maxh=L * self.maxh,
            clamped={
                k: Affine(L * turn @ a.value, turn @ a.slope @ turn.T)
                for k, a in self.clamped.items()
            },
            pressure={k: number(p, E) for k, p in self.pressure.items()},
            traction={k: direction(t, E) for k, t in self.traction.items()},
            weight={k: direction(w, E / L) for k, w in self.weight.items()},
        )

    def renamed(self, new: Mapping[str, str]) -> Scene:
        """The scene with other names of bodies and sides."""

        def keys(data: Mapping[str, object]) -> dict[str, object]:
            return {new[k]: v for k, v in sorted(data.items(), key=lambda item: new[item[0]])}

        def names(old: tuple[str, ...]) -> tuple[str, ...]:
            return tuple(new[name] for name in old)

        def body(b: Body) -> Body:
            sides, inner = (
                tuple(replace(s, name=new[s.name]) for s in part) for part in (b.sides, b.inner)
            )
            return replace(b, name=new[b.name], sides=sides, inner=inner)

        data = {k: keys(getattr(self, k)) for k in ("clamped", "pressure", "traction", "weight")}
        return replace(
            self,
            bodies=tuple(body(b) for b in self.bodies),
            pairs=tuple(
                replace(p, secondary=names(p.secondary), primary=names(p.primary))
                for p in self.pairs
            ),
            sliding=names(self.sliding),
            finer=None if self.finer is None else keys(self.finer),  # type: ignore[arg-type]
            **data,  # type: ignore[arg-type]
        )
