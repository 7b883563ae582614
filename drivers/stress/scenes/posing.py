"""A scene as a problem of the package: geometry, meshes, data."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from netgen.occ import ArcOfCircle, Edge, Face, OCCGeometry, Pnt

from drivers.stress.scenes.scene import Affine, Array, Pair, Scene, Side
from ngcontact import Contact, ContactWarning, Elastic, Problem, Solution, adapt, solve
from ngcontact.geometries.region import body, compound, segment


def _edge(side: Side) -> Edge:
    if side.centre is None:
        return segment(side.start, side.end)
    middle = side.point(np.array([side.length / 2]))[0]
    ends = [Pnt(float(x), float(y), 0) for x, y in (side.start, middle, side.end)]
    return ArcOfCircle(*ends)


def geometry(scene: Scene, factor: float = 1.0) -> OCCGeometry:
    """CAD geometry; bodies with sizes of their own where the scene has them, times `factor`."""
    faces: list[Face] = []
    for b in scene.bodies:
        loops = [[(s.name, _edge(s)) for s in part] for part in (b.sides, b.inner) if part]
        face = body(b.name, *loops)
        if scene.finer is not None:
            face.maxh = factor * scene.maxh * scene.finer[b.name]
            for edge in face.edges:
                edge.maxh = face.maxh
        faces.append(face)
    return compound(*faces)


def netgen_mesh(scene: Scene, factor: float = 1.0) -> ng.Mesh:
    """Netgen's own mesh, which knows of no pairs; `factor` times the sizes of the scene."""
    return ng.Mesh(geometry(scene, factor).GenerateMesh(maxh=factor * scene.maxh))


def field_of(a: Affine) -> ng.CoefficientFunction:
    """An affine number or vector as a CoefficientFunction."""
    if a.value.ndim == 0:
        gx, gy = a.slope
        return ng.CF(float(a.value) + float(gx) * ng.x + float(gy) * ng.y)
    return ng.CF(tuple(field_of(Affine(v, row)) for v, row in zip(a.value, a.slope, strict=True)))


def _contact(pair: Pair) -> Contact:
    gap = pair.gap
    return Contact(
        secondary="|".join(pair.secondary),
        primary="|".join(pair.primary) or None,
        direction=pair.direction,
        gap=None if gap is None else lambda x, y: gap(np.column_stack([x, y])),
    )


def posed(scene: Scene, shape: OCCGeometry | ng.Mesh | None = None) -> Problem:
    """The problem on the scene's geometry, or on `shape`."""
    return Problem(
        geometry=geometry(scene) if shape is None else shape,
        materials={b.name: Elastic(b.E, b.nu) for b in scene.bodies},
        displacement={name: field_of(u) for name, u in scene.clamped.items()},
        sliding=list(scene.sliding) or None,
        traction={name: field_of(p) for name, p in scene.pressure.items()},
        force=dict(scene.weight),
        contact=[_contact(pair) for pair in scene.pairs],
        model=scene.model,
    )


@dataclass(frozen=True)
class Answer:
    """What the package says to a scene."""

    solution: Solution | None  # None where it refused
    warned: tuple[str, ...] = ()  # messages of its own class of warnings
    refusal: Exception | None = None


def _heard(run: Callable[[], Solution]) -> Answer:
    """What a run returns or raises, and its warnings."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        solution, refusal = None, None
        try:
            solution = run()
            solution.error_estimate  # noqa: B018  # the estimate may warn, too
        except Exception as error:  # whatever it is, it is what the user would see
            solution, refusal = None, error
    told = tuple(str(w.message) for w in caught if issubclass(w.category, ContactWarning))
    return Answer(solution, told, refusal)


def answer(scene: Scene, mesh: ng.Mesh | None = None, order: int | None = None) -> Answer:
    """Solve a scene, on `mesh` if it is given."""
    degree = order or scene.order
    if mesh is not None:
        return _heard(lambda: solve(posed(scene, mesh), order=degree))
    if scene.finer is not None:
        return _heard(lambda: solve(posed(scene), mesh=netgen_mesh(scene), order=degree))
    return _heard(lambda: solve(posed(scene), maxh=scene.maxh, order=degree))


def adapted(scene: Scene, max_dofs: int) -> Answer:
    """The last level of an adaptive run from the scene's mesh."""

    def run() -> Solution:
        shape = netgen_mesh(scene) if scene.finer is not None else None
        maxh = None if shape is not None else scene.maxh
        problem = posed(scene, shape)
        *_, last = adapt(problem, maxh=maxh, order=scene.order, max_dofs=max_dofs)
        return last

    return _heard(run)


def values_at(function: ng.CoefficientFunction, points: object) -> Array:
    """Values (k, dim) at mapped points."""
    return np.asarray(function(points), dtype=float).reshape(-1, function.dim)
