"""Contact problems carried along by similarities of the plane: what must not change, does not."""

import math
from dataclasses import dataclass, field, replace

import ngsolve as ng
import numpy as np
from scipy.spatial import cKDTree

from drivers.reference import cases
from drivers.stress.motion import Motion, moved_mesh
from ngcontact import Contact, Elastic, Problem
from ngcontact.geometries import blocks
from ngcontact.mesh import first_mesh
from ngcontact.problem import MeshArrays

AS_IT_IS = Motion("as it is")


@dataclass(frozen=True, eq=False)
class Scene:
    """A problem on a straight-sided mesh without geometry, with what a motion must carry along."""

    problem: Problem
    prescribed: np.ndarray  # displacement (nv, 2) of the vertices of the supports
    pressure: dict[str, float] = field(default_factory=dict)  # normal to boundaries
    force: dict[str, tuple[float, float]] = field(default_factory=dict)  # per body and area

    @property
    def contact(self) -> Contact:
        return self.problem.contact[0]


def on_its_mesh(problem: Problem, maxh: float) -> Scene:
    """The scene of a problem on its first mesh."""
    mesh, *_ = moved_mesh(first_mesh(problem, maxh), AS_IT_IS)
    value, view = np.zeros((mesh.nv, 2)), MeshArrays(mesh)
    ends = ng.IntegrationRule([(1, 0, 0), (0, 0, 0)], [1, 1])
    nodes, names = view.facets, np.array(mesh.GetBoundaries())[view.boundaries]
    points = mesh.MapToAllElements(ends, ng.BND).reshape(-1, 2)
    for pattern, components in problem.displacement.items():
        at = np.isin(names, pattern.split("|"))
        value[nodes[at].ravel()] = ng.CF(components)(points[at].ravel()).reshape(-1, 2)
    return Scene(replace(problem, geometry=mesh), value)


def parting() -> Scene:
    """S1: blocks that part at the origin, bounded zone."""
    return on_its_mesh(cases.one_transition().problem, 0.25)


def hertz_scene() -> Scene:
    """S3: blocks with the gap x^2 / 2R as data."""
    problem = cases.hertz_contact(half_width=0.5).problem
    contact = replace(problem.contact[0], gap=lambda x, y: x**2 / 10)
    return on_its_mesh(replace(problem, contact=[contact]), 0.25)


def disc_scene() -> Scene:
    """A polygonal disc on a block, gaps measured."""
    scene = on_its_mesh(cases.pressed_disc(), 0.15)
    return replace(scene, prescribed=20 * scene.prescribed)  # several nodes in contact


def cornered() -> Scene:
    """Contact along a line with corners both ways, in part, under all kinds of load."""
    down = {"top": (0.01, -0.02 + 0.015 * ng.x), "bottom": (0, 0)}
    problem = cases.touching_blocks(down, geometry=blocks(line=cases.LINE), sliding="lower_left")
    return replace(
        on_its_mesh(problem, 0.25),
        pressure={"upper_left|upper_right": 0.01},
        force={"lower": (0.002, -0.01)},
    )


def moved_contact(contact: Contact, motion: Motion) -> Contact:
    """The pair with its direction and its gap carried along."""
    gap, moved = contact.gap, {}
    if contact.direction is not None:
        moved["direction"] = tuple(motion.turn @ np.array(contact.direction))
    if callable(gap):
        moved["gap"] = lambda x, y: (
            motion.length * motion.load * gap(*motion.back(np.column_stack([x, y])).T)
        )
    return replace(contact, **moved)


def posed(scene: Scene, motion: Motion) -> tuple[Problem, np.ndarray, np.ndarray]:
    """The moved problem, and the numbers there of the vertices and triangles."""
    problem, turned = scene.problem, motion.seed is not None
    mesh, vertex, triangle = moved_mesh(problem.geometry, motion)
    u = ng.GridFunction(ng.VectorH1(mesh, order=1))
    values = motion.length * motion.load * scene.prescribed @ motion.turn.T
    u.vec.FV().NumPy().reshape(2, -1)[:, vertex] = values.T
    stress = motion.modulus * motion.load
    moved = Problem(
        geometry=mesh,
        materials={
            body: Elastic(motion.modulus * law.E, law.nu)
            for body, law in sorted(problem.materials.items(), reverse=turned)
        },
        displacement=dict.fromkeys(problem.displacement, u),
        sliding=problem.sliding,
        traction={name: stress * p for name, p in scene.pressure.items()},
        force={
            body: tuple(stress / motion.length * (motion.turn @ np.array(F)))
            for body, F in scene.force.items()
        },
        contact=[moved_contact(scene.contact, motion)],
    )
    return moved, vertex, triangle


def nodal(solution):
    """Displacements (nv, 2) of the vertices."""
    return solution.displacement.vec.FV().NumPy().reshape(2, -1)[:, : solution.mesh.nv].T


def same_points(first, other, motion):
    """Numbers in both solutions of the contact points that are the same."""
    origin, size = first.points[:1], np.ptp(first.points, axis=0).max()
    x = (motion.place(first.points) - motion.place(origin)) / (motion.length * size)
    y = (other.points - motion.place(origin)) / (motion.length * size)
    here, there = (
        np.concatenate([pair.line.direction for pair in s.pairs]) for s in (first, other)
    )
    tree = cKDTree(np.column_stack([y, there]))
    distance, number = tree.query(np.column_stack([x, here @ motion.turn.T]))
    same = np.flatnonzero(distance < 1e-6)
    return same, number[same]


def differences(first, other, motion, vertex, triangle) -> dict[str, float]:
    """What `other` misses of the image of `first`, each relative to the largest of its kind.

    Infinite where active sets or steps differ.
    """
    same, number = same_points(first, other, motion)
    complete = len(same) == len(np.unique(number)) == len(first.points) == len(other.points)
    size, modulus = motion.length * motion.load, motion.modulus
    force, root = modulus * motion.load * motion.length, math.sqrt(modulus)
    u = np.abs(nodal(first)).max()
    pushed = first.contact_force()
    # Coordinates that are rounded otherwise, and gaps that are data, decide otherwise which points
    # are the nearest.
    rounded = np.abs(motion.shift).max() > 1 or motion.load != 1
    scaled = first.energy * force * size  # beyond the range of numbers 0 or infinite

    def off(value, image, scale):
        return float(np.abs(value - image).max(initial=0.0) / scale)

    found = {
        "points": 0.0 if complete else math.inf,
        "active": 0.0 if (other.active[number] == first.active[same]).all() else math.inf,
        "steps": 0.0 if other.steps == first.steps or rounded else math.inf,
        "displacement": off(nodal(other)[vertex] / size, nodal(first) @ motion.turn.T, u),
        "pressure": off(
            other.pressure[number] / (modulus * motion.load),
            first.pressure[same],
            first.pressure.max(),
        ),
        "gap": off(other.gap[number] / size, first.gap[same], max(u, first.gap.max())),
        "force": off(other.contact_force() / force, pushed @ motion.turn.T, np.linalg.norm(pushed)),
        "reactions": max(
            off(other.reactions[name] / force, ours @ motion.turn.T, np.linalg.norm(pushed))
            for name, ours in first.reactions.items()
        ),
        "energy": 0.0 if other.energy == scaled else off(other.energy / scaled, 1.0, 1.0),
        "estimate": abs(other.error_estimate / (root * size) / first.error_estimate - 1),
        # What is left where the stresses of neighbours cancel.
        "indicators": off(
            other.indicators[triangle] / (root * size), first.indicators, first.energy_norm
        ),
    }
    return {name: value if value == value else math.inf for name, value in found.items()}
