"""Elements that are refined, or are not, whatever their indicators."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ..arrays import Array, Mask
from ..contact import ContactState, ending_segments
from ..errors import warn
from ..fem import BoundaryTrace
from ..mesh import neighbours, resolved_lengths
from ..problem import Triangulation

HALVED = 2.5  # least length that halves need, whose sizes differ by a quarter at most
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


def at_limit(mesh: ng.Mesh, degree: int) -> Mask:
    """Elements (ne,) at segments of curved edges whose halves no geometry kernel resolves.

    `degree` is the one of the curves that the mesh will have.
    """
    limit = np.zeros(mesh.ne, dtype=bool)
    if degree > 1:  # straight segments have no middles to place
        view = Triangulation(mesh)
        element, _ = neighbours(view.segments, view.triangles, mesh.nv)
        limit[element[resolved_lengths(mesh) < HALVED]] = True
    return limit


def warn_of_limit(trace: BoundaryTrace, *, ends: bool) -> None:
    """Warn of the shortest segment `at_limit`, and of what follows: whether refinement `ends`."""
    shortest = int(np.argmin(resolved_lengths(trace.mesh)))
    x, y = trace.curve[shortest].mean(axis=0)
    name = trace.mesh.GetBoundaries()[trace.region[shortest]]
    what = "refinement ends here" if ends else "it is not divided any more, others are"
    warn(
        f'a segment of the curved edge "{name}" near ({x:.4g}, {y:.4g}) has the length '
        f"{trace.lengths(np.array([shortest]))[0]:.2g}, and the geometry kernel loses digits on "
        f"its halves: {what}; choose a smaller unit of length if the estimate is too large"
    )


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
