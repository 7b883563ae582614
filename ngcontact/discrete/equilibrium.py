"""Rigid motions that supports leave free, and equilibrium of the load on them.

HH81 Remark 3.7: the energy has a minimiser only if the load does no work on a rigid motion that
supports and contact admit.
"""

from __future__ import annotations

import itertools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any, TypeAlias

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from netgen.occ import OCCGeometry
from scipy.linalg import block_diag
from scipy.optimize import linprog, nnls

from ..arrays import Array, Columns, Index, Mask, across, dense, rotations
from ..constraints import BasisTransformation, Conditions, Rows
from ..errors import NoEquilibriumError
from ..fem import Bodies, BoundaryTrace, Space, body_of_unknown, connected_bodies, model_of
from ..linalg import shared
from ..problem import Problem, numbers, region_mask
from ..qp import NULL_SPACE_TOLERANCE, NullSpace, pinned_null_space, vanishing_combinations
from ..quadrature import Load, SampledElements, loads_of

STRAIN_FORCE = 1e-9  # force of a rigid motion, relative to its terms, from which it is not in V_h
LOAD_ORDER = 10  # of quadrature, enough for smooth loads on curved elements
ADDED_DEGREES = 2  # of the mesh's curved sides, to see their error
# Multiple of the measured error of a load's work that is allowed; up to .21 was met.
QUADRATURE_ERRORS = 3.0
ROW_SHARE = 0.02  # of a motion, at free unknowns: a lever of a plate's thickness, .01, is no pin
WORK_NOISE = 1e-10  # work that is allowed besides, relative to the sum of its terms: round-off
FORCE_ROUND_OFF = 1e-13  # of all contact forces: what their least squares leave, measured 2e-14
MIN_RESISTANCE = 1e-2  # change of gaps by a unit motion, below which contact hardly resists it
SPREAD_SHARE = 1e-6  # of the force of a point that those beside it on its segments have at least
WORK_ROUND_OFF = 1e-14  # work, relative to the most that the load could do, that is none

