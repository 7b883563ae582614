"""Meshes as an import gives them: no geometry, any nodes on straight contact lines."""

import math
from itertools import pairwise

import ngsolve as ng
import numpy as np
from netgen.meshing import Element1D, Element2D, FaceDescriptor, Mesh, MeshPoint, Pnt

UPPER = ("upper_contact", "upper_right", "top", "upper_left")
LOWER = ("bottom", "lower_right", "lower_contact", "lower_left")


def mesh_of(bodies, place=lambda x, y: (x, y)):
    """Rectangles, each (name, x, y, names of first row, right, last row, left), moved by `place`.

    One whose y falls has the mirror image of the triangles of one whose y grows.
    """
    mesh = Mesh(dim=2)
    names = list(dict.fromkeys(name for body in bodies for name in body[3]))
    for k, (name, x, y, sides) in enumerate(bodies, start=1):
        face = mesh.Add(FaceDescriptor(surfnr=k, domin=k, bc=k))
        mesh.SetMaterial(k, name)
        p = [[mesh.Add(MeshPoint(Pnt(*place(float(u), float(v)), 0))) for u in x] for v in y]
        turn = 1 if y[-1] > y[0] else -1
        for below, above in pairwise(p):
            for (a, b), (c, d) in zip(pairwise(below), pairwise(above), strict=True):
                mesh.Add(Element2D(face, [a, b, d][::turn]))
                mesh.Add(Element2D(face, [a, d, c][::turn]))
        right, left = [row[-1] for row in p], [row[0] for row in p]
        for name, line in zip(sides, (p[0], right, p[-1][::-1], left[::-1]), strict=True):
            for ends in pairwise(line):
                mesh.Add(Element1D(list(ends[::turn]), index=names.index(name) + 1))
    for k, name in enumerate(names):
        mesh.SetBCName(k, name)
    return ng.Mesh(mesh)


def two_blocks(upper, lower, angle=0.0):
    """Boundaries as of `geometries.blocks`, with nodes `upper`, `lower` on the contact lines."""
    cos, sin, y = math.cos(angle), math.sin(angle), np.linspace(0, 1, 4)
    bodies = [("upper", upper, y, UPPER), ("lower", lower, y - 1, LOWER)]
    return mesh_of(bodies, lambda x, y: (cos * x - sin * y, sin * x + cos * y))


def structured(x, y, move=lambda x, y: (x, y)):
    """Two blocks on a grid x (n,) by y (m,), y[0] = 0; `move` maps the upper one and its mirror."""

    def place(a, b):
        u, v = move(a, abs(b))
        return u, math.copysign(v, b)

    names = tuple(LOWER[k] for k in (2, 1, 0, 3))
    return mesh_of([("upper", x, y, UPPER), ("lower", x, -y, names)], place)
