"""A random scene for every seed."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from drivers.stress.motion import Motion
from drivers.stress.scenes import blocks, discs
from drivers.stress.scenes.scene import Scene
from drivers.stress.scenes.sides import Array

KINDS: tuple[Callable[[np.random.Generator], Scene], ...] = (
    *(blocks.line, blocks.unmatched, blocks.corner, blocks.stack, blocks.polygonal),
    *(blocks.branch, blocks.overlap, blocks.obstacle, discs.vee, discs.pin, discs.rolling),
)
UNKNOWNS = (300, 1600)  # of a scene, about
SHARE = 0.43  # of the square of its size that an element has as area


def rotation(angle: float) -> Array:
    """Rotation (2, 2) by an angle in radians."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s], [s, c]])


def _area(scene: Scene) -> float:
    """Area of all bodies, about: of the polygons of their sides, less those of holes."""
    total = 0.0
    for body in scene.bodies:
        for part in (body.sides, body.inner):
            ends = [side.point(np.array([0.0, side.length / 2])) for side in part]
            x = np.concatenate([np.zeros((0, 2)), *ends])
            y = np.roll(x, -1, axis=0)
            total += 0.5 * float((x[:, 0] * y[:, 1] - x[:, 1] * y[:, 0]).sum())
    return total


def scene_of(seed: int) -> Scene:
    """The scene of a seed: kinds take turns, everything else is drawn."""
    draw = np.random.default_rng([seed, 7])
    scene = KINDS[seed % len(KINDS)](draw)
    order = int(draw.integers(1, 5))
    low, high = np.log(UNKNOWNS)
    elements = math.exp(draw.uniform(low, high)) / order**2
    if scene.finer is not None:
        elements /= 2  # the finer body has more of them
    maxh = math.sqrt(_area(scene) / (SHARE * elements))
    models = ["plane strain", "plane stress"]
    scene = replace(scene, order=order, maxh=min(maxh, 0.5), model=str(draw.choice(models)))
    motion = Motion(
        "as drawn",
        turn=rotation(float(draw.choice([0.0, math.pi / 2, draw.uniform(0, 2 * math.pi)]))),
        length=float(10 ** draw.uniform(-1, 2)),
        modulus=float(10 ** draw.uniform(-3, 11)),
    )
    return scene.moved(motion)