# Of work (r,) what contact forces (m,) cannot balance, and these.
Balance: TypeAlias = Callable[[Array], tuple[Array, Array]]


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A rigid motion, of size 1 or so, of one or several bodies.

    Attributes
    ----------
    bodies : tuple of str
        What moves, the body that moves most first.
    translation : ndarray (k, d)
        Of the middle of each of them, a length.
    rotation : ndarray (k, r)
        About the middle: the angle, anticlockwise, in the plane, r = 1; in space about x, y and z.
    middle : ndarray (k, d)
        Places, lengths.
    multiplier : float
        Of the condition that the integral of v.z ds over the boundary of the bodies vanishes, for
        the motion z: what the quadrature of the load leaves, a force per length.
    """

    bodies: tuple[str, ...]
    translation: Array
    rotation: Array
    middle: Array
    multiplier: float = 0.0

    def __str__(self) -> str:
        """The motion of the first body in words."""
        t, turn, centre = self.translation[0], self.rotation[0], self.middle[0]
        first = f'of "{self.bodies[0]}"'
        if not turn.any():
            words = f"translation {first} along {_described(t / np.abs(t).max())}"
        elif len(turn) == 1:
            words = f"rotation {first} about {_described(centre + across(t) / turn)}"
        else:
            pitch = turn @ t / (turn @ turn) * turn  # along the axis
            at = centre + np.cross(turn, t) / (turn @ turn)
            kind = "screw" if np.abs(pitch).max() > NULL_SPACE_TOLERANCE * np.abs(t).max() else ""
            axis = f"along {_described(turn / np.abs(turn).max())} through {_described(at)}"
            words = f"{kind or 'rotation'} {first} about the axis {axis}"
        return words + "".join(f' with "{name}"' for name in self.bodies[1:])

    def field(self, body: int) -> ng.CoefficientFunction:
        """The displacement (d,) of one of the bodies, by its number among them."""
        d = self.middle.shape[1]
        arm = [x - float(c) for x, c in zip((ng.x, ng.y, ng.z), self.middle[body], strict=False)]
        t, turn = self.translation[body].tolist(), self.rotation[body].tolist()
        if d == 2:
            return ng.CF((t[0] - turn[0] * arm[1], t[1] + turn[0] * arm[0]))
        return ng.CF(tuple(t)) + ng.Cross(ng.CF(tuple(turn)), ng.CF(tuple(arm)))


def _described(x: Array) -> str:
    """A vector in a few characters."""
    return f"({', '.join(f'{value:.3g}' for value in x + 0.0)})"


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """The r rigid motions that supports leave free."""

    bodies: Bodies  # what moves
    # (m * b, r), of the translations and rotations, m = 3 or 6 in space, of each of b bodies
    combinations: Array
    nodal: Columns  # (d * n, r) node values, lengths; sparse of several bodies

    @property
    def of_bodies(self) -> Array:
        """The combinations of each body, (b, m, r)."""
        return self.combinations.reshape(len(self.bodies.names), -1, self.combinations.shape[1])

    @property
    def names(self) -> list[str]:
        """Names of the bodies that can move."""
        both = zip(self.bodies.names, self.of_bodies, strict=True)
        return [name for name, part in both if part.any()]

    def motion(self, amounts: Array, multiplier: float = 0.0) -> RigidMotion:
        """One of the motions, by its `amounts` (r,)."""
        parts = (self.combinations @ amounts).reshape(len(self.bodies.names), -1)
        parts[np.abs(parts) <= NULL_SPACE_TOLERANCE * np.abs(parts).max()] = 0.0
        size = np.abs(parts).max(axis=1)
        moving = [int(b) for b in np.argsort(-size, kind="stable") if size[b] > 0]
        d = self.bodies.middle.shape[1]
        return RigidMotion(
            bodies=tuple(self.bodies.names[b] for b in moving),
            translation=parts[moving, :d],
            rotation=parts[moving, d:] / self.bodies.size[moving, None],
            middle=self.bodies.middle[moving],
            multiplier=multiplier,
        )


def free_motions(
    space: Space, conditions: Conditions, motions: Sequence[bool]
) -> tuple[FreeMotions, Columns] | None:
    """The rigid motions that the supports `conditions` leave free, None if there are none.

    And their unknowns (d * N, r) in V_h. Of those that are rigid in the model: `motions` (m,), see
    `Model`.
    Elements that do not contain the rotation of a free body are refused.
    """
    trace = space.trace
    bodies, rigid = connected_bodies(trace), np.flatnonzero(motions)
    position = np.zeros((trace.space.ndof, trace.model.dim))
    body = np.zeros(trace.space.ndof, dtype=np.intp)
    position[trace.nodes] = trace.positions(np.arange(len(trace.region)))
    body[trace.nodes] = bodies.of_segment[:, None]
    at = body[conditions.node]
    arm = (position[conditions.node] - bodies.middle[at]) / bodies.size[at, None]
    turn = np.einsum("kir,ki->kr", rotations(arm), conditions.direction)
    resisted = np.column_stack([conditions.direction, turn])[:, rigid]
    free = [vanishing_combinations(resisted[at == b]) for b in range(len(bodies.names))]
    if not any(x.shape[1] for x in free):
        return None
    combinations = block_diag(*(np.eye(len(motions))[:, rigid] @ x for x in free))
    of_unknown, n = body_of_unknown(space, bodies), space.basis.shape[1] // trace.model.dim
    own = _node_values(space, bodies, of_unknown[:n])
    of_node = np.tile(of_unknown[:n], trace.model.dim)
    own_values = space.basis @ own
    nodal = _by_body(own, of_node, combinations)
    values = _by_body(own_values, of_unknown, combinations)
    if trace.geometry_order > trace.order:  # else elements contain their own coordinates
        forces = _by_body(space.A @ own_values, of_unknown, combinations)
        terms = _largest(values * space.diagonal[:, None])
        if (_largest(forces) > STRAIN_FORCE * terms).any():
            raise ValueError(
                "curved superparametric elements do not contain the rotation of a body that its "
                'supports leave free; use element="isoparametric"'
            )
    return FreeMotions(bodies, combinations, nodal), values


def _by_body(own: Array, body: Index, combinations: Array) -> Columns:
    """Combinations (n, r) of the `own` motions (n, m) of each `body` (n,); sparse of several."""
    n, m = own.shape
    of_bodies = combinations.reshape(-1, m, combinations.shape[1])
    moving = np.flatnonzero(of_bodies.any(axis=(1, 2)))
    if len(moving) == 1:
        return np.where((body == moving[0])[:, None], own @ of_bodies[moving[0]], 0.0)
    column = m * body[:, None] + np.arange(m)
    each = (own.ravel(), column.ravel(), np.arange(0, n * m + 1, m))
    return sp.csr_array(each, (n, len(combinations))) @ sp.csr_array(combinations)


def _largest(columns: Columns) -> Array:
    """Largest size (r,) in each of the `columns` (n, r)."""
    return dense(abs(columns).max(axis=0)).ravel()


def _node_values(space: Space, bodies: Bodies, body: Index) -> Array:
    """Translations by 1 and turns, by 1 at half the size, (d * n, m), of each node's `body`."""
    trace, d = space.trace, space.trace.model.dim
    n = space.basis.shape[1] // d
    place, one = np.zeros((n, d)), np.zeros(n)
    one[: trace.mesh.nv] = 1.0
    if trace.geometry_order == 1:  # edge and inner functions have no part in straight elements
        place[: trace.mesh.nv] = trace.arrays.vertices
    else:
        field = ng.GridFunction(trace.space)
        for axis, x in enumerate((ng.x, ng.y, ng.z)[:d]):
            field.Set(x)
            place[:, axis] = field.vec.FV().NumPy()
    nodes = trace.nodes[space.nodal]
    place[nodes], one[nodes] = trace.positions(space.nodal), 1.0
    moves = one[:, None, None] * np.eye(d)
    arm = (place - one[:, None] * bodies.middle[body]) / bodies.size[body, None]
    both = np.concatenate([moves, rotations(arm)], axis=2)
    return both.transpose(1, 0, 2).reshape(d * n, -1)


