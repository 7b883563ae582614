"""Scenes and meshes that several test modules use."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from netgen.occ import OCCGeometry

from drivers.reference import cases
from ngcontact.adaptivity import refined
from ngcontact.discrete import discretise
from ngcontact.fem import boundary_trace
from ngcontact.geometries import blocks
from ngcontact.linalg import coarsenings
from ngcontact.mesh import curve, first_mesh, vertex_parents

REPRODUCED = {  # cases whose solution lies in the space, at the orders of conftest.ORDERS
    "constant pressure": cases.pressure_patch,
    "linear pressure": lambda: cases.pressure_patch(p1=0.5),
    "polygonal line": cases.polygonal_patch,
}

REFINED = {  # problems whose meshes are refined: a rigid obstacle, matched nodes, two curves
    "disc": cases.disc_on_rigid_plane(),
    "block": cases.partly_opening_block(),
    "disc on block": replace(
        cases.pressed_disc(), displacement={"block_bottom": (0, 0), "disc_top": (0, -0.05)}
    ),
}


def unmatched_blocks():
    """Geometry of two blocks with a division of the upper line that the lower one has not."""
    shape = blocks().shape
    for edge in shape.edges:
        if edge.name == "upper_contact":
            edge.partition = [0.13, 0.31, 0.77]
    return OCCGeometry(shape, dim=2)


def coordinates(mesh):
    """Copy of all vertices; a view outlives no mesh."""
    return np.array(mesh.ngmesh.Coordinates())[:, :2]


def vertices(mesh, pattern):
    """Vertices (k, 2) of the boundaries of that name."""
    trace = boundary_trace(mesh, 1)
    numbers = np.unique(trace.nodes[trace.segments(pattern)])
    return coordinates(mesh)[numbers]


def near_origin(mesh, radius=0.7):
    """Elements with centres that near, (ne,)."""
    triangles = mesh.ngmesh.Elements2D().NumPy()["nodes"][:, :3].astype(int) - 1
    return np.linalg.norm(coordinates(mesh)[triangles].mean(axis=1), axis=1) < radius


def discrete(problem, order, rounds, maxh=0.5):
    """Discrete problem on a mesh that was refined so often."""
    mesh = first_mesh(problem, maxh)
    for _ in range(rounds):
        mesh = refined(problem, mesh)
    return discretise(problem, curve(mesh, order, "isoparametric")[0], order, "isoparametric")


def steps_of(problem, coarsest=100):
    """Coarser spaces of a discrete problem."""
    trace = problem.space.trace
    nodes = trace.nodes[problem.space.nodal]
    return coarsenings(problem.basis.T, vertex_parents(trace.mesh), nodes, coarsest)
