"""A random scene for every seed: bodies with straight sides, discs, pins and holes.

They are about 1 in size and 1 in stiffness before they are moved.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from drivers.stress.motion import Motion
from drivers.stress.scenes.posing import geometry
from drivers.stress.scenes.scene import (
    Affine,
    Array,
    Body,
    Pair,
    Point,
    Scene,
    Side,
    scalar,
    vector,
)

Draw = np.random.Generator

LOAD = 0.01  # displacements and loads over size and stiffness


def polygon(name: str, vertices: Sequence[Point], sides: Sequence[str], draw: Draw) -> Body:
    """A body with random moduli; ``sides[i]`` leaves vertex i, each name begins with the body's."""
    ends = [*vertices[1:], vertices[0]]
    found = tuple(
        Side(f"{name}_{side}", a, b) for side, a, b in zip(sides, vertices, ends, strict=True)
    )
    return Body(name, found, *moduli(draw))


def moduli(draw: Draw) -> tuple[float, float]:
    """Young's modulus and Poisson's ratio."""
    return float(10 ** draw.uniform(-1, 1.5)), float(draw.uniform(0, 0.4))


def block(name: str, x: Point, y: Point, draw: Draw) -> Body:
    """A rectangle: left and right end `x`, lower and upper end `y`."""
    (a, b), (c, d) = x, y
    return polygon(name, ((a, c), (b, c), (b, d), (a, d)), ("bottom", "right", "top", "left"), draw)


def fixed(name: str) -> dict[str, Affine]:
    """A clamped side."""
    return {name: vector((0.0, 0.0))}


def pressed(scene: Scene, body: Body, middle: float, half: float, draw: Draw) -> Scene:
    """The scene with the top of a body moved down and tilted, or under a pressure.

    Of a line from `middle` - `half` to `middle` + `half` in x.
    """
    top, softest = f"{body.name}_top", min(b.E for b in scene.bodies)
    if draw.random() < 0.5:
        tilt = LOAD * draw.uniform(-2, 2) / half
        down = -LOAD * draw.uniform(0.5, 1)
        u = vector((LOAD * draw.uniform(-0.3, 0.3), down - tilt * middle), tilt)
        return replace(scene, clamped={**scene.clamped, top: u})
    mean = LOAD * softest * draw.uniform(0.5, 1)
    slope = mean * draw.uniform(-2.5, 2.5) / half  # opens beyond 1, tips over beyond 3
    p = scalar(mean - slope * middle, (slope, 0.0))
    return replace(scene, pressure={**scene.pressure, top: p})


def swapped_sides(pair: Pair, draw: Draw) -> Pair:
    """The pair, or with its roles exchanged."""
    return pair if draw.random() < 0.5 else pair.swapped()


def line(draw: Draw) -> Scene:
    """Two blocks on a common line."""
    u = block("u", (-1, 1), (0, float(draw.uniform(0.6, 1.2))), draw)
    wide = float(draw.choice([1.0, draw.uniform(1.1, 1.6)]))
    low = block("l", (-wide, wide), (-float(draw.uniform(0.6, 1.2)), 0), draw)
    pair = swapped_sides(Pair(("u_bottom",), ("l_top",)), draw)
    if draw.random() < 0.3:
        y = -1.0 if pair.secondary[0] == "u_bottom" else 1.0
        pair = replace(pair, direction=(0.0, y))
    scene = Scene("line", (u, low), (pair,), clamped=fixed("l_bottom"))
    return pressed(scene, u, 0.0, 1.0, draw)


def unmatched(draw: Draw) -> Scene:
    """The same, one side finer, at any ratio up to 8."""
    share = float(draw.uniform(1 / 8, 1.0))
    finer, other = draw.permutation(["u", "l"]).tolist()
    return replace(line(draw), kind="unmatched", finer={finer: share, other: 1.0})


