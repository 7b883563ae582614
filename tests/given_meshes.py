"""Meshes as an import gives them: no geometry, any nodes on straight contact lines."""

import math
from itertools import pairwise

import ngsolve as ng
import numpy as np
from netgen.meshing import Element1D, Element2D, FaceDescriptor, Mesh, MeshPoint, Pnt


def mesh_of(bodies, place=lambda x, y: (x, y)):
    """Rectangles, each (name, x, y, names of bottom, right, top, left), moved by `place`."""
    mesh = Mesh(dim=2)
    names = list(dict.fromkeys(name for body in bodies for name in body[3]))
    for k, (name, x, y, sides) in enumerate(bodies, start=1):
        face = mesh.Add(FaceDescriptor(surfnr=k, domin=k, bc=k))
        mesh.SetMaterial(k, name)
        p = [[mesh.Add(MeshPoint(Pnt(*place(float(u), float(v)), 0))) for u in x] for v in y]
        for j in range(len(y) - 1):
            for i in range(len(x) - 1):
                mesh.Add(Element2D(face, [p[j][i], p[j][i + 1], p[j + 1][i + 1]]))
                mesh.Add(Element2D(face, [p[j][i], p[j + 1][i + 1], p[j + 1][i]]))
        right, left = [row[-1] for row in p], [row[0] for row in p]
        for name, line in zip(sides, (p[0], right, p[-1][::-1], left[::-1]), strict=True):
            for ends in pairwise(line):
                mesh.Add(Element1D(list(ends), index=names.index(name) + 1))
    for k, name in enumerate(names):
        mesh.SetBCName(k, name)
    return ng.Mesh(mesh)


def _bodies(upper, lower, heights):
    top = ("upper_contact", "upper_right", "top", "upper_left")
    base = ("bottom", "lower_right", "lower_contact", "lower_left")
    return [("upper", upper, heights, top), ("lower", lower, -heights[::-1], base)]


def two_blocks(upper, lower, angle=0.0):
    """Boundaries as of `geometries.blocks`, with nodes `upper`, `lower` on the contact lines."""
    cos, sin = math.cos(angle), math.sin(angle)
    turned = lambda x, y: (cos * x - sin * y, sin * x + cos * y)  # noqa: E731
    return mesh_of(_bodies(upper, lower, np.linspace(0, 1, 4)), turned)


def structured(x, y, move=lambda x, y: (x, y)):
    """Two blocks on a grid x (n,) by y (m,), y[0] = 0; `move` maps the upper one and its mirror."""

    def place(a, b):
        u, v = move(a, abs(b))
        return u, math.copysign(v, b)

    return mesh_of(_bodies(x, x, y), place)
