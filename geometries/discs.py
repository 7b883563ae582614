"""Discs, the halves of them that face contact, bounded by arcs of circles."""

from __future__ import annotations

from itertools import pairwise

from netgen.occ import OCCGeometry

from ngcontact.geometries.check import flag, positive
from ngcontact.geometries.region import (
    DOWN,
    LEFT,
    RIGHT,
    UP,
    Loop,
    Point,
    body,
    compound,
    half_block,
    polygon,
    quarter_arc,
    segment,
)


def disc(radius: float = 1.0, symmetric: bool = True) -> OCCGeometry:
    """Lower half of a disc that touches the line y = 0 at the origin, for a rigid foundation.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the disc about (0, `radius`).
    symmetric : bool
        Only the part with x >= 0.

    Returns
    -------
    OCCGeometry
        The body, with a vertex at the origin.

    Raises
    ------
    TypeError, ValueError
        If `radius` is not positive, or `symmetric` is not a truth value.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``disc``              y <= `radius`, inside the circle

    ``top``               y = `radius`
    ``arc``               the circle
    ``axis``              x = 0 (only if `symmetric`)
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    outline = _half_disc(radius, True, flag("symmetric", symmetric), arc="arc", flat="top")
    return compound(body("disc", outline))


def disc_on_block(
    radius: float = 1.0,
    width: float | None = None,
    height: float | None = None,
    symmetric: bool = True,
) -> OCCGeometry:
    """Lower half of a disc that rests at the origin on the top of a block.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the disc about (0, `radius`).
    width : float, optional
        The block covers |x| <= `width`. Default: 2 `radius`.
    height : float, optional
        Height of the block below y = 0. Default: 2 `radius`.
    symmetric : bool
        Only the part with x >= 0.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Both have a vertex at the origin.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or `symmetric` is not a truth value.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``disc``              y <= `radius`, inside the circle
    ``block``             |x| <= `width`, -`height` <= y <= 0

    ``disc_top``          y = `radius`
    ``disc_arc``          the circle
    ``block_top``         y = 0
    ``block_bottom``      y = -`height`
    ``side``              |x| = `width`
    ``axis``              x = 0, both bodies (only if `symmetric`)
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    right = 2 * radius if width is None else positive("width", width)
    bottom = -2 * radius if height is None else -positive("height", height)
    half = flag("symmetric", symmetric)
    disc = _half_disc(radius, True, half, arc="disc_arc", flat="disc_top")
    return compound(body("disc", disc), body("block", _block(right, bottom, half)))


def disc_on_disc(
    radius: float = 1.0,
    lower_radius: float | None = None,
    symmetric: bool = True,
) -> OCCGeometry:
    """Lower half of a disc that touches the upper half of another at the origin.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the upper disc about (0, `radius`).
    lower_radius : float, optional
        Radius of the lower disc about (0, -`lower_radius`). Default: `radius`.
    symmetric : bool
        Only the part with x >= 0.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Both have a vertex at the origin.

    Raises
    ------
    TypeError, ValueError
        If a radius is not positive, or `symmetric` is not a truth value.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``upper``             y <= `radius`, inside the upper circle
    ``lower``             y >= -`lower_radius`, inside the lower circle

    ``top``               y = `radius`
    ``upper_arc``         the upper circle
    ``lower_arc``         the lower circle
    ``bottom``            y = -`lower_radius`
    ``axis``              x = 0, both bodies (only if `symmetric`)
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    lower_radius = radius if lower_radius is None else positive("lower_radius", lower_radius)
    half = flag("symmetric", symmetric)
    upper = _half_disc(radius, True, half, arc="upper_arc", flat="top")
    lower = _half_disc(lower_radius, False, half, arc="lower_arc", flat="bottom")
    return compound(body("upper", upper), body("lower", lower))


def _block(right: float, bottom: float, symmetric: bool) -> Loop:
    """Counterclockwise loop of a block below y = 0 with a vertex at the origin."""
    if symmetric:
        return half_block(right, bottom)
    return polygon(
        [(0.0, 0.0), (-right, 0.0), (-right, bottom), (right, bottom), (right, 0.0)],
        ["block_top", "side", "block_bottom", "side", "block_top"],
    )


def _half_disc(radius: float, above: bool, symmetric: bool, *, arc: str, flat: str) -> Loop:
    """Counterclockwise loop of the half of a disc that faces the origin from above or below.

    The arc is split at the origin; `symmetric` keeps x >= 0.
    """
    way = [LEFT, DOWN, RIGHT] if above else [RIGHT, UP, LEFT]
    if symmetric:
        way = [k for k in way if k != LEFT]
    y = radius if above else -radius
    centre: Point = (0.0, y)
    ends = {RIGHT: (radius, y), LEFT: (-radius, y)}  # others face contact, at the origin
    first, last = (ends.get(k, (0.0, 0.0)) for k in (way[0], way[-1]))
    arcs = [(arc, quarter_arc(centre, radius, *pair)) for pair in pairwise(way)]
    if not symmetric:
        return [*arcs, (flat, segment(last, first))]
    names = ("axis", flat) if way[-1] == UP else (flat, "axis")
    return [*arcs, (names[0], segment(last, centre)), (names[1], segment(centre, first))]
