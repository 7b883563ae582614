"""Solids with names, and meshes of boxes as an import gives them: equal cubes, no geometry."""

from itertools import permutations

import ngsolve as ng
import numpy as np
from netgen.meshing import Element2D, Element3D, FaceDescriptor, Mesh, MeshPoint, Pnt
from netgen.occ import Z


def named(name, solid):
    """A solid with its name; its faces are "name_top", "name_bottom" and "name_side"."""
    solid.solids.name, solid.faces.name = name, f"{name}_side"
    solid.faces.Max(Z).name, solid.faces.Min(Z).name = f"{name}_top", f"{name}_bottom"
    return solid


SIDES = ("left", "right", "front", "back", "bottom", "top")


def boxes(*bodies, turn=None):
    """Boxes (name, low corner, high corner, divisions (3,)), their sides "name_left" and so on.

    Turned by an orthogonal matrix (3, 3), if one is given.
    """
    mesh = Mesh(dim=3)
    turn = np.eye(3) if turn is None else turn
    for k, (name, low, high, counts) in enumerate(bodies):
        low, high, n = np.array(low, float), np.array(high, float), np.array(counts)
        places = np.stack(np.meshgrid(*(np.arange(m + 1) for m in n), indexing="ij"), axis=-1)
        x = (low + (high - low) * places / n) @ turn.T
        number = np.empty(n + 1, dtype=object)
        for at in np.ndindex(*(n + 1)):
            number[at] = mesh.Add(MeshPoint(Pnt(*x[at])))
        mesh.SetMaterial(k + 1, name)
        regions = [
            mesh.Add(FaceDescriptor(surfnr=6 * k + i + 1, domin=k + 1, bc=6 * k + i + 1))
            for i in range(6)
        ]
        for at in np.ndindex(*n):
            for order in permutations(range(3)):  # Kuhn's division along the diagonal
                path = [np.array(at)]
                for axis in order:
                    path.append(path[-1] + np.eye(3, dtype=int)[axis])
                corners = [number[tuple(p)] for p in path]
                odd = np.linalg.det(np.diff(path, axis=0)) > 0
                if odd:  # Netgen's orientation
                    corners[2:] = corners[:1:-1]
                mesh.Add(Element3D(k + 1, corners))
                for skipped in range(4):
                    face = [p for i, p in enumerate(path) if i != skipped]
                    for axis in range(3):
                        for side, value in ((0, 0), (1, n[axis])):
                            if all(p[axis] == value for p in face):
                                region = regions[2 * axis + side]
                                mesh.Add(Element2D(region, [number[tuple(p)] for p in face]))
        for i, side in enumerate(SIDES):
            mesh.SetBCName(6 * k + i, f"{name}_{side}")
    return ng.Mesh(mesh)
