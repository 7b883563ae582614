"""Named plane bodies from named edges, and the geometry made of them.

Netgen takes the side of the material from the direction of each edge: the body must lie to the
left of every edge. A loop that runs the wrong way round still meshes with positive area, but its
boundary normals point inwards (and holes are filled), so the rule is kept here, at the source.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from netgen.occ import (
    ArcOfCircle,
    Compound,
    Edge,
    Face,
    OCCGeometry,
    Pnt,
    Segment,
    Wire,
    WorkPlane,
)

Point = tuple[float, float]
Loop = Sequence[tuple[str, Edge]]

# Ten times the distance at which Open CASCADE takes points for equal, whatever the unit of length.
SHORTEST_EDGE = 1e-6

# Unit vectors at 0, 90, 180 and 270 degrees, exact where cos and sin would leave 6e-17.
COMPASS: tuple[Point, ...] = ((1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0))
RIGHT, UP, LEFT, DOWN = range(4)  # their numbers


def segment(start: Point, end: Point) -> Edge:
    """Straight edge from `start` to `end`."""
    return Segment(Pnt(*start, 0), Pnt(*end, 0))


def quarter_arc(centre: Point, radius: float, start: int, end: int) -> Edge:
    """Quarter circle from ``COMPASS[start]`` to the neighbouring ``COMPASS[end]``."""
    (x0, y0), (x1, y1) = COMPASS[start], COMPASS[end]
    middle = ((x0 + x1) * math.sqrt(0.5), (y0 + y1) * math.sqrt(0.5))
    points = [
        Pnt(centre[0] + radius * x, centre[1] + radius * y, 0)
        for x, y in (COMPASS[start], middle, COMPASS[end])
    ]
    return ArcOfCircle(*points)


def polygon(vertices: Sequence[Point], names: Sequence[str]) -> Loop:
    """Polygon of straight edges; ``names[i]`` belongs to the edge that leaves vertex i."""
    ends = [*vertices[1:], vertices[0]]
    return [
        (name, segment(start, end)) for name, start, end in zip(names, vertices, ends, strict=True)
    ]


def half_block(right: float, bottom: float) -> Loop:
    """Counterclockwise loop of 0 <= x <= `right`, `bottom` <= y <= 0, in the gallery's names."""
    corners = [(0.0, 0.0), (0.0, bottom), (right, bottom), (right, 0.0)]
    return polygon(corners, ["axis", "block_bottom", "side", "block_top"])


def body(name: str, outline: Loop, hole: Loop | None = None) -> Face:
    """Plane face with normal +z whose name and edge names are set.

    Parameters
    ----------
    name : str
        Name of the body.
    outline : sequence of (str, Edge)
        Boundary names and edges, end to end, counterclockwise.
    hole : sequence of (str, Edge), optional
        The same, clockwise, for the edge of a hole.

    Raises
    ------
    ValueError
        If an edge is too short for the CAD kernel.
    """
    loops = [outline] if hole is None else [outline, hole]
    for boundary, edge in (pair for loop in loops for pair in loop):
        if edge.mass < SHORTEST_EDGE:
            raise ValueError(
                f"{boundary} of {name}: an edge is {edge.mass:.1e} long, expected at least "
                f"{SHORTEST_EDGE:.0e}, as the CAD kernel merges points closer than 1e-07: "
                "use a smaller unit of length"
            )
    plane = WorkPlane().Rectangle(1, 1).Face()  # carries the normal +z; its extent is irrelevant
    face = Face(plane, [Wire([edge for _, edge in loop]) for loop in loops])
    face.name = name
    named = [(boundary, _middle(edge)) for loop in loops for boundary, edge in loop]
    # Wire replaces edges to share their end points, and the copies lose their names.
    for edge in face.edges:
        x, y = _middle(edge)
        edge.name = min(named, key=lambda item: math.dist(item[1], (x, y)))[0]
    return face


def compound(*bodies: Face) -> OCCGeometry:
    """Geometry of bodies that keep their own nodes where they touch (never glued)."""
    return OCCGeometry(Compound(list(bodies)), dim=2)


def _middle(edge: Edge) -> Point:
    """Point at the middle of the parameter interval: it lies on no other edge of the body."""
    start, end = edge.parameter_interval
    point = edge.Value((start + end) / 2)
    return point.x, point.y
