"""Curved edges: places on them, and the tractions of polynomials in x."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ....lagrange import gauss, gauss_lobatto, lagrange, lagrange_derivative
from ....problem import Problem
from .partition import Partition
from .polynomials import basis, dimension, legendre_values

GUIDE_DEGREE = 16  # of the polynomials that stand for the directions of guides
GUIDE_BONUS = 16  # quadrature order above that of polynomials, where these count
PLACES = 17  # on each edge, at which curves are looked at
BENT = 1e-12  # distance of a segment from its chord, relative, up to which it is straight


def bent_segments(boundary: BoundaryTrace) -> Index:
    """Segments (j,) of the boundary that are not straight, or not evenly parametrised."""
    curve = boundary.curve
    s = gauss_lobatto(boundary.geometry_order)[:, None]
    straight = curve[:, :1] + s * (curve[:, -1:] - curve[:, :1])
    off = np.abs(curve - straight).max(axis=(1, 2))
    return np.flatnonzero(off > BENT * boundary.lengths(np.arange(len(off))))


def turning_guides(problem: Problem, boundary: BoundaryTrace) -> Index:
    """Segments (j,) of Gamma_0 that are curved, or stand for curves: directions turn."""
    at = boundary.segments(None if problem.sliding is None else str(problem.sliding))
    if at.size == 0:
        return at
    s = gauss_lobatto(GUIDE_DEGREE)
    places = np.repeat(at, len(s)), np.tile(s, len(at))
    off = np.abs(boundary.exact_normal(*places) - boundary.normal(*places)).reshape(len(at), -1)
    turns = off.max(axis=1, initial=0.0) > BENT
    return at[turns | np.isin(at, bent_segments(boundary))]


@dataclass(frozen=True, eq=False)
class CurvedEdges:
    """Curved edges of the boundary, j of e, of polynomial curves.

    To these belong all of Gamma_0 along which its direction d turns. There tractions have the
    components along d and along v = m - (m.d) d, where m is the rigid motion nearest to a unit
    vector across d: on a circle a rotation does no work, whatever polynomials miss.

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
    guided : ndarray of bool (j,)
        Those of Gamma_0.
    directions : ndarray (j, l, 2)
        Legendre coefficients of d there.
    motions : ndarray (j, 3)
        m there: two translations, and a rotation about the first end.
    """

    edge: Index
    number: Index
    nodes: Array
    normal: Array
    guided: Mask
    directions: Array
    motions: Array


def curved_edges(problem: Problem, boundary: BoundaryTrace, partition: Partition) -> CurvedEdges:
    """The edges of all curved segments and turning guides."""
    guides = turning_guides(problem, boundary)
    bent = np.union1d(bent_segments(boundary), guides)
    edge = partition.edge_of_segment[bent]
    along = partition.along[edge]
    curve = boundary.curve[bent] / partition.length
    number = np.full(len(partition.ends), -1)
    number[edge] = np.arange(len(edge))
    side = np.where(along, boundary.side[bent], -boundary.side[bent])
    nodes = np.where(along[:, None, None], curve, curve[:, ::-1])
    guided = np.isin(bent, guides)
    directions, motions = np.zeros((len(bent), GUIDE_DEGREE + 1, 2)), np.zeros((len(bent), 3))
    if guides.size:
        some = boundary, guides, along[guided], nodes[guided]
        directions[guided], motions[guided] = _directions(*some)
    return CurvedEdges(edge, number, nodes, side, guided, directions, motions)


def _directions(
    boundary: BoundaryTrace, segments: Index, along: Mask, nodes: Array
) -> tuple[Array, Array]:
    """Directions (j, l, 2) and motions (j, 3) of `CurvedEdges` on guides."""
    t, (rule, w) = gauss_lobatto(GUIDE_DEGREE), gauss(2 * GUIDE_DEGREE)
    s = np.where(along[:, None], t, 1 - t).ravel()
    d = boundary.exact_normal(np.repeat(segments, len(t)), s).reshape(len(segments), -1, 2)
    c = np.linalg.inv(legendre_values(GUIDE_DEGREE, t)) @ d
    d = legendre_values(GUIDE_DEGREE, rule) @ c
    chord = nodes[:, -1] - nodes[:, 0]
    length = np.linalg.norm(chord, axis=1)[:, None]
    x = (lagrange(nodes.shape[1] - 1, rule) @ nodes - nodes[:, :1]) / length[:, :, None]
    arm = d[..., 1] * x[..., 0] - d[..., 0] * x[..., 1]
    A = np.sqrt(w)[:, None] * np.stack([d[..., 0], d[..., 1], arm], axis=2)
    m = np.linalg.svd(A)[2][:, -1]  # the motion of least work along d
    m = m / length ** np.array([0, 0, 1])
    at_middle = m[:, :2] + m[:, 2:] * np.column_stack([-chord[:, 1], chord[:, 0]]) / 2
    return c, m / np.linalg.norm(at_middle, axis=1)[:, None]


def guide_frames(curves: CurvedEdges, at: Index, t: Array) -> Array:
    """Rows d and v of `CurvedEdges`, (k, q, 2, 2), at `t` (k, q) of those `at` (k,) of them."""
    shape = (*t.shape, -1)
    d = legendre_values(GUIDE_DEGREE, t.ravel()).reshape(shape) @ curves.directions[at]
    d = d / np.linalg.norm(d, axis=2, keepdims=True)
    nodes, motion = curves.nodes[at], curves.motions[at]
    x = lagrange(nodes.shape[1] - 1, t.ravel()).reshape(shape) @ nodes - nodes[:, :1]
    m = motion[:, None, :2] + motion[:, None, 2:] * np.stack([-x[..., 1], x[..., 0]], axis=2)
    v = m - (m * d).sum(axis=2, keepdims=True) * d
    return np.stack([d, v], axis=2)


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
    guides = np.flatnonzero(curves.guided)
    t, w = gauss(degree * geometry + geometry + degree + (GUIDE_BONUS if guides.size else 0))
    density, _ = tractions_on_curves(partition, curves, degree, curves.edge, t)
    if guides.size:
        frames = guide_frames(curves, guides, np.broadcast_to(t, (len(guides), len(t))))
        density[guides] = frames @ density[guides]
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
        Directions of the components there, but on turning guides: d, and others do no work.
    about : tuple of ndarray (j, a, 2), (j, a)
        Centres of rotation and lengths.
    degree : int
        d, that of the curves.
    """
    centre, size = about
    number = curves.number[edges]
    guides = np.flatnonzero((number >= 0) & np.append(curves.guided, False)[number])
    t, w = gauss(2 * degree + (GUIDE_BONUS if guides.size else 0))
    places = np.broadcast_to(t, (len(edges), len(t)))
    x, _ = edge_places(partition, edges, curves, places)
    apart = (x[:, None] - centre[:, :, None]) / size[:, :, None, None]
    values = np.zeros((*apart.shape[:2], 3, *apart.shape[2:]))
    values[:, :, 0, :, 0], values[:, :, 1, :, 1] = 1.0, 1.0
    values[:, :, 2, :, 0], values[:, :, 2, :, 1] = -apart[..., 1], apart[..., 0]
    test = legendre_values(degree, t) * w[:, None]
    found = np.einsum("jfc,jaiqc,qp->jaifp", frames, values, test, optimize=True)
    if guides.size:
        turned = guide_frames(curves, number[guides], places[guides])
        turned[:, :, 1] = 0.0
        found[guides] = np.einsum("jqfc,jaiqc,qp->jaifp", turned, values[guides], test)
    return np.asarray(found)
