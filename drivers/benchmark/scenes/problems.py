"""The two common problems, with what is known of their solutions."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import NDArray

from drivers.reference.cases import disc_on_rigid_plane, partly_opening_block
from ngcontact import Problem

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Reference:
    """What every engine has to find, in any consistent units."""

    force: float  # of contact, of the whole disc where half of it is solved
    peak: float  # contact pressure at x = 0, where it is largest
    half_width: float  # the x at which contact ends
    energy: float  # strain energy of what is solved


@dataclass(frozen=True, eq=False)
class Common:
    """A common problem: one pair, vertical direction of contact, contact for 0 <= x <= a.

    The statement's ``materials``, ``displacement``, ``sliding`` (vertical lines only) and
    ``traction`` (pressures only) hold numbers, which other codes can read as well.
    """

    name: str
    problem: Problem
    reference: Reference
    parts: int  # mirror images that `Reference.force` counts
    # Element size at points (n, 2) of a mesh graded by hand, for a fineness c < 1.
    mesh_size: Callable[[Array, float], Array]
    on_curve: Callable[[Array], Array]  # points (n, 2) near the contact curve, moved onto it


# `adapt` up to 200 000 unknowns. The last four levels of order 4 agree, relative to their values,
# to the digits printed: force 1e-10, peak 1e-10, half-width 2e-7, energy 1e-12. The last level of
# order 3 differs by: force < 1e-9, peak 5e-7, half-width 2e-7, energy 3e-11.
DISC = Reference(
    force=0.4465326527,  # (1)
    peak=5.591862,  # (3)
    half_width=0.05082023,  # (1)
    energy=5.22103207482e-4,  # (1)
)

# The same for the block. Half-width: levels of order 4 from 18 000 unknowns on give 1.545313, order
# 3 ends at 1.545312. Energy: order 4 agrees in 2e-12.
BLOCK = Reference(
    force=1.0,  # by equilibrium
    peak=0.975722,  # (1)
    half_width=1.545313,  # (1)
    energy=7.16412557393e-4,  # (1)
)


def _towards(points: Array, end: tuple[float, float], radius: float, c: float) -> Array:
    """Share, at most 1, by which elements shrink towards an r^(3/2) singularity, order 2."""
    distance = np.hypot(*(points - end).T) / radius
    return np.sqrt(np.clip(distance, c**2, 1))


def _disc_size(points: Array, c: float) -> Array:
    """Proportional to the distance, as the field of a point load asks for; finest at the end."""
    a = DISC.half_width
    return c * (a + np.hypot(*points.T)) * _towards(points, (a, 0), a, c)


def _block_size(points: Array, c: float) -> Array:
    """Finer at the end of contact, the end of the load and the corner of the clamped edge."""
    ends = [(BLOCK.half_width, 0.0), (1.0, 1.0), (2.0, -1.0)]
    return c * np.array([_towards(points, end, 0.5, c) for end in ends]).min(axis=0)


def _on_circle(points: Array) -> Array:
    centre = np.array([0.0, 1.0])
    ray = points - centre
    return centre + ray / np.hypot(*ray.T)[:, None]


def disc() -> Common:
    """Problem A: quarter disc pressed on a rigid plane, contact zone not known beforehand."""
    return Common("disc", disc_on_rigid_plane(), DISC, 2, _disc_size, _on_circle)


def block() -> Common:
    """Problem B: block that lifts off on one side, contact zone bounded, nodes matched."""
    return Common("block", partly_opening_block(), BLOCK, 1, _block_size, lambda points: points)


Name: TypeAlias = Literal["disc", "block"]
COMMONS: dict[Name, Callable[[], Common]] = {"disc": disc, "block": block}
