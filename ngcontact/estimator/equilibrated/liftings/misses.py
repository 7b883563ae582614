"""Where the discrete displacement misses its conditions on Gamma_u and Gamma_K, and liftings."""

from __future__ import annotations

from collections.abc import Sequence

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index
from ....fem import BoundaryTrace
from ....lagrange import gauss
from ....problem import Problem
from ..data import Discrete, Units
from .edges import (
    DEGREE,
    EdgeField,
    at_points,
    coefficients,
    derivative,
    norms,
    samples,
)

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
        Prescribed displacements that jump where boundaries meet.
    """
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
        c = coefficients(r / (units.strain * units.length))
        rule, w = gauss(2 * DEGREE + 4)
        t = np.tile(rule, (len(segments), 1))
        weight = np.tile(w, (len(segments), 1))
        fields.append(EdgeField(edge, t, weight, at_points(c, t), at_points(derivative(c), t)))
    return fields


def lifted(
    discrete: Discrete, fields: Sequence[EdgeField], others: Sequence[tuple[Index, Array]]
) -> Array:
    """Energy norms (n,) of all liftings on each triangle, sums where there are several.

    Of `fields` on Gamma_u, and of the triangles and norms in `others` (k,) on Gamma_K.
    """
    partition = discrete.partition
    total = np.zeros(len(partition.triangles))
    for field in fields:
        np.add.at(total, partition.owner[0][field.edge], norms(discrete, field))
    for triangle, norm in others:
        np.add.at(total, triangle, norm)
    return total