@dataclass(frozen=True, eq=False)
class Rigid:
    """The r rigid motions that supports leave free, the load and the contact rows on them."""

    free: FreeMotions
    gram: Array  # (r, r) products of the motions, over the boundaries where work is left
    rows: Array  # (m, r) left sides of the contact rows, lengths
    work: Array  # (r,) of the load, before what quadrature left of it was taken out
    motions: Columns  # (d * n, r) in the unknowns of the program
    null_space: NullSpace  # their part that no row resists, and the rest
    placing: Array  # (r,) amounts by which the load moves rigid bodies until contact stops them
    carries: Mask  # (m,) rows that would carry the load there

    def left_free(self, active: Mask) -> list[RigidMotion]:
        """Motions that the rows `active` (m,) do not resist either, Remark 3.7."""
        found, free = vanishing_combinations(self.rows[active]).T, self.free
        return [free.motion(x, float(x @ self.work / (x @ self.gram @ x))) for x in found]

    def hardly_held(self, values: Array) -> NoEquilibriumError | None:
        """The error of a large motion that hardly changes any gap, None without one.

        Of one body or all, in the displacement of node `values` (d * n,). Wrong moments make
        it as large as the mesh allows, as those of a hole's normals at points of a pin that is not
        in its middle.
        """
        free, extent = self.free, np.abs(values).max(initial=0.0)
        amounts = np.linalg.solve(dense(free.nodal.T @ free.nodal), free.nodal.T @ values)
        unresisted = vanishing_combinations(self.rows)
        amounts -= unresisted @ np.linalg.lstsq(unresisted, amounts)[0]
        for part in (free.combinations, *free.of_bodies):
            mine = np.where(part.any(axis=0), amounts, 0.0)
            size, seen = (np.abs(x @ mine).max(initial=0.0) for x in (part, self.rows))
            if size > MIN_RESISTANCE * extent and seen < MIN_RESISTANCE * size:
                motion, work = free.motion(mine / size), float(mine @ self.work)
                return NoEquilibriumError(
                    f"contact hardly holds a rigid {motion}: by {size:.3g} it opens or closes gaps "
                    f"by {seen:.3g} only, and the load does the work {work:.6g}; give that body as "
                    "secondary, hold it by `displacement` or `sliding`, or draw it where the load "
                    "presses it",
                    motion=motion,
                    work=work,
                )
        return None


