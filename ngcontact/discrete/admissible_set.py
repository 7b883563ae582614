"""K_h = {v in V_h : B v <= g}: supports and contact rows, one unknown for each, and forces."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..arrays import Array, Index
from ..constraints import (
    BasisTransformation,
    Conditions,
    Rows,
    change_of_basis,
    concatenated,
    no_conditions,
)
from ..contact import ContactLine, joined, kept_lines, merged
from ..fem import BoundaryTrace, Space
from ..problem import Problem, boundary_mask


def _prescribed(problem: Problem, trace: BoundaryTrace) -> Conditions:
    """Gamma_u, (3.6): interpolated displacement components at the nodes."""
    n = trace.space.ndof
    given = np.zeros((2, n), dtype=bool)
    value = np.zeros((2, n))
    for pattern, components in problem.displacement.items():
        segment, s = trace.at_nodes(trace.segments(pattern))
        node = trace.nodes[segment[:: trace.order + 1]].ravel()
        for axis, function in enumerate(components):
            if function is not None:
                given[axis, node] = True
                value[axis, node] = trace.evaluate(function, segment, s)[:, 0]  # (3.6)
    axes, nodes = np.nonzero(given)
    return Conditions(node=nodes, direction=np.eye(2)[axes], value=value[axes, nodes])


def _guided(problem: Problem, trace: BoundaryTrace) -> Conditions:
    """Gamma_0, (3.8): zero normal displacement at the nodes, with the exact normals."""
    if problem.sliding is None:
        return no_conditions()
    segment, s = trace.at_nodes(trace.segments(str(problem.sliding)))
    node = trace.nodes[segment[:: trace.order + 1]].ravel()
    number, normal = trace.number_points(segment, node, trace.exact_normal(segment, s))
    _, first = np.unique(number, return_index=True)
    return Conditions(node=node[first], direction=normal, value=np.zeros(len(first)))  # (3.8)


def _on_axis(trace: BoundaryTrace) -> Conditions:
    """No radial displacement on the axis of a body of revolution."""
    ends = [trace.nodes[trace.axis == end, place] for end, place in ((-1, 0), (1, -1))]
    node = np.unique(np.concatenate([trace.nodes[trace.on_axis].ravel(), *ends]))
    return Conditions(node, np.tile([1.0, 0.0], (len(node), 1)), np.zeros(len(node)))


def support_conditions(problem: Problem, trace: BoundaryTrace) -> Conditions:
    """Gamma_u and Gamma_0, to which the axis of a body of revolution belongs."""
    return concatenated([_prescribed(problem, trace), _guided(problem, trace), _on_axis(trace)])


def conditioned_segments(problem: Problem, trace: BoundaryTrace) -> Index:
    """Segments (k,) on which conditions are posed: Gamma_u, Gamma_0, Gamma_K, the axis."""
    sides = [side for pair in problem.contact for side in (pair.secondary, pair.primary)]
    guides = [] if problem.sliding is None else [str(problem.sliding)]
    chosen = trace.lies_on(np.arange(len(trace.region)), *problem.displacement, *guides, *sides)
    return np.flatnonzero(chosen | trace.on_axis)


def resultants(problem: Problem, trace: BoundaryTrace, reaction: Array) -> dict[str, Array]:
    """Sums (2,) of the forces `reaction` (n, 2) of supports, by boundary of Gamma_u and Gamma_0.

    Per unit thickness, on the nodes of the boundary and all others.
    """
    mesh = trace.mesh
    names = np.array(mesh.GetBoundaries())
    patterns = [
        *reversed(list(problem.displacement)),  # at a common node the last one is in force
        *([] if problem.sliding is None else [str(problem.sliding)]),
    ]
    counted = np.zeros(len(reaction), dtype=bool)
    result: dict[str, Array] = {}
    for pattern in patterns:
        segments = trace.segments(pattern)
        named = names[trace.region[segments]]
        for name in dict.fromkeys(names[boundary_mask(mesh, pattern)]):
            nodes = np.unique(trace.nodes[segments[named == name]])
            nodes = nodes[~counted[nodes]]
            counted[nodes] = True
            result[str(name)] = trace.model.resultant(reaction[nodes].sum(axis=0))
    return result


@dataclass(frozen=True, eq=False)
class AdmissibleSet:
    """K_h of HH81 (2.3), (2.5), (2.10)."""

    lines: list[ContactLine]  # the contact pairs with the points that carry rows
    conditions: Conditions  # Gamma_u and Gamma_0 at nodes
    rows: Rows  # those of all pairs in order
    basis: BasisTransformation  # unknowns in which rows and prescribed values are single unknowns


def admissible_set(problem: Problem, space: Space, found: Sequence[ContactLine]) -> AdmissibleSet:
    """K_h for the contact points `found` of each pair.

    Raises
    ------
    ValueError
        Prescribed displacements that violate a contact row.
    """
    trace = space.trace
    conditions = support_conditions(problem, trace)  # (3.6), (3.8)
    lines, rows = merged(list(found), joined(list(found), trace))  # (2.3), (2.5), (2.10)
    length = float(np.abs(trace.curve).max())
    stiffness = space.stiffness() if rows.coupling.nnz else None  # else all rows have one host
    basis = change_of_basis(conditions, rows, length, stiffness)
    return AdmissibleSet(kept_lines(lines, basis.kept), conditions, rows.select(basis.kept), basis)
