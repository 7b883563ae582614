"""Loads that may not be what was meant: that are nowhere, or too fine."""

from __future__ import annotations

import ngsolve as ng

from ..arrays import Index
from ..errors import warn
from ..problem import Problem
from .loads import known_rough_load, moment_degree, numbers
from .view import View, looked_at

FEW = 64  # elements
LOST = 1e-3  # of a load that quadrature may miss without a word


def warn_of_data(problem: Problem, mesh: ng.Mesh, order: int) -> None:
    """Warn of loads that vanish wherever they are looked at or are finer than any quadrature."""
    loads = [("force", k, F, F, mesh.Materials(k)) for k, F in problem.force.items()]
    for k, p in problem.traction.items():
        loads.append(("traction", k, p, problem.traction_vector(k), mesh.Boundaries(k)))
    for kind, name, data, load, region in loads:
        if numbers(data):
            continue
        view = View(mesh, 2 if region.VB() == ng.VOL else 1)
        if count := _zeros(load, view, view.inside(region)):
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


def _zeros(load: ng.CoefficientFunction, view: View, elements: Index) -> int:
    """Number of points at which a load that vanishes on `elements` (k,) was looked at, else 0.

    On a few of them first, which show nearly every load.
    """
    for step in (max(1, len(elements) // FEW), 1):
        values = [v for _, v, _ in looked_at(load, view, elements[::step])]
        if any(v.any() for v in values):
            return 0
    return sum(v.shape[0] * v.shape[1] for v in values)
