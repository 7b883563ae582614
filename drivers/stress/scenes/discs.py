"""Random scenes of discs, pins and holes, about 1 in size and 1 in stiffness."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from drivers.stress.scenes.blocks import Draw, block, fixed, moduli, polygon, swapped_sides
from drivers.stress.scenes.scene import Body, Pair, Scene
from drivers.stress.scenes.sides import Point, Side, scalar, vector

QUARTERS = tuple((math.cos(a), math.sin(a)) for a in (math.pi / 2 * np.arange(4)))


def circle(names: tuple[str, ...], radius: float, hole: bool = False) -> tuple[Side, ...]:
    """Four quarter circles about the origin from angle 0 on, clockwise where they bound a hole."""
    at = [(radius * x, radius * y) for x, y in QUARTERS]
    ends = list(zip(names, at, [*at[1:], at[0]], strict=True))
    if hole:
        return tuple(Side(name, b, a, (0.0, 0.0), True) for name, a, b in ends[::-1])
    return tuple(Side(name, a, b, (0.0, 0.0)) for name, a, b in ends)


def disc(name: str, radius: float, names: tuple[str, ...], draw: Draw) -> Body:
    """A disc about the origin."""
    return Body(name, circle(names, radius), *moduli(draw))


def _stiffness(scene: Scene) -> float:
    """Effective modulus of two bodies in contact."""
    return 1 / sum((1 - b.nu**2) / b.E for b in scene.bodies)


def _force(half_width: float, scene: Scene, radius: float = 1.0) -> float:
    """Force per thickness that makes a half-width of contact on a plane (Hertz)."""
    return math.pi * half_width**2 * _stiffness(scene) / (4 * radius)


def vee(draw: Draw) -> Scene:
    """A disc under its weight in a vee, a pair for each flank or one for both."""
    half = math.radians(draw.uniform(35, 60))  # between the flank and the vertical
    sine, cosine, reach = math.sin(half), math.cos(half), 2 / math.tan(half)
    apex = (0.0, -1 / sine)
    right = (reach * sine, apex[1] + reach * cosine)
    wide, bottom = right[0] + 0.3, apex[1] - 0.6
    rim: list[Point] = [(wide, right[1]), right, apex, (-right[0], right[1]), (-wide, right[1])]
    vertices = [(-wide, bottom), (wide, bottom), *rim]
    names = ["bottom", "side", "rim", "right", "left", "rim", "side"]
    low = polygon("v", vertices, names, draw)
    d = disc("d", 1.0, ("d_top", "d_top", "d_left", "d_right"), draw)
    pairs: tuple[Pair, ...] = (
        Pair(("d_left",), ("v_left",), (-cosine, -sine)),
        Pair(("d_right",), ("v_right",), (cosine, -sine)),
    )
    choice = draw.random()
    if choice < 0.4:
        pairs = tuple(replace(pair, direction=None) for pair in pairs)
    elif choice < 0.55:
        pairs = (Pair(("d_left", "d_right"), ("v_left", "v_right")),)
    elif choice < 0.65:  # not across the flanks
        pairs = (Pair(("d_left", "d_right"), ("v_left", "v_right"), (0.0, -1.0)),)
    elif choice < 0.8:
        pairs = tuple(swapped_sides(pair, draw) for pair in pairs)
    scene = Scene("vee", (d, low), pairs, clamped=fixed("v_bottom"))
    w = _force(draw.uniform(0.1, 0.4), scene) / math.pi
    side = float(draw.uniform(-0.4, 0.4)) * math.tan(math.pi / 2 - half) * w
    return replace(scene, weight={"d": (side, -w)})


def pin(draw: Draw) -> Scene:
    """A pin in the hole of a plate, with clearance or interference."""
    plate = block("p", (-2.0, 2.0), (-2.0, 2.0), draw)
    plate = replace(plate, inner=circle(("p_hole",) * 4, 1.0, hole=True))
    clearance = float(draw.choice([-1, 1]) * 10 ** draw.uniform(-3, -1.5))
    bored = draw.random() < 0.4
    shaft = disc("d", 1 - clearance, ("d_rim",) * 4, draw)
    if bored:
        shaft = replace(shaft, inner=circle(("d_bore",) * 4, 0.4, hole=True))
    pair = swapped_sides(Pair(("d_rim",), ("p_hole",)), draw)
    scene = Scene("pin", (shaft, plate), (pair,), clamped=fixed("p_bottom"))
    push = abs(clearance) * float(draw.uniform(0.3, 2))
    if bored:
        angle = draw.uniform(0, 2 * math.pi)
        reach = push + max(clearance, 0.0)
        u = vector((reach * math.cos(angle), reach * math.sin(angle)))
        return replace(scene, clamped={**scene.clamped, "d_bore": u})
    w = push * _stiffness(scene) / math.pi
    return replace(scene, weight={"d": (float(draw.uniform(-1, 1)) * w, -w)})


def rolling(draw: Draw) -> Scene:
    """Half a disc on a block, or on a rigid plane."""
    arc = circle(("", "", "d_arc", "d_arc"), 1.0)[2:]
    d = Body("d", (Side("d_top", (1.0, 0.0), (-1.0, 0.0)), *arc), *moduli(draw))
    depth = float(draw.uniform(0.01, 0.06))
    clamped = {"d_top": vector((0.0, -depth))}
    rigid = draw.random() < 0.3
    if rigid:
        pair = Pair(("d_arc",), (), (0.0, -1.0), scalar(1.0, (0.0, 1.0)))
        return Scene("disc", (d,), (pair,), clamped=clamped)
    low = block("l", (-1.5, 1.5), (-2.2, -1.0), draw)
    direction = (0.0, -1.0) if draw.random() < 0.5 else None
    pair = swapped_sides(Pair(("d_arc",), ("l_top",), direction), draw)
    scene = Scene("disc", (d, low), (pair,), clamped={**clamped, **fixed("l_bottom")})
    if draw.random() < 0.3:
        finer, other = draw.permutation(["d", "l"]).tolist()
        scene = replace(scene, finer={finer: float(draw.uniform(0.2, 1)), other: 1.0})
    return scene