def equilibrium(
    problem: Problem,
    space: Space,
    conditions: Conditions,
    rows: Rows,
    basis: BasisTransformation,
    around: Callable[[Array], Array],
) -> tuple[Rigid | None, Array]:
    """The rigid motions that supports leave free, and the load (d * N,) in equilibrium on them.

    None, and the load as it is, if supports alone hold all bodies. `around` sums values of rows
    over those on their segments. A load that does work on a rigid motion which supports and contact
    admit, or needs contact forces at single points, is a `NoEquilibriumError`.
    """
    found = free_motions(space, conditions, model_of(problem).motions)
    if found is None:
        return None, space.f
    free, values = found
    f, work, of_rows = space.f, values.T @ space.f, rows.left_sides(free.nodal)
    left_sides, terms = dense(of_rows), abs(values).T @ np.abs(f)
    # If all of the load on a body acted along its motions, each of which moves one body:
    of_body = np.bincount(body_of_unknown(space, free.bodies), np.abs(f))
    most = _largest(values) * of_body[free.of_bodies.any(axis=1).argmax(axis=0)]
    noise = np.where(np.abs(work) <= WORK_ROUND_OFF * most, work, 0.0)
    balance = partial(_unbalanced, left_sides, rows.equality)
    left, forces = balance(work - noise)
    if not _is_within(left, forces, WORK_NOISE * terms):
        _check_work(problem, space, free, balance, work - noise, WORK_NOISE * terms)
    left = left + noise
    unresisted, size = vanishing_combinations(left_sides), np.abs(forces)
    if np.sum(size > SPREAD_SHARE * size.max(initial=0.0)) < len(work) - unresisted.shape[1]:
        spread = left_sides + SPREAD_SHARE * around(left_sides)
        idle, forces = _unbalanced(spread, rows.equality, work - left)
        if not _is_within(idle, forces, np.zeros_like(work)):
            raise _concentrated(space.trace, free, rows.node, left_sides, idle, size)
    # Integrals of v.z over the boundaries for the motions z; any product serves motions that rows
    # resist, if no work is left.
    means = _boundary_mass(space) @ values if left.any() or unresisted.size else values
    gram = dense(values.T @ means)
    if left.any():  # Remark 3.7: without it the energy has no minimiser
        f = f - means @ np.linalg.solve(gram, left)
    placing, carries = _placing(left_sides, unresisted, work - left, rows.g, rows.equality)
    motions = basis.coordinates(free.nodal, of_rows)
    vanishing = np.zeros((motions.shape[0], 0))
    if unresisted.size:  # the mean of such a motion over the boundary of the bodies
        vanishing = basis.T.T @ (space.basis.T @ (means @ unresisted))
    at = basis.unknown, basis.fixed
    null_space = pinned_null_space(motions, unresisted, vanishing.T, *at, ROW_SHARE)
    return Rigid(free, gram, left_sides, work, motions, null_space, placing, carries), f


def _boundary_mass(space: Space) -> sp.csr_array:
    """Integrals (d * N, d * N) of u.v over the boundaries of all bodies."""
    mass, (u, v) = ng.BilinearForm(space.V), space.V.TnT()
    mass += space.trace.model.weighted(u.Trace() * v.Trace()) * ng.ds
    return shared(mass.Assemble().mat)


def _placing(
    rows: Array, unresisted: Array, work: Array, g: Array, equality: Mask
) -> tuple[Array, Mask]:
    """Amounts (r,) by which the load moves rigid bodies into contact, and rows (m,) in force."""
    no_motion = np.zeros(len(work)), np.zeros(len(g), dtype=bool)
    scale, force = np.abs(g).max(initial=0.0), np.abs(work).max(initial=0.0)
    if scale == 0.0 or force == 0.0:
        return no_motion
    free = ~equality
    result = linprog(
        -work / force,
        A_ub=rows[free],
        b_ub=g[free] / scale,
        A_eq=np.vstack([rows[equality], unresisted.T]),
        b_eq=np.concatenate([g[equality] / scale, np.zeros(unresisted.shape[1])]),
        bounds=(None, None),
        method="highs",
    )
    if result.status != 0:
        return no_motion
    carries = np.zeros(len(g), dtype=bool)
    carries[free] = result.ineqlin.marginals < -NULL_SPACE_TOLERANCE
    return scale * result.x, carries


