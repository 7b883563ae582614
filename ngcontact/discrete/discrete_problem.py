"""The discrete problems (P_1h), (P_2h) of HH81 on one mesh, and their solution."""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ..arrays import Mask
from ..constraints import BasisTransformation, Conditions, change_of_basis
from ..contact import ContactLine, joined, kept_lines, merged
from ..errors import ConvergenceError
from ..fem import (
    LOAD_BONUS,
    BoundaryTrace,
    Space,
    assemble,
    boundary_trace,
    load_vector,
    node_basis,
)
from ..linalg import congruent
from ..mesh import vertex_parents
from ..problem import Problem
from ..qp import BorderedSystems, Iterate, QuadraticProgram, minimise, no_null_space
from ..triplets import from_triplets
from .equilibrium import Rigid, rigid_motions
from .linear_systems import linear_systems
from .reuse import contact_lines, same_basis, same_boundary, same_stiffness
from .supports import conditioned_segments, support_conditions

SMALLEST, LARGEST = -306, 305  # powers of ten between which sums of products keep their digits


@dataclass(frozen=True, eq=False)
class DiscreteProblem:
    """One discrete problem.

    Attributes
    ----------
    problem : Problem
    space : Space
    found : list of ContactLine
        One for each contact pair.
    lines : list of ContactLine
        The same with the points that carry rows.
    conditions : Conditions
        Gamma_u and Gamma_0 at nodes.
    B : sparse (m, 2n)
        Contact rows on node values, all pairs in order.
    basis : BasisTransformation
        Unknowns in which rows and prescribed values are single unknowns.
    program : QuadraticProgram
        The quadratic program in those unknowns.
    systems : BorderedSystems
        Its linear systems, with the factorisation once there is one.
    rigid : Rigid or None
        Rigid motions that supports leave free, if there are any.
    assembled : bool
        False where the stiffness is that of an earlier problem.
    """

    problem: Problem
    space: Space
    found: list[ContactLine]
    lines: list[ContactLine]
    conditions: Conditions
    B: sp.csr_array
    basis: BasisTransformation
    program: QuadraticProgram
    systems: BorderedSystems
    rigid: Rigid | None
    assembled: bool


def _space(
    problem: Problem, trace: BoundaryTrace, element: str, previous: DiscreteProblem | None
) -> tuple[Space, bool]:
    """Space with its forms, and whether its stiffness had to be assembled."""
    nodal = conditioned_segments(problem, trace)
    if previous is not None and same_stiffness(problem, previous.problem):
        V = previous.space.V
        basis = node_basis(V, trace, nodal, element)
        f = load_vector(problem, V, LOAD_BONUS)
        return replace(previous.space, trace=trace, nodal=nodal, basis=basis, f=f), False
    return assemble(problem, trace, element, nodal), True


def _check_range(program: QuadraticProgram) -> None:
    """Raise where double precision holds the data but neither the forces nor the displacements."""
    p = program
    stiffness, load = p.diagonal.max(initial=0.0), np.abs(p.b).max(initial=0.0)
    given = max(np.abs(p.values).max(initial=0.0), -p.g.min(initial=0.0))
    with np.errstate(divide="ignore"):
        k, f, v = np.log10([stiffness, load, given])
    for name, size in (("displacements", max(v, f - k)), ("forces", max(f, k + v))):
        if not (size == -np.inf or SMALLEST < size < LARGEST):
            raise ValueError(
                f"moduli, loads and prescribed displacements make {name} of 1e{size:+.0f}, beyond "
                f"the range of numbers (1e{SMALLEST} to 1e+{LARGEST}); choose other units"
            )


def discretise(
    problem: Problem,
    mesh: ng.Mesh,
    order: int,
    element: str,
    previous: DiscreteProblem | None = None,
) -> DiscreteProblem:
    """Assemble the discrete problem on a mesh that is curved to the element's degree.

    Of a `previous` problem with the same elements on the same mesh, what is the same is used
    again: the stiffness if the bodies are, the factorisation if also the rows and supports are.

    Raises
    ------
    ValueError
        A pair of which no point faces; prescribed displacements that violate a contact row;
        forces or displacements beyond the range of numbers.
    """
    trace = boundary_trace(mesh, order)
    if previous is not None and not same_boundary(trace, previous.space.trace):
        previous = None  # the mesh has been changed in place
    found = contact_lines(problem, trace, [] if previous is None else previous.found)
    space, assembled = _space(problem, trace, element, previous)
    n = space.basis.shape[1] // 2
    conditions = support_conditions(problem, trace)
    lines, rows = merged(found, joined(found, trace))
    length = float(np.abs(trace.curve).max())
    basis = change_of_basis(conditions, rows, length, space.stiffness())
    lines, rows = kept_lines(lines, basis.kept), rows.select(basis.kept)
    B = rows.matrix()
    rigid = None
    loaded = rigid_motions(problem, space, conditions, basis, B, rows.g, rows.equality)
    if loaded is not None:
        rigid, f = loaded
        space = replace(space, f=f)
    T = space.basis @ basis.T
    m = len(basis.unknown)
    if (
        previous is not None
        and not assembled
        and np.array_equal(space.nodal, previous.space.nodal)
        and same_basis(basis, previous.basis)
    ):
        K, systems = previous.program.K, previous.systems
    else:
        K, matrix = congruent(space.matrix, space.A, T)
        systems = None
    program = QuadraticProgram(
        K=K,
        b=T.T @ space.f,
        R=from_triplets(np.ones(m), np.arange(m), basis.unknown, (m, 2 * n)),
        g=rows.g,
        equality=rows.equality,
        fixed=basis.fixed,
        values=basis.values,
        unknown=basis.unknown,
        null_space=no_null_space(2 * n) if rigid is None else rigid.null_space,
    )
    _check_range(program)
    return DiscreteProblem(
        problem=problem,
        space=space,
        found=found,
        lines=lines,
        conditions=conditions,
        B=B,
        basis=basis,
        program=program,
        systems=systems
        or linear_systems(program, matrix, basis.T, vertex_parents(mesh), trace.nodes[space.nodal]),
        rigid=rigid,
        assembled=assembled,
    )


def minimise_energy(discrete: DiscreteProblem, active: Mask) -> Iterate:
    """Exact minimiser of L over K_h.

    Bodies that contact alone can hold start from where they rest when rigid, so that the way
    there costs no digits of the deformation.

    Raises
    ------
    ConvergenceError
        See `ssn.minimise`; carries the last iterate.
    """
    p, rigid, systems = discrete.program, discrete.rigid, discrete.systems
    if rigid is None or not rigid.placing.any():
        systems.restart(p)
        return minimise(systems, active)
    systems.restart(replace(p, g=p.g - rigid.rows @ rigid.placing))
    try:
        result = minimise(systems, active)
    except ConvergenceError as error:
        error.iterate = _placed(p, rigid, error.iterate)
        raise
    result = _placed(p, rigid, result)
    result.u[p.unknown[result.active]] = p.g[result.active]
    return result


def _placed(p: QuadraticProgram, rigid: Rigid, iterate: Iterate) -> Iterate:
    """An iterate relative to where the bodies rest when rigid, with the way there added."""
    u = iterate.u + rigid.motions @ rigid.placing
    u -= p.null_space.lineal @ (p.null_space.conditions @ u)
    return replace(iterate, u=u)
