"""Bodies inside of others, bounded by circles: rings, a ball in its socket."""

from __future__ import annotations

from netgen.occ import Face, OCCGeometry

from ngcontact.geometries.check import above, finite, flag, positive
from ngcontact.geometries.region import (
    DOWN,
    LEFT,
    RIGHT,
    UP,
    body,
    compound,
    quarter_arc,
    segment,
)


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
    inner : float
        Radius of the hole.
    interface : float
        Outer radius of the inner ring, larger than `inner`.
    outer : float
        Radius of the rim, larger than `interface`.
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
    body, boundary        where
    ====================  ==================================================
    ``inner``             `inner` <= r <= `interface`
    ``outer``             `interface` - `interference` <= r <= `outer`

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
    bore = bore_of(hole, shaft, rim, interference)
    part = _quarter_ring if flag("quarter", quarter) else _full_ring
    return compound(
        part("inner", hole, shaft, "hole", "inner_contact"),
        part("outer", bore, rim, "outer_contact", "rim"),
    )


def ball_in_socket(
    radius: float = 1.0,
    clearance: float = 0.05,
    width: float | None = None,
    depth: float | None = None,
) -> OCCGeometry:
    """Lower half of a ball that rests at (0, -`radius`) in a hemispherical socket.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Of the ball about the origin.
    clearance : float
        By which the radius of the socket is larger.
    width : float, optional
        The socket's block covers x <= `width`, more than the socket's radius. Default: 2 `radius`.
    depth : float, optional
        It covers y >= -`depth`, more than the socket's radius. Default: 2 `radius`.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Both have a vertex at the lowest point.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or the block does not hold the socket.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``ball``              y <= 0, inside the ball
    ``socket``            the block, outside the socket

    ``ball_top``          y = 0, ``ball``
    ``ball_arc``          the ball
    ``socket_arc``        the socket, a circle about (0, `clearance`)
    ``socket_rim``        y = `clearance`
    ``side``              x = `width`
    ``socket_bottom``     y = -`depth`
    ``axis``              x = 0, both bodies
    ====================  ==================================================
    """
    radius, clearance = positive("radius", radius), positive("clearance", clearance)
    bore = radius + clearance
    right = 2 * bore if width is None else above("width", width, "radius + clearance", bore)
    bottom = -2 * radius if depth is None else -above("depth", depth, "radius", radius)
    ball = [
        ("ball_arc", quarter_arc((0.0, 0.0), radius, DOWN, RIGHT)),
        ("ball_top", segment((radius, 0.0), (0.0, 0.0))),
        ("axis", segment((0.0, 0.0), (0.0, -radius))),
    ]
    corners = [(0.0, -radius), (0.0, bottom), (right, bottom), (right, clearance)]
    names = ["axis", "socket_bottom", "side", "socket_rim"]
    ends = [*corners[1:], (bore, clearance)]
    socket = [(name, segment(a, b)) for name, a, b in zip(names, corners, ends, strict=True)]
    socket.append(("socket_arc", quarter_arc((0.0, clearance), bore, RIGHT, DOWN)))
    return compound(body("ball", ball), body("socket", socket))


def bore_of(hole: float, shaft: float, rim: float, interference: float) -> float:
    """Inner radius of the outer ring, refused where it leaves the radii `hole` to `rim`."""
    bore = shaft - finite("interference", interference)
    if not hole < bore < rim:
        raise ValueError(
            f"interference = {interference!r}: expected more than interface - outer = "
            f"{shaft - rim!r} and less than interface - inner = {shaft - hole!r}"
        )
    return bore


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