def _unbalanced(rows: Array, equality: Mask, work: Array) -> tuple[Array, Array]:
    """Work (r,) that contact forces (m,), positive or of equalities, cannot balance, and these."""
    scale = np.abs(work).max(initial=0.0)
    G = np.vstack([rows, -rows[equality]]).T
    if scale == 0.0 or G.shape[1] == 0:
        return work, np.zeros(len(rows))
    force = scale * nnls(G, work / scale, maxiter=100 * G.shape[1])[0]
    left, (m, pull) = work - G @ force, (len(rows), np.zeros(len(rows)))
    pull[equality] = force[m:]
    return left, force[:m] - pull


def _motion_of(left: Array) -> Array:
    """The motion (r,) on which this is work: what forces balance does none on it."""
    return left / (np.abs(left).max(initial=0.0) or 1.0)


def _is_within(left: Array, forces: Array, error: Array, beside: float = 0.0) -> bool:
    """Whether errors (r,), round-off of `forces` (m,) and work `beside` explain work `left`."""
    motion, round_off = _motion_of(left), FORCE_ROUND_OFF * np.abs(forces).sum()
    return bool(motion @ left <= np.abs(motion) @ error + round_off + beside)


def _concentrated(
    trace: BoundaryTrace, free: FreeMotions, node: Index, rows: Array, idle: Array, forces: Array
) -> NoEquilibriumError:
    """The error of a load through an end of contact, whose `forces` (m,) cannot be spread.

    Their energy is infinite: at a point of the plane, in space along an edge. Of work `idle` (r,)
    spread forces leave so much; by that motion contact opens, at nodes `node` (m,) as their `rows`
    (m, r) say, but for those.
    """
    motion = _motion_of(idle)
    opening, words = np.abs(rows @ motion), free.motion(motion)
    at = node[np.where(opening <= 2 * SPREAD_SHARE * opening.max(), forces, 0.0).argmax()]
    segment, place = np.argwhere(trace.nodes == at)[0]
    return NoEquilibriumError(
        f"no equilibrium: the load does no work on a rigid {words}, which opens contact but for "
        f"an end of its zone, at {_described(trace.positions(np.array([segment]))[0, place])}: a "
        "force at a point, in space along an edge, has infinite energy, which no mesh resolves; "
        "move the load towards the zone, or hold that body by `displacement` or `sliding`",
        motion=words,
        work=0.0,
    )


def _check_work(
    problem: Problem, space: Space, free: FreeMotions, balance: Balance, work: Array, noise: Array
) -> None:
    """Raise unless quadrature, round-off or the mesh's shape made the unbalanced `work` (r,)."""
    measured = _measured_work(problem, space, free)
    if measured is not None:
        work, noise = measured[0], noise + QUADRATURE_ERRORS * measured[1]
    left, forces = balance(work)
    if _is_within(left, forces, noise):
        return
    motion, mesh = free.motion(_motion_of(left)), space.trace.mesh
    of_shape, done = 0.0, float(_motion_of(left) @ left)
    if len(set(motion.bodies)) == len(motion.bodies):  # their names tell them apart
        of_shape = abs(float(_change_by_shape(problem, mesh, motion).sum()))
    if not _is_within(left, forces, noise, QUADRATURE_ERRORS * of_shape):
        raise NoEquilibriumError(
            f"no equilibrium: the load does the work {done:.6g} on a rigid {motion}, which "
            "neither supports nor contact resist; hold that body by `displacement`, `sliding` or "
            "a contact pair, or balance the load",
            motion=motion,
            work=done,
        )


