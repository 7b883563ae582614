"""Meshes that all engines share: uniform ones, and ones graded by hand around the known zone."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import ngsolve as ng
import numpy as np
from netgen.meshing import MeshingParameters
from netgen.occ import Compound, OCCGeometry, TopoDS_Shape
from numpy.typing import NDArray

from drivers.benchmark.scenes.problems import Common
from ngcontact import Problem
from ngcontact.geometries.region import body, polygon
from ngcontact.mesh import first_mesh
from ngcontact.problem import MeshArrays

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

KINDS = ("uniform", "graded")
SHAPE = np.sqrt(3) / 2  # area per node of an equilateral mesh, over the edge length squared
# Unknowns of order 1 up to which netgen makes the mesh itself: where its seconds count, and where
# only the mesh does, whose sizes regular refinement follows less well.
LARGE = {"uniform": 4_000, "graded": 10_000}
CLOSE = 0.05  # relative difference from the size asked for that ends the search for a graded mesh
FIRST = 0.5  # fineness of the first graded mesh
TRIES = 12
GRADING = 0.3  # growth of element sizes with distance, netgen's default
SAMPLES = 20_001
OBSTACLE = "obstacle"
SIDES = [[0, 1], [1, 2], [2, 0]]  # corners of a triangle that its sides join


@dataclass(frozen=True, eq=False)
class Mesh:
    """Triangles of one common problem."""

    ngmesh: object  # with its geometry; engines work on a copy
    seconds: float  # spent on it where that counts, else 0

    def copy(self) -> ng.Mesh:
        """NGSolve mesh of its own, straight-sided until it is curved."""
        return ng.Mesh(self.ngmesh.Copy())  # type: ignore[attr-defined]

    @cached_property
    def _view(self) -> MeshArrays:
        return MeshArrays(self.copy())

    @cached_property
    def points(self) -> Array:
        """Vertices (nv, 2)."""
        return self._view.vertices

    @cached_property
    def triangles(self) -> Indices:
        """Vertices (ne, 3) of the triangles, anticlockwise."""
        return self._view.elements

    @cached_property
    def bodies(self) -> dict[str, Indices]:
        """Triangles of each body."""
        names = np.array(self._view.mesh.GetMaterials())[self._view.bodies]
        return {str(name): np.flatnonzero(names == name) for name in np.unique(names)}

    @cached_property
    def edges(self) -> dict[str, Indices]:
        """Vertices (k, 2) of the segments of each boundary."""
        names, ends = np.array(self._view.mesh.GetBoundaries()), self._view.facets
        names = names[self._view.boundaries]
        return {str(name): ends[names == name] for name in np.unique(names)}

    def read(self) -> None:
        """Have the arrays ready, before a clock starts."""
        for name in ("points", "triangles", "bodies", "edges"):
            getattr(self, name)

    def unknowns(self, order: int) -> int:
        """Displacement components of all nodes of order 1 or 2, but for those of an obstacle."""
        own = [at for name, at in self.bodies.items() if name != OBSTACLE]
        corners = self.triangles[np.concatenate(own)]
        nodes = len(np.unique(corners))
        if order == 2:
            nodes += len(np.unique(np.sort(corners[:, SIDES], axis=2).reshape(-1, 2), axis=0))
        return 2 * nodes


@lru_cache
def made(common: Common, kind: str, order: int, size: int, obstacle: bool = False) -> Mesh:
    """Mesh with about `size` unknowns of order 1 or 2, "uniform" or "graded", remembered.

    With an `obstacle` it has a block under a rigid foundation's boundary, for codes that need two
    bodies.
    """
    if kind not in KINDS:
        raise ValueError(f"kind={kind!r}: expected one of {KINDS}")
    problem = _with_obstacle(common.problem) if obstacle else common.problem
    if kind == "graded":
        return Mesh(_graded(common, problem, order, size), 0.0)
    maxh = order * _spacing(common.problem.geometry, size)
    started = time.perf_counter()
    halvings = _halvings(kind, order, size)
    mesh = first_mesh(problem, maxh * 2**halvings).ngmesh
    for _ in range(halvings):
        mesh.Refine()
    return Mesh(mesh, time.perf_counter() - started)


def _with_obstacle(problem: Problem) -> Problem:
    """The problem with a thin block under y = 0, as wide as any contact may reach."""
    outline = polygon(
        [(0, 0), (0, -0.02), (0.2, -0.02), (0.2, 0)],
        [*[f"{OBSTACLE}_rest"] * 3, f"{OBSTACLE}_contact"],
    )
    shape = Compound([problem.geometry.shape, body(OBSTACLE, outline)])
    return replace(problem, geometry=OCCGeometry(shape, dim=2))


def _halvings(kind: str, order: int, size: int) -> int:
    """Regular refinements after meshing: netgen needs seconds where they need milliseconds."""
    return max(0, math.ceil(math.log(size / order**2 / LARGE[kind], 4)))


def _spacing(geometry: OCCGeometry, size: int) -> float:
    """Distance of nodes of an even mesh with `size` unknowns: n = A / (SHAPE h^2) + P / 2h."""
    area = sum(face.mass for face in geometry.shape.faces)
    half_perimeter = sum(edge.mass for edge in geometry.shape.edges) / 2
    nodes = size / 2
    root = np.sqrt(half_perimeter**2 + 4 * nodes * area / SHAPE)
    return float((half_perimeter + root) / (2 * nodes))


def _graded(common: Common, problem: Problem, order: int, size: int) -> object:
    """Netgen mesh with the problem's element sizes, scaled until it has about `size` unknowns.

    Each mesh is at most twice as fine as the one before, at whose vertices the size is given:
    netgen lets sizes grow between them, and that growth is its smooth grading.
    """
    halvings = _halvings("graded", order, size)
    mesh, c = Mesh(first_mesh(problem).ngmesh, 0.0), FIRST
    for _ in range(TRIES):
        mesh = Mesh(_sized(common, problem, mesh.points, c), 0.0)
        count = 4**halvings * mesh.unknowns(order)
        if abs(count / size - 1) <= CLOSE:
            for _ in range(halvings):
                mesh.ngmesh.Refine()  # type: ignore[attr-defined]
            return mesh.ngmesh
        c *= float(np.clip(np.sqrt(count / size), 0.5, 2.0))
    raise RuntimeError(f"no graded mesh with {size} unknowns after {TRIES} meshes; last {count}")


def _sized(common: Common, problem: Problem, points: Array, c: float) -> object:
    """Netgen mesh with the sizes of fineness `c` prescribed at `points`, facing nodes matched."""
    parameters = MeshingParameters(maxh=1.0, grading=GRADING)
    for (x, y), h in zip(points, common.mesh_size(points, c), strict=True):
        parameters.RestrictH(x, y, 0, h)
    [contact] = problem.contact
    names = [contact.secondary, contact.primary]
    facing = [e for e in problem.geometry.shape.edges if contact.primary and e.name in names]
    try:
        for edge in facing:
            edge.partition = _division(common, edge, c)
        # A new geometry, as the old one has taken over the division it was made with.
        return OCCGeometry(problem.geometry.shape, dim=2).GenerateMesh(mp=parameters)
    finally:
        for edge in facing:
            edge.partition = None


def _division(common: Common, edge: TopoDS_Shape, c: float) -> list[float]:
    """Fractions of a straight edge on y = 0 at which nodes of the wanted sizes are placed."""
    start, end = (edge.Value(t).x for t in edge.parameter_interval)
    x = np.linspace(min(start, end), max(start, end), SAMPLES)
    h = common.mesh_size(np.column_stack([x, np.zeros_like(x)]), c)
    count = np.concatenate([[0.0], np.cumsum(np.diff(x) * (1 / h[1:] + 1 / h[:-1]) / 2)])
    nodes = np.interp(np.linspace(0, count[-1], int(np.ceil(count[-1])) + 1)[1:-1], count, x)
    return sorted(((nodes - start) / (end - start)).tolist())
