"""Conditions and rows of a few nodes, as tests write them down."""

import numpy as np
import scipy.sparse as sp

from ngcontact.constraints.rows import Conditions, Rows, no_conditions

X, Y = (1.0, 0.0), (0.0, 1.0)


def unit(angle):
    return np.array([np.cos(angle), np.sin(angle)])


def conditions(*entries):
    """Conditions from (node, direction, value)."""
    if not entries:
        return no_conditions()
    node, direction, value = zip(*entries, strict=True)
    return Conditions(np.array(node), np.array(direction, dtype=float), np.array(value, float))


def clamped(node, ux=0.0, uy=0.0):
    return (node, X, ux), (node, Y, uy)


def rows(n, *entries, g=None):
    """Rows on n nodes from (node, direction, {facing node: weight})."""
    m = len(entries)
    coupling = sp.lil_array((m, n))
    for j, (_, _, facing) in enumerate(entries):
        for k, weight in facing.items():
            coupling[j, k] = weight
    return Rows(
        node=np.array([e[0] for e in entries], dtype=int),
        direction=np.array([e[1] for e in entries], dtype=float).reshape(m, 2),
        coupling=coupling.tocsr(),
        g=np.zeros(m) if g is None else np.array(g, dtype=float),
        equality=np.zeros(m, dtype=bool),
    )
