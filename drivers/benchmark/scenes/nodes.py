"""Nodes on the sides of a common mesh, for codes that are given triangles."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from drivers.benchmark.scenes.meshes import Mesh
from drivers.benchmark.scenes.plane import Numbering
from drivers.benchmark.scenes.problems import Common
from drivers.benchmark.scenes.triangles import sides, which

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def middles(common: Common, made: Mesh, ends: Indices) -> Array:
    """Places (k, 2) of the middles of all sides; those of contact lie on the curve."""
    places = made.points[ends].mean(axis=1)
    [contact] = common.problem.contact
    for name in (contact.secondary, contact.primary):
        if name is not None:
            at = which(ends, made.edges[name])
            places[at] = common.on_curve(places[at])
    return places


def segments(made: Mesh, order: int, ends: Indices) -> dict[str, Indices]:
    """Nodes (m, order + 1) of the segments of each boundary: vertices first, then sides."""
    if order == 1:
        return made.edges
    return {
        name: np.insert(pairs, 1, len(made.points) + which(ends, pairs), axis=1)
        for name, pairs in made.edges.items()
    }


def interleaved(common: Common, made: Mesh, order: int) -> tuple[Array, Indices, Numbering]:
    """Places (n, 2), nodes (ne, 3 or 6) of the triangles, and unknowns that go node by node."""
    ends, number = sides(made.triangles)
    places, cells = made.points, made.triangles
    if order == 2:
        places = np.vstack([places, middles(common, made, ends)])
        cells = np.hstack([cells, len(made.points) + number])
    unknown = np.arange(places.size).reshape(-1, 2).T
    return places, cells, Numbering(made.points, unknown, segments(made, order, ends))
