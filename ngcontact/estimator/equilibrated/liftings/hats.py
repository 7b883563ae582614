"""Hats of vertices that move, and their energy."""

from __future__ import annotations

import numpy as np

from ....arrays import Array, Index
from ....lagrange import gauss
from ....problem import Triangulation
from ..data import Discrete, edge_places
from .edges import MERIDIAN, POINTS, most_of_law, strain_of, towards


def moved_norms(discrete: Discrete, v: Array) -> Array:
    """Energy norms (ne,) of the hats of the vertices of the mesh times their moves `v` (nv, 2)."""
    partition = discrete.partition
    elements = Triangulation(partition.mesh).triangles
    moving = (v[elements] != 0).any(axis=2)
    triangle, corner = np.nonzero(moving[partition.parent])
    u = partition.within[triangle]
    hats = np.concatenate([u, 1 - u.sum(axis=2, keepdims=True)], axis=2)
    hats = hats[np.arange(len(triangle)), :, corner]
    element = partition.parent[triangle]
    norm = _hat_norms(discrete, triangle, hats, v[elements[element, corner]])
    squares = np.bincount(3 * element + corner, norm**2, minlength=elements.size)
    return np.asarray(np.sqrt(squares).reshape(elements.shape).sum(axis=1))


def _hat_norms(discrete: Discrete, triangle: Index, hats: Array, moves: Array) -> Array:
    """Energy norms (k,) of functions with values `hats` (k, 3) in corners, times `moves` (k, 2).

    On triangles `triangle` (k,), linear, on curved ones on lines from the curve to the opposite
    vertex.
    """
    if discrete.balance.extent:
        return _hats_about_axis(discrete, triangle, hats, moves)
    opposite, t, w = _from_curve(discrete, triangle, 2 * discrete.geometry + 4)
    slope, weight, _ = _hat_slopes(discrete, triangle, hats, opposite, t)
    e = strain_of(np.broadcast_to(moves[:, None], slope.shape), slope)
    C = discrete.law[triangle]
    square = np.einsum("kq,kqi,kij,kqj->k", weight * w, e, C, e, optimize=True) / 2
    return np.sqrt(square * most_of_law(discrete, triangle))


def _from_curve(discrete: Discrete, triangle: Index, order: int) -> tuple[Index, Array, Array]:
    """Vertices (k,) opposite to a curved edge or any, points (k, q) and weights (q,) on it."""
    edges = discrete.partition.edges[triangle]
    opposite = (discrete.curves.number[edges] >= 0).argmax(axis=1)
    rule, w = gauss(order)
    return opposite, np.tile(rule, (len(triangle), 1)), w


def _hat_slopes(
    discrete: Discrete, triangle: Index, hats: Array, opposite: Index, t: Array
) -> tuple[Array, Array, Array]:
    """Gradients (k, q, 2) of `hats` (k, 3), the same on lines from the edge to `opposite` (k,).

    With twice the area per parameter (k, q), and the values (k, q) on the edge.
    """
    partition, every = discrete.partition, np.arange(len(triangle))
    edge = partition.edges[triangle, opposite]
    along, inwards, weight = towards(discrete, triangle, opposite, edge, t)
    first = np.where(partition.flips[triangle, opposite], 2, 1)
    start = hats[every, (opposite + first) % 3][:, None]
    stop = hats[every, (opposite + 3 - first) % 3][:, None]
    value = (1 - t) * start + t * stop
    inner = (hats[every, opposite][:, None] - value)[:, :, None]
    return (stop - start)[:, :, None] * along + inner * inwards, weight, value


def _hats_about_axis(discrete: Discrete, triangle: Index, hats: Array, moves: Array) -> Array:
    """The norms of hats about an axis, which lie between an edge and the vertex opposite."""
    partition, balance = discrete.partition, discrete.balance
    if triangle.size == 0:
        return np.zeros(0)
    opposite, t, w = _from_curve(discrete, triangle, 2 * discrete.geometry + 2 * POINTS)
    slope, weight, value = _hat_slopes(discrete, triangle, hats, opposite, t)
    x, _ = edge_places(partition, partition.edges[triangle, opposite], discrete.curves, t)
    apex = partition.vertices[partition.triangles[triangle, opposite]]
    top = hats[np.arange(len(triangle)), opposite][:, None]
    law, e = discrete.law[triangle], np.zeros((*t.shape, 4))
    e[..., MERIDIAN] = strain_of(np.broadcast_to(moves[:, None], slope.shape), slope)
    square = np.zeros(len(triangle))
    for up, of_up in zip(*gauss(2 * POINTS), strict=True):
        place = x + up * (apex[:, None] - x)
        hat = up * top + (1 - up) * value
        e[..., 2] = moves[:, :1] * hat / place[..., 0]
        share = weight * w * (1 - up) * of_up * balance.measure(place)
        square += np.einsum("kq,kqi,kij,kqj->k", share, e, law, e, optimize=True)
    return np.sqrt(square * most_of_law(discrete, triangle))