def corner(draw: Draw) -> Scene:
    """A block in a step, or on it with its side free: bottom and side are the secondary."""
    w, h = draw.uniform(0.8, 1.3, 2)
    u = block("u", (0, float(w)), (0, float(h)), draw)
    wide, high = float(w * draw.uniform(1, 1.5)), float(h * draw.uniform(0.5, 1.4))
    vertices = ((-0.6, -0.7), (wide, -0.7), (wide, 0.0), (0.0, 0.0), (0.0, high), (-0.6, high))
    low = polygon("l", vertices, ("bottom", "right", "top", "wall", "head", "left"), draw)
    wall = draw.random() < 0.6
    pair = Pair(("u_bottom", "u_left"), ("l_top", "l_wall") if wall else ("l_top",))
    if not wall:  # the step ends below the block's side
        low = block("l", (-0.6, wide), (-0.7, 0), draw)
        if draw.random() < 0.5:
            low = block("l", (0, wide), (-0.7, 0), draw)
    scene = Scene("corner", (u, low), (pair,), clamped=fixed("l_bottom"))
    scene = pressed(scene, u, w / 2, w / 2, draw)
    if wall:
        p = LOAD * min(u.E, low.E) * float(draw.uniform(0, 1))
        scene = replace(scene, pressure={**scene.pressure, "u_right": scalar(p)})
    if wall and draw.random() < 0.4:
        scene = replace(scene, pairs=(pair.swapped(),))
    return scene


def stack(draw: Draw) -> Scene:
    """Three blocks; contact alone holds those that are not clamped."""
    half = draw.uniform(0.6, 1.2, 3)
    low = block("a", (-float(half[0]), float(half[0])), (-0.8, 0), draw)
    shift = float(draw.uniform(-0.2, 0.2))
    mid = block("b", (shift - float(half[1]), shift + float(half[1])), (0, 0.6), draw)
    top = block("c", (-float(half[2]), float(half[2])), (0.6, 1.2), draw)
    pairs = (
        swapped_sides(Pair(("b_bottom",), ("a_top",)), draw),
        swapped_sides(Pair(("c_bottom",), ("b_top",)), draw),
    )
    scene = Scene("stack", (low, mid, top), pairs, clamped=fixed("a_bottom"))
    if draw.random() < 0.5:
        scene = replace(scene, weight={"b": (0.0, -0.2 * LOAD * mid.E)})
    return pressed(scene, top, 0.0, float(half[2]), draw)


def polygonal(draw: Draw) -> Scene:
    """Two blocks on a line with corners both ways."""
    inner = np.sort(draw.uniform(-0.8, 0.8, draw.integers(1, 4)))
    x = [-1.0, *inner[np.diff(inner, prepend=-1.0) > 0.2].tolist(), 1.0]
    vertices = [(a, float(draw.uniform(-0.25, 0.25))) for a in x]
    n = len(x) - 1
    up = [*vertices, (1.0, 1.0), (-1.0, 1.0)]
    u = polygon("u", up, [*["bottom"] * n, "right", "top", "left"], draw)
    down = [(-1.0, -1.0), (1.0, -1.0), *vertices[::-1]]
    low = polygon("l", down, ["bottom", "right", *["top"] * n, "left"], draw)
    pair = swapped_sides(Pair(("u_bottom",), ("l_top",)), draw)
    scene = Scene("polygon", (u, low), (pair,), clamped=fixed("l_bottom"))
    return pressed(scene, u, 0.0, 1.0, draw)


