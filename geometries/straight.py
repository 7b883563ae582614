"""Bodies bounded by straight lines."""

from __future__ import annotations

from collections.abc import Sequence

from netgen.occ import OCCGeometry

from ngcontact.geometries.check import above, finite, increasing_line, positive
from ngcontact.geometries.region import Point, body, compound, polygon


def blocks(
    width: float = 2.0,
    height: float = 1.0,
    line: Sequence[tuple[float, float]] | None = None,
    lower_height: float | None = None,
) -> OCCGeometry:
    """Two blocks that meet along a common straight or polygonal line.

    Lengths are in any consistent unit.

    Parameters
    ----------
    width : float
        Width of both blocks. Sets the default `line` only.
    height : float
        The upper block reaches to y = `height`.
    line : sequence of (x, y), optional
        Vertices of the contact line from left to right, x strictly increasing, corners either
        way. Its ends set the sides of the blocks. Default: y = 0 from -`width`/2 to `width`/2.
    lower_height : float, optional
        The lower block reaches to y = -`lower_height`. Default: `height`.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Each has its own edge on every side of the line.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, `line` does not run to the right, or does not stay strictly
        between y = -`lower_height` and y = `height`.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``upper``             between the line and y = `height`
    ``lower``             between y = -`lower_height` and the line

    ``upper_contact``     the line, side of ``upper``
    ``lower_contact``     the line, side of ``lower``
    ``top``               y = `height`
    ``bottom``            y = -`lower_height`
    ``upper_left``        left side of ``upper``
    ``upper_right``       right side of ``upper``
    ``lower_left``        left side of ``lower``
    ``lower_right``       right side of ``lower``
    ====================  ==================================================
    """
    width, height = positive("width", width), positive("height", height)
    depth = height if lower_height is None else positive("lower_height", lower_height)
    if line is None:
        line = ((-width / 2, 0.0), (width / 2, 0.0))
    vertices = _line_between(-depth, height, line)
    (left, _), (right, _) = vertices[0], vertices[-1]
    sides = len(vertices) - 1
    names = ["upper_contact"] * sides + ["upper_right", "top", "upper_left"]
    upper = polygon([*vertices, (right, height), (left, height)], names)
    names = ["lower_contact"] * sides + ["lower_left", "bottom", "lower_right"]
    lower = polygon([*vertices[::-1], (left, -depth), (right, -depth)], names)
    return compound(body("upper", upper), body("lower", lower))


def punch(
    half_width: float = 0.5,
    punch_height: float = 1.0,
    width: float | None = None,
    depth: float | None = None,
) -> OCCGeometry:
    """Rectangular punch on a large foundation.

    Lengths are in any consistent unit.

    Parameters
    ----------
    half_width : float
        Half the width of the punch.
    punch_height : float
        Height of the punch above the surface y = 0.
    width : float, optional
        Half the width of the foundation, which covers |x| <= `width`. More than `half_width`.
        Default: 8 `half_width`.
    depth : float, optional
        Depth of the foundation. Default: 8 `half_width`.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. The surface of the foundation has vertices at the corners of
        the punch.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or `width` does not exceed `half_width`.

    Notes
    -----
    ======================  ==================================================
    body, boundary          where
    ======================  ==================================================
    ``punch``               |x| <= `half_width`, 0 <= y <= `punch_height`
    ``foundation``          |x| <= `width`, -`depth` <= y <= 0

    ``punch_top``           y = `punch_height`
    ``punch_sides``         |x| = `half_width`
    ``punch_contact``       y = 0, side of ``punch``
    ``foundation_contact``  y = 0, |x| <= `half_width`, side of ``foundation``
    ``foundation_free``     y = 0, |x| >= `half_width`
    ``foundation_sides``    |x| = `width`
    ``foundation_bottom``   y = -`depth`
    ======================  ==================================================
    """
    half = positive("half_width", half_width)
    top = positive("punch_height", punch_height)
    far = 8 * half if width is None else above("width", width, "half_width", half)
    bottom = -8 * half if depth is None else -positive("depth", depth)
    upper = polygon(
        [(-half, 0.0), (half, 0.0), (half, top), (-half, top)],
        ["punch_contact", "punch_sides", "punch_top", "punch_sides"],
    )
    surface = [(far, 0.0), (half, 0.0), (-half, 0.0), (-far, 0.0)]
    foundation = polygon(
        [*surface, (-far, bottom), (far, bottom)],
        [
            *("foundation_free", "foundation_contact", "foundation_free"),
            *("foundation_sides", "foundation_bottom", "foundation_sides"),
        ],
    )
    return compound(body("punch", upper), body("foundation", foundation))


def sleeve_on_shaft(
    radius: float = 1.0,
    outer: float = 1.6,
    length: float = 1.0,
    overhang: float = 0.5,
    interference: float = 0.0,
) -> OCCGeometry:
    """Solid shaft, longer than the sleeve on it: a press fit or a clearance.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Of the shaft.
    outer : float
        Radius of the sleeve's rim.
    length : float
        The sleeve covers |y| <= `length` / 2.
    overhang : float
        By which the shaft is longer on both sides.
    interference : float
        Radius of the shaft minus that of the sleeve's bore; negative: clearance.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, `outer` does not exceed `radius`, or the bore leaves (0,
        `outer`).

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``shaft``             x <= `radius`
    ``sleeve``            `radius` - `interference` <= x <= `outer`

    ``shaft_contact``     x = `radius`, |y| <= `length` / 2
    ``shaft_free``        x = `radius`, beside the sleeve
    ``sleeve_contact``    the bore of the sleeve
    ``rim``               x = `outer`
    ``shaft_ends``        both ends of the shaft
    ``sleeve_ends``       both ends of the sleeve
    ``axis``              x = 0
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    rim, half = above("outer", outer, "radius", radius), positive("length", length) / 2
    end, bore = half + positive("overhang", overhang), radius - finite("interference", interference)
    above("radius - interference", bore, "zero", 0.0)
    above("outer", outer, "radius - interference", bore)
    corners = [(radius, -end), (radius, -half), (radius, half), (radius, end), (0.0, end)]
    names = ["shaft_free", "shaft_contact", "shaft_free", "shaft_ends", "axis", "shaft_ends"]
    shaft = polygon([*corners, (0.0, -end)], names)
    corners = [(bore, -half), (rim, -half), (rim, half), (bore, half)]
    sleeve = polygon(corners, ["sleeve_ends", "rim", "sleeve_ends", "sleeve_contact"])
    return compound(body("shaft", shaft), body("sleeve", sleeve))


def _line_between(bottom: float, top: float, line: object) -> list[Point]:
    """Vertices of a line that runs to the right, refused where one leaves `bottom` < y < `top`."""
    vertices = increasing_line("line", line)
    for k, (_, y) in enumerate(vertices):
        if not bottom < y < top:
            raise ValueError(
                f"line[{k}] = {vertices[k]!r}: expected y strictly between "
                f"-lower_height = {bottom!r} and height = {top!r}"
            )
    return vertices
