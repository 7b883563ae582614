"""First meshes whose nodes on facing contact lines match, HH81 (2.3), (2.10)."""

from __future__ import annotations

import threading
from numbers import Real

import netgen.occ as occ
import ngsolve as ng
import numpy as np

from ..problem import Problem, Triangulation, triangle_sides
from .matching import Edge, divided

COARSE = 8  # elements along the largest extent of the geometry when no mesh size is given ...
FINER = 2  # ... and that many times more on a bounded zone: contact may end anywhere on it

# Lengths that OCC and Netgen serve; given meshes have no such limits. Measured with discs, blocks,
# rings and splines: meshes are as at size 1 up to 4e8, from 1e9 on Netgen ignores sizes or never
# returns. OCC merges points within 1e-7; a body of twice that has no mesh, of 2e-6 it has one.
FARTHEST = 5e8  # from the origin
SMALLEST = 1e-6  # extent

SHARED = threading.Lock()


def _require_complete(mesh: ng.Mesh, problem: Problem) -> None:
    """Raise where Netgen, which only prints a message, left a part of a body without elements."""
    view = Triangulation(mesh)
    side, rim = (
        np.sort(ends, axis=1) @ np.array([mesh.nv, 1])
        for ends in (triangle_sides(view.triangles), view.segments)
    )
    known, count = np.unique(side, return_counts=True)
    missing = np.setxor1d(known[count == 1], rim[~np.isin(rim, known[count > 1])])
    if missing.size:
        pairs = [f"contact {k} of {p.named()}" for k, p in enumerate(problem.contact)]
        free = [name for name, p in zip(pairs, problem.contact, strict=True) if not p.direction]
        right = f"if two bodies bulge towards each other give {' and '.join(free)} a direction; "
        raise ValueError(
            f"Netgen left holes in the mesh, with {missing.size} sides; {right if free else ''}"
            "choose another maxh, or name the parts of an edge that belong to several contact "
            "pairs apart"
        )


def _generated(shape: occ.TopoDS_Shape, edges: list[Edge], maxh: float) -> ng.Mesh:
    """Netgen's mesh; the geometry, which is the user's, is left as it was."""
    sizes = [edge.shape.maxh for edge in edges]
    try:
        for edge in edges:
            edge.shape.maxh = edge.maxh
            if edge.runs:
                edge.shape.partition = edge.partition()
        return ng.Mesh(occ.OCCGeometry(shape, dim=2).GenerateMesh(maxh=maxh))
    finally:
        for edge, size in zip(edges, sizes, strict=True):
            edge.shape.maxh, edge.shape.partition = size, None


def first_mesh(problem: Problem, maxh: float | None = None) -> ng.Mesh:
    """Mesh of the problem's geometry with matching nodes on facing contact lines.

    Parameters
    ----------
    problem : Problem
        A Mesh as its geometry is returned as it is.
    maxh : float, optional
        Largest element size, a length; when left out an eighth of the largest extent, half of that
        on bounded contact zones.

    Raises
    ------
    ValueError, TypeError
        `maxh` is not a positive finite number, or given for a geometry that is a Mesh; the geometry
        contains solids, or has lengths beyond what the kernel and Netgen mesh; Netgen failed to
        fill a body.
    """
    if isinstance(problem.geometry, ng.Mesh):
        if maxh is not None:
            raise ValueError(f"maxh={maxh} has no effect: the geometry is a Mesh; leave maxh out")
        return problem.geometry
    shape = problem.geometry.shape
    if shape.solids:
        raise ValueError("the geometry contains solids; bodies are faces in the plane z = 0")
    low, high = shape.bounding_box
    extent = max(high.x - low.x, high.y - low.y)
    far = max(abs(low.x), abs(low.y), abs(high.x), abs(high.y))
    if not (extent >= SMALLEST and far <= FARTHEST):
        raise ValueError(
            f"the geometry has the extent {extent:g} and reaches {far:g} from the origin: the "
            f"geometry kernel and Netgen mesh extents from {SMALLEST:g} and places up to "
            f"{FARTHEST:g}; choose another unit of length, or another origin"
        )
    finer = FINER if maxh is None else 1
    maxh = extent / COARSE if maxh is None else maxh
    if isinstance(maxh, bool) or not isinstance(maxh, Real):
        raise TypeError(f"maxh={maxh!r} is not a number; give a length like {extent / COARSE:g}")
    maxh = float(maxh)
    if not (np.isfinite(maxh) and maxh > 0):
        raise ValueError(f"maxh={maxh} must be positive and finite, like {extent / COARSE:g}")
    with SHARED:  # sizes and divisions are told to Netgen on the shape, which others may mesh, too
        edges = divided(problem, shape, maxh, maxh / finer)
        mesh = _generated(shape, edges, maxh)
    _require_complete(mesh, problem)
    return mesh
