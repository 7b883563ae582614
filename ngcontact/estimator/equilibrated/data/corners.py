"""Where given tractions meet at a vertex of the boundary: triangles to be divided.

With tractions t1, t2 given on both sides of a vertex in one triangle, a symmetric stress needs
t1.n2 = t2.n1; in two triangles a jump of the load is one that the edge between them must carry.
"""

from __future__ import annotations

import numpy as np

from ....arrays import Index, Mask
from ....fem import BoundaryTrace
from ....problem import Problem, Triangulation
from .conditions import projected_loads
from .curves import bent_segments
from .polynomials import legendre_values

SAME = 1e-12  # difference of tractions, relative to the largest


def divided_elements(problem: Problem, boundary: BoundaryTrace, degree: int, uneven: Index) -> Mask:
    """Elements (ne,) in whose corners given tractions meet that leave a stress no freedom.

    `degree` is that of the stress; on segments `uneven` (j,) the polynomials that stand for p*
    jump at vertices.
    """
    view = Triangulation(boundary.mesh)
    outer = np.flatnonzero(~boundary.inner)
    free = np.zeros(len(boundary.region), dtype=bool)
    for pattern, components in problem.displacement.items():
        if all(value is not None for value in components):
            free[boundary.segments(pattern)] = True
    sides = [side for pair in problem.contact for side in (pair.secondary, pair.primary)]
    touching = np.zeros(len(free), dtype=bool)
    touching[boundary.segments(*sides)] = True
    ends = np.array([0.0, 1.0])
    load = np.zeros((len(free), 2, 2))
    for at, c, _ in projected_loads(problem, boundary, degree):
        load[at] = np.einsum("ei,jci->jec", legendre_values(degree - 1, ends), c[..., :degree])
    normal = boundary.normal(np.repeat(outer, 2), np.tile(ends, len(outer))).reshape(-1, 2, 2)
    vertex = boundary.nodes[outer][:, [0, -1]].ravel()
    order = np.argsort(vertex, kind="stable")
    first, last = order[:-1], order[1:]
    pairs = vertex[first] == vertex[last]
    first, last = first[pairs], last[pairs]
    (i, a), (j, b) = np.divmod(first, 2), np.divmod(last, 2)
    one, other, m, n = load[outer[i], a], load[outer[j], b], normal[i, a], normal[j, b]
    small = SAME * np.abs(load).max(initial=0.0)
    contact = touching[outer[i]] | touching[outer[j]]
    skew = np.abs((one * n).sum(axis=1) - (other * m).sum(axis=1)) > small
    jump = np.abs(one - other).max(axis=1) > small
    jump |= np.isin(outer[i], uneven) | np.isin(outer[j], uneven)
    count = np.bincount(view.triangles.ravel(), minlength=len(view.vertices))[vertex[first]]
    bad = ((count == 1) & (contact | skew)) | ((count == 2) & jump)
    bad &= ~free[outer[i]] & ~free[outer[j]]
    divided: Mask = np.any(np.isin(view.triangles, vertex[first[bad]]), axis=1, keepdims=True)[:, 0]
    # On curves tractions are met in the mean, and curved triangles have no straight parts.
    divided[boundary.element[bent_segments(boundary)]] = False
    return np.asarray(divided)
