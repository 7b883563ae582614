"""Where the discrete displacement misses its conditions on Gamma_u and Gamma_K, and liftings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ....lagrange import gauss
from ....problem import Problem
from ..pressures import Zone, ZonePoints, zone_points
from ..stresses import Discrete, Units
from .edges import (
    DEGREE,
    EdgeField,
    at_points,
    coefficients,
    derivative,
    norms,
    panels,
    samples,
)

AT_ENDS = 1e-9  # of a displacement, relative to the largest: what nodes miss but for round-off


@dataclass(frozen=True, eq=False)
class Gap:
    """The gap of one pair on its k segments that face the other body, as polynomials.

    Attributes
    ----------
    local : ndarray of int (k,)
        Segments, counted in the pair's line.
    points : ZonePoints
        d + 1 places on each.
    values : ndarray (k, d + 1)
        Legendre coefficients of the gap, over strain times length.
    """

    local: Index
    points: ZonePoints
    values: Array


def gap_of(zone: Zone, boundary: BoundaryTrace, displacement: ng.GridFunction, units: Units) -> Gap:
    """The gap after deformation."""
    local = np.flatnonzero(zone.state.line.faces)
    s = samples()
    at, s = np.repeat(local, len(s)), np.tile(s, len(local))
    scales = units.strain, units.length
    points = zone_points(zone.state, boundary, displacement, scales, at, s, np.ones(len(s)))
    return Gap(local, points, coefficients(points.gap.reshape(len(local), -1)))


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


def _facing(gap: Gap) -> tuple[Index, Mask]:
    """Segment (k,) that each one faces, and whether both run the same way, (k,)."""
    shape = len(gap.local), -1
    facing, s = gap.points.facing.reshape(shape), gap.points.facing_s.reshape(shape)
    inside = DEGREE // 2
    return facing[:, inside], s[:, inside + 1] > s[:, inside - 1]


def on_contact(zone: Zone, gap: Gap, discrete: Discrete) -> list[tuple[Index, Array]]:
    """Triangles (k,) and energy norms (k,) of liftings after which K is met, on both bodies.

    Segments in full contact, and bilateral ones, close; others keep their distance.
    """
    partition = discrete.partition
    closed = zone.full[gap.local] | zone.state.line.contact.bilateral
    sampled = gap.points.gap.reshape(len(gap.local), -1)
    misses = np.where(closed, np.abs(sampled).max(axis=1), -sampled.min(axis=1))
    at = np.flatnonzero(misses > 0)
    if at.size == 0:
        return []
    c = gap.values[at]
    t, weight = panels(np.where(closed[at, None], 0.0, c))
    value, slope = at_points(c, t), at_points(derivative(c), t)
    active = closed[at, None] | (value < 0)
    r, dr = -value * active, -slope * active
    direction = gap.points.direction.reshape(len(gap.local), -1, 2)[at, 0][:, None]
    segments = zone.state.line.segments[gap.local[at]]
    facing, same = _facing(gap)
    sides = [(segments, np.ones(len(at), dtype=bool))]
    if zone.state.line.contact.primary is not None:
        sides.append((facing[at], same[at]))
    found = []
    for segment, forwards in sides:
        edge = partition.edge_of_segment[segment]
        along = (partition.along[edge] == forwards)[:, None]
        field = EdgeField(
            edge=edge,
            t=np.where(along, t, 1 - t),
            weight=weight,
            value=r[:, :, None] * direction,
            slope=np.where(along, dr, -dr)[:, :, None] * direction,
        )
        found.append((partition.owner[0][edge], norms(partition, discrete.law, field)))
    if len(found) == 1:
        return found
    (one, a), (other, b) = found  # shared by compliance
    whole = a**2 + b**2
    whole[whole == 0] = 1.0
    return [(one, a * b**2 / whole), (other, b * a**2 / whole)]


def lifted(
    discrete: Discrete, fields: Sequence[EdgeField], others: Sequence[tuple[Index, Array]]
) -> Array:
    """Energy norms (n,) of all liftings on each triangle, sums where there are several.

    Of `fields` on Gamma_u, and of the triangles and norms in `others` (k,) on Gamma_K.
    """
    partition = discrete.partition
    total = np.zeros(len(partition.triangles))
    for field in fields:
        np.add.at(total, partition.owner[0][field.edge], norms(partition, discrete.law, field))
    for triangle, norm in others:
        np.add.at(total, triangle, norm)
    return total
