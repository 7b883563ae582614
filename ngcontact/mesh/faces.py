"""The exact boundary faces of an OCC geometry of solids: points, normals, facets of a mesh on them.

Netgen hands out one CAD face for each face region of a mesh, in the same order, and keeps with each
surface triangle the surface parameters (u, v) of its corners. They are exact to 1e-10, also after
refinement; Newton's method on the surface takes them to round-off.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry, TopoDS_Shape

from ..arrays import NEWTON_STEPS, Array, Index, Mask
from ..problem import MeshArrays
from .cad import cad_edges, drawn_sides

# Step on the surface, relative to the coordinates, at which Newton has arrived.
NEWTON_TOLERANCE = 1e-15
NORMAL_DIFFERENCE = 1e-12  # difference of unit normals up to which a face is plane
SAMPLES = 7  # points of a face, in both parameters, that show whether it is plane
POLE_SINE = 1e-9  # sine of the angle of both tangents, below which the surface has a pole


class CadFace:
    """One CAD face as a parametrised surface."""

    def __init__(self, face: TopoDS_Shape) -> None:
        self._surface = face.surf
        self.name = face.name or ""  # of the boundary
        self._plane: dict[tuple[float, ...], bool] = {}

    def point(self, uv: Array) -> Array:
        """Points (k, 3) at parameters `uv` (k, 2)."""
        return self._at(uv)[0]

    def _at(self, uv: Array) -> tuple[Array, Array]:
        """Points (k, 3) and both tangents (k, 3, 2) at parameters `uv` (k, 2)."""
        found = [self._surface.D1(float(u), float(v)) for u, v in uv]
        values = np.array([[(a.x, a.y, a.z) for a in one] for one in found]).reshape(-1, 3, 3)
        return values[:, 0], values[:, 1:].transpose(0, 2, 1)

    def normal_at(self, uv: Array) -> Array:
        """Unit normals (k, 3) at parameters `uv` (k, 2), on one side of the face or the other."""
        normals = [list(self._surface.Normal(float(u), float(v))) for u, v in uv]
        return np.array(normals).reshape(-1, 3)

    def plane(self, uv: Array) -> bool:
        """Whether the part between parameters `uv` (k, 2) is plane."""
        low, high = uv.min(axis=0), uv.max(axis=0)
        key = (*low, *high)
        if key not in self._plane:
            grid = np.stack(np.meshgrid(*np.linspace(low, high, SAMPLES).T), axis=-1)
            normals = self.normal_at(grid.reshape(-1, 2))
            self._plane[key] = bool(np.abs(normals - normals[0]).max() <= NORMAL_DIFFERENCE)
        return self._plane[key]

    def project(self, points: Array, uv: Array) -> Array:
        """Parameters (k, 2) of the feet of `points` (k, 3), by Newton's method from `uv` (k, 2)."""
        uv, size = uv.copy(), np.abs(points).max(initial=0.0)
        rest = np.arange(len(uv))
        for _ in range(NEWTON_STEPS):
            x, t = self._at(uv[rest])
            # At a pole one tangent vanishes: that parameter stays.
            step = (np.linalg.pinv(t, rcond=POLE_SINE) @ (points[rest] - x)[..., None])[..., 0]
            uv[rest] += step
            rest = rest[
                np.linalg.norm((t @ step[..., None])[..., 0], axis=1) > NEWTON_TOLERANCE * size
            ]
            if rest.size == 0:
                break
        return uv


@lru_cache(maxsize=1)  # for all meshes of one adaptive run
def _faces(geometry: OCCGeometry) -> list[CadFace]:
    return [CadFace(face) for face in geometry.shape.faces]


def cad_faces(mesh: ng.Mesh) -> list[CadFace] | None:
    """CAD faces by boundary region number, or None for a mesh without an OCC geometry."""
    return drawn_sides(mesh, _faces)


def _by_face(mesh: ng.Mesh, facets: Index) -> Iterator[tuple[CadFace, Index, Array, bool]]:
    """CAD faces, positions (k,) of their facets, parameters (k, 3, 2) of corners, and if plane."""
    faces, view = cad_faces(mesh) or [], MeshArrays(mesh)
    region, uv = view.boundaries, view.surface_parameters
    for number in np.unique(region[facets]) if faces else ():
        face, at = faces[number], np.flatnonzero(region[facets] == number)
        yield face, at, uv[facets[at]], face.plane(uv[region == number].reshape(-1, 2))


def curved_facets(mesh: ng.Mesh) -> Mask:
    """Facets (k,) of curved CAD faces, in the plane of curved edges."""
    if mesh.dim == 2:
        region = MeshArrays(mesh).boundaries
        bent = np.array([not edge.straight for edge in cad_edges(mesh) or ()])
        return bent[region] if bent.any() else np.zeros(len(region), dtype=bool)
    curved = np.zeros(mesh.GetNE(ng.BND), dtype=bool)
    for _, at, _, plane in _by_face(mesh, np.arange(len(curved))):
        curved[at] = not plane
    return curved


def unwrapped(uv: Array) -> Array:
    """Parameters (k, 3, 2), those `uv` (k, 3, 2) of corners of triangles without jumps at a seam.

    A jump is by a period, 2 pi, of an angle: no triangle turns by half of that.
    """
    jump = np.round((uv - uv[:, :1]) / (2 * np.pi))
    return np.where(np.abs(uv - uv[:, :1]) > np.pi, uv - 2 * np.pi * jump, uv)


def feet_on_faces(
    mesh: ng.Mesh, facets: Index, points: Array, shapes: Array
) -> Iterator[tuple[CadFace, Index, Array, bool]]:
    """CAD faces that have some of the `facets` (n,), and feet on them; none without CAD.

    With each the positions (k,) of its facets, parameters (k, 2) of the feet of their `points`
    (n, 3), beside places where the functions of degree 1 are `shapes` (n, 3), and whether it is
    plane: one pair of parameters does then.
    """
    for face, at, corners, plane in _by_face(mesh, facets):
        uv = corners[:1, 0]
        if not plane:
            # Facets share their nodes: each place once.
            size = np.abs(points[at]).max(initial=0.0) or 1.0
            rounded = np.round(points[at] / size, 13)
            _, first, back = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
            start = np.einsum("ki,kid->kd", shapes[at[first]], unwrapped(corners[first]))
            uv = face.project(points[at[first]], start)[back.ravel()]
        yield face, at, uv, plane
