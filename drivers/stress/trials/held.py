"""Problems of bodies that contact alone holds, at rest on others (HH81 Remark 3.7)."""

from __future__ import annotations

import math

import ngsolve as ng

from ngcontact import Contact, Elastic, Problem
from ngcontact.geometries.region import Loop, Point, body, compound, polygon, quarter_arc

STEEL = Elastic(E=1000.0, nu=0.3)
WEIGHT = 0.1  # of a disc of radius 1, per area


def _disc(centre: Point, *names: str) -> Loop:
    """Circle of radius 1, of four quarter arcs from angle 0."""
    return [(name, quarter_arc(centre, 1.0, k, (k + 1) % 4)) for k, name in enumerate(names)]


def disc_above_block(gap: float = 0.05) -> tuple[Problem, float]:
    """Disc `gap` above a clamped block, with nothing but its weight; also that weight."""
    disc = _disc((0.0, 1.0 + gap), "over", "over", "arc", "arc")
    base = polygon([(-2, -1), (2, -1), (2, 0), (-2, 0)], ["bottom", "side", "block_top", "side"])
    problem = Problem(
        geometry=compound(body("disc", disc), body("block", base)),
        materials={"disc|block": STEEL},
        displacement={"bottom": (0, 0)},
        force={"disc": (0, -WEIGHT)},
        contact=[Contact("arc", "block_top", direction=(0, -1))],
    )
    return problem, WEIGHT * math.pi


def disc_in_notch() -> tuple[Problem, float]:
    """Disc in a notch of 90 degrees whose faces it touches, one pair each; also its weight."""
    deep = math.sqrt(2)  # from the centre of the disc down to the root of the notch
    wide, low, high = 1.5 * deep, -2 * deep, 0.5 * deep
    notch = polygon(
        [(0, -deep), (-wide, high), (-wide, low), (wide, low), (wide, high)],
        ["left_face", "side", "bottom", "side", "right_face"],
    )
    disc = _disc((0.0, 0.0), "over", "over", "left_arc", "right_arc")
    problem = Problem(
        geometry=compound(body("disc", disc), body("notch", notch)),
        materials={"disc|notch": STEEL},
        displacement={"bottom": (0, 0)},
        force={"disc": (0, -WEIGHT)},
        contact=[
            Contact("left_arc", "left_face", direction=(-1, -1)),
            Contact("right_arc", "right_face", direction=(1, -1)),
        ],
    )
    return problem, WEIGHT * math.pi


def stack() -> tuple[Problem, list[float]]:
    """Three blocks on each other, the lowest clamped; also the loads on the two lines."""
    halves, bodies = {"base": 1.5, "middle": 1.0, "cap": 0.5}, []
    for y, (name, half) in enumerate(halves.items()):
        corners: list[Point] = [(-half, y), (half, y), (half, y + 1), (-half, y + 1)]
        sides = [f"{name}_{side}" for side in ("below", "side", "above", "side")]
        bodies.append(body(name, polygon(corners, sides)))
    problem = Problem(
        geometry=compound(*bodies),
        materials={"base|middle|cap": STEEL},
        displacement={"base_below": (0, 0)},
        force={"middle": (0, -WEIGHT), "cap": (0, -WEIGHT)},
        traction={"cap_above": ng.CF((0, -1 - ng.x))},
        contact=[
            Contact("middle_below", "base_above", direction=(0, -1)),
            Contact("cap_below", "middle_above", direction=(0, -1)),
        ],
    )
    return problem, [1 + 3 * WEIGHT, 1 + WEIGHT]
