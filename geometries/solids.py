"""Solids in contact: shells, balls, cylinders and blocks, cut at planes of symmetry."""

from __future__ import annotations

import math
from collections.abc import Callable

import netgen.occ as occ
from netgen.occ import OCCGeometry

SAME = 1e-6  # distance, relative to the size of a body, up to which a point lies on a surface
FAR = 8.0  # sizes of a body that a quarter of space reaches


def _named(solid: occ.TopoDS_Shape, name: str, of: dict[str, Callable[[occ.gp_Pnt], bool]]) -> None:
    """Name a solid, and its faces by the first of conditions that holds at all their vertices.

    And at a point inside each, for what no vertex tells.
    """
    solid.solids.name = name
    for face in solid.faces:
        points = [vertex.p for vertex in face.vertices]
        points += [
            edge.Value(sum(edge.parameter_interval) / 2)
            for edge in face.edges
            if edge.mass > SAME * math.sqrt(face.mass)  # a pole is an edge of no length
        ]
        face.name = next((what for what, on in of.items() if all(map(on, points))), f"{name}_side")


def _plane(axis: str, value: float, size: float) -> Callable[[occ.gp_Pnt], bool]:
    return lambda p: abs(getattr(p, axis) - value) < SAME * size


def _sphere(centre: tuple[float, float, float], radius: float) -> Callable[[occ.gp_Pnt], bool]:
    return lambda p: abs(math.dist((p.x, p.y, p.z), centre) - radius) < SAME * radius


def shells(a: float = 0.5, middle: float = 1.0, b: float = 1.5) -> OCCGeometry:
    """An octant of two spherical shells, from radius `a` to `middle` and on to `b`, lengths.

    Bodies "inner" and "outer"; boundaries "inner_contact", "outer_contact", "inner_free",
    "outer_free", and the planes of symmetry "x", "y" and "z".
    """
    octant, origin = occ.Box((0, 0, 0), (2 * b, 2 * b, 2 * b)), occ.Pnt(0, 0, 0)
    planes = {axis: _plane(axis, 0.0, b) for axis in "xyz"}
    bodies = []
    for name, low, high, contact in (("inner", a, middle, middle), ("outer", middle, b, middle)):
        body = (occ.Sphere(origin, high) - occ.Sphere(origin, low)) * octant
        free = low if contact == high else high
        spheres = {
            f"{name}_contact": _sphere((0, 0, 0), contact),
            f"{name}_free": _sphere((0, 0, 0), free),
        }
        _named(body, name, planes | spheres)
        bodies.append(body)
    return OCCGeometry(occ.Compound(bodies))
