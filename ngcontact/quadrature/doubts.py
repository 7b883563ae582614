"""Data that may not be what was meant: loads that are nowhere, supports that contradict."""

from __future__ import annotations

import ngsolve as ng
import numpy as np

from ..arrays import Array
from ..errors import warn
from ..problem import Problem, Triangulation
from .loads import known_rough_load, moment_degree, numbers
from .view import View, looked_at, mesh_points

LOST = 1e-3  # of a load that quadrature may miss without a word
APART = 1e-6  # values of two supports at one corner, relative to the largest, that are two values


def warn_of_data(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of loads that vanish wherever they are looked at or are finer than any quadrature.

    And of two values that supports prescribe at one corner, of which no displacement has both.
    """
    loads = [("force", k, F, F, mesh.Materials(k)) for k, F in problem.force.items()]
    for k, p in problem.traction.items():
        loads.append(("traction", k, p, problem.traction_vector(k), mesh.Boundaries(k)))
    for kind, name, data, load, region in loads:
        if numbers(data):
            continue
        view = View(mesh, 2 if region.VB() == ng.VOL else 1)
        values = [v for _, v, _ in looked_at(load, view, view.inside(region))]
        if not any(v.any() for v in values):
            count = sum(v.shape[0] * v.shape[1] for v in values)
            warn(
                f'{kind} "{name}" is zero at all {count} points at which it was looked at: if it '
                "acts on a smaller part, make that a boundary or a body of its own"
            )
            continue
        found = known_rough_load(data, load, region, moment_degree(order))
        if found is not None and found.missed.sum() > LOST * found.total:
            warn(
                f'{kind} "{name}" is finer than any quadrature: up to '
                f"{found.missed.sum() / found.total:.1%} of it may be missed; give a smoother load"
            )
    _warn_of_corners(problem, mesh)


def _warn_of_corners(problem: Problem, mesh: ng.Mesh) -> None:
    """Warn of the first corner of each two supports at which one component has two values."""
    view, ends = Triangulation(mesh), np.array([[[1.0]], [[0.0]]])
    seen: dict[tuple[int, int], tuple[str, float]] = {}
    told: set[tuple[str, str]] = set()
    for pattern, components in problem.displacement.items():
        segments = View(mesh, 1).inside(mesh.Boundaries(pattern))
        for axis, value in enumerate(components):
            if value is None or not len(segments):
                continue
            for side, s in enumerate(ends):
                points = mesh_points(mesh, segments, np.tile(s, (len(segments), 1, 1)))
                here: Array = np.asarray(value(points.ravel())).ravel()
                for vertex, u in zip(view.segments[segments, side].tolist(), here, strict=True):
                    name, other = seen.setdefault((vertex, axis), (pattern, float(u)))
                    size = APART * max(abs(other), abs(float(u)))
                    if abs(u - other) > size and name != pattern and (name, pattern) not in told:
                        told.add((name, pattern))
                        x, y = view.vertices[vertex]
                        warn(
                            f'displacement "{name}" and "{pattern}" prescribe {other:.6g} and '
                            f"{float(u):.6g} along {'xy'[axis]} at their corner ({x:.6g}, {y:.6g}):"
                            " the energy is infinite and no mesh resolves it; make them equal there"
                        )
