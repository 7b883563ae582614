"""Similarities of the plane, and meshes carried along by them."""

from __future__ import annotations

from dataclasses import dataclass, field

import netgen.meshing as nm
import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ngcontact.problem import MeshArrays

Array = NDArray[np.float64]
Index = NDArray[np.intp]


@dataclass(frozen=True, eq=False)
class Motion:
    """x -> length (turn x + shift); moduli and loads times a factor; numbers permuted by `seed`.

    `load` multiplies displacements, gaps and loads: a linear problem's solution follows.
    """

    name: str
    turn: Array = field(default_factory=lambda: np.eye(2))
    shift: tuple[float, float] = (0.0, 0.0)
    length: float = 1.0
    modulus: float = 1.0
    load: float = 1.0
    seed: int | None = None

    def place(self, points: Array) -> Array:
        """Images (k, 2) of points."""
        return self.length * (points @ self.turn.T + self.shift)

    def back(self, points: Array) -> Array:
        """Points (k, 2) of which `points` are the images."""
        return (points / self.length - self.shift) @ self.turn


def moved_mesh(mesh: ng.Mesh, motion: Motion) -> tuple[ng.Mesh, Index, Index]:
    """A new mesh without geometry, and the numbers there of the old vertices and triangles."""
    old = MeshArrays(mesh)
    triangles, segments, body, side = old.elements, old.facets, old.bodies, old.boundaries
    names = list(mesh.GetMaterials()), list(mesh.GetBoundaries())
    sizes = (len(old.vertices), len(triangles), len(segments), *map(len, names))
    if motion.seed is None:
        orders = [np.arange(size) for size in sizes]
        first = np.zeros(len(triangles), dtype=int)
    else:
        rng = np.random.default_rng(motion.seed)
        orders = [rng.permutation(size) for size in sizes]
        first = rng.integers(0, 3, len(triangles))
    points, faces, lines, *regions = orders
    triangles = triangles[np.arange(len(triangles))[:, None], (first[:, None] + np.arange(3)) % 3]
    if np.linalg.det(motion.turn) < 0:  # keeps the triangles counterclockwise
        triangles, segments = triangles[:, ::-1], segments[:, ::-1]

    new = nm.Mesh(dim=2)
    where = motion.place(old.vertices)
    ids = [new.Add(nm.MeshPoint(nm.Pnt(x, y, 0))) for x, y in where[points].tolist()]
    for dim, region, labels in ((2, regions[0], names[0]), (1, regions[1], names[1])):
        for k in region:
            new.AddRegion(labels[k], dim=dim)
    number, face, line = np.argsort(points), np.argsort(regions[0]), np.argsort(regions[1])
    for k in faces:
        nodes = [ids[number[v]] for v in triangles[k]]
        new.Add(nm.Element2D(int(face[body[k]]) + 1, nodes))
    for k in lines:
        nodes = [ids[number[v]] for v in segments[k]]
        new.Add(nm.Element1D(nodes, index=int(line[side[k]]) + 1))
    return ng.Mesh(new), number, np.argsort(faces)
