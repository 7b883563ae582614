"""Bodies in space, or the parts of them that symmetry leaves: balls, cylinders, shells, cubes."""

from __future__ import annotations

import math

from netgen.occ import (
    Axis,
    Box,
    Compound,
    Cylinder,
    OCCGeometry,
    Pnt,
    Sphere,
    TopoDS_Shape,
    X,
    Y,
    Z,
    gp_Dir,
    gp_Vec,
)

from ngcontact.geometries.check import above, flag, positive
from ngcontact.geometries.concentric import bore_of


def ball_on_block(
    radius: float = 1.0,
    width: float | None = None,
    height: float | None = None,
    symmetric: bool = True,
) -> OCCGeometry:
    """Lower half of a ball that rests at the origin on the top of a round block.

    Both are bodies of revolution by the section `disc_on_block`.
    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the ball about (0, 0, `radius`).
    width : float, optional
        Radius of the block. Default: 2 `radius`.
    height : float, optional
        Height of the block below z = 0. Default: 2 `radius`.
    symmetric : bool
        Only the quarter with x >= 0 and y >= 0.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Both have a vertex at the origin if `symmetric`.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or `symmetric` is not a truth value.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``ball``              z <= `radius`, inside the ball
    ``block``             r <= `width`, -`height` <= z <= 0

    ``ball_top``          z = `radius`
    ``ball_surface``      the ball
    ``block_top``         z = 0
    ``block_bottom``      z = -`height`
    ``side``              r = `width`
    ``cut_x``             x = 0, both bodies (only if `symmetric`)
    ``cut_y``             y = 0, both bodies (only if `symmetric`)
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    width = 2 * radius if width is None else positive("width", width)
    height = 2 * radius if height is None else positive("height", height)
    part = _quarter if flag("symmetric", symmetric) else _whole
    names = ("block_bottom", "side", "block_top")
    block = _cylinder((0.0, 0.0, -height), Z, width, height, names)
    return compound(
        body("ball", part(_ball(radius, radius, "ball_surface"), 2 * radius, radius, "ball_top")),
        body("block", part(block, 2 * (width + height))),
    )


def crossed_cylinders(
    radius: float = 1.0,
    lower_radius: float | None = None,
    length: float | None = None,
    symmetric: bool = True,
) -> OCCGeometry:
    """Halves of two cylinders at right angles, which touch at the origin.

    Where gaps are A x^2 + B y^2 contact is an ellipse: A = 1 / (2 `lower_radius`),
    B = 1 / (2 `radius`).
    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the upper cylinder about the line y = 0, z = `radius`.
    lower_radius : float, optional
        Radius of the lower one about the line x = 0, z = -`lower_radius`. Default: `radius`.
    length : float, optional
        Half the length of both. Default: the larger radius.
    symmetric : bool
        Only the quarter with x >= 0 and y >= 0.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Both have a vertex at the origin if `symmetric`.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or `symmetric` is not a truth value.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``upper``             z <= `radius`, inside the upper cylinder
    ``lower``             z >= -`lower_radius`, inside the lower cylinder

    ``top``               z = `radius`
    ``upper_surface``     the upper cylinder
    ``upper_ends``        |x| = `length`
    ``lower_surface``     the lower cylinder
    ``lower_ends``        |y| = `length`
    ``bottom``            z = -`lower_radius`
    ``cut_x``             x = 0, both bodies (only if `symmetric`)
    ``cut_y``             y = 0, both bodies (only if `symmetric`)
    ====================  ==================================================
    """
    radius = positive("radius", radius)
    lower = radius if lower_radius is None else positive("lower_radius", lower_radius)
    length = max(radius, lower) if length is None else positive("length", length)
    part = _quarter if flag("symmetric", symmetric) else _whole
    far = 2 * (length + radius + lower)
    ends = ("upper_ends", "upper_surface", "upper_ends")
    over = _cylinder((-length, 0.0, radius), X, radius, 2 * length, ends)
    ends = ("lower_ends", "lower_surface", "lower_ends")
    # The seam of a cylinder lies above along x, below along -y: out of contact on both.
    under = _cylinder((0.0, length, -lower), -Y, lower, 2 * length, ends)
    return compound(
        body("upper", part(over, far, radius, "top")),
        body("lower", part(under, far, -lower, "bottom", above=True)),
    )


def shells(
    inner: float = 0.5,
    interface: float = 1.0,
    outer: float = 1.5,
    interference: float = 0.0,
) -> OCCGeometry:
    """Octant x, y, z >= 0 of two concentric spherical shells about the origin, one in the other.

    Lengths are in any consistent unit.

    Parameters
    ----------
    inner : float
        Radius of the hole.
    interface : float
        Outer radius of the inner shell, larger than `inner`.
    outer : float
        Radius of the rim, larger than `interface`.
    interference : float
        Outer radius of the inner shell minus inner radius of the outer one; negative: clearance.
        Where it is 0 faces coincide, and their nodes match.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies.

    Raises
    ------
    TypeError, ValueError
        If the radii are not positive and increasing, or `interference` pushes the inner radius
        of the outer shell out of (`inner`, `outer`).

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
    ``cut_x``             x = 0, both bodies
    ``cut_y``             y = 0, both bodies
    ``cut_z``             z = 0, both bodies
    ====================  ==================================================
    """
    hole = positive("inner", inner)
    core = above("interface", interface, "inner", hole)
    rim = above("outer", outer, "interface", core)
    bore = bore_of(hole, core, rim, interference)
    octant = _box(0.0, 2 * rim, (0.0, 2 * rim), {"x": "cut_x", "y": "cut_y", "z": "cut_z"})
    return compound(
        body("inner", (_ball(core, 0, "inner_contact") - _ball(hole, 0, "hole")) * octant),
        body("outer", (_ball(rim, 0, "rim") - _ball(bore, 0, "outer_contact")) * octant),
    )


def ball_in_cup(
    radius: float = 1.0,
    clearance: float = 0.02,
    depth: float | None = None,
    width: float | None = None,
    height: float | None = None,
    symmetric: bool = True,
) -> OCCGeometry:
    """Lower half of a ball that rests at the origin in a spherical cup: conforming contact.

    Lengths are in any consistent unit.

    Parameters
    ----------
    radius : float
        Radius of the ball about (0, 0, `radius`).
    clearance : float
        By which the radius of the cup is larger.
    depth : float, optional
        Of the cup, less than its radius. Default: 0.6 `radius`.
    width : float, optional
        Radius of the round block with the cup. Default: 2 `radius`.
    height : float, optional
        Height of the block below z = 0. Default: `radius`.
    symmetric : bool
        Only the quarter with x >= 0 and y >= 0.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies. Both have a vertex at the origin if `symmetric`.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive, or the block does not hold the cup.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``ball``              z <= `radius`, inside the ball
    ``cup``               the block, -`height` <= z <= `depth`, outside the cup

    ``ball_top``          z = `radius`
    ``ball_surface``      the ball
    ``cup_surface``       the cup, a sphere about (0, 0, `radius` + `clearance`)
    ``cup_rim``           z = `depth`
    ``cup_side``          r = `width`
    ``cup_bottom``        z = -`height`
    ``cut_x``             x = 0, both bodies (only if `symmetric`)
    ``cut_y``             y = 0, both bodies (only if `symmetric`)
    ====================  ==================================================
    """
    radius, clearance = positive("radius", radius), positive("clearance", clearance)
    bore = radius + clearance
    depth = 0.6 * radius if depth is None else positive("depth", depth)
    if depth >= bore:
        raise ValueError(f"depth = {depth!r}: expected less than radius + clearance = {bore!r}")
    rim = math.sqrt(depth * (2 * bore - depth))
    width = 2 * radius if width is None else above("width", width, "radius of the rim", rim)
    height = radius if height is None else positive("height", height)
    part = _quarter if flag("symmetric", symmetric) else _whole
    names = ("cup_bottom", "cup_side", "cup_rim")
    block = _cylinder((0.0, 0.0, -height), Z, width, height + depth, names)
    cup = block - _ball(bore, bore, "cup_surface")
    return compound(
        body("ball", part(_ball(radius, radius, "ball_surface"), 2 * radius, radius, "ball_top")),
        body("cup", part(cup, 2 * (width + height + depth))),
    )


def cube_on_block(
    size: float = 1.0, width: float | None = None, height: float | None = None
) -> OCCGeometry:
    """A cube that stands on the middle of a square block, both about the z axis.

    Lengths are in any consistent unit.

    Parameters
    ----------
    size : float
        Of the cube, 0 <= z <= `size`.
    width : float, optional
        Of the block. Default: 2 `size`. Where it is `size` faces coincide, and their nodes match.
    height : float, optional
        Height of the block below z = 0. Default: `size`.

    Returns
    -------
    OCCGeometry
        Compound of the two bodies.

    Raises
    ------
    TypeError, ValueError
        If a length is not positive.

    Notes
    -----
    ====================  ==================================================
    body, boundary        where
    ====================  ==================================================
    ``cube``              |x|, |y| <= `size` / 2, 0 <= z <= `size`
    ``block``             |x|, |y| <= `width` / 2, -`height` <= z <= 0

    ``cube_top``          z = `size`
    ``cube_side``         |x| or |y| = `size` / 2
    ``cube_bottom``       z = 0, side of ``cube``
    ``block_top``         z = 0, side of ``block``
    ``block_side``        |x| or |y| = `width` / 2
    ``block_bottom``      z = -`height`
    ====================  ==================================================
    """
    size = positive("size", size)
    width = 2 * size if width is None else positive("width", width)
    height = size if height is None else positive("height", height)
    bodies = []
    for name, half, ends in (("cube", size / 2, (0.0, size)), ("block", width / 2, (-height, 0.0))):
        shape = _box(-half, half, ends, {"z": f"{name}_bottom", "Z": f"{name}_top"})
        for face in shape.faces:
            face.name = face.name or f"{name}_side"
        bodies.append(body(name, shape))
    return compound(*bodies)


def _ball(radius: float, z: float, surface: str) -> TopoDS_Shape:
    """Ball about (0, 0, z), whose poles and seam lie where neither parts nor contact are."""
    ball = Sphere(Pnt(0, 0, z), radius)
    ball = ball.Rotate(Axis((0, 0, z), Z), 180).Rotate(Axis((0, 0, z), (1, 1, 0)), 90)
    ball.faces.name = surface
    return ball


def _cylinder(
    start: tuple[float, float, float],
    along: gp_Vec,
    radius: float,
    length: float,
    names: tuple[str, str, str],
) -> TopoDS_Shape:
    """Cylinder from `start` on, with the `names` of its first end, its side and its last end."""
    first, side, last = names
    return Cylinder(Pnt(*start), gp_Dir(along), radius, length, bottom=first, mantle=side, top=last)


def _box(low: float, high: float, ends: tuple[float, float], names: dict[str, str]) -> TopoDS_Shape:
    """Box `low` <= x, y <= `high` between two z; `names` of x, y, z low, of X, Y, Z high faces."""
    box = Box(Pnt(low, low, ends[0]), Pnt(high, high, ends[1]))
    for axis, name in names.items():
        direction = {"x": X, "y": Y, "z": Z}[axis.lower()]
        face = box.faces.Min(direction) if axis.islower() else box.faces.Max(direction)
        face.name = name
    return box


def _quarter(
    shape: TopoDS_Shape, far: float, z: float | None = None, name: str = "", above: bool = False
) -> TopoDS_Shape:
    """The part with x >= 0 and y >= 0, and below a plane at `z` with a `name`, or `above` it."""
    return shape * _half_space(0.0, far, z, name, above, {"x": "cut_x", "y": "cut_y"})


def _whole(
    shape: TopoDS_Shape, far: float, z: float | None = None, name: str = "", above: bool = False
) -> TopoDS_Shape:
    """The part below a plane at `z` with a `name`, or `above` it; all where there is none."""
    return shape if z is None else shape * _half_space(-far, far, z, name, above, {})


def _half_space(
    low: float, far: float, z: float | None, name: str, above: bool, names: dict[str, str]
) -> TopoDS_Shape:
    """Box from `low` to `far` in x and y, `above` a plane at `z` or below it."""
    if z is None:
        return _box(low, far, (-far, far), names)
    return _box(low, far, (z, far) if above else (-far, z), {**names, "z" if above else "Z": name})


def body(name: str, shape: TopoDS_Shape) -> TopoDS_Shape:
    """A solid with its name.

    Raises
    ------
    ValueError
        If the geometry kernel, which knows absolute lengths, makes no solid of so small a shape.
    """
    if len(shape.solids) != 1:
        raise ValueError(
            f'"{name}" is {len(shape.solids)} solids and not one: lengths are too small for the '
            "geometry kernel, which knows absolute ones; use a smaller unit of length"
        )
    (solid,) = shape.solids
    solid.name = name
    return solid


def compound(*bodies: TopoDS_Shape) -> OCCGeometry:
    """Geometry of solids that keep their own nodes where they touch (never glued)."""
    return OCCGeometry(Compound(list(bodies)))
