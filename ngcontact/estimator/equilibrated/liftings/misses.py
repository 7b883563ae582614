"""Where the discrete displacement misses its conditions on Gamma_u and Gamma_0, and liftings."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ....fem import BoundaryTrace
from ....lagrange import gauss
from ....problem import Problem
from ....quadrature import features_of
from ..data import Discrete, EdgeConditions, Units, guide_frames
from .edges import (
    DEGREE,
    EdgeField,
    at_points,
    coefficients,
    derivative,
    norms,
    samples,
)
from .gaps import Gap, on_contact
from .hats import moved_norms
from .secondaries import on_secondaries
from .strips import strip_norms

COSTLY = 0.05  # lifting over constitutive part of the bound from which a better one is sought
AT_ENDS = 1e-9  # of a displacement, relative to the largest: what nodes miss but for round-off


def on_supports(
    problem: Problem,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    discrete: Discrete,
    units: Units,
) -> list[EdgeField]:
    """u_D - u_h on each boundary of Gamma_u, 0 in components that are free.

    Raises
    ------
    ValueError
        Prescribed displacements that jump, on a boundary or where two of them meet.
    """
    _refuse_steps(problem, boundary)
    partition, fields, s = discrete.partition, [], samples()
    size = float(np.abs(displacement.vec.FV().NumPy()).max(initial=0.0))
    for pattern, components in problem.displacement.items():  # (3.6)
        segments = boundary.segments(pattern)
        at, places = np.repeat(segments, len(s)), np.tile(s, len(segments))
        u = boundary.evaluate(displacement, at, places)
        r = np.zeros_like(u)
        for axis, value in enumerate(components):
            if value is not None:
                r[:, axis] = boundary.evaluate(value, at, places)[:, 0] - u[:, axis]
        r = r.reshape(len(segments), -1, 2)
        if np.abs(r[:, [0, -1]]).max(initial=0.0) > AT_ENDS * size:
            raise ValueError(
                f'the displacement prescribed on "{pattern}" differs at a vertex from the one '
                "beside it: no displacement of finite energy takes both values there"
            )
        r[:, [0, -1]] = 0.0
        edge = partition.edge_of_segment[segments]
        r = np.where(partition.along[edge][:, None, None], r, r[:, ::-1])
        fields.append(_smooth_field(edge, r / (units.strain * units.length)))
    return fields


def _refuse_steps(problem: Problem, boundary: BoundaryTrace) -> None:
    """Raise where a prescribed displacement jumps inside a boundary."""
    for one in features_of(problem, boundary.mesh):
        for x, y, _ in one.jumps.tolist():
            raise ValueError(
                f'the displacement prescribed on "{one.name}" jumps near ({x:.6g}, {y:.6g}): '
                "no displacement of finite energy does; make it continuous, or leave a gap between "
                "boundaries"
            )


def on_guides(
    problem: Problem,
    boundary: BoundaryTrace,
    displacement: ng.GridFunction,
    discrete: Discrete,
    units: Units,
) -> list[EdgeField]:
    """-(u_h.d) d on the guides along which d turns; on others u_h.d is 0.

    Raises
    ------
    ValueError
        Guides that are crossed at a vertex: by displacements prescribed beside them, or since
        their normals jump there.
    """
    if problem.sliding is None:
        return []
    name, s, curves = str(problem.sliding), samples(), discrete.curves
    every = boundary.segments(name)
    ends = np.repeat(every, 2), np.tile([0.0, 1.0], len(every))
    across = (boundary.evaluate(displacement, *ends) * boundary.exact_normal(*ends)).sum(axis=1)
    size = float(np.abs(displacement.vec.FV().NumPy()).max(initial=0.0))
    if np.abs(across).max(initial=0.0) > AT_ENDS * size:
        raise ValueError(
            f'no guaranteed bound is known where a displacement leads across the guide "{name}" at '
            "a vertex: by what is prescribed beside it, or as normals of a mesh without CAD differ"
        )
    guides = np.flatnonzero(curves.guided)
    if guides.size == 0:
        return []
    edge = curves.edge[guides]
    t = np.tile(s, (len(edge), 1))
    d = guide_frames(curves, guides, t)[:, :, 0]
    segment, along = discrete.partition.segment[edge], discrete.partition.along[edge]
    places = np.where(along[:, None], t, 1 - t).ravel()
    u = boundary.evaluate(displacement, np.repeat(segment, len(s)), places).reshape(d.shape)
    off = -(u * d).sum(axis=2) / (units.strain * units.length)
    off[:, [0, -1]] = 0.0
    return [_smooth_field(edge, off[:, :, None] * d)]


def _smooth_field(edge: Index, values: Array) -> EdgeField:
    """A field with `values` (k, d + 1, 2) at the `samples` of edges (k,), as they run."""
    c = coefficients(values)
    rule, w = gauss(2 * DEGREE + 4)
    t = np.tile(rule, (len(edge), 1))
    weight = np.tile(w, (len(edge), 1))
    return EdgeField(edge, t, weight, at_points(c, t), at_points(derivative(c), t))


def lifted(discrete: Discrete, fields: Sequence[EdgeField], moves: Array | None = None) -> Array:
    """Energy norms (ne,) of all liftings on each element, sums where there are several.

    Of `fields` on Gamma_u and Gamma_K, and of `moves` (nv, 2) of the vertices.
    """
    partition = discrete.partition
    total = np.zeros(partition.mesh.ne) if moves is None else moved_norms(discrete, moves)
    for field in fields:
        triangle = partition.owner[0][field.edge]
        np.add.at(total, partition.parent[triangle], norms(discrete, field))
    return total


def least_lifting(
    problem: Problem,
    boundary: BoundaryTrace,
    conditions: EdgeConditions,
    discrete: Discrete,
    fields: Sequence[EdgeField],
    gaps: Sequence[Gap],
    units: Units,
    square: float,
) -> Array:
    """Norms (ne,) of w: edge by edge, or of least energy where that is much beside `square`.

    That is the constitutive part of the bound, squared.
    """
    whole = [gap for gap in gaps if gap.pieces.whole]
    every = [*fields, *(field for gap in whole for field in on_contact(gap, discrete))]
    moves, others = on_secondaries(gaps, boundary, conditions, discrete)
    found = lifted(discrete, [*every, *others], moves)
    if found @ found <= COSTLY * square:
        return found
    least = strip_norms(problem, boundary, conditions, discrete, [*every, *others], moves, units)
    return least if least @ least < found @ found else found
