"""Contact problems carried along by similarities of the plane: what must not change, does not.

`Scene` is a contact problem on one straight-sided mesh without CAD geometry, `Motion` what is done
to it, `posed` the moved problem, `differences` what its solution misses of the first one's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace

import netgen.meshing as nm
import ngsolve as ng
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from ngcontact import Contact, Elastic, Problem, Solution
from ngcontact.problem import Gap

Array = NDArray[np.float64]
Index = NDArray[np.intp]

# On the curve, or at the points, of the secondary: not the same when the bodies are swapped.
ON_SECONDARY = ("estimate", "indicators", "relative", "transitions")


@dataclass(frozen=True, eq=False)
class Scene:
    """A contact problem whose data any similarity carries along.

    Attributes
    ----------
    name : str
    mesh : ng.Mesh
        Straight-sided, without CAD geometry.
    materials : dict of Elastic
    supports : tuple of str
        Boundary patterns on which `prescribed` holds.
    prescribed : ndarray (nv, 2)
        Displacement of the vertices of the supports.
    contact : Contact
        Its gap is None or a function.
    sliding : str, optional
    matched : bool
        Whether facing nodes lie opposite to each other.
    pressure : dict of float
        Loads normal to boundaries.
    force : dict of tuple
        Loads per body and area.
    """

    name: str
    mesh: ng.Mesh
    materials: dict[str, Elastic]
    supports: tuple[str, ...]
    prescribed: Array
    contact: Contact
    sliding: str | None = None
    matched: bool = True
    pressure: dict[str, float] = field(default_factory=dict)
    force: dict[str, tuple[float, float]] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Motion:
    """x -> length (turn x + shift); moduli and loads times a factor; numbers permuted by `seed`.

    `load` multiplies displacements, gaps and loads: a linear problem's solution follows.
    """

    name: str
    turn: Array = field(default_factory=lambda: np.eye(2))
    shift: tuple[float, float] = (0.0, 0.0)
    length: float = 1.0
    modulus: float = 1.0
    load: float = 1.0
    seed: int | None = None

    def place(self, points: Array) -> Array:
        """Images (k, 2) of points."""
        return self.length * (points @ self.turn.T + self.shift)

    def back(self, points: Array) -> Array:
        """Points (k, 2) of which `points` are the images."""
        return (points / self.length - self.shift) @ self.turn


def _vertices(mesh: ng.Mesh) -> Array:
    return np.array(mesh.ngmesh.Coordinates())[:, :2]


def moved_mesh(mesh: ng.Mesh, motion: Motion) -> tuple[ng.Mesh, Index, Index]:
    """A new mesh without geometry, and the numbers there of the old vertices and triangles."""
    old = mesh.ngmesh
    triangles = old.Elements2D().NumPy()["nodes"][:, :3].astype(int) - 1
    segments = old.Elements1D().NumPy()["nodes"][:, :2].astype(int) - 1
    body, side = (x.NumPy()["index"] - 1 for x in (old.Elements2D(), old.Elements1D()))
    names = list(mesh.GetMaterials()), list(mesh.GetBoundaries())
    sizes = (len(_vertices(mesh)), len(triangles), len(segments), *map(len, names))
    if motion.seed is None:
        orders = [np.arange(size) for size in sizes]
        first = np.zeros(len(triangles), dtype=int)
    else:
        rng = np.random.default_rng(motion.seed)
        orders = [rng.permutation(size) for size in sizes]
        first = rng.integers(0, 3, len(triangles))
    points, faces, lines, *regions = orders
    triangles = triangles[np.arange(len(triangles))[:, None], (first[:, None] + np.arange(3)) % 3]
    if np.linalg.det(motion.turn) < 0:  # keeps the triangles counterclockwise
        triangles, segments = triangles[:, ::-1], segments[:, ::-1]

    new = nm.Mesh(dim=2)
    where = motion.place(_vertices(mesh))
    ids = [new.Add(nm.MeshPoint(nm.Pnt(x, y, 0))) for x, y in where[points].tolist()]
    for dim, region, labels in ((2, regions[0], names[0]), (1, regions[1], names[1])):
        for k in region:
            new.AddRegion(labels[k], dim=dim)
    number, face, line = np.argsort(points), np.argsort(regions[0]), np.argsort(regions[1])
    for k in faces:
        nodes = [ids[number[v]] for v in triangles[k]]
        new.Add(nm.Element2D(int(face[body[k]]) + 1, nodes))
    for k in lines:
        nodes = [ids[number[v]] for v in segments[k]]
        new.Add(nm.Element1D(nodes, index=int(line[side[k]]) + 1))
    return ng.Mesh(new), number, np.argsort(faces)


def _moved_contact(contact: Contact, motion: Motion) -> Contact:
    gap, direction = contact.gap, contact.direction
    if direction is not None:
        direction = tuple(motion.turn @ np.array(direction))
    if callable(gap):
        moved: Gap = lambda x, y: (  # noqa: E731
            motion.length * motion.load * gap(*motion.back(np.column_stack([x, y])).T)
        )
        return replace(contact, gap=moved, direction=direction)
    return replace(contact, direction=direction)


def posed(scene: Scene, motion: Motion) -> tuple[Problem, Index, Index]:
    """The moved problem, and the numbers there of the vertices and triangles."""
    mesh, vertex, triangle = moved_mesh(scene.mesh, motion)
    u = ng.GridFunction(ng.VectorH1(mesh, order=1))
    values = motion.length * motion.load * scene.prescribed @ motion.turn.T
    u.vec.FV().NumPy().reshape(2, -1)[:, vertex] = values.T
    stress = motion.modulus * motion.load
    problem = Problem(
        geometry=mesh,
        materials={
            body: Elastic(motion.modulus * law.E, law.nu)
            for body, law in sorted(scene.materials.items(), reverse=motion.seed is not None)
        },
        displacement=dict.fromkeys(scene.supports, u),
        sliding=scene.sliding,
        traction={name: stress * p for name, p in scene.pressure.items()},
        force={
            body: tuple(stress / motion.length * (motion.turn @ np.array(F)))
            for body, F in scene.force.items()
        },
        contact=[_moved_contact(scene.contact, motion)],
    )
    return problem, vertex, triangle


def _displacement(solution: Solution) -> Array:
    """Displacements (nv, 2) of the vertices."""
    return solution.displacement.vec.FV().NumPy().reshape(2, -1)[:, : solution.mesh.nv].T


def _sides_swapped(first: Solution, other: Solution) -> bool:
    return first.problem.contact[0].secondary != other.problem.contact[0].secondary


def _directions(solution: Solution) -> Array:
    return np.concatenate([line.direction for line in solution.discrete.lines])


def _same_points(first: Solution, other: Solution, motion: Motion) -> tuple[Index, Index]:
    """Numbers in both solutions of the contact points that are the same.

    Of swapped bodies they are so if they face each other.
    """
    origin, size = first.points[:1], np.ptp(first.points, axis=0).max()
    x = (motion.place(first.points) - motion.place(origin)) / (motion.length * size)
    y = (other.points - motion.place(origin)) / (motion.length * size)
    here, there = _directions(first) @ motion.turn.T, _directions(other)
    if _sides_swapped(first, other):
        here = -here
        if other.problem.contact[0].direction is not None:  # only the place across it counts
            x, y = (z - (z * there[0]).sum(axis=1)[:, None] * there[0] for z in (x, y))
    distance, number = cKDTree(np.column_stack([y, there])).query(np.column_stack([x, here]))
    same = np.flatnonzero(distance < 1e-6)
    return same, number[same]


def _all_compared(first: Solution, other: Solution, same: Index, number: Index) -> bool:
    """Whether only points without force are not; bodies that are not swapped miss none."""
    if not _sides_swapped(first, other):
        return len(same) == len(np.unique(number)) == len(first.points) == len(other.points)
    counts = np.count_nonzero(first.active), np.count_nonzero(other.active)
    return counts == (first.active[same].sum(), other.active[np.unique(number)].sum())


def differences(
    first: Solution, other: Solution, motion: Motion, vertex: Index, triangle: Index
) -> dict[str, float]:
    """What `other` misses of the image of `first`, each relative to the largest of its kind.

    Infinite where active sets, steps or the number of transitions differ.
    """
    same, number = _same_points(first, other, motion)
    size = motion.length * motion.load
    stress, force = motion.modulus * motion.load, motion.modulus * motion.load * motion.length
    estimate = math.sqrt(motion.modulus) * size
    sign = -1 if _sides_swapped(first, other) else 1
    length = np.ptp(first.points, axis=0).max()
    u = np.abs(_displacement(first)).max()
    gap = max(u, first.gap.max())

    def off(value: Array, image: Array, scale: float) -> float:
        return float(np.abs(value - image).max(initial=0.0) / scale)

    def right(value: bool | np.bool_) -> float:
        return 0.0 if value else math.inf

    result = {
        "points": right(_all_compared(first, other, same, number)),
        "active": right((other.active[number] == first.active[same]).all()),
        # Coordinates that are rounded otherwise, and gaps that are data, decide otherwise which
        # points are the nearest.
        "steps": right(
            other.steps == first.steps
            or np.abs(motion.shift).max() > 1
            or motion.load != 1
            or sign < 0
        ),
        "displacement": off(
            _displacement(other)[vertex] / size, _displacement(first) @ motion.turn.T, u
        ),
        "pressure": off(
            other.pressure[number] / stress, first.pressure[same], first.pressure.max()
        ),
        "gap": off(other.gap[number] / size, first.gap[same], gap),
        "force": off(
            sign * other.contact_force() / force,
            first.contact_force() @ motion.turn.T,
            float(np.linalg.norm(first.contact_force())),
        ),
        "energy": _off_energy(other.energy, first.energy * force * size),
        "estimate": abs(other.error_estimate / estimate / first.error_estimate - 1),
        # What is left where the stresses of neighbours cancel.
        "indicators": off(
            other.indicators[triangle] / estimate, first.indicators, first.energy_norm
        ),
        "relative": abs(other.relative_error_estimate / first.relative_error_estimate - 1),
    }
    result["transitions"] = _apart(first.transitions(), other.transitions(), motion, length)
    if sign < 0:  # these are taken on the curve and at the points of the secondary
        result = {name: result[name] for name in result if name not in ON_SECONDARY}
    return {name: value if value == value else math.inf for name, value in result.items()}


def _off_energy(energy: float, right: float) -> float:
    """Relative difference; energies beyond the range of numbers are 0 or infinite."""
    return 0.0 if energy == right else abs(energy / right - 1) if right else math.inf


def _apart(ends: Array, images: Array, motion: Motion, length: float) -> float:
    """Distance of the transitions `images` from those of the first solution over `length`."""
    if len(ends) != len(images):
        return math.inf
    if len(ends) == 0:
        return 0.0
    origin = motion.place(ends[:1])
    distance, _ = cKDTree(images - origin).query(motion.place(ends) - origin)
    return float(distance.max() / (motion.length * length))


def swapped(scene: Scene) -> Scene:
    """The facing side carries the contact points."""
    contact = scene.contact
    direction = None if contact.direction is None else tuple(-np.array(contact.direction))
    contact = replace(
        contact, secondary=str(contact.primary), primary=contact.secondary, direction=direction
    )
    return replace(scene, contact=contact)
