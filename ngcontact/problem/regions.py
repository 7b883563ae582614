"""Regions of a mesh by name: masks of boundaries and bodies, connected bodies."""

from __future__ import annotations

from collections.abc import Callable

import ngsolve as ng
import numpy as np

from .triangulation import Triangulation


def boundary_mask(mesh: ng.Mesh, pattern: str) -> np.ndarray:
    """Return which of r boundary region numbers a name or pattern selects, bool (r,).

    One name may stand on several numbers. Nothing selected is not an error here.
    """
    return _mask(mesh.Boundaries, pattern)


def body_mask(mesh: ng.Mesh, pattern: str) -> np.ndarray:
    """Return which of r material region numbers a name or pattern selects, bool (r,)."""
    return _mask(mesh.Materials, pattern)


def _mask(select: Callable[[str], ng.Region], pattern: str) -> np.ndarray:
    try:
        return np.fromiter(select(pattern).Mask(), dtype=bool)
    except RuntimeError as error:
        raise ValueError(f'"{pattern}" is no name and no regular expression: {error}') from error


def body_of_vertex(mesh: ng.Mesh) -> np.ndarray:
    """Return the number of the connected piece of the mesh each vertex belongs to, int (nv,)."""
    from scipy.sparse import csr_array  # not needed to state a problem
    from scipy.sparse.csgraph import connected_components

    nodes = Triangulation(mesh).triangles
    # Vertices first, to be numbered first, then triangles, each joined to its vertices.
    starts = np.concatenate([np.zeros(mesh.nv), 3 * np.arange(len(nodes) + 1)]).astype(np.int32)
    size = mesh.nv + len(nodes)
    graph = csr_array((np.ones(nodes.size), nodes.ravel().astype(np.int32), starts), (size, size))
    return connected_components(graph, directed=False)[1][: mesh.nv]
