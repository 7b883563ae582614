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
    from scipy.sparse.csgraph import connected_components  # not needed to state a problem

    from ..triplets import from_triplets

    view = Triangulation(mesh)
    nodes, size = view.triangles, len(view.vertices)
    start, end = nodes[:, [0, 1]].ravel(), nodes[:, [1, 2]].ravel()
    graph = from_triplets(np.ones(len(start), dtype=bool), start, end, (size, size))
    return connected_components(graph, directed=False)[1]
