"""Where prescribed displacements jump: a property of the data, looked for once a run."""

from __future__ import annotations

from dataclasses import dataclass
from weakref import WeakKeyDictionary

import ngsolve as ng
import numpy as np

from ..arrays import Array, Index
from ..problem import Problem
from ..quadrature import looked, numbers, steps_on
from .boundary import BoundaryTrace, boundary_trace

MIDDLE = ng.IntegrationRule([(0.5, 0, 0)], [1])  # of a segment
BESIDE = 1e-9  # of a segment, how far from a jump its sides are looked at


@dataclass(frozen=True)
class Step:
    """A jump of what is prescribed on one boundary.

    Attributes
    ----------
    name : str
        The boundary, a key of `displacement`.
    axis : int
        The component.
    place : ndarray (2,)
        Where, a length.
    amount : float
        By how much, a length.
    """

    name: str
    axis: int
    place: Array
    amount: float


@dataclass(frozen=True)
class Prescribed:
    """What was seen of the prescribed displacements.

    Attributes
    ----------
    steps : list of Step
        Jumps inside boundaries.
    largest : float
        Largest size of a component, a length.
    """

    steps: list[Step]
    largest: float


SEEN: WeakKeyDictionary[Problem, Prescribed] = WeakKeyDictionary()  # of the last run of each


def look_at_prescribed(problem: Problem, mesh: ng.Mesh) -> Prescribed:
    """Look at the prescribed displacements anew, as each run does: parameters may have changed."""
    steps, largest, trace = [], 0.0, None
    for name, components in problem.displacement.items():
        first = mesh.MapToAllElements(MIDDLE, mesh.Boundaries(name))[:1]
        for axis, value in enumerate(components):
            if value is None or not len(first):
                continue
            if numbers(value):
                largest = max(largest, float(np.abs(value(first)).max()))
                continue
            trace = trace or boundary_trace(mesh, 1)  # functions alone ask for it
            found, size = _steps(trace, value, trace.segments(name), name, axis)
            steps += found
            largest = max(largest, size)
    SEEN[problem] = Prescribed(steps, largest)
    return SEEN[problem]


def prescribed(problem: Problem, mesh: ng.Mesh) -> Prescribed:
    """What the last look at a problem has shown; there is one if it is asked for first."""
    return SEEN[problem] if problem in SEEN else look_at_prescribed(problem, mesh)


def _steps(
    trace: BoundaryTrace, value: ng.CoefficientFunction, segments: Index, name: str, axis: int
) -> tuple[list[Step], float]:
    """Jumps on the `segments` (k,) of one boundary, and the largest size seen."""

    def values(segment: Index, s: Array) -> Array:
        return looked(value, trace.mesh_points(segment, s))[:, 0]

    at, s, largest = steps_on(values, segments)
    if not at.size:
        return [], largest
    low, high = (values(at, np.clip(s + side, 0.0, 1.0)) for side in (-BESIDE, BESIDE))
    places, amounts = trace.point(at, s), np.abs(high - low).tolist()
    return [Step(name, axis, *one) for one in zip(places, amounts, strict=True)], largest
