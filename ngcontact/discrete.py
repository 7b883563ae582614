"""The discrete problems (P_1h), (P_2h) of HH81 on one mesh, and their solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from numpy.typing import NDArray

from .bordered import Factor, Program
from .constraint import Basis, change_of_basis
from .gap import ContactLine, contact_line, without
from .kernel import no_kernel
from .lagrange import lagrange
from .newton import Minimiser
from .problem import Problem, boundary_mask
from .projection import snap
from .rigid import Rigid, rigid_motions
from .rows import Conditions, Rows
from .space import Space, assemble, cholesky, in_unknowns
from .ssn import minimise
from .trace import Trace, boundary_trace

Array = NDArray[np.float64]
Index = NDArray[np.intp]
Mask = NDArray[np.bool_]

SMALLEST, LARGEST = -306, 305  # powers of ten between which sums of products keep their digits


@dataclass(frozen=True, eq=False)
class Discrete:
    """One discrete problem.

    Attributes
    ----------
    problem : Problem
    space : Space
    lines : list of ContactLine
        One for each contact pair, with the points that carry rows.
    conditions : Conditions
        Gamma_u and Gamma_0 at nodes.
    B : sparse (m, 2n)
        Contact rows on node values, all pairs in order.
    basis : Basis
        Unknowns in which rows and prescribed values are single unknowns.
    program : Program
        The quadratic program in those unknowns.
    factor : callable
        Factorises its matrix.
    rigid : Rigid or None
        Rigid motions that supports leave free, if there are any.
    """

    problem: Problem
    space: Space
    lines: list[ContactLine]
    conditions: Conditions
    B: sp.csr_matrix
    basis: Basis
    program: Program
    factor: Factor
    rigid: Rigid | None


def _prescribed(problem: Problem, trace: Trace) -> Conditions:
    """Gamma_u: interpolated displacement components at the nodes."""
    n = trace.space.ndof
    given = np.zeros((2, n), dtype=bool)
    value = np.zeros((2, n))
    for pattern, components in problem.displacement.items():
        segment, s = trace.at_nodes(trace.select(boundary_mask(trace.mesh, pattern)))
        node = trace.nodes[segment[:: trace.order + 1]].ravel()
        for axis, function in enumerate(components):
            if function is not None:
                given[axis, node] = True
                value[axis, node] = trace.evaluate(function, segment, s)[:, 0]
    axes, nodes = np.nonzero(given)
    return Conditions(node=nodes, direction=np.eye(2)[axes], value=value[axes, nodes])


def _guided(problem: Problem, trace: Trace) -> Conditions:
    """Gamma_0: zero normal displacement at the nodes, with the exact normals."""
    if problem.sliding is None:
        return Conditions(np.zeros(0, dtype=np.intp), np.zeros((0, 2)), np.zeros(0))
    segment, s = trace.at_nodes(trace.select(boundary_mask(trace.mesh, str(problem.sliding))))
    node = trace.nodes[segment[:: trace.order + 1]].ravel()
    number, normal = trace.number_points(segment, node, trace.exact_normal(segment, s))
    _, first = np.unique(number, return_index=True)
    return Conditions(node=node[first], direction=normal, value=np.zeros(len(first)))


def _rows(line: ContactLine, trace: Trace) -> Rows:
    """Rows of one contact line."""
    share = lagrange(trace.order, snap(line.partner_s, trace.order))
    share[line.partner < 0] = 0.0
    return Rows(
        node=line.node,
        direction=line.direction,
        partner=trace.nodes[line.partner],
        share=share,
        g=line.gap,
        equality=np.full(len(line.node), line.contact.bilateral),
    )


def _joined(rows: list[Rows], order: int) -> Rows:
    """Rows of all lines together."""
    if rows:
        return Rows(
            *(np.concatenate([getattr(r, name) for r in rows]) for name in Rows.__annotations__)
        )
    none = np.zeros(0, dtype=np.intp)
    shape = (0, order + 1)
    return Rows(
        node=none,
        direction=np.zeros((0, 2)),
        partner=np.zeros(shape, dtype=np.intp),
        share=np.zeros(shape),
        g=np.zeros(0),
        equality=np.zeros(0, dtype=bool),
    )


def _kept(lines: list[ContactLine], kept: Index) -> list[ContactLine]:
    """The lines with the points that carry the rows `kept` of all lines together."""
    dropped = np.ones(sum(len(line.node) for line in lines), dtype=bool)
    dropped[kept] = False
    stops = np.cumsum([len(line.node) for line in lines])
    parts = np.split(dropped, stops[:-1]) if lines else []
    return [without(x, np.flatnonzero(part)) for x, part in zip(lines, parts, strict=True)]


def _merged(lines: list[ContactLine], rows: Rows, n: int) -> tuple[list[ContactLine], Rows]:
    """Lines and rows with one row for each left side: the tightest of those that repeat it."""
    number = rows.repeated(n)
    first = np.unique(number)
    if len(first) == len(number):
        return lines, rows
    g, weight = rows.g.copy(), np.concatenate([line.weight for line in lines])
    equality = np.zeros(len(g), dtype=bool)
    np.logical_or.at(equality, number, rows.equality)
    # An equality is the tightest; what another pair at that node asks for follows or is refused.
    tight = np.where(rows.equality | ~equality[number], rows.g, np.inf)
    g[first] = np.inf
    np.minimum.at(g, number, tight)
    repeated = number != np.arange(len(number))
    np.add.at(weight, number[repeated], weight[repeated])
    stops = np.cumsum([len(line.node) for line in lines])
    lines = [
        replace(line, weight=part)
        for line, part in zip(lines, np.split(weight, stops[:-1]), strict=True)
    ]
    return _kept(lines, first), replace(rows, g=g, equality=equality).select(first)


def _check_range(program: Program) -> None:
    """Raise where double precision holds the data but neither the forces nor the displacements."""
    p = program
    stiffness, load = np.abs(p.K.data).max(initial=0.0), np.abs(p.b).max(initial=0.0)
    given = max(np.abs(p.values).max(initial=0.0), -p.g.min(initial=0.0))
    with np.errstate(divide="ignore"):
        k, f, v = np.log10([stiffness, load, given])
    for name, size in (("displacements", max(v, f - k)), ("forces", max(f, k + v))):
        if not (size == -np.inf or SMALLEST < size < LARGEST):
            raise ValueError(
                f"moduli, loads and prescribed displacements make {name} of 1e{size:+.0f}, beyond "
                f"the range of numbers (1e{SMALLEST} to 1e+{LARGEST}); choose other units"
            )


def discretise(problem: Problem, mesh: ng.Mesh, order: int, element: str) -> Discrete:
    """Assemble the discrete problem on a mesh that is curved to the element's degree.

    Raises
    ------
    ValueError
        A pair of which no point faces; prescribed displacements that violate a contact row;
        forces or displacements beyond the range of numbers.
    """
    trace = boundary_trace(mesh, order)
    lines = [contact_line(trace, contact) for contact in problem.contact]
    space = assemble(problem, trace, element)
    n = space.basis.shape[1] // 2
    prescribed, guided = _prescribed(problem, trace), _guided(problem, trace)
    conditions = Conditions(
        *(
            np.concatenate([getattr(c, name) for c in (prescribed, guided)])
            for name in Conditions.__annotations__
        )
    )
    lines, rows = _merged(lines, _joined([_rows(line, trace) for line in lines], order), n)
    stiffness = space.stiffness()
    basis = change_of_basis(n, conditions, rows, float(np.abs(trace.curve).max()), stiffness)
    lines, rows = _kept(lines, basis.kept), rows.select(basis.kept)
    B = rows.matrix(n)
    rigid = None
    found = rigid_motions(problem, space, conditions, basis, B, rows.g, rows.equality)
    if found is not None:
        rigid, f = found
        space = replace(space, f=f)
    T = space.basis @ basis.T
    m = len(basis.unknown)
    K, matrix = in_unknowns(space, T)
    program = Program(
        K=K,
        b=T.T @ space.f,
        R=sp.csr_matrix((np.ones(m), (np.arange(m), basis.unknown)), (m, 2 * n)),
        g=rows.g,
        equality=rows.equality,
        fixed=basis.fixed,
        values=basis.values,
        unknown=basis.unknown,
        kernel=no_kernel(2 * n) if rigid is None else rigid.kernel,
    )
    _check_range(program)
    return Discrete(
        problem=problem,
        space=space,
        lines=lines,
        conditions=conditions,
        B=B,
        basis=basis,
        program=program,
        factor=cholesky(matrix),
        rigid=rigid,
    )


def minimise_energy(discrete: Discrete, active: Mask) -> Minimiser:
    """Exact minimiser of L over K_h.

    Bodies that contact alone can hold start from where they rest when rigid, so that the way
    there costs no digits of the deformation.
    """
    p, rigid = discrete.program, discrete.rigid
    if rigid is None or not rigid.placing.any():
        return minimise(p, discrete.factor, active)
    result = minimise(replace(p, g=p.g - rigid.rows @ rigid.placing), discrete.factor, active)
    u = result.u + rigid.motions @ rigid.placing
    u -= p.kernel.lineal @ (p.kernel.conditions @ u)
    u[p.unknown[result.active]] = p.g[result.active]
    return replace(result, u=u)
