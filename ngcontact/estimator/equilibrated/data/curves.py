"""Curved edges: places on them, and the tractions of polynomials in x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index
from ....fem import BoundaryTrace
from ....lagrange import gauss, gauss_lobatto, lagrange, lagrange_derivative
from .partition import Partition
from .polynomials import basis, dimension, legendre_values

PLACES = 17  # on each edge, at which curves are looked at
BENT = 1e-12  # distance of a segment from its chord, relative, up to which it is straight


def bent_segments(boundary: BoundaryTrace) -> Index:
    """Segments (j,) of the boundary that are not straight, or not evenly parametrised."""
    curve = boundary.curve
    s = gauss_lobatto(boundary.geometry_order)[:, None]
    straight = curve[:, :1] + s * (curve[:, -1:] - curve[:, :1])
    off = np.abs(curve - straight).max(axis=(1, 2))
    return np.flatnonzero(off > BENT * boundary.lengths(np.arange(len(off))))


@dataclass(frozen=True, eq=False)
class CurvedEdges:
    """Curved edges of the boundary, j of e, of polynomial curves.

    Attributes
    ----------
    edge : ndarray of int (j,)
        Their numbers.
    number : ndarray of int (e,)
        Which of them an edge is, or -1.
    nodes : ndarray (j, d + 1, 2)
        The curves in the direction of the edge at Gauss-Lobatto points, in units of length.
    normal : ndarray (j,)
        +1 where the outward normal lies to the right of that direction, else -1.
    """

    edge: Index
    number: Index
    nodes: Array
    normal: Array


def curved_edges(partition: Partition, boundary: BoundaryTrace, bent: Index) -> CurvedEdges:
    """The edges of the segments `bent` (j,)."""
    edge = partition.edge_of_segment[bent]
    along = partition.along[edge]
    curve = boundary.curve[bent] / partition.length
    number = np.full(len(partition.ends), -1)
    number[edge] = np.arange(len(edge))
    side = np.where(along, boundary.side[bent], -boundary.side[bent])
    return CurvedEdges(edge, number, np.where(along[:, None, None], curve, curve[:, ::-1]), side)


def edge_places(
    partition: Partition, edges: Index, curves: CurvedEdges, t: Array
) -> tuple[Array, Array]:
    """Places and derivatives, each (k, q, 2), at `t` (k, q) of the edges (k,), `edges` (k,)."""
    ends = partition.vertices[partition.ends[edges]]
    along = ends[:, 1] - ends[:, 0]
    x = ends[:, 0, None] + t[:, :, None] * along[:, None]
    dx = np.broadcast_to(along[:, None], x.shape).copy()
    bent = np.flatnonzero(curves.number[edges] >= 0)
    if bent.size:
        nodes = curves.nodes[curves.number[edges[bent]]]
        degree, shape = nodes.shape[1] - 1, (len(bent), t.shape[1], -1)
        flat = t[bent].ravel()
        x[bent] = lagrange(degree, flat).reshape(shape) @ nodes
        dx[bent] = lagrange_derivative(degree, flat).reshape(shape) @ nodes
    return x, dx


def tractions_on_curves(
    partition: Partition, curves: CurvedEdges, degree: int, edge: Index, t: Array
) -> tuple[Array, Array]:
    """Tractions of stresses at `t` (q,) of curved edges `edge` (j,), times ds over chord and dt.

    Returns
    -------
    density : ndarray (j, q, 2, 3 n)
        By the coefficients of (xx, yy, xy) in the triangle at the edge.
    stretch : ndarray (j, q)
        ds over the chord and dt.
    """
    triangle, _ = (x[edge] for x in partition.owner)
    places = np.broadcast_to(t, (len(triangle), len(t)))
    x, dx = edge_places(partition, edge, curves, places)
    chord = partition.edge_lengths[edge][:, None]
    n = (
        curves.normal[curves.number[edge], None, None]
        * np.stack([dx[..., 1], -dx[..., 0]], axis=-1)
        / chord[:, :, None]
    )
    origin = partition.vertices[partition.triangles[triangle, 2]]
    flat = np.einsum("kij,kqj->kqi", partition.inverses[triangle], x - origin[:, None])
    phi = basis(degree).values(flat.reshape(-1, 2)).reshape(*x.shape[:2], dimension(degree))
    zero = np.zeros_like(n[..., 0])
    by = np.stack(
        [np.stack([n[..., 0], zero, n[..., 1]], -1), np.stack([zero, n[..., 1], n[..., 0]], -1)],
        axis=2,
    )
    density = np.einsum("kqcs,kqi->kqcsi", by, phi)
    density = density.reshape(*x.shape[:2], 2, 3 * phi.shape[2])
    return density, np.linalg.norm(dx, axis=2) / chord


def curved_moments(partition: Partition, curves: CurvedEdges, degree: int, geometry: int) -> Array:
    """Tractions (j, r, 3 n) as `raw_operators` has them, of curved edges."""
    t, w = gauss(degree * geometry + geometry + degree)
    density, _ = tractions_on_curves(partition, curves, degree, curves.edge, t)
    test = legendre_values(degree, t) * w[:, None]
    moments = np.einsum("qi,kqcj->kcij", test, density, optimize=True)
    return moments.reshape(len(curves.edge), 2 * (degree + 1), density.shape[-1])


def rigid_motions_on(
    partition: Partition,
    curves: CurvedEdges,
    edges: Index,
    frames: Array,
    about: tuple[Array, Array],
    degree: int,
) -> Array:
    """Rigid motions on edges, (j, a, 3, 2, d + 1): motion, component, Legendre polynomial.

    Two translations and the rotation over a length.

    Parameters
    ----------
    partition, curves
        All edges.
    edges : ndarray of int (j,)
        The edges.
    frames : ndarray (j, 2, 2)
        Directions of the components there.
    about : tuple of ndarray (j, a, 2), (j, a)
        Centres of rotation and lengths.
    degree : int
        d, that of the curves.
    """
    centre, size = about
    t, w = gauss(2 * degree)
    x, _ = edge_places(partition, edges, curves, np.broadcast_to(t, (len(edges), len(t))))
    apart = (x[:, None] - centre[:, :, None]) / size[:, :, None, None]
    values = np.zeros((*apart.shape[:2], 3, *apart.shape[2:]))
    values[:, :, 0, :, 0], values[:, :, 1, :, 1] = 1.0, 1.0
    values[:, :, 2, :, 0], values[:, :, 2, :, 1] = -apart[..., 1], apart[..., 0]
    test = legendre_values(degree, t) * w[:, None]
    return np.einsum("jfc,jaiqc,qp->jaifp", frames, values, test, optimize=True)