def _measured_work(problem: Problem, space: Space, free: FreeMotions) -> tuple[Array, Array] | None:
    """Work (r,) of the load on the motions, and its measured error (r,); None of numbers."""
    trace, bodies = space.trace, free.bodies
    loads, measured = loads_of(problem, trace.mesh), _adaptively if problem.dim == 2 else _by_rules
    if all(numbers(load.data) for load in loads):
        return None
    arrays = trace.arrays
    body = {ng.VOL: bodies.of_vertex[arrays.elements[:, 0]], ng.BND: bodies.of_segment}
    region = {ng.VOL: arrays.bodies, ng.BND: arrays.boundaries}
    work, error = np.zeros((2, free.combinations.shape[1]))
    for load, (b, amounts) in itertools.product(loads, enumerate(free.of_bodies)):
        kind, loaded = load.region.VB(), region_mask(load.region)
        here = np.flatnonzero((body[kind] == b) & loaded[region[kind]])
        moving = np.flatnonzero(amounts.any(axis=0))  # each motion is of one body
        if here.size and moving.size:
            fields = [free.motion(one).field(0) for one in np.eye(len(work))[moving]]
            powers = tuple(ng.InnerProduct(load.density, field) for field in fields)
            power, order = trace.model.weighted(ng.CF(powers)), space.V.globalorder
            work_here, error_here = measured(load, power, here, order)
            work[moving] += work_here
            error[moving] += error_here
    return work, error


def _adaptively(
    load: Load, power: ng.CoefficientFunction, elements: Index, order: int
) -> tuple[Array, Array]:
    """Integrals (c,) of `power` (c,) over `elements` (k,), of a load, and their errors (c,)."""
    found = load.where_rough(order)
    view = SampledElements(load.region.mesh, 2 if load.kind == "force" else 1)
    return view.integral(power, elements, None if found is None else found.rough)


def _by_rules(
    load: Load, power: ng.CoefficientFunction, elements: Index, order: int
) -> tuple[Array, Array]:
    """The same of solids; errors are the differences of two rules of quadrature."""
    where: dict[str, Any] = {"definedon": load.region, "element_wise": True}
    orders, mesh = (LOAD_ORDER, LOAD_ORDER + ADDED_DEGREES), load.region.mesh
    found = [[ng.Integrate(one, mesh, order=k, **where) for one in power] for k in orders]
    coarse, fine = np.asarray(found)[..., elements].sum(axis=2)
    return fine, np.abs(fine - coarse)


def _change_by_shape(problem: Problem, mesh: ng.Mesh, motion: RigidMotion | None = None) -> Array:
    """Change of the work of each load on a rigid motion by curved sides, (k, 1).

    Of bodies with names of their own; on the d translations of all, (k, d), without a motion. The
    centre of a disc is not that of its mesh.
    """
    finer, model, work = ng.Mesh(mesh.ngmesh.Copy()), model_of(problem), []
    finer.Curve(mesh.GetCurveOrder() + ADDED_DEGREES)
    axes = np.eye(model.dim).tolist()
    for m in (mesh, finer) if isinstance(mesh.ngmesh.GetGeometry(), OCCGeometry) else ():
        fields = [ng.CF(tuple(axis)) for axis in axes]
        if motion is not None:
            z = {name: motion.field(b) for b, name in enumerate(motion.bodies)}
            fields = [m.MaterialCF(z, default=ng.CF((0,) * model.dim))]
        for load in loads_of(problem, m):
            inside = load.kind == "force"
            there = [z if inside else ng.BoundaryFromVolumeCF(z) for z in fields]
            power = model.weighted(ng.CF(tuple(ng.InnerProduct(load.density, z) for z in there)))
            work.append(ng.Integrate(power, m, definedon=load.region, order=LOAD_ORDER))
    none = np.zeros((2, 0, model.dim))
    coarse, fine = np.reshape(work, (2, len(work) // 2, -1)) if work else none
    return np.asarray(fine - coarse)


def load_by_shape(problem: Problem, mesh: ng.Mesh) -> Array:
    """Largest change of all loads by curved sides, forces (d,) per thickness.

    A disc weighs more than its mesh, and pressure acts on more than the mesh of an arc.
    """
    resultant, changes = model_of(problem).resultant, _change_by_shape(problem, mesh)
    return np.abs([resultant(x) for x in changes]).reshape(-1, changes.shape[1]).sum(axis=0)
