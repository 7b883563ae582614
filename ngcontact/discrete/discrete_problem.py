"""The discrete problems (P_1h), (P_2h) of HH81 on one mesh: reuse, first active sets, solution."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from operator import attrgetter
from types import SimpleNamespace
from typing import Any

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from scipy.spatial import cKDTree

from ..arrays import Array, Mask, by_field, from_triplets
from ..constraints import BasisTransformation, Conditions, held_rows
from ..contact import (
    ContactLine,
    ContactState,
    by_line,
    contact_line,
    for_partial_cover,
    lines_together,
)
from ..errors import ConvergenceError
from ..fem import BoundaryTrace, Space, assemble, boundary_trace, model_of
from ..linalg import (
    COARSEST,
    IterativeSystems,
    Multigrid,
    cholesky,
    cholesky_of_closed_rows,
    coarsenings,
    congruent,
    handed_over,
    truncated_multigrid,
)
from ..mesh import vertex_parents
from ..problem import Contact, Elastic, Hooke, Problem, varies
from ..qp import BorderedSystems, Iterate, QuadraticProgram, SingularError, minimise, no_null_space
from .admissible_set import (
    AdmissibleSet,
    admissible_set,
    conditioned_segments,
    contact_rows,
    support_conditions,
)
from .equilibrium import Rigid, equilibrium

TOUCHING_GAP = 1e-12  # gap, relative to the zone, up to which points start active
CORNER_DISTANCE = 1e-6  # of its two points, by their directions, relative to the zone
IDLE_FORCE = 1e-9  # of a pair, relative to the largest of all pairs, which only round-off makes
DISTANCE_ROUND_OFF = 1e-6  # difference of two distances, relative to them, that it may have made
# Powers of ten between which sums of products keep their digits.
MIN_EXPONENT, MAX_EXPONENT = -306, 305
MIN_REFINED = 0.7  # share of the unknowns that must be gone in the coarsest space


# Sizes from which multigrid takes the place of a factorisation; measurements and tests change them.
MULTIGRID = SimpleNamespace(
    # Unknowns by order from which it is the faster one, on one thread: at 80 000 of orders 1 and 2
    # both take the same time, of order 3 at a million; it always takes less memory.
    large={1: 100_000, 2: 100_000},
    large_solids=dict.fromkeys((1, 2, 3), 25_000),  # whose factors fill up sooner
    coarsest=COARSEST,  # unknowns up to which a problem is factorised anyway
)


def linear_systems(
    program: QuadraticProgram,
    matrix: ng.BaseMatrix | None,
    space: Space,
    basis: BasisTransformation,
) -> BorderedSystems:
    """Systems of a discrete problem: by multigrid where it is large and has coarser spaces.

    `matrix` is that of the `program` for NGSolve, None where `congruent` answers none.
    """
    trace = space.trace
    if matrix is None:
        links = from_triplets(*basis.links, basis.T.shape)
        factor = cholesky_of_closed_rows(space.form.mat, space.basis, basis.T, links)
    else:
        factor = cholesky(matrix)
    parents = vertex_parents(trace.mesh)
    size = program.b.size
    large = MULTIGRID.large if trace.model.dim == 2 else MULTIGRID.large_solids
    small = size < large.get(trace.order, np.inf) or size <= MULTIGRID.coarsest
    d = trace.model.dim
    coarsest = d * np.count_nonzero(parents[:, 0] < 0)  # of the first mesh
    if small or coarsest > (1 - MIN_REFINED) * size:
        return BorderedSystems(program, factor)

    def prepare(free: Mask) -> Multigrid:
        linear = trace.linear(space.nodal)
        steps = coarsenings(basis.T, parents, linear, MULTIGRID.coarsest, d)
        of_all = handed_over(program.K) if matrix is None else matrix
        return truncated_multigrid(of_all, steps, free)

    return IterativeSystems(program, factor, prepare)


@dataclass(frozen=True, eq=False)
class DiscreteProblem(AdmissibleSet):
    """One discrete problem: L over K_h."""

    problem: Problem
    space: Space
    found: list[ContactLine]  # one for each contact pair, with all points
    conditions: Conditions  # Gamma_u and Gamma_0 at nodes
    program: QuadraticProgram  # in those unknowns
    systems: BorderedSystems  # its linear systems, with the factorisation once there is one
    rigid: Rigid | None  # rigid motions that supports leave free, if there are any
    assembled: bool  # False where the stiffness is that of an earlier problem

    def influence(self, active: Mask, jumps: Array) -> Iterate:
        """The displacement of least energy that moves the `active` (m,) points by `jumps` (m,).

        Supports rest, the other points are free, and there are no loads: one back-solve where there
        is a factorisation for the active set. Active points and supports that leave a rigid motion
        free are a `ConvergenceError`.
        """
        p, systems = self.program, self.systems
        if not p.null_space.resisted(p.unknown[active]):
            raise ConvergenceError("contact leaves a rigid motion free")
        zero = np.zeros_like(p.b)
        systems.restart(replace(p, b=zero, g=jumps, values=zero))
        try:
            y, force = systems.solve(active)
        except SingularError as singular:
            raise ConvergenceError(str(singular)) from None
        finally:
            work = systems.factorizations, systems.back_solves
            systems.restart(p)
        return Iterate(
            u=y, force=force, active=active, steps=[], factorizations=work[0], back_solves=work[1]
        )

    def displacement(self, unknowns: Array, load: Array | None) -> ng.GridFunction:
        """The displacement with the given `unknowns` (2n,), under a `load` (2N,) if any."""
        result, space = ng.GridFunction(self.space.V), self.space
        u = space.basis @ (self.basis.T @ unknowns)
        result.vec.FV().NumPy()[:] = space.extended(u, load)
        return result


def same_mesh(trace: BoundaryTrace, space: Space) -> bool:
    """Whether the mesh of `trace` is still as it was when `space` was made on it, in its model."""
    old = space.trace
    return (
        trace.model is old.model
        and np.array_equal(trace.nodes, old.nodes)
        and np.array_equal(trace.bernstein, old.bernstein)
        and np.array_equal(trace.curve, old.curve)
        and np.array_equal(trace.arrays.vertices, old.arrays.vertices)
    )


def same_stiffness(problem: Problem, other: Problem) -> bool:
    """Whether two problems have the same elastic bodies; functions may have changed unseen."""

    def data(law: Elastic | Hooke) -> list[Any]:
        return [type(law), *(np.asarray(value).tolist() for value in vars(law).values())]

    laws, others = problem.materials, other.materials
    if problem.model != other.model or any(map(varies, [*laws.values(), *others.values()])):
        return False
    return {k: data(law) for k, law in laws.items()} == {k: data(law) for k, law in others.items()}


def same_basis(one: BasisTransformation, other: BasisTransformation) -> bool:
    """Whether rows and supports make the same unknowns; bounds and values may differ."""
    return (
        np.array_equal(one.fixed, other.fixed)
        and np.array_equal(one.unknown, other.unknown)
        and one.T.shape == other.T.shape
        and (one.T != other.T).nnz == 0
    )


def _alone(
    contacts: Sequence[Contact], trace: BoundaryTrace, alike: Callable[[Contact], Any]
) -> list[list[int]]:
    """Numbers of pairs of one primary, `alike`, with no node in common, nor a segment with others.

    As the rollers of a bearing on one of its rings.
    """
    groups: dict[Any, list[int]] = defaultdict(list)
    for number, contact in enumerate(contacts):
        if contact.roles == "given" and not callable(contact.gap):
            groups[contact.primary, alike(contact)].append(number)

    def alone(group: list[int]) -> bool:
        segments = [trace.segments(contact.secondary) for contact in contacts]
        own = [segments[number] for number in group]
        nodes = np.concatenate([np.unique(trace.nodes[some]) for some in own])
        pairs = np.bincount(np.concatenate(segments))[np.concatenate(own)]
        return bool((np.bincount(nodes) < 2).all() and (pairs == 1).all())

    return [group for group in groups.values() if len(group) > 1 and alone(group)]


def contact_lines(
    problem: Problem,
    trace: BoundaryTrace,
    conditions: Conditions,
    known: Sequence[ContactLine],
) -> list[ContactLine]:
    """The line of each pair with the `conditions` at its nodes, a known one where it is the same.

    What an earlier pair of the same direction and gap covers is left to that one where both know
    the facing segments. Pairs of one primary whose secondaries meet no other are found at once.
    """

    def held(line: ContactLine) -> Mask:
        return held_rows(conditions, contact_rows([line], trace), np.abs(trace.curve).max())

    sides, others = ("secondary", "primary"), ("direction", "bilateral", "rows", "roles", "gap")
    alike, same, lines = attrgetter(*others), attrgetter(*sides, *others), list[ContactLine]()
    ready: dict[int, ContactLine] = {}
    if trace.model.dim == 2 and not known:
        for group in _alone(problem.contact, trace, alike):
            of_all = lines_together(trace, [problem.contact[number] for number in group])
            ready |= zip(group, of_all, strict=True)
    for number, contact in enumerate(problem.contact):
        if number in ready:
            lines.append(ready[number])
            continue
        taken, facing = [np.zeros(0, dtype=np.intp)], trace.segments(contact.primary)
        for earlier, line in zip(problem.contact[:number], lines, strict=True):
            if alike(earlier) != alike(contact):
                continue
            if earlier.primary == contact.primary:
                taken.append(line.segments)
            elif np.intersect1d(line.facing, facing).size:
                taken.append(line.segments[line.faces])
        own = np.intersect1d(np.concatenate(taken), trace.segments(contact.secondary))
        found = next((line for line in known if same(line.contact) == same(contact)), None)
        if found is None or own.size or contact.gap is not None:  # that may have changed unseen
            in_space = trace.model.dim == 3  # of lines only two ends can be held
            lines.append(contact_line(trace, contact, own, held if in_space else None))
        else:
            lines.append(replace(found, searches=0))
    return lines


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
    Refused are a pair of which no point faces, prescribed displacements that violate a contact row,
    forces or displacements beyond the range of numbers, and what `equilibrium` refuses.
    """
    trace = boundary_trace(mesh, order, model_of(problem))
    trace = for_partial_cover(trace, problem.contact)
    nodal = conditioned_segments(problem, trace)
    if previous is not None and not same_mesh(trace, previous.space):
        previous = None  # its mesh has been changed in place
    conditions, known = support_conditions(problem, trace), list[ContactLine]()  # (3.6), (3.8)
    if previous is not None:
        held = previous.conditions
        same = np.array_equal(held.node, conditions.node)
        if same and np.array_equal(held.direction, conditions.direction):
            known = previous.found
    found = contact_lines(problem, trace, conditions, known)  # Gamma_K, first: it may be refused
    if previous is not None and not same_stiffness(problem, previous.problem):
        previous = None
    stiffness = None if previous is None else previous.space
    space = assemble(problem, trace, element, nodal, stiffness)  # V_h
    passed = np.zeros(0, dtype=np.intp)
    for _ in range(2):
        admissible = admissible_set(space, conditions, found, passed)
        basis, rows, around = admissible.basis, admissible.rows, admissible.around
        rigid, f = equilibrium(problem, space, conditions, rows, basis, around)  # Remark 3.7
        # Of a body one element thick that is in contact on both sides rows are all unknowns.
        pinned = rigid is not None and np.isin(basis.unknown, rigid.null_space.pins)
        passed = basis.kept[np.flatnonzero(pinned)]
        if not passed.size:
            break
    space = replace(space, f=f)
    T = space.basis @ basis.T
    b = T.T @ space.condensed(space.right_side)
    same_unknowns = previous is not None and same_basis(basis, previous.basis)
    if previous is not None and same_unknowns and np.array_equal(nodal, previous.space.nodal):
        program = _program(b, admissible, rigid, previous.program.K)
        systems = previous.systems
    else:
        K, matrix = congruent(space.form.mat, T)
        program = _program(b, admissible, rigid, K)
        systems = linear_systems(program, matrix, space, basis)
    return DiscreteProblem(
        **by_field(admissible),
        problem=problem,
        space=space,
        found=found,
        conditions=conditions,
        program=program,
        systems=systems,
        rigid=rigid,
        assembled=previous is None,
    )


