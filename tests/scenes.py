"""Scenes and meshes that several test modules use."""

from dataclasses import replace
from itertools import pairwise

import ngsolve as ng
import numpy as np
from netgen.occ import OCCGeometry

from drivers.reference import cases
from ngcontact import Contact, Elastic, Problem
from ngcontact.adaptivity import refined
from ngcontact.discrete import discretise, first_active_set, minimise_energy
from ngcontact.fem import boundary_trace
from ngcontact.geometries import ball_on_block, blocks, cube_on_block
from ngcontact.geometries.region import body, polygon
from ngcontact.lagrange import gauss, lagrange
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


def rectangle(name, x, y, sides=None):
    """Body between x[0] and x[1], y[0] and y[1]; `sides`: bottom, right, top and left, or all.

    Their names are "name_bottom" and so on if none are given.
    """
    (a, b), (c, d) = x, y
    names = sides or [f"{name}_{side}" for side in ("bottom", "right", "top", "left")]
    names = [names] * 4 if isinstance(names, str) else names
    return body(name, polygon([(a, c), (b, c), (b, d), (a, d)], names))


def pressed_cube(**changes):
    """A cube under the pressure .1 on a block that is as wide."""
    data = {
        "geometry": cube_on_block(width=1.0),
        "materials": {"cube": Elastic(E=1.0, nu=0.3), "block": Elastic(E=3.0, nu=0.2)},
        "displacement": {"block_bottom": (0, 0, 0)},
        "traction": {"cube_top": 0.1},
        "contact": [Contact("cube_bottom", "block_top", direction=(0, 0, -1))],
    }
    return Problem(**(data | changes))


def pressed_ball(depth, **changes):
    """A quarter of a ball of radius 1, pressed into a block."""
    data = {
        "geometry": ball_on_block(width=1.0, height=1.0),
        "materials": {"ball": Elastic(E=1.0, nu=0.3), "block": Elastic(E=3.0, nu=0.2)},
        "displacement": {"block_bottom": (0, 0, 0), "ball_top": (0, 0, -depth)},
        "sliding": "cut_x|cut_y",
        "contact": [Contact("ball_surface", "block_top", direction=(0, 0, -1))],
    }
    return Problem(**(data | changes))


def coordinates(mesh):
    """Copy of all vertices; a view outlives no mesh."""
    return np.array(mesh.ngmesh.Coordinates())[:, :2]


def vertices(mesh, pattern):
    """Vertices (k, 2) of the boundaries of that name."""
    trace = boundary_trace(mesh, 1)
    numbers = np.unique(trace.nodes[trace.segments(pattern)])
    return coordinates(mesh)[numbers]


def discrete(problem, order, rounds, maxh=0.5):
    """Discrete problem on a mesh that was refined so often."""
    mesh = first_mesh(problem, maxh)
    for _ in range(rounds):
        mesh = refined(problem, mesh)
    return discretise(problem, curve(mesh, order, "isoparametric")[0], order, "isoparametric")


def steps_of(problem, coarsest=100):
    """Coarser spaces of a discrete problem."""
    trace = problem.space.trace
    linear = trace.linear(problem.space.nodal)
    return coarsenings(problem.basis.T, vertex_parents(trace.mesh), linear, coarsest)


def divided(geometry, counts):
    """A geometry whose edges of these names have so many equal segments."""
    for edge in geometry.shape.edges:
        if edge.name in counts:
            n = counts[edge.name]
            edge.partition = [k / n for k in range(1, n)]
    return OCCGeometry(geometry.shape, dim=2)


def pressed(case, ratio, swap, **options):
    """A case on a geometry whose two contact lines have so many segments."""
    [pair] = case.problem.contact
    counts = dict(zip((pair.secondary, pair.primary), ratio, strict=True))
    pair = replace(pair.swapped() if swap else pair, **options)
    geometry = divided(case.problem.geometry, counts)
    return replace(case.problem, geometry=geometry, contact=[pair])


def unit_load(trace, pattern, parts):
    """Nodal forces (n,) of a unit traction on the `parts`, intervals of x, of a straight line."""
    force = np.zeros(trace.space.ndof)
    points, weights = gauss(2 * trace.order)
    for k in trace.segments(pattern):
        a, b = trace.curve[k][[0, -1], 0]
        cuts = np.unique([0.0, 1.0, *np.clip((np.ravel(parts) - a) / (b - a), 0, 1)])
        for low, high in pairwise(cuts):
            middle = a + (low + high) / 2 * (b - a)
            if any(start < middle < stop for start, stop in parts):
                s = low + (high - low) * points
                scale = weights * (high - low) * abs(b - a)
                force[trace.nodes[k]] += scale @ lagrange(trace.order, s)
    return force


def solved_with_load(problem, mesh, order, pattern, parts):
    """Discrete problem with a unit traction along y on parts of a line, and its solution."""
    d = discretise(problem, mesh, order, "isoparametric")
    load = unit_load(d.space.trace, pattern, parts)
    nodal = np.concatenate([np.zeros_like(load), load])
    program = replace(d.program, b=d.program.b + d.basis.T.T @ nodal)
    d = replace(d, program=program)
    d.systems.restart(program)
    return d, minimise_energy(d, first_active_set(d))


def distance(d, result, u):
    """From the displacement `u` in L2."""
    miss = d.displacement(result.u, d.space.right_side) - ng.CF(u)
    return np.sqrt(ng.Integrate(ng.InnerProduct(miss, miss), d.space.trace.mesh))
