"""Stress: the same bodies numbered otherwise, mirrored, turned, moved far away, swapped."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import ngsolve as ng
import numpy as np

from drivers.reference.cases import (
    FIRST,
    SECOND,
    curved_lines,
    hertz_contact,
    one_transition,
    pressed_disc,
)
from drivers.stress import Outcome, solved
from drivers.stress.differences import differences
from drivers.stress.motion import Array, Motion, Scene, moved_mesh, posed, swapped
from ngcontact import Contact, Elastic, Problem, Solution, solve
from ngcontact.geometries import blocks
from ngcontact.mesh import first_mesh
from ngcontact.problem import Triangulation

SAME = 1e-9  # difference of two solutions of one problem, the figure asked for
ORDERS = (1, 4)
FAR = 1e4  # lengths of the bodies by which they are moved


def _scene(name: str, problem: Problem, maxh: float, matched: bool = True) -> Scene:
    """A problem's straight-sided mesh and the values of its supports' displacements."""
    mesh = (
        first_mesh(problem, maxh) if matched else ng.Mesh(problem.geometry.GenerateMesh(maxh=maxh))
    )
    mesh, *_ = moved_mesh(mesh, Motion("none"))
    value = np.zeros((mesh.nv, 2))
    ends = ng.IntegrationRule([(1, 0, 0), (0, 0, 0)], [1, 1])
    view = Triangulation(mesh)
    nodes, names = view.segments, np.array(mesh.GetBoundaries())[view.boundaries]
    points = mesh.MapToAllElements(ends, ng.BND).reshape(-1, 2)
    for pattern, components in problem.displacement.items():
        at = np.isin(names, pattern.split("|"))
        found = ng.CF(components)(points[at].ravel()).reshape(-1, 2)
        value[nodes[at].ravel()] = found
    return Scene(
        name=name,
        mesh=mesh,
        materials={
            body: law for body, law in problem.materials.items() if isinstance(law, Elastic)
        },
        supports=tuple(problem.displacement),
        prescribed=value,
        contact=problem.contact[0],
        sliding=None if problem.sliding is None else str(problem.sliding),
        matched=matched,
    )


def parting() -> Scene:
    """S1: blocks that part at the origin, bounded zone."""
    return _scene("S1", one_transition().problem, 0.25)


def hertz_scene() -> Scene:
    """S3: blocks with the gap x^2 / 2R as data."""
    scene = _scene("S3", hertz_contact(half_width=0.5).problem, 0.25)
    return replace(scene, contact=replace(scene.contact, gap=lambda x, y: x**2 / 10))


def disc_scene(matched: bool = True) -> Scene:
    """A polygonal disc on a block, gaps measured."""
    name = "disc on block" if matched else "disc on block, unmatched"
    scene = _scene(name, pressed_disc(), 0.15, matched)
    return replace(scene, prescribed=20 * scene.prescribed)  # several nodes in contact


def unmatched_disc() -> Scene:
    """The same on a mesh whose facing nodes do not lie opposite to each other."""
    return disc_scene(matched=False)


def graph_scene() -> Scene:
    """S8: two polygons in place of parabolas that face each other, gaps measured."""
    return _scene("S8", curved_lines().problem, 0.15)


def cornered() -> Scene:
    """Contact along a line with corners both ways, in part, under all kinds of load."""
    line = ((-1.0, 0.0), (-0.4, 0.25), (0.3, -0.2), (1.0, 0.1))
    problem = Problem(
        geometry=blocks(line=line),
        materials={"upper": FIRST, "lower": SECOND},
        displacement={"top": (0.01, -0.02 + 0.015 * ng.x), "bottom": (0, 0)},
        contact=[Contact(secondary="upper_contact", primary="lower_contact")],
    )
    return replace(
        _scene("corners", problem, 0.25),
        pressure={"upper_left|upper_right": 0.01},
        force={"lower": (0.002, -0.01)},
    )


SCENES = (parting, hertz_scene, disc_scene, unmatched_disc, graph_scene, cornered)


def _turned(degrees: float) -> Array:
    a = math.radians(degrees)
    return np.array([[math.cos(a), -math.sin(a)], [math.sin(a), math.cos(a)]])


MOTIONS = (
    Motion("numbered otherwise", seed=1),
    Motion("mirrored", turn=np.diag([-1.0, 1.0])),
    Motion("turned by 37 degrees", turn=_turned(37)),
    Motion("mirrored, turned, numbered otherwise", turn=_turned(37) @ np.diag([1, -1]), seed=2),
    # There coordinates are rounded to 1e-12 lengths, 1e-10 of the displacements: the points of
    # order 4 make that 5e-10 of the pressure (measured), just inside of what is asked.
    Motion("moved by 1e4 lengths", shift=(FAR, FAR)),
    Motion("moved by 1e4 lengths, turned", shift=(FAR, -FAR), turn=_turned(37)),
)


def compared(scene: Scene, motion: Motion, order: int, first: Solution, allowed: float) -> Outcome:
    """The moved scene against `first`, the solution of the scene as it is."""
    problem, vertex, triangle = posed(scene, motion)
    other = solve(problem, order=order)
    error = max(differences(first, other, motion, vertex, triangle).values())
    return solved(f"{scene.name}, order {order}", motion.name, other, error, allowed)


def motions(seed: int = 0) -> list[Motion]:
    """All motions, with numberings of their own for every seed."""
    return [m if m.seed is None else replace(m, seed=m.seed + 2 * seed) for m in MOTIONS]


def outcomes(seed: int = 0) -> Iterator[Outcome]:
    """Every scene at orders 1 and 4, moved in every way, and with its bodies swapped."""
    for make in SCENES:
        scene = make()
        for order in ORDERS:
            first = solve(posed(scene, Motion("as it is"))[0], order=order)
            for motion in motions(seed):
                yield compared(scene, motion, order, first, SAME)
            if scene.matched:
                yield compared(swapped(scene), Motion("bodies swapped"), order, first, SAME)
