"""What tractions an equilibrated stress has on the edges: continuous, given, or free."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ....lagrange import gauss
from ....problem import Problem
from ....quadrature import known_rough_load, moment_degree
from .balance import ROUND_OFF, balance_of
from .curves import bent_segments, turning_guides
from .partition import Partition
from .polynomials import legendre_values

HIGHER = 4  # degrees above that of the stress up to which loads are met triangle by triangle
DATA_BONUS = 10  # quadrature order above that of the polynomials, for loads


@dataclass(frozen=True, eq=False)
class EdgeConditions:
    """Tractions on e edges: two components of k + 1 Legendre polynomials, r numbers on each.

    Attributes
    ----------
    frames : ndarray (e, 2, 2)
        Directions of the components, as rows; `CurvedEdges` has those of turning guides.
    constrained : ndarray of bool (e, r)
        Components that are continuous or given; the others are the supports'.
    soft : ndarray of bool (e, r)
        Those of them that need be met but nearly: the last ones on curves, where all of them are
        nearly dependent, as they are on straight edges.
    given : ndarray (e, 2, r)
        Loads, weighted by the hats of both ends of the edge.
    higher : ndarray (e, 2, l)
        Loads along x and y on straight edges, Legendre coefficients k to k - 1 + `HIGHER`.
    missed : ndarray (e,)
        Norm of the part of the load on straight edges that all these polynomials do not have.
    """

    frames: Array
    constrained: Mask
    soft: Mask
    given: Array
    higher: Array
    missed: Array


def edge_parameters(partition: Partition, segment: Index, s: Array) -> tuple[Index, Array]:
    """Edge (k,) and parameter (k,) on it of points `s` (k,) of segments `segment` (k,)."""
    edge = partition.edge_at(segment, s)
    return edge, partition.on_edges(edge, s)


@lru_cache
def with_hats(degree: int) -> Array:
    """Coefficients (2, k + 1, k) of Legendre polynomials times the hats of both ends."""
    t, w = gauss(2 * degree)
    high, low = legendre_values(degree, t), legendre_values(degree - 1, t)
    return np.stack([(high * (w * hat)[:, None]).T @ low for hat in (1 - t, t)])


def projected_loads(
    problem: Problem, boundary: BoundaryTrace, degree: int
) -> Iterator[tuple[Index, Array, Array]]:
    """Loads on the segments of each pattern of Gamma_tau, as polynomials.

    Yields
    ------
    segments : ndarray of int (j,)
        Of the boundary.
    coefficients : ndarray (j, 2, l)
        Along x and y, Legendre coefficients in the segment's parameter up to degree k - 1 +
        `HIGHER`, units of stress; on curves of the load per chord.
    squares : ndarray (j,)
        Means of the squares of what these miss.
    """
    rule, w = gauss(2 * degree + DATA_BONUS)
    for pattern in problem.traction:  # (3.7)
        segments, P = boundary.segments(pattern), problem.traction_vector(pattern)
        region = boundary.mesh.Boundaries(pattern)
        found = known_rough_load(
            problem.traction[pattern], P, region, moment_degree(boundary.order)
        )
        rough = np.zeros(len(boundary.region), dtype=bool) if found is None else found.rough
        smooth = segments[~rough[segments]]
        at, s = np.repeat(smooth, len(rule)), np.tile(rule, len(smooth))
        weight = np.tile(w, len(smooth))
        if found is not None:  # points that see what the usual ones may not
            at = np.append(at, np.repeat(found.cells.element, found.cells.weights.shape[1]))
            s = np.append(s, 1 - found.cells.points[..., 0])  # NGSolve's parameter
            weight = np.append(weight, found.cells.weights)
        values = legendre_values(degree - 1 + HIGHER, s)
        ds = np.linalg.norm(boundary.derivative(at, s), axis=1) / boundary.lengths(at)
        f = boundary.evaluate(P, at, s) * (ds * boundary.measure(at, s))[:, None]
        c = np.zeros((len(rough), 2, values.shape[1]))
        np.add.at(c, at, np.einsum("n,ni,nc->nci", weight, values, f))
        rest = f - np.einsum("ni,nci->nc", values, c[at])
        squares = np.zeros(len(rough))
        np.add.at(squares, at, weight * (rest**2).sum(axis=1))
        yield segments, c[segments], squares[segments]


def axis_segments(boundary: BoundaryTrace) -> Index:
    """Segments (j,) of the boundary where the body has no extent: tractions there do no work."""
    ends = boundary.curve[:, [0, -1]]
    return np.flatnonzero(boundary.model.on_axis(ends.reshape(-1, 2)).reshape(-1, 2).all(axis=1))


def edge_conditions(
    problem: Problem, boundary: BoundaryTrace, partition: Partition, degree: int, unit: float
) -> EdgeConditions:
    """The conditions of Gamma_u, Gamma_0, Gamma_tau; stresses over `unit`.

    The tractions of contact are left to be added to `given`.
    """
    e, q = len(partition.ends), degree + 1
    frames = np.tile(np.eye(2), (e, 1, 1))
    constrained = np.ones((e, 2, q), dtype=bool)
    for pattern, components in problem.displacement.items():  # (3.6)
        edges = partition.edge_of_segment[boundary.segments(pattern)]
        for axis, value in enumerate(components):
            if value is not None:
                constrained[edges, axis] = False
    if problem.sliding is not None:  # (3.8)
        segments = boundary.segments(str(problem.sliding))
        edges = partition.edge_of_segment[segments]
        normal = boundary.normal(segments, np.full(len(segments), 0.5))
        frames[edges] = np.stack([normal, np.column_stack([-normal[:, 1], normal[:, 0]])], axis=1)
        constrained[edges, 0] = False
    constrained[partition.edge_of_segment[axis_segments(boundary)]] = False
    given, higher, missed = np.zeros((e, 2, 2, q)), np.zeros((e, 2, HIGHER)), np.zeros(e)
    signs = (-1.0) ** np.arange(degree + HIGHER)
    for segments, c, squares in projected_loads(problem, boundary, degree):
        edge = partition.edge_of_segment[segments]
        c = np.where(partition.along[edge][:, None, None], c, c * signs) / unit
        c = np.einsum("kfc,kcj->kfj", frames[edge], c) * constrained[edge, :, :1]
        given[edge] += np.einsum("hij,kfj->khfi", with_hats(degree), c[..., :degree])
        higher[edge] += np.einsum("kfc,kfj->kcj", frames[edge], c[..., degree:])
        missed[edge] += np.sqrt(partition.edge_lengths[edge] * squares) / unit
    soft = np.zeros_like(constrained)
    bent = np.union1d(bent_segments(boundary), turning_guides(problem, boundary))
    curved = partition.edge_of_segment[bent]
    soft[curved, :, -1] = True
    higher[curved], missed[curved] = 0.0, 0.0
    # Triangles at an axis have no constants: what they miss but for round-off is refused.
    touching = partition.touching(balance_of(boundary.model).at_axis(partition))
    rest = np.hypot(missed, np.sqrt((higher**2).sum(axis=(1, 2)) * partition.edge_lengths))
    rest[rest <= ROUND_OFF * np.sqrt(partition.edge_lengths) * np.abs(given).max(initial=0.0)] = 0.0
    higher[touching], missed[touching] = 0.0, rest[touching]
    return EdgeConditions(
        frames=frames,
        constrained=constrained.reshape(e, -1),
        soft=soft.reshape(e, -1),
        given=given.reshape(e, 2, -1),
        higher=higher,
        missed=missed,
    )