def _program(
    b: Array, admissible: AdmissibleSet, rigid: Rigid | None, K: sp.csr_array
) -> QuadraticProgram:
    """L over K_h in the unknowns of rows and supports, with the load `b` and stiffness `K`."""
    basis = admissible.basis
    p = QuadraticProgram(  # (2.6)
        K=K,
        b=b,
        g=admissible.rows.g,
        equality=admissible.rows.equality,
        fixed=basis.fixed,
        values=basis.values,
        unknown=basis.unknown,
        null_space=no_null_space(K.shape[0]) if rigid is None else rigid.null_space,
    )
    stiffness, load = p.diagonal.max(initial=0.0), np.abs(p.b).max(initial=0.0)
    given = max(np.abs(p.values).max(initial=0.0), -p.g.min(initial=0.0))
    with np.errstate(divide="ignore"):
        k, f, v = np.log10([stiffness, load, given])
    for name, size in (("displacements", max(v, f - k)), ("forces", max(f, k + v))):
        if not (size == -np.inf or MIN_EXPONENT < size < MAX_EXPONENT):
            raise ValueError(
                f"moduli, loads and prescribed displacements make {name} of 1e{size:+.0f}, beyond "
                f"the range of numbers (1e{MIN_EXPONENT} to 1e+{MAX_EXPONENT}); choose other units"
            )
    return p


