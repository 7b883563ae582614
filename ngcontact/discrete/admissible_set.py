"""K_h = {v in V_h : B v <= g}: supports and contact rows, one unknown for each, and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import scipy.sparse as sp

from ..arrays import Array, Index, Mask, from_triplets, joined, rows_of
from ..constraints import BasisTransformation, Conditions, Rows, change_of_basis
from ..contact import ContactLine, by_line
from ..fem import BoundaryTrace, Space
from ..problem import Problem, boundary_mask

SAME_DIRECTION = 1e-12  # squared sine below which two boundaries prescribe one direction
DIRECTION_DIFFERENCE = 1e-9  # of unit vectors, up to which two points at a node are one


def _prescribed(problem: Problem, trace: BoundaryTrace) -> Conditions:
    """Gamma_u, (3.6): interpolated displacement components at the nodes."""
    n, d = trace.space.ndof, trace.model.dim
    given = np.zeros((d, n), dtype=bool)
    value = np.zeros((d, n))
    for pattern, components in problem.displacement.items():
        segments = trace.segments(pattern)
        segment, s = trace.at_nodes(segments)
        node = trace.nodes[segments]
        for axis, function in enumerate(components):
            if function is not None:
                given[axis, node] = True
                values = trace.evaluate(function, segment, s).reshape(node.shape)  # (3.6)
                value[axis, node] = trace.unknowns_of_values(segments, values)
    axes, nodes = np.nonzero(given)
    return Conditions(node=nodes, direction=np.eye(d)[axes], value=value[axes, nodes])


def _guided(guide: str, trace: BoundaryTrace) -> Conditions:
    """Gamma_0, (3.8): zero normal displacement at the nodes, with the exact normals."""
    node, (number, normal) = trace.nodes[trace.segments(guide)].ravel(), trace.guide(guide)
    _, first = np.unique(number, return_index=True)
    return Conditions(node=node[first], direction=normal, value=np.zeros(len(first)))  # (3.8)


def _on_axis(trace: BoundaryTrace) -> Conditions:
    """No radial displacement on the axis of a body of revolution."""
    ends = [trace.nodes[trace.axis == end, place] for end, place in ((-1, 0), (1, -1))]
    node = np.unique(np.concatenate([trace.nodes[trace.on_axis].ravel(), *ends]))
    radial = np.eye(trace.model.dim)[:1]
    return Conditions(node, np.tile(radial, (len(node), 1)), np.zeros(len(node)))


def support_conditions(problem: Problem, trace: BoundaryTrace) -> Conditions:
    """Gamma_u and Gamma_0, to which the axis of a body of revolution belongs."""
    guided = [] if problem.guide is None else [_guided(problem.guide, trace)]
    return joined([_prescribed(problem, trace), *guided, _on_axis(trace)])


def conditioned_segments(problem: Problem, trace: BoundaryTrace) -> Index:
    """Segments (k,) on which conditions are posed: Gamma_u, Gamma_0, Gamma_K, the axis."""
    sides = [side for pair in problem.contact for side in pair.sides]
    chosen = trace.lies_on(slice(None), *problem.displacement, problem.guide, *sides)
    return np.flatnonzero(chosen | trace.on_axis)


def resultants(problem: Problem, trace: BoundaryTrace, reaction: Array) -> dict[str, Array]:
    """Sums (d,) of the forces `reaction` (n, d) of supports, by boundary of Gamma_u and Gamma_0.

    Per unit thickness, on the nodes of the boundary and all others. At a node of several boundaries
    each has the parts along the directions that it prescribes. A direction that several prescribe
    is shared in proportion to their lengths or areas beside the node, as the consistent nodal
    forces of one constant traction would be.
    """
    mesh, (n, d) = trace.mesh, reaction.shape
    names = np.array(mesh.GetBoundaries())
    # Patterns, and directions (j, d) at all of their nodes or (k * q, j, d) at each.
    supports = [
        (pattern, np.eye(d)[[function is not None for function in components]])
        for pattern, components in problem.displacement.items()
    ]
    if problem.guide is not None:
        number, normal = trace.guide(problem.guide)
        supports.append((problem.guide, normal[number][:, None]))
    every, held = [], np.zeros((n, d, d))  # sums of size a a' at nodes, a the directions
    for pattern, directions in supports:
        segments = trace.segments(pattern)
        node, q = trace.nodes[segments].ravel(), trace.nodes.shape[1]
        size = np.repeat(trace.sizes(segments), q)
        share = size[:, None, None] * (np.swapaxes(directions, -1, -2) @ directions)
        np.add.at(held, node, share)
        every.append((pattern, np.repeat(trace.region[segments], q), node, share))
    # The forces size a (a.y) add up to that of the node.
    some, y = held.any(axis=(1, 2)), np.zeros((n, d))
    inverse = np.linalg.pinv(held[some], SAME_DIRECTION, hermitian=True)
    y[some] = np.einsum("iab,ib->ia", inverse, reaction[some])
    result: dict[str, Array] = {}
    for pattern, region, node, share in every:
        forces = np.einsum("kab,kb->ka", share, y[node])
        for name in dict.fromkeys(names[boundary_mask(mesh, pattern)]):
            total = trace.model.resultant(forces[names[region] == name].sum(axis=0))
            result[str(name)] = result.get(str(name), 0.0) + total
    return result


def contact_rows(lines: list[ContactLine], trace: BoundaryTrace) -> Rows:
    """Rows of all lines, in order, on the nodes of the trace's space."""
    if not lines:
        none, coupling = np.zeros(0, dtype=np.intp), sp.csr_array((0, trace.space.ndof))
        return Rows(none, np.zeros((0, trace.model.dim)), coupling, np.zeros(0), none > 0)
    return joined(
        [
            Rows(
                node=line.node,
                direction=line.direction,
                coupling=line.coupling,
                g=line.gap,  # (2.10): eps(C_j); (2.3), (2.5): 0 where the bodies touch
                equality=np.full(len(line.node), line.contact.bilateral),
            )
            for line in lines
        ]
    )


