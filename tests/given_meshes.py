"""Meshes as an import gives them: no geometry, any nodes on straight contact lines."""

import math
from itertools import pairwise

import ngsolve as ng
import numpy as np
from netgen.meshing import Element1D, Element2D, FaceDescriptor, Mesh, MeshPoint, Pnt


def mesh_of(bodies, angle=0.0):
    """Rectangles, each (name, x, y, names of bottom, right, top, left), turned by `angle`."""
    mesh, cos, sin = Mesh(dim=2), math.cos(angle), math.sin(angle)
    names = list(dict.fromkeys(name for body in bodies for name in body[3]))
    for k, (name, x, y, sides) in enumerate(bodies, start=1):
        face = mesh.Add(FaceDescriptor(surfnr=k, domin=k, bc=k))
        mesh.SetMaterial(k, name)
        p = [
            [mesh.Add(MeshPoint(Pnt(cos * u - sin * v, sin * u + cos * v, 0))) for u in x]
            for v in y
        ]
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


def two_blocks(upper, lower, angle=0.0):
    """Boundaries as of `geometries.blocks`, with nodes `upper`, `lower` on the contact lines."""
    heights = np.linspace(0, 1, 4)
    top = ("upper_contact", "upper_right", "top", "upper_left")
    base = ("bottom", "lower_right", "lower_contact", "lower_left")
    bodies = [("upper", upper, heights, top), ("lower", lower, heights - 1, base)]
    return mesh_of(bodies, angle)
