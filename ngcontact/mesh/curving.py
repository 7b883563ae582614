"""Curved elements of a mesh, its copies, and the parents of its vertices."""

from __future__ import annotations

import ngsolve as ng
import numpy as np
from netgen.meshing import IdentificationType

from ..arrays import Array, Integers
from ..problem import KEPT, POSITION, MeshArrays
from .cad import CadEdge, cad_edges
from .faces import curved_facets

PARENTS = "_ngcontact_parents"  # attribute of a mesh: it lives as long as the mesh
# OCC's projections know absolute lengths: points within 1e-7 of the end of an arc go to that end,
# on other curves 1e-10 over the speed counts as met. On edges of extent SMALL_EDGE that changes no
# more than 1e-8 of it as long as elements keep their shape.
SMALL_EDGE = 1e-2  # extent of an edge; measured: all but arcs of circles are wrong from 2e-3
# A segment of a curved edge; measured: elements of order 4 turn over at 5e-7.
MIN_CURVED_LENGTH = 1e-6
SHORTEST_ON_SMALL = 1e-5  # ... of a smaller arc; measured: middles displaced from 5e-6, order 4
CURVE_DISTANCE = 1e-12  # of a curved boundary from its elements, relative to positions: round-off


def vertex_parents(mesh: ng.Mesh) -> Integers:
    """Ends (nv, 2) of edges that refinement halved, numbered before; -1 of first vertices."""
    kept: Integers = getattr(mesh, PARENTS, np.zeros((0, 2), dtype=np.int32))
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
    """Copy that keeps the names, the geometry, the parents and matched points; not curved."""
    copy = ng.Mesh(mesh.ngmesh.Copy())
    for one, other, number in mesh.ngmesh.GetIdentifications():  # of solids; `Copy` drops them
        copy.ngmesh.AddPointIdentification(one, other, number, IdentificationType.PERIODIC)
    keep_parents(copy, vertex_parents(mesh))
    setattr(copy, KEPT, dict(getattr(mesh, KEPT, {})))
    return copy


def keep_parents(mesh: ng.Mesh, parents: Integers) -> None:
    """Let `vertex_parents` of a mesh that forgot them be `parents` (nv, 2)."""
    setattr(mesh, PARENTS, parents)


def resolved_lengths(mesh: ng.Mesh) -> Array:
    """Length (k,) of each boundary segment over the least on its curve; inf on straight edges."""
    view = MeshArrays(mesh)
    ends, edges = view.vertices[view.facets], cad_edges(mesh)
    if not edges:
        return np.full(len(ends), np.inf)
    least = np.array([0.0 if edge.straight else _shortest(edge) for edge in edges])
    with np.errstate(divide="ignore"):
        return np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1) / least[view.boundaries]


def _shortest(edge: CadEdge) -> float:
    """Length from which OCC curves the elements at a segment of an edge."""
    return SHORTEST_ON_SMALL if edge.size < SMALL_EDGE else MIN_CURVED_LENGTH


def unresolved(mesh: ng.Mesh) -> bool:
    """Whether segments of curved elements are too short for OCC."""
    return mesh.GetCurveOrder() > 1 and bool((resolved_lengths(mesh) < 1).any())


def check_curves(mesh: ng.Mesh) -> None:
    """Raise a `ValueError` if curved edges are too small for OCC to curve elements beside them."""
    boundaries, length = MeshArrays(mesh).boundaries, resolved_lengths(mesh)
    for number, edge in enumerate(cad_edges(mesh) or []):
        shortest = float(length[boundaries == number].min(initial=np.inf))
        small = edge.size < SMALL_EDGE and not (edge.straight or edge.circle)
        if shortest < 1 or small:
            raise ValueError(
                f'the curved edge "{edge.name}" has the extent {edge.size:g} and segments of '
                f"{shortest * _shortest(edge):g}, on which the geometry kernel loses digits; "
                f"choose a smaller unit of length: curved edges of {SMALL_EDGE:g} and more may "
                f"have segments down to {MIN_CURVED_LENGTH:g}"
            )


def _straightened(mesh: ng.Mesh) -> bool:
    """Whether elements miss their own curved boundary, as after NGSolve's `Refine`."""
    off = ng.BoundaryFromVolumeCF(POSITION) - POSITION
    missed, size = (ng.Integrate(ng.InnerProduct(x, x), mesh, ng.BND) for x in (off, POSITION))
    return bool(missed > CURVE_DISTANCE**2 * size)


def curve(mesh: ng.Mesh, order: int, element: str) -> tuple[ng.Mesh, int]:
    """Mesh curved to the element's degree, and the number of elements at curved edges or faces.

    A mesh of that degree is used as it is, and so is one without an OCC geometry or without curved
    edges; otherwise, also after NGSolve's `Refine` has straightened it, the result is a copy. So it
    is of a mesh with halved edges, which `Refine` keeps among those in use: a file of the mesh has
    none, and numbers the edges otherwise.
    """
    count, degree = int(np.count_nonzero(curved_facets(mesh))), mesh.GetCurveOrder()
    if count:
        degree = order if element == "isoparametric" else order + 1  # (2.8)
    halved = ng.H1(mesh, order=2).ndof < mesh.nv + mesh.nedge
    if mesh.GetCurveOrder() == degree and not (halved or (count and _straightened(mesh))):
        return mesh, count
    copy = copied(mesh)
    copy.Curve(degree)
    return copy, count