def kept_lines(lines: list[ContactLine], kept: Index) -> list[ContactLine]:
    """The lines with the points that carry the rows `kept` (k,) of all lines together."""
    points = np.isin(np.arange(sum(len(line.node) for line in lines)), kept)
    parts = zip(lines, by_line(lines, points), strict=True)
    return [line.with_points(part) for line, part in parts]


def _same_point(lines: list[ContactLine], rows: Rows) -> tuple[Index, Mask]:
    """Number (m,) of an earlier row of the same point, or the row's own; and rows to be averaged.

    Rows at a node and along a direction are of one point if their left sides are the same, as where
    two contact lines meet smoothly, or if one is a mean over segments: then both are, over the
    segments of different pairs.
    """
    means = np.concatenate([np.zeros(0, dtype=bool), *(line.means for line in lines)])
    number, averaged = np.arange(len(means)), np.zeros(len(means), dtype=bool)
    x = np.round(rows.direction.T, 6)  # neighbours in this order, the first pair's row first
    order = np.lexsort((*x[::-1], rows.node))
    turn = np.abs(np.diff(rows.direction[order], axis=0)).max(axis=1)
    same = (np.diff(rows.node[order]) == 0) & (turn <= DIRECTION_DIFFERENCE)
    for a, b in zip(order[:-1][same], order[1:][same], strict=True):
        alike = rows.alike(a, b)
        if alike or means[a] or means[b]:
            number[b] = number[a]
            averaged[[a, b]] |= not alike
    return number, averaged


def _own_weights(lines: list[ContactLine], number: Index, weight: Array) -> Array:
    """Weights (m,) of rows without what others of the same point count on the same segments.

    Of rows of one point, `number` (m,), on one segment the one of the largest `weight` (m,) keeps
    it; pairs of other primaries face another part of the segment, which counts, too.
    """
    found = []
    for line, own in zip(lines, by_line(lines, np.arange(len(weight))), strict=True):
        at, place = np.nonzero(line.rows >= 0)
        primary = next(j for j, one in enumerate(lines) if _share_primary(one, line))
        group = np.full(len(at), primary)
        found.append((own[line.rows[at, place]], line.segments[at], group, line.shares[at, place]))
    row, segment, group, share = (np.concatenate(x) for x in zip(*found, strict=True))
    order = np.lexsort((row, -weight[row]))
    keys = np.column_stack([number[row], segment, group])[order]
    kept = np.zeros(len(order), dtype=bool)
    kept[order[np.unique(keys, axis=0, return_index=True)[1]]] = True
    whole, own = (np.bincount(row, share * part, len(weight)) for part in (1.0, kept))
    return np.asarray(weight * np.where(whole > 0, own / np.where(whole > 0, whole, 1.0), 1.0))


