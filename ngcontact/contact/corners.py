"""Corners of Gamma_K: two contact points at one node, one state and one pressure.

A corner of Gamma_K carries two contact points, one for each side: HH81 (2.3). Both rows hold at one
node. When it touches the corner, its force splits between the two normals, and where these are
nearly parallel the split is no measure of the pressure: a part of the force across the corner
weighs 1 / turn in it, and one of the two rows may even be open.
"""

from __future__ import annotations

import numpy as np

from ..arrays import Array, Index, Mask
from .line import ContactLine

ALIKE = np.sqrt(0.5)  # cosine of the turn up to which both sides of a corner have one pressure


def twins(line: ContactLine) -> Index:
    """Pairs (t, 2) of contact points that share a node."""
    order = np.argsort(line.node, kind="stable")
    node = line.node[order]
    same = np.flatnonzero(node[1:] == node[:-1])
    return np.column_stack([order[same], order[same + 1]])


def in_contact(line: ContactLine, active: Mask) -> Mask:
    """Points in contact (m,): the `active` (m,) and open ones at corners inside the contact.

    The node touches the other side of the corner, and the next point on this side is active: one
    of the two rows is released where the node would rather slide off the corner.
    """
    state = active.copy()
    corners = twins(line)
    for i in corners[active[corners].sum(axis=1) == 1].ravel():
        if not active[i]:
            first, last = line.rows[:, :-1], line.rows[:, 1:]
            next_to = np.concatenate([last[first == i], first[last == i]])
            state[i] = (next_to >= 0).all() and active[next_to].all()
    return state


def pressure_across_corners(line: ContactLine, force: Array, active: Mask) -> Array:
    """Pressure (m,): force over weight, but at corners one value for both sides.

    `Solution.pressure` is force over weight everywhere, which at corners of small turns splits the
    node's force without a meaning. A stress that is continuous at a corner without friction has
    both normals as eigenvectors, so that both pressures are equal unless the sides are
    perpendicular. Up to a turn of 45 degrees they are told together, from the part of the node's
    force along the sum of weight times normal: what a uniform pressure on both sides exerts.

    Parameters
    ----------
    line : ContactLine
        The pair.
    force : ndarray (m,)
        At its points, per unit thickness.
    active : ndarray of bool (m,)
        Points in contact.

    Returns
    -------
    ndarray (m,)
        Force per unit length (P1) or per unit eta (P2).
    """
    pressure = force / line.weight
    corners = twins(line)
    if corners.size == 0 or line.contact.direction is not None:
        return pressure
    inside = in_contact(line, active)[corners].all(axis=1)
    normal = line.direction[corners]  # (t, 2, 2), row i the normal of side i
    inside &= (normal[:, 0] * normal[:, 1]).sum(axis=1) >= ALIKE
    corners, normal = corners[inside], normal[inside]
    uniform = (line.weight[corners][:, :, None] * normal).sum(axis=1)
    resultant = (force[corners][:, :, None] * normal).sum(axis=1)
    shared = (resultant * uniform).sum(axis=1) / (uniform**2).sum(axis=1)
    pressure[corners] = shared[:, None]
    return pressure