def branch(draw: Draw) -> Scene:
    """One secondary against two primaries beside a slot, in two pairs or in one."""
    u = block("u", (-1, 1), (0, float(draw.uniform(0.4, 1.0))), draw)
    slot = float(draw.choice([0.4, 0.1, 1e-2, 1e-3]))
    at = float(draw.uniform(-0.4, 0.4))
    end = float(draw.choice([1.0, 1.3]))
    a = block("a", (-end, at - slot / 2), (-0.8, 0), draw)
    b = block("b", (at + slot / 2, end), (-0.8, 0), draw)
    pairs: tuple[Pair, ...] = (Pair(("u_bottom",), ("a_top",)), Pair(("u_bottom",), ("b_top",)))
    if draw.random() < 0.4:
        pairs = (Pair(("u_bottom",), ("a_top", "b_top")),)
    elif draw.random() < 0.3:
        pairs = tuple(pair.swapped() for pair in pairs)
    clamped = {**fixed("a_bottom"), **fixed("b_bottom")}
    return pressed(Scene("branch", (u, a, b), pairs, clamped=clamped), u, 0.0, 1.0, draw)


def overlap(draw: Draw) -> Scene:
    """Pairs that share a part of the secondary, or that are the same."""
    cut = np.sort(draw.uniform(-0.7, 0.7, 2))
    cut[1] = max(cut[1], cut[0] + 0.2)
    x = (-1.0, float(cut[0]), float(cut[1]), 1.0)
    bottom = [(a, 0.0) for a in x]
    u = polygon(
        "u", [*bottom, (1.0, 0.9), (-1.0, 0.9)], ["1", "2", "3", "right", "top", "left"], draw
    )
    low = block("l", (-1.2, 1.2), (-0.8, 0), draw)
    pairs = (Pair(("u_1", "u_2"), ("l_top",)), Pair(("u_2", "u_3"), ("l_top",)))
    if draw.random() < 0.3:
        pairs = (Pair(("u_1", "u_2", "u_3"), ("l_top",)),) * 2
    scene = Scene("overlap", (u, low), pairs, clamped=fixed("l_bottom"))
    if draw.random() < 0.3:
        scene = replace(scene, finer={"u": 1.0, "l": float(draw.uniform(0.3, 0.9))})
    return pressed(scene, u, 0.0, 1.0, draw)


def obstacle(draw: Draw) -> Scene:
    """A block on a rigid plane, level or slightly tilted, at a distance."""
    u = block("u", (-1, 1), (0, float(draw.uniform(0.5, 1.2))), draw)
    tilt = LOAD * float(draw.choice([0.0, draw.uniform(-1, 1)]))
    gap = scalar(abs(tilt) + LOAD * 0.3 * float(draw.uniform(0, 1)), (tilt, 0.0))
    d = (0.0, -1.0) if draw.random() < 0.5 else None
    scene = Scene("obstacle", (u,), (Pair(("u_bottom",), (), d, gap),))
    return pressed(scene, u, 0.0, 1.0, draw)


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


KINDS: tuple[Callable[[np.random.Generator], Scene], ...] = (
    *(line, unmatched, corner, stack, polygonal),
    *(branch, overlap, obstacle, vee, pin, rolling),
)
UNKNOWNS = (300, 1600)  # of a scene, about
SHARE = 0.43  # of the square of its size that an element has as area


def rotation(angle: float) -> Array:
    """Rotation (2, 2) by an angle in radians."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def scene_of(seed: int) -> Scene:
    """The scene of a seed: kinds take turns, everything else is drawn."""
    draw = np.random.default_rng([seed, 7])
    scene = KINDS[seed % len(KINDS)](draw)
    order = int(draw.integers(1, 5))
    low, high = np.log(UNKNOWNS)
    elements = math.exp(draw.uniform(low, high)) / order**2
    if scene.finer is not None:
        elements /= 2  # the finer body has more of them
    area = sum(face.mass for face in geometry(scene).shape.faces)
    maxh = math.sqrt(area / (SHARE * elements))
    models = ["plane strain", "plane stress"]
    scene = replace(scene, order=order, maxh=min(maxh, 0.5), model=str(draw.choice(models)))
    motion = Motion(
        "as drawn",
        turn=rotation(float(draw.choice([0.0, math.pi / 2, draw.uniform(0, 2 * math.pi)]))),
        length=float(10 ** draw.uniform(-1, 2)),
        modulus=float(10 ** draw.uniform(-3, 11)),
    )
    return scene.moved(motion)
