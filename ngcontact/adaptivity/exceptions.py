"""Elements that are refined, or are not, whatever their indicators."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..contact import ContactState, ending_segments
from ..fem import BoundaryTrace
from ..problem import Triangulation

SETTLED = 1e-3  # radius of discs in which nothing is refined, over the extent of the mesh


def at_ends(trace: BoundaryTrace, pairs: Sequence[ContactState], share: float) -> Mask:
    """Elements (ne,) in which contact ends, larger than a `share` of their contact line."""
    marked = np.zeros(trace.mesh.ne, dtype=bool)
    for pair in pairs:
        line = pair.line
        segments = line.segments[ending_segments(line, pair.transitions)]
        extent = np.linalg.norm(np.ptp(line.position, axis=0)) if line.node.size else 0.0
        marked[trace.element[segments[trace.lengths(segments) > share * extent]]] = True
    return marked


def settled(mesh: ng.Mesh, places: Array) -> Mask:
    """Elements (ne,) that lie at `places` (k, 2) where refinement is of no use, and are small.

    All within a thousandth of the mesh's extent of one.
    """
    view = Triangulation(mesh)
    radius = SETTLED * np.ptp(view.vertices, axis=0).max()
    result = np.zeros(mesh.ne, dtype=bool)
    for place in places:
        near = np.linalg.norm(view.vertices - place, axis=1) <= radius
        result |= near[view.triangles].all(axis=1)
    return result
