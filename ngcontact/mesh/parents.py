"""Parents of the vertices of refined meshes; NGSolve forgets them when a mesh is copied."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Integers

KEPT = "_ngcontact_parents"  # attribute of a mesh: it lives as long as the mesh


def vertex_parents(mesh: ng.Mesh) -> Integers:
    """Ends of the edges that refinement halved, (nv, 2); -1 for vertices of the first mesh.

    Both have lower numbers than the vertex itself.
    """
    kept: Integers = getattr(mesh, KEPT, np.zeros((0, 2), dtype=np.int32))
    known = len(kept)
    if known > mesh.nv:  # another mesh has been loaded into this one
        known, kept = 0, kept[:0]
    if known < mesh.nv and mesh.GetParentVertices(mesh.nv - 1)[0] < 0:  # nothing was refined here
        new = np.full((mesh.nv - known, 2), -1, dtype=np.int32)
    else:
        pairs = [mesh.GetParentVertices(v) for v in range(known, mesh.nv)]
        new = np.array(pairs, dtype=np.int32).reshape(-1, 2)
    return np.concatenate([kept, new])


def copied(mesh: ng.Mesh) -> ng.Mesh:
    """Copy that keeps the names, the geometry and the parents; not curved."""
    copy = ng.Mesh(mesh.ngmesh.Copy())
    keep_parents(copy, vertex_parents(mesh))
    return copy


def keep_parents(mesh: ng.Mesh, parents: Integers) -> None:
    """Let `vertex_parents` of a mesh that forgot them be `parents` (nv, 2)."""
    setattr(mesh, KEPT, parents)