def reassembled(
    problem: Problem, space: Space, program: dict[str, Any], arrays: dict[str, Any]
) -> DiscreteProblem:
    """A discrete problem of a space that is assembled again and of arrays that were kept.

    `program` has the fields of its quadratic program but the matrix, `arrays` all other fields but
    the linear systems.
    """
    K, matrix = congruent(space.form.mat, space.basis @ arrays["basis"].T)
    again = QuadraticProgram(K=K, **program)
    systems = linear_systems(again, matrix, space, arrays["basis"])
    return DiscreteProblem(problem=problem, space=space, program=again, systems=systems, **arrays)


def minimise_energy(discrete: DiscreteProblem, active: Mask) -> Iterate:
    """Exact minimiser of L over K_h, from the first active set `active` (m,): (P_1h), (P_2h).

    Bodies that contact alone can hold start from where they rest when rigid, so that the way
    there costs no digits of the deformation. What is raised is of `qp.minimise`.
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


def first_active_set(discrete: DiscreteProblem) -> Mask:
    """Cold start (m,): the points that touch before the load.

    Bodies that contact alone can hold are first placed, rigid, where the load presses them.
    """
    p = discrete.program
    gap, carries = p.g, np.zeros(len(p.g), dtype=bool)
    if (rigid := discrete.rigid) is not None:
        gap, carries = gap - rigid.rows @ rigid.placing, rigid.carries
    active = [np.zeros(0, dtype=bool)]
    for line, distance in zip(discrete.lines, by_line(discrete.lines, gap), strict=True):
        size = np.ptp(line.position, axis=0).max() if len(line.node) else 0.0
        active.append(distance <= TOUCHING_GAP * size)
    return np.concatenate(active) | carries


def carried_active_set(lines: Sequence[ContactLine], previous: Sequence[ContactState]) -> Mask:
    """Warm start (m,): the state of the nearest contact point of the same pair on another mesh.

    At orders above 1 the points around a transition are divided by the side of it they lie on: it
    is located more closely than the nodes of either mesh. Of a pair that touches without a force
    as many points are active as were.
    """
    sizes = [np.abs(old.force).max(initial=0.0) for old in previous]
    without_force = IDLE_FORCE * max(sizes, default=0.0)
    carried = [
        _nearest(new, old) if size <= without_force else _carried(new, old)
        for new, old, size in zip(lines, previous, sizes, strict=True)
    ]
    return np.concatenate([np.zeros(0, dtype=bool), *carried])


def _nearest(new: ContactLine, old: ContactState) -> Mask:
    """Points (m,) of one pair that are nearest to an old active one."""
    active = np.zeros(new.node.size, dtype=bool)
    if active.size and old.active.any():
        active[cKDTree(new.position).query(old.line.position[old.active])[1]] = True
    return active


def _carried(new: ContactLine, old: ContactState) -> Mask:
    """First active points of one pair, (m,)."""
    known = old.line  # with points, as it has forces
    # Two points at a corner are distinguished by their directions.
    size = CORNER_DISTANCE * np.ptp(known.position, axis=0).max(initial=0.0)
    tree = cKDTree(np.column_stack([known.position, size * known.direction]))
    places = np.column_stack([new.position, size * new.direction])
    distance, near = tree.query(places, k=[1, min(2, known.node.size)])
    away, nearest = distance[:, 0], near[:, 0]
    # A new point in the middle of two: active if one of them is, whatever round-off says.
    tied = distance[:, 1] <= (1 + DISTANCE_ROUND_OFF) * away
    active: Mask = old.active[nearest] | (tied & old.active[near[:, 1]])
    order, ends = known.rows.shape[1] - 1, old.transitions if known.dim == 2 else None
    elsewhere = away.max(initial=0.0) > size  # else the points are the same
    if order > 1 and elsewhere and ends is not None and len(ends.inner):
        around = np.isin(nearest, [ends.inner, ends.outer])
        end = cKDTree(ends.position).query(new.position)[1]  # the nearest one tells
        inwards = (known.position[ends.inner] - known.position[ends.outer])[end]
        inside = ((new.position - ends.position[end]) * inwards).sum(axis=1) >= 0
        active[around] = inside[around]
    return active
