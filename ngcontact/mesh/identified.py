"""Faces of two solids that coincide: Netgen divides them alike where they are identified."""

from __future__ import annotations

import re
from itertools import product

import netgen.occ as occ
import numpy as np

from ..arrays import Array
from ..problem import Problem

# Distance, relative to a face, up to which two faces are one: OCC's own is 1e-7.
FACE_DISTANCE = 1e-6


def _points(face: occ.TopoDS_Shape) -> Array:
    """Points (n, 3) that distinguish faces: vertices, centres of edges, its own."""
    vertices = [vertex.p for vertex in face.vertices]
    middles = [edge.center for edge in face.edges]
    return np.array([(p.x, p.y, p.z) for p in [*vertices, *middles, face.center]])


def _coincide(one: occ.TopoDS_Shape, other: occ.TopoDS_Shape) -> bool:
    """Whether two faces have the same area and the same points."""
    size = one.mass**0.5
    if abs(one.mass - other.mass) > FACE_DISTANCE * one.mass:
        return False
    a, b = _points(one), _points(other)
    if len(a) != len(b):
        return False
    apart = np.linalg.norm(a[:, None] - b, axis=2)
    return bool(max(apart.min(axis=0).max(), apart.min(axis=1).max()) <= FACE_DISTANCE * size)


def identify_coinciding_faces(problem: Problem, shape: occ.TopoDS_Shape) -> None:
    """Let Netgen divide faces of contact pairs alike where they lie on each other.

    The shape remembers it, by a name for each two of its faces; to say it again changes nothing.
    """
    here = occ.gp_Trsf.Translation(occ.gp_Vec(0, 0, 0))
    faces = list(shape.faces)
    for contact in problem.contact:
        if contact.primary is None:
            continue
        sides = [
            {i for i, face in enumerate(faces) if re.fullmatch(pattern, face.name or "")}
            for pattern in (contact.primary, contact.secondary)
        ]
        for i, j in sorted({(min(both), max(both)) for both in product(*sides)}):
            if _coincide(faces[i], faces[j]):
                name, kind = f"ngcontact {i} {j}", occ.IdentificationType.PERIODIC
                faces[i].Identify(faces[j], name, kind, here)
