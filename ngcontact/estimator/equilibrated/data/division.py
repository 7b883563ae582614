"""Triangles of the mesh that are divided into parts.

With tractions t1, t2 given on both sides of a vertex in one triangle, a symmetric stress needs
t1.n2 = t2.n1; in two triangles a jump of the load is one that the edge between them must carry.
Two triangles without traction on sides that lie on one line, as patches have them, leave no freedom
either, and need none; where the sides are bent a little, the little that is missing cannot be met.
Such triangles are divided from their middle. Those at segments that face vertices of the other body
are fans from the opposite vertex to these places.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from ....arrays import Array, Index, Mask
from ....fem import BoundaryTrace
from ....problem import Problem, Triangulation
from .conditions import axis_segments, projected_loads
from .curves import bent_segments
from .partition import Partition
from .polynomials import CORNERS, legendre_values

SAME = 1e-12  # difference of tractions, relative to the largest
STRAIGHT = 1e-11  # sine of the angle between sides of one line, by round-off
NEARLY_STRAIGHT = 1e-4  # ... below which its square is lost among eigenvalues of a patch


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
    free[axis_segments(boundary)] = True
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
    bent = boundary.element[bent_segments(boundary)]
    divided[bent] = False
    fixed = np.isin(np.arange(len(divided)), bent)
    divided[_beside_a_bend(view, fixed)] = True
    return np.asarray(divided)


def _beside_a_bend(view: Triangulation, fixed: Mask) -> Index:
    """One of each two triangles with a common edge whose other sides at its end are nearly a line.

    Nearly, but not quite, and none that is `fixed` (ne,).
    """
    triangles, x = view.triangles, view.vertices
    ends = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    keys = ends[:, 0] * len(x) + ends[:, 1]
    order = np.argsort(keys, kind="stable")
    inner = np.flatnonzero(keys[order][1:] == keys[order][:-1])
    both = order[np.column_stack([inner, inner + 1])]
    # (k, side, end, component): from both ends of k edges to the vertices opposite
    side = x[triangles.ravel()[both]][:, :, None] - x[ends[both[:, 0]]][:, None]
    side /= np.linalg.norm(side, axis=3, keepdims=True)
    one, other = side[:, 0], side[:, 1]
    bend = np.abs(one[..., 0] * other[..., 1] - one[..., 1] * other[..., 0])
    bent = (bend > STRAIGHT) & (bend < NEARLY_STRAIGHT) & ((one * other).sum(axis=2) < 0)
    chosen: set[int] = set()
    for pair in (both[bent.any(axis=1)] // 3).tolist():
        if chosen.isdisjoint(pair):
            chosen.update([number for number in pair if not fixed[number]][:1])
    return np.array(sorted(chosen), dtype=np.intp)


def _with_middles(
    triangles: Index, parent: Index, within: Array, divided: Mask, vertices: Array
) -> tuple[Index, Index, Array, Array]:
    """Triangles with those `divided` (n,) in three parts, parents, places, and all vertices."""
    whole, cut = np.flatnonzero(~divided), np.flatnonzero(divided)
    middle, places = len(vertices) + np.arange(len(cut)), within[cut].mean(axis=1)
    old, parts, inside = triangles[cut], [triangles[whole]], [within[whole]]
    for i in range(3):
        j = (i + 1) % 3
        parts.append(np.column_stack([old[:, i], old[:, j], middle]))
        inside.append(np.stack([within[cut, i], within[cut, j], places], axis=1))
    vertices = np.concatenate([vertices, vertices[old].mean(axis=1)])
    parents = np.concatenate([parent[whole], *[parent[cut]] * 3])
    return np.concatenate(parts), parents, np.concatenate(inside), vertices


@dataclass(frozen=True)
class _Chains:
    """Edges of the boundary, q of them: segment, ends, part of the parameter of the segment."""

    segment: Index
    ends: Index
    start: Array
    stop: Array


def _chains(boundary: BoundaryTrace, cuts: dict[int, Array], first: int) -> _Chains:
    """Edges of all segments, some with `cuts`; new vertices are numbered from `first` on."""
    rows = []
    for segment in np.flatnonzero(~boundary.inner).tolist():
        places = cuts.get(segment, np.zeros(0))
        low, high = boundary.nodes[segment, [0, -1]]
        vertices = [low, *range(first, first + len(places)), high]
        first += len(places)
        s = [0.0, *places, 1.0]
        parts = zip(pairwise(vertices), pairwise(s), strict=True)
        rows += [(segment, *ends, *places) for ends, places in parts]
    segment, low, high, start, stop = np.array(rows).T
    ends = np.column_stack([low, high]).astype(np.intp)
    return _Chains(segment.astype(np.intp), ends, start, stop)


def _with_fans(triangles: Index, within: Array, chains: _Chains) -> tuple[Index, Index, Array]:
    """Elements, those at edges that are cut in fans from the vertices opposite, and parents."""
    parent = np.arange(len(triangles))
    cut = np.flatnonzero(np.bincount(chains.segment)[chains.segment] > 1)
    if cut.size == 0:
        return triangles, parent, within
    rows = {i: list(t) for i, t in enumerate(triangles.tolist())}
    places, parents = dict(enumerate(within)), dict(enumerate(parent.tolist()))
    owner = {frozenset((t[i - 2], t[i - 1])): n for n, t in rows.items() for i in range(3)}
    for segment in np.unique(chains.segment[cut]):
        mine = cut[chains.segment[cut] == segment]
        vertices = [*chains.ends[mine, 0].tolist(), int(chains.ends[mine[-1], 1])]
        s = np.append(chains.start[mine], 1.0)
        number = owner[frozenset((vertices[0], vertices[-1]))]
        triangle, corners = rows[number], places[number]
        low, high = (triangle.index(vertices[i]) for i in (0, -1))
        apex = 3 - low - high
        x = corners[low] + s[:, None] * (corners[high] - corners[low])
        if (low + 1) % 3 != high:  # fans are anticlockwise
            vertices, x = vertices[::-1], x[::-1]
        for i, (a, b) in enumerate(pairwise(vertices)):
            at = number if i == 0 else len(rows)
            rows[at], parents[at] = [a, b, triangle[apex]], parents[number]
            places[at] = np.stack([x[i], x[i + 1], corners[apex]])
            for j in range(3):
                owner[frozenset((rows[at][j - 2], rows[at][j - 1]))] = at
    n = range(len(rows))
    return (
        np.array([rows[i] for i in n]),
        np.array([parents[i] for i in n]),
        np.array([places[i] for i in n]),
    )


def partition_of(
    boundary: BoundaryTrace, length: float, divided: Mask, cuts: dict[int, Array]
) -> Partition:
    """The elements of a mesh, those `divided` (ne,) in three parts; coordinates over `length`.

    `cuts` (j,) of some straight segments are parameters at which they are cut.
    """
    view = Triangulation(boundary.mesh)
    chains = _chains(boundary, cuts, len(view.vertices))
    within = np.tile(CORNERS, (len(view.triangles), 1, 1))
    triangles, parent, within = _with_fans(view.triangles, within, chains)
    new = np.flatnonzero(chains.start > 0)
    more = boundary.point(chains.segment[new], chains.start[new])
    vertices = np.concatenate([view.vertices, more]) / length
    triangles, parent, within, vertices = _with_middles(
        triangles, parent, within, divided[parent], vertices
    )
    pairs = np.sort(triangles[:, [[1, 2], [2, 0], [0, 1]]].reshape(-1, 2), axis=1)
    size = len(vertices)
    keys, first, edges = np.unique(
        pairs[:, 0] * size + pairs[:, 1], return_index=True, return_inverse=True
    )
    segment, along = np.full(len(keys), -1), np.ones(len(keys), dtype=bool)
    start, stop = np.zeros(len(keys)), np.ones(len(keys))
    low, high = np.sort(chains.ends, axis=1).T
    at = np.searchsorted(keys, low * size + high)
    segment[at], start[at], stop[at] = chains.segment, chains.start, chains.stop
    along[at] = chains.ends[:, 0] < chains.ends[:, 1]
    return Partition(
        mesh=boundary.mesh,
        vertices=vertices,
        length=length,
        triangles=triangles,
        parent=parent,
        within=within,
        edges=edges.reshape(-1, 3),
        ends=pairs[first],
        segment=segment,
        along=along,
        start=start,
        stop=stop,
    )
