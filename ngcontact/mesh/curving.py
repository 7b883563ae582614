"""Curved elements: the degree an element asks for, and edges too small for it."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array
from ..problem import Triangulation
from .cad import cad_edges
from .parents import copied

# OCC's projections know absolute lengths: points within 1e-7 of the end of an arc go to that end,
# on other curves 1e-10 over the speed counts as met. On edges of extent SMALLEST that changes no
# more than 1e-8 of it as long as elements keep their shape.
SMALLEST = 1e-2  # extent of an edge; measured: all but arcs of circles are wrong from 2e-3
SHORTEST = 1e-6  # a segment of a curved edge; measured: elements of order 4 turn over at 5e-7
SHORTEST_ON_SMALL = 1e-5  # ... of a smaller arc; measured: middles displaced from 5e-6, order 4
ON_CURVE = 1e-12  # distance, relative to the geometry's size, at which an element misses its curve


def resolved_lengths(mesh: ng.Mesh) -> Array:
    """Length (k,) of each boundary segment over the least on its curve; inf on straight edges."""
    view = Triangulation(mesh)
    ends = view.vertices[view.segments]
    least = [
        0.0 if edge.straight else SHORTEST_ON_SMALL if edge.size < SMALLEST else SHORTEST
        for edge in cad_edges(mesh) or []
    ]
    if not least:
        return np.full(len(ends), np.inf)
    with np.errstate(divide="ignore"):
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / np.array(least)[view.boundaries]


def unresolved(mesh: ng.Mesh) -> bool:
    """Whether segments of curved elements are too short for OCC."""
    return mesh.GetCurveOrder() > 1 and bool((resolved_lengths(mesh) < 1).any())


def check_curves(mesh: ng.Mesh) -> None:
    """Raise if curved edges are too small for OCC to curve the elements beside them.

    Raises
    ------
    ValueError
        Names the edge and its length; another unit of length mends it.
    """
    boundaries, length = Triangulation(mesh).boundaries, resolved_lengths(mesh)
    for number, edge in enumerate(cad_edges(mesh) or []):
        if edge.straight:
            continue
        small = edge.size < SMALLEST
        limit = SHORTEST_ON_SMALL if small else SHORTEST
        shortest = float(length[boundaries == number].min(initial=np.inf))
        if shortest < 1 or (small and not edge.uniform):
            raise ValueError(
                f'the curved edge "{edge.name}" has the extent {edge.size:g} and segments of '
                f"{shortest * limit:g}, on which the geometry kernel loses digits; choose a "
                f"smaller unit of length: curved edges of {SMALLEST:g} and more may have segments "
                f"down to {SHORTEST:g}"
            )


def geometry_order(order: int, element: str) -> int:
    """Degree of the curved elements: Zlamal's (2.8) maps P_order by geometry one degree up."""
    return order if element == "isoparametric" else order + 1  # (2.8)


def _straightened(mesh: ng.Mesh) -> bool:
    """Whether elements miss their own curved boundary, as after NGSolve's `Refine`."""
    position = ng.CF((ng.x, ng.y))
    off = ng.BoundaryFromVolumeCF(position) - position
    missed, size = (ng.Integrate(ng.InnerProduct(x, x), mesh, ng.BND) for x in (off, position))
    return bool(missed > ON_CURVE**2 * size)


def curve(mesh: ng.Mesh, order: int, element: str) -> tuple[ng.Mesh, int]:
    """Mesh curved to the element's degree, and the number of elements at curved edges.

    A mesh without an OCC geometry, without curved edges, or curved to that degree already is
    used as it is; otherwise, also after `Refine` has straightened it, the result is a copy.
    """
    degree = geometry_order(order, element)
    edges = cad_edges(mesh)
    if edges is None:
        return mesh, 0
    curved = np.array([not edge.straight for edge in edges])[Triangulation(mesh).boundaries]
    count = int(np.count_nonzero(curved))
    if count == 0 or (mesh.GetCurveOrder() == degree and not _straightened(mesh)):
        return mesh, count
    copy = copied(mesh)
    copy.Curve(degree)
    return copy, count
