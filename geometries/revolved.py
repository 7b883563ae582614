"""Indenters and seals: meridian sections of bodies of revolution, x = r >= 0 and y = z."""

from __future__ import annotations

import math

from netgen.occ import Face, OCCGeometry

from ngcontact.geometries.check import above, finite, positive
from ngcontact.geometries.region import (
    DOWN,
    LEFT,
    RIGHT,
    UP,
    body,
    compound,
    half_block,
    polygon,
    quarter_arc,
    segment,
)


def cone_on_block(
    radius: float = 1.0,
    slope: float = 10.0,
    height: float | None = None,
    width: float | None = None,
    depth: float | None = None,
) -> OCCGeometry:
    """Conical indenter with its tip at the origin, on the top of a block.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the cone's base.
    slope : float
        Angle between the cone and the surface y = 0, degrees, between 0 and 90.
    height : float, optional
        Of the indenter. More than that of the cone; default: that and `radius`.
    width : float, optional
        The block covers x <= `width`. Default: 2 `radius`.
    depth : float, optional
        The block covers y >= -`depth`. Default: 2 `radius`.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, the slope not between 0 and 90, or `height` too small.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``indenter``          above the cone
    ``block``             x <= `width`, -`depth` <= y <= 0

    ``flank``             the cone
    ``indenter_side``     x = `radius`
    ``indenter_top``      y = `height`
    ``block_top``         y = 0
    ``block_bottom``      y = -`depth`
    ``side``              x = `width`
    ``axis``              x = 0, both bodies
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    if not 0 < finite("slope", slope) < 90:
        raise ValueError(f"slope = {slope!r}: expected degrees between 0 and 90")
    rise = radius * math.tan(math.radians(slope))
    top = rise + radius if height is None else above("height", height, "that of the cone", rise)
    corners = [(0.0, 0.0), (radius, rise), (radius, top), (0.0, top)]
    cone = polygon(corners, ["flank", "indenter_side", "indenter_top", "axis"])
    return compound(body("indenter", cone), _block(radius, width, depth))


def rounded_punch(
    flat: float = 1.0,
    rounding: float = 0.2,
    height: float | None = None,
    width: float | None = None,
    depth: float | None = None,
) -> OCCGeometry:
    """Flat circular punch with a rounded edge, on the top of a block.

    Lengths are in any consistent unit.

    Parameters
    ----------
    flat : float
        Radius of the flat part of its end.
    rounding : float
        Radius of its edge; that of the punch is `flat` and `rounding`.
    height : float, optional
        Of the punch, more than `rounding`. Default: `flat` and `rounding`.
    width : float, optional
        The block covers x <= `width`. Default: twice the punch's radius.
    depth : float, optional
        The block covers y >= -`depth`. Default: twice the punch's radius.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or `height` does not exceed `rounding`.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``indenter``          the punch
    ``block``             x <= `width`, -`depth` <= y <= 0

    ``end``               y = 0, x <= `flat`, and the rounded edge
    ``indenter_side``     x = `flat` + `rounding`
    ``indenter_top``      y = `height`
    ``block_top``         y = 0
    ``block_bottom``      y = -`depth`
    ``side``              x = `width`
    ``axis``              x = 0, both bodies
    ====================  ==================================================
    """
    flat, rounding = positive("flat", flat), positive("rounding", rounding)
    radius = flat + rounding
    top = radius if height is None else above("height", height, "rounding", rounding)
    punch = [
        ("end", segment((0.0, 0.0), (flat, 0.0))),
        ("end", quarter_arc((flat, rounding), rounding, DOWN, RIGHT)),
        ("indenter_side", segment((radius, rounding), (radius, top))),
        ("indenter_top", segment((radius, top), (0.0, top))),
        ("axis", segment((0.0, top), (0.0, 0.0))),
    ]
    return compound(body("indenter", punch), _block(radius, width, depth))


def ring_in_groove(
    radius: float = 3.0,
    section: float = 0.5,
    width: float | None = None,
    depth: float | None = None,
    wall: float | None = None,
) -> OCCGeometry:
    """O-ring in a rectangular groove, under a plate.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Of the ring's middle line.
    section : float
        Radius of the ring's circular section.
    width : float, optional
        Of the groove, more than 2 `section`. Default: 2.8 `section`.
    depth : float, optional
        Of the groove, less than 2 `section`. Default: 1.5 `section`.
    wall : float, optional
        Thickness of housing and plate. Default: 2 `section`.

    Returns
    -------
    OCCGeometry
        Compound of the three bodies. The ring touches the groove, y = 0, and the plate.

    Raises
    ------
    TypeError, ValueError
        If a length is out of its range, or the housing reaches the axis.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``ring``              the O-ring
    ``housing``           around the groove
    ``plate``             above the ring

    ``ring_lower``        its arcs with y <= `section`
    ``ring_upper``        its arcs with y >= `section`
    ``groove``            bottom of the groove
    ``walls``             sides of the groove
    ``face``              faces of the housing beside the groove
    ``plate_face``        y = 2 `section`
    ``housing_bottom``    lower end of the housing
    ``plate_top``         upper end of the plate
    ``rims``              sides of both
    ====================  ==================================================
    """
    radius, t = positive("radius", radius), positive("section", section)
    half = 1.4 * t if width is None else above("width", width, "2 section", 2 * t) / 2
    face = _groove_depth(t, depth)
    thick = 2 * t if wall is None else positive("wall", wall)
    above("radius", radius, "half the groove and the wall", half + thick)
    a, b, c, d = (radius + x for x in (-half - thick, -half, half, half + thick))
    corners = [(a, 2 * t), (d, 2 * t), (d, 2 * t + thick), (a, 2 * t + thick)]
    plate = body("plate", polygon(corners, ["plate_face", "rims", "plate_top", "rims"]))
    return compound(_ring(radius, t), _housing(a, b, c, d, face, -thick), plate)


def _ring(radius: float, section: float) -> Face:
    """Section of the O-ring that touches y = 0."""
    around = [RIGHT, UP, LEFT, DOWN, RIGHT]
    names = ["ring_upper", "ring_upper", "ring_lower", "ring_lower"]
    arcs = [quarter_arc((radius, section), section, *around[k : k + 2]) for k in range(4)]
    return body("ring", list(zip(names, arcs, strict=True)))


def _groove_depth(section: float, depth: float | None) -> float:
    """Depth of the groove, refused where the ring would not reach the plate."""
    face = 1.5 * section if depth is None else positive("depth", depth)
    if face >= 2 * section:
        raise ValueError(f"depth = {depth!r}: expected less than 2 section = {2 * section!r}")
    return face


def _housing(a: float, b: float, c: float, d: float, face: float, bottom: float) -> Face:
    """Housing a <= x <= d with the groove b <= x <= c down to y = 0."""
    corners = [(a, bottom), (d, bottom), (d, face), (c, face), (c, 0.0), (b, 0.0), (b, face)]
    names = ["housing_bottom", "rims", "face", "walls", "groove", "walls", "face", "rims"]
    return body("housing", polygon([*corners, (a, face)], names))


def _block(radius: float, width: float | None, depth: float | None) -> Face:
    """Block below y = 0 about the axis, by default twice as wide and deep as `radius`."""
    right = 2 * radius if width is None else above("width", width, "the indenter's", radius)
    bottom = -2 * radius if depth is None else -positive("depth", depth)
    return body("block", half_block(right, bottom))
