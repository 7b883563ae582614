"""Contact problems carried along by similarities of the plane: what must not change, does not.

`Scene` is a contact problem on one straight-sided mesh without CAD geometry, `Motion` what is done
to it, `posed` the moved problem; `differences.differences` is what its solution misses.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import netgen.meshing as nm
import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ngcontact import Contact, Elastic, Problem
from ngcontact.problem import Gap, Triangulation

Array = NDArray[np.float64]
Index = NDArray[np.intp]


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
    return Triangulation(mesh).vertices


def moved_mesh(mesh: ng.Mesh, motion: Motion) -> tuple[ng.Mesh, Index, Index]:
    """A new mesh without geometry, and the numbers there of the old vertices and triangles."""
    old = Triangulation(mesh)
    triangles, segments, body, side = old.triangles, old.segments, old.bodies, old.boundaries
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


def swapped(scene: Scene) -> Scene:
    """The facing side carries the contact points."""
    contact = scene.contact
    direction = None if contact.direction is None else tuple(-np.array(contact.direction))
    contact = replace(
        contact, secondary=str(contact.primary), primary=contact.secondary, direction=direction
    )
    return replace(scene, contact=contact)
