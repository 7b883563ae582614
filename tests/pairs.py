"""Pairs of bodies whose contact lines meshes match: bounded zones, and zones that grow."""

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from netgen.occ import OCCGeometry

from drivers.reference.cases import LINE
from ngcontact import Contact, Elastic, Problem
from ngcontact.geometries import blocks, disc_on_block, disc_on_disc, graphs, punch, rings

SOFT = Elastic(E=1.0, nu=0.3)
BLOCKS, RINGS = ("upper", "lower"), ("inner", "outer")
MATCHED_PART = 0.86  # of a radius: the steepest part of a circle stays unmatched by design
ROUND_OFF = 1e-12  # of coordinates of size 1; the bound of the published method's matched nodes


@dataclass(frozen=True)
class Pair:
    """A geometry, its bodies and pair; the height of both lines over x, matched for |x| < part."""

    geometry: Callable[[], OCCGeometry]
    bodies: tuple[str, str]
    contact: Contact
    curves: tuple[Callable[[float], float], ...] = ()
    part: float = math.inf

    def problem(self):
        return pressed(self.geometry(), self.bodies, self.contact)

    @property
    def sides(self):
        return self.contact.secondary, self.contact.primary


def pressed(geometry, bodies, *contact):
    return Problem(geometry=geometry, materials=dict.fromkeys(bodies, SOFT), contact=contact)


def flat(x):
    return 0.0


def wave(x):
    return 0.02 + 0.01 * math.sin(9 * x)


def valley(x):
    return -0.2 * math.cos(3 * x)


def arc(radius):
    """Lower half of the circle about (0, radius), or upper one for a negative radius."""
    return lambda x: radius - math.copysign(math.sqrt(max(radius**2 - x * x, 0.0)), radius)


def unmatched(a, b):
    """Largest distance from a point of one set to the nearest one of the other, both ways."""
    a, b = (v.reshape(len(v), -1) for v in (a, b))
    distance = np.linalg.norm(a[:, None] - b, axis=2)
    return max(distance.min(axis=0).max(), distance.min(axis=1).max())


UP, DOWN = (0, 1), (0, -1)
FACING = Contact("lower_contact", "upper_contact")
RISING = Contact("lower_contact", "upper_contact", direction=UP)
BOUNDED = {
    "blocks": Pair(blocks, BLOCKS, Contact("upper_contact", "lower_contact")),
    "polygon": Pair(lambda: blocks(line=LINE), BLOCKS, FACING),
    "one graph": Pair(lambda: graphs(valley, valley), BLOCKS, FACING),
    "punch": Pair(punch, ("punch", "foundation"), Contact("punch_contact", "foundation_contact")),
    "rings": Pair(rings, RINGS, Contact("outer_contact", "inner_contact")),
    "quarter rings": Pair(
        lambda: rings(quarter=True), RINGS, Contact("inner_contact", "outer_contact")
    ),
}
ENLARGING = {
    "blocks": Pair(blocks, BLOCKS, RISING, (flat, flat)),
    "waves": Pair(lambda: graphs(wave, valley), BLOCKS, RISING, (valley, wave)),
    "disc on block": Pair(
        disc_on_block,
        ("disc", "block"),
        Contact("disc_arc", "block_top", direction=DOWN),
        (arc(1.0), flat),
        MATCHED_PART,
    ),
    "disc on disc": Pair(
        lambda: disc_on_disc(lower_radius=2.0, symmetric=False),
        BLOCKS,
        Contact("lower_arc", "upper_arc", direction=UP),
        (arc(-2.0), arc(1.0)),
        MATCHED_PART,
    ),
}
ALL = {f"bounded {k}": v for k, v in BOUNDED.items()} | {
    f"enlarging {k}": v for k, v in ENLARGING.items()
}
