"""Bodies bounded by arcs of circles."""

from __future__ import annotations

from netgen.occ import Face, OCCGeometry

from ngcontact.geometries.check import above, finite, flag, positive
from ngcontact.geometries.region import Loop, Point, body, compound, polygon, quarter_arc, segment

RIGHT, UP, LEFT, DOWN = range(4)


def rings(
    inner: float = 0.5,
    interface: float = 1.0,
    outer: float = 2.0,
    interference: float = 0.0,
    quarter: bool = False,
) -> OCCGeometry:
    """Two concentric rings about the origin, one in the other: a press fit or a clearance.

    Lengths are in any consistent unit.

    Parameters
    ----------
    inner, interface, outer : float
        Radius of the hole, outer radius of the inner ring, radius of the rim; increasing.
    interference : float
        Outer radius of the inner ring minus inner radius of the outer ring; negative: clearance.
    quarter : bool
        Only the part with x >= 0 and y >= 0.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Circles are quarter arcs from angle 0, so that both contact
        circles have vertices at equal angles.

    Raises
    ------
    TypeError, ValueError
        If the radii are not positive and increasing, or `interference` pushes the inner radius
        of the outer ring out of (`inner`, `outer`).

    Notes
    -----
    ====================  ==================================================
    body                  where
    ====================  ==================================================
    ``inner``             `inner` <= r <= `interface`
    ``outer``             `interface` - `interference` <= r <= `outer`
    ====================  ==================================================

    ====================  ==================================================
    boundary              where
    ====================  ==================================================
    ``hole``              r = `inner`
    ``inner_contact``     r = `interface`, side of ``inner``
    ``outer_contact``     r = `interface` - `interference`, side of ``outer``
    ``rim``               r = `outer`
    ``inner_cut_x``       x = 0, ``inner`` (only if `quarter`)
    ``outer_cut_x``       x = 0, ``outer`` (only if `quarter`)
    ``inner_cut_y``       y = 0, ``inner`` (only if `quarter`)
    ``outer_cut_y``       y = 0, ``outer`` (only if `quarter`)
    ====================  ==================================================
    """
    hole = positive("inner", inner)
    shaft = above("interface", interface, "inner", hole)
    rim = above("outer", outer, "interface", shaft)
    bore = shaft - finite("interference", interference)
    if not hole < bore < rim:
        raise ValueError(
            f"interference = {interference!r}: expected more than interface - outer = "
            f"{shaft - rim!r} and less than interface - inner = {shaft - hole!r}"
        )
    part = _quarter_ring if flag("quarter", quarter) else _full_ring
    return compound(
        part("inner", hole, shaft, "hole", "inner_contact"),
        part("outer", bore, rim, "outer_contact", "rim"),
    )


def disc(radius: float = 1.0, symmetric: bool = True) -> OCCGeometry:
    """Lower half of a disc that touches the line y = 0 at the origin, for a rigid foundation.

    Parameters
    ----------
    radius : float
        Radius of the disc about (0, `radius`), any consistent unit of length.
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
    body                  where
    ====================  ==================================================
    ``disc``              y <= `radius`, inside the circle
    ====================  ==================================================

    ====================  ==================================================
    boundary              where
    ====================  ==================================================
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
    body                  where
    ====================  ==================================================
    ``disc``              y <= `radius`, inside the circle
    ``block``             |x| <= `width`, -`height` <= y <= 0
    ====================  ==================================================

    ====================  ==================================================
    boundary              where
    ====================  ==================================================
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
    if flag("symmetric", symmetric):
        block = polygon(
            [(0.0, 0.0), (0.0, bottom), (right, bottom), (right, 0.0)],
            ["axis", "block_bottom", "side", "block_top"],
        )
    else:
        block = polygon(
            [(0.0, 0.0), (-right, 0.0), (-right, bottom), (right, bottom), (right, 0.0)],
            ["block_top", "side", "block_bottom", "side", "block_top"],
        )
    disc = _half_disc(radius, True, symmetric, arc="disc_arc", flat="disc_top")
    return compound(body("disc", disc), body("block", block))


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
    body                  where
    ====================  ==================================================
    ``upper``             y <= `radius`, inside the upper circle
    ``lower``             y >= -`lower_radius`, inside the lower circle
    ====================  ==================================================

    ====================  ==================================================
    boundary              where
    ====================  ==================================================
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


def _half_disc(radius: float, above: bool, symmetric: bool, *, arc: str, flat: str) -> Loop:
    """Counterclockwise loop of the half of a disc that faces the origin from above or below.

    The arc is split at the origin; `symmetric` keeps x >= 0.
    """
    y = radius if above else -radius
    centre: Point = (0.0, y)
    right, origin, left = (radius, y), (0.0, 0.0), (-radius, y)
    if above and symmetric:
        straight = [(flat, segment(right, centre)), ("axis", segment(centre, origin))]
        return [(arc, quarter_arc(centre, radius, DOWN, RIGHT)), *straight]
    if above:
        arcs = [(LEFT, DOWN), (DOWN, RIGHT)]
        straight = [(flat, segment(right, left))]
    elif symmetric:
        arcs = [(RIGHT, UP)]
        straight = [("axis", segment(origin, centre)), (flat, segment(centre, right))]
    else:
        arcs = [(RIGHT, UP), (UP, LEFT)]
        straight = [(flat, segment(left, right))]
    return [*((arc, quarter_arc(centre, radius, *ends)) for ends in arcs), *straight]


def _full_ring(name: str, bore: float, rim: float, bore_name: str, rim_name: str) -> Face:
    """Ring about the origin between the radii `bore` and `rim`."""
    around = [RIGHT, UP, LEFT, DOWN, RIGHT]
    back = around[::-1]  # a hole runs clockwise
    return body(
        name,
        [(rim_name, quarter_arc((0, 0), rim, *around[k : k + 2])) for k in range(4)],
        [(bore_name, quarter_arc((0, 0), bore, *back[k : k + 2])) for k in range(4)],
    )


def _quarter_ring(name: str, bore: float, rim: float, bore_name: str, rim_name: str) -> Face:
    """First quadrant of the ring, cut on y = 0 and x = 0."""
    return body(
        name,
        [
            (f"{name}_cut_y", segment((bore, 0), (rim, 0))),
            (rim_name, quarter_arc((0, 0), rim, RIGHT, UP)),
            (f"{name}_cut_x", segment((0, rim), (0, bore))),
            (bore_name, quarter_arc((0, 0), bore, UP, RIGHT)),
        ],
    )
