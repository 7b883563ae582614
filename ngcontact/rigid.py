"""Rigid motions that supports and active contact rows leave free. No NGSolve beyond names."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .check import body_of_vertex
from .discrete import Discrete

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

FREE = 1e-8  # singular value, relative to the largest, below which a motion meets no resistance


def _bodies(discrete: Discrete) -> NDArray[np.intp]:
    """Number of the connected body of each boundary segment, from 0 without gaps."""
    trace = discrete.space.trace
    piece = body_of_vertex(trace.mesh)[trace.nodes[:, 0]]
    return np.unique(piece, return_inverse=True)[1]


def _motions(discrete: Discrete) -> tuple[Array, Array, Array]:
    """Rigid motions at the boundary nodes.

    Returns
    -------
    values : ndarray (2n, 3b)
        For each of b bodies the translations along x and y and the rotation about its middle,
        scaled to displacements of size 1; x components first, zero elsewhere.
    middle : ndarray (b, 2)
    size : ndarray (b,)
    """
    trace = discrete.space.trace
    n = discrete.space.basis.shape[1] // 2
    bodies = _bodies(discrete)
    count = int(bodies.max()) + 1
    body = np.repeat(bodies, trace.order + 1)
    segment, s = trace.at_nodes(np.arange(len(trace.region)))
    node, x = trace.nodes.ravel(), trace.point(segment, s)
    values = np.zeros((2 * n, 3 * count))
    middle, size = np.zeros((count, 2)), np.ones(count)
    for b in range(count):
        at, place = node[body == b], x[body == b]
        middle[b] = (place.min(axis=0) + place.max(axis=0)) / 2
        size[b] = np.ptp(place, axis=0).max() / 2
        arm = (place - middle[b]) / size[b]
        values[at, 3 * b] = 1.0
        values[at + n, 3 * b + 1] = 1.0
        values[at, 3 * b + 2] = -arm[:, 1]
        values[at + n, 3 * b + 2] = arm[:, 0]
    return values, middle, size


def free_motion(discrete: Discrete, active: Mask) -> str | None:
    """A rigid motion that the supports and the rows `active` do not resist, in words, or None."""
    values, middle, size = _motions(discrete)
    n = len(values) // 2
    c = discrete.conditions
    supports = c.direction[:, :1] * values[c.node] + c.direction[:, 1:] * values[c.node + n]
    contact = discrete.B[np.flatnonzero(active)] @ values
    resisted = np.concatenate([supports, contact])
    if len(resisted) < values.shape[1]:
        resisted = np.pad(resisted, ((0, values.shape[1] - len(resisted)), (0, 0)))
    _, singular, directions = np.linalg.svd(resisted, full_matrices=False)
    if singular[-1] > FREE * singular[0]:
        return None
    amounts = directions[-1].reshape(-1, 3)
    b = int(np.abs(amounts).max(axis=1).argmax())
    names = _names(discrete)
    tx, ty, turn = amounts[b] / np.abs(amounts[b]).max()
    if abs(turn) <= FREE:
        return f'body "{names[b]}" can move along ({tx + 0.0:.3g}, {ty + 0.0:.3g})'
    centre = middle[b] + size[b] / turn * np.array([-ty, tx])
    centre[np.abs(centre) <= FREE * size[b]] = 0.0
    return f'body "{names[b]}" can turn about ({centre[0]:.3g}, {centre[1]:.3g})'


def _names(discrete: Discrete) -> dict[int, str]:
    """Name of each body, by its number."""
    trace = discrete.space.trace
    materials = trace.mesh.GetMaterials()
    return {int(b): materials[m] for b, m in zip(_bodies(discrete), trace.body, strict=True)}