def _share_primary(one: ContactLine, other: ContactLine) -> bool:
    """Whether two lines face segments in common, or an obstacle both."""
    both_rigid = len(one.facing) == len(other.facing) == 0
    return both_rigid or bool(np.intersect1d(one.facing, other.facing).size)


def merged(lines: list[ContactLine], rows: Rows) -> tuple[list[ContactLine], Rows]:
    """Lines and rows with one row for each point: of those that repeat a left side the tightest."""
    number, averaged = _same_point(lines, rows)
    first, every = np.unique(number), np.arange(len(number))
    if len(first) == len(number):
        return lines, rows
    weight = _own_weights(lines, number, np.concatenate([line.weight for line in lines]))
    repeated = number != every
    if averaged.any():  # the first row of a point is the mean by weights
        total = np.bincount(number, weight * averaged)
        share = np.where(averaged, weight / np.where(averaged, total[number], 1.0), 1.0)
        mean = from_triplets(share, np.where(averaged, number, every), every, (len(every),) * 2)
        rows = replace(rows, coupling=(mean @ rows.coupling).tocsr(), g=mean @ rows.g)
    g, equality = rows.g.copy(), np.zeros(len(number), dtype=bool)
    np.logical_or.at(equality, number, rows.equality)
    # An equality is the tightest; another pair's row at that node follows from it or is refused.
    tight = np.where(rows.equality | averaged | ~equality[number], rows.g, np.inf)
    tight[averaged & repeated] = np.inf  # in the mean already
    g[first] = np.inf
    np.minimum.at(g, number, tight)
    np.add.at(weight, number[repeated], weight[repeated])
    parts = zip(lines, by_line(lines, weight), strict=True)
    lines = [replace(line, weight=part) for line, part in parts]
    kept = []
    for k, line in enumerate(kept_lines(lines, first)):
        # Without segments of which earlier lines have all points it had. Where these face another
        # primary the segment faces both of them in part, and stays.
        had = (lines[k].rows >= 0).any(axis=1)
        earlier = [one.segments for one in lines[:k] if _share_primary(one, lines[k])]
        taken = np.isin(line.segments, np.concatenate([np.zeros(0, np.intp), *earlier]))
        left = (line.rows >= 0).any(axis=1) | ~had | ~taken
        kept.append(rows_of(line, left, *line.by_segment))
    return kept, rows_of(replace(rows, g=g, equality=equality), first)


@dataclass(frozen=True, eq=False)
class AdmissibleSet:
    """K_h of HH81 (2.3), (2.5), (2.10)."""

    lines: list[ContactLine]  # the contact pairs with the points that carry rows
    rows: Rows  # those of all pairs in order
    basis: BasisTransformation  # unknowns in which rows and prescribed values are single unknowns

    def around(self, values: Array) -> Array:
        """Sums (m, r) of `values` (m, r) of the rows over those on their segments."""
        parts = [values[:0]]
        for line, part in zip(self.lines, by_line(self.lines, values), strict=True):
            segment, place = np.nonzero(line.rows >= 0)
            point, size = line.rows[segment, place], (len(line.rows), len(part))
            on = from_triplets(np.ones(len(point)), segment, point, size)
            parts.append(on.T @ (on @ part))
        return np.concatenate(parts)


def admissible_set(
    space: Space, conditions: Conditions, found: Sequence[ContactLine], passed: Index
) -> AdmissibleSet:
    """K_h by the `conditions` and the points `found`; rows `passed` (k,) have hosts in front."""
    trace = space.trace
    lines, rows = merged(list(found), contact_rows(list(found), trace))  # (2.3), (2.5), (2.10)
    length = float(np.abs(trace.curve).max())
    stiffness = space.stiffness() if rows.coupling.nnz else None  # else all rows have one host
    if stiffness is not None:
        stiffness[rows.node[passed]] = np.inf
    basis = change_of_basis(conditions, rows, length, stiffness)
    if space.inner.any():  # of these nothing is left in the matrix
        basis = replace(basis, fixed=basis.fixed | space.inner)
    if len(basis.kept) < len(rows.node):  # the others are prescribed
        lines, rows = kept_lines(lines, basis.kept), rows_of(rows, basis.kept)
    return AdmissibleSet(lines, rows, basis)
