"""Rigid motions of the bodies, explicit vectors: translations and rotations."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import ngsolve as ng
import numpy as np
from scipy.linalg import block_diag

from ..arrays import Array, Index
from ..constraints import Conditions
from ..fem import (
    Bodies,
    BoundaryTrace,
    Space,
    body_of_unknown,
    connected_bodies,
)
from ..problem import MeshArrays, Problem, numbers
from ..qp import FREE, vanishing_combinations
from ..quadrature import SampledElements, loads_of

NOT_RIGID = 1e-9  # force of a rigid motion, relative to its terms, that shows it is not in V_h


@dataclass(frozen=True, eq=False)
class RigidMotion:
    """A rigid motion, of size 1 or so, of one or several bodies.

    Attributes
    ----------
    bodies : tuple of str
        What moves, the body that moves most first.
    translation : ndarray (k, 2)
        Of the middle of each of them, a length.
    rotation : ndarray (k,)
        Angle, anticlockwise, about the middle.
    middle : ndarray (k, 2)
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
        """What the first body does."""
        (tx, ty), turn, centre = self.translation[0], self.rotation[0], self.middle[0].copy()
        size = max(abs(tx), abs(ty))
        if turn == 0.0:
            words = f"along ({tx / size + 0.0:.3g}, {ty / size + 0.0:.3g})"
        else:
            centre += np.array([-ty, tx]) / turn
            words = f"about ({centre[0] + 0.0:.3g}, {centre[1] + 0.0:.3g})"
        kind = "translation" if turn == 0.0 else "rotation"
        others = "".join(f' with "{name}"' for name in self.bodies[1:])
        return f'{kind} of "{self.bodies[0]}" {words}{others}'


def unsupported(
    trace: BoundaryTrace, bodies: Bodies, c: Conditions, motions: Sequence[bool]
) -> list[Array]:
    """Motions (3, d) of each body - translations, rotation - that its supports leave free.

    Of those that are rigid in the model: `motions` (3,), see `Model`.
    """
    order = trace.order + 1
    position = np.zeros((trace.space.ndof, 2))
    body = np.zeros(trace.space.ndof, dtype=np.intp)
    segment, s = trace.at_nodes(np.arange(len(trace.region)))
    position[trace.nodes.ravel()] = trace.point(segment, s)
    body[trace.nodes.ravel()] = np.repeat(bodies.of_segment, order)
    at = body[c.node]
    arm = (position[c.node] - bodies.middle[at]) / bodies.size[at, None]
    turn = arm[:, 0] * c.direction[:, 1] - arm[:, 1] * c.direction[:, 0]
    resisted = np.column_stack([c.direction, turn])
    rigid = np.flatnonzero(motions)
    result = []
    for b in range(len(bodies.names)):
        free = vanishing_combinations(np.take(resisted[at == b], rigid, axis=1))
        result.append(np.zeros((3, free.shape[1])))
        result[-1][rigid] = free
    return result


def rigid_motion(bodies: Bodies, amounts: Array, multiplier: float) -> RigidMotion:
    """Motion by the `amounts` (3b,) of the translations and rotations of all bodies."""
    parts = amounts.reshape(-1, 3).copy()
    parts[np.abs(parts) <= FREE * np.abs(parts).max()] = 0.0
    size = np.abs(parts).max(axis=1)
    moving = [int(b) for b in np.argsort(-size, kind="stable") if size[b] > 0]
    return RigidMotion(
        bodies=tuple(bodies.names[b] for b in moving),
        translation=parts[moving, :2],
        rotation=parts[moving, 2] / bodies.size[moving],
        middle=bodies.middle[moving],
        multiplier=multiplier,
    )


def node_values(space: Space, bodies: Bodies, of_node: Index) -> Array:
    """Translations and rotation of each body, (2n, 3b), as values of nodes and unknowns.

    `of_node` (n,) is the body of each of them; translations are 1, rotations 1 at half its size.
    """
    trace = space.trace
    n = space.basis.shape[1] // 2
    place = np.zeros((n, 2))
    one = np.zeros(n)
    one[: trace.mesh.nv] = 1.0
    if trace.geometry_order == 1:  # edge and inner functions have no part in straight elements
        place[: trace.mesh.nv] = MeshArrays(trace.mesh).vertices
    else:
        field = ng.GridFunction(trace.space)
        for axis, x in enumerate((ng.x, ng.y)):
            field.Set(x)
            place[:, axis] = field.vec.FV().NumPy()
    segment, s = trace.at_nodes(space.nodal)
    nodes = trace.nodes[space.nodal].ravel()
    place[nodes], one[nodes] = trace.point(segment, s), 1.0
    values = np.zeros((2 * n, 3 * len(bodies.names)))
    for b, (middle, size) in enumerate(zip(bodies.middle, bodies.size, strict=True)):
        at = np.flatnonzero(of_node == b)
        arm = (place[at] - one[at, None] * middle) / size
        values[at, 3 * b] = values[at + n, 3 * b + 1] = one[at]
        values[at, 3 * b + 2], values[at + n, 3 * b + 2] = -arm[:, 1], arm[:, 0]
    return values


def functionals(space: Space, bodies: Bodies, of_unknown: Index) -> Array:
    """Integrals (2N, 3b) of v.z over the boundary of each body, for its three motions z.

    `of_unknown` (2N,) is the body of each unknown.
    """
    v = space.V.TestFunction()
    columns = []
    for z in (ng.CF((1, 0)), ng.CF((0, 1)), ng.CF((-ng.y, ng.x))):
        form = ng.LinearForm(space.V)
        form += space.trace.model.weighted(z * v.Trace()) * ng.ds
        form.Assemble()
        columns.append(form.vec.FV().NumPy().copy())
    x, y, turn = columns
    result = np.zeros((len(x), 3 * len(bodies.names)))
    for b, ((cx, cy), size) in enumerate(zip(bodies.middle, bodies.size, strict=True)):
        parts = np.column_stack([x, y, (turn + cy * x - cx * y) / size])
        result[:, 3 * b : 3 * b + 3] = np.where((of_unknown == b)[:, None], parts, 0.0)
    return result


@dataclass(frozen=True, eq=False)
class FreeMotions:
    """The r rigid motions that supports leave free, as functions of V_h.

    Attributes
    ----------
    space : Space
        V_h.
    bodies : Bodies
        What moves.
    combinations : ndarray (3b, r)
        Of the translations and the rotation of each of b bodies.
    of_unknown : ndarray of int (2N,)
        The body of each unknown of V_h.
    nodal : ndarray (2n, r)
        Node values, lengths.
    values : ndarray (2N, r)
        Unknowns of V_h.
    """

    space: Space
    bodies: Bodies
    combinations: Array
    of_unknown: Index
    nodal: Array
    values: Array

    @property
    def of_bodies(self) -> Array:
        """The combinations of each body, (b, 3, r)."""
        return self.combinations.reshape(len(self.bodies.names), 3, -1)

    @property
    def names(self) -> list[str]:
        """Of the bodies that can move."""
        both = zip(self.bodies.names, self.of_bodies, strict=True)
        return [name for name, part in both if part.any()]

    @cached_property
    def means(self) -> Array:
        """Integrals (2N, r) of v.z over the boundaries for the motions z, made when asked for."""
        return functionals(self.space, self.bodies, self.of_unknown) @ self.combinations

    @cached_property
    def gram(self) -> Array:
        """Integrals (r, r) of the products of the motions over the boundaries."""
        return self.values.T @ self.means

    def motion(self, amounts: Array, multiplier: float = 0.0) -> RigidMotion:
        """One of the motions, by its `amounts` (r,)."""
        return rigid_motion(self.bodies, self.combinations @ amounts, multiplier)


def free_motions(
    space: Space, conditions: Conditions, motions: Sequence[bool]
) -> FreeMotions | None:
    """The rigid motions that the supports `conditions` leave free, None if there are none.

    Of those that are rigid in the model: `motions` (3,), see `Model`.

    Raises
    ------
    ValueError
        The elements do not contain the rotation of a free body.
    """
    bodies = connected_bodies(space.trace)
    free = unsupported(space.trace, bodies, conditions, motions)
    if not any(x.shape[1] for x in free):
        return None
    combinations = block_diag(*free)
    of_unknown = body_of_unknown(space, bodies)
    n = space.basis.shape[1] // 2
    nodal = node_values(space, bodies, of_unknown[:n]) @ combinations
    values = space.basis @ nodal
    terms = (space.diagonal[:, None] * np.abs(values)).max(axis=0)
    if (np.abs(space.A @ values).max(axis=0) > NOT_RIGID * terms).any():
        raise ValueError(
            "curved superparametric elements do not contain the rotation of a body that its "
            'supports leave free; use element="isoparametric"'
        )
    return FreeMotions(space, bodies, combinations, of_unknown, nodal, values)


def measured_work(problem: Problem, free: FreeMotions) -> tuple[Array, Array] | None:
    """Work (r,) of the load on the free motions, by the mesh, and the error (r,) measured of it.

    None where all loads are numbers: those of V_h are exact.
    """
    trace, bodies = free.space.trace, free.bodies
    mesh, model = trace.mesh, trace.model
    loads = loads_of(problem, mesh)
    if all(numbers(load.data) for load in loads):
        return None
    work, error = np.zeros((2, free.combinations.shape[1]))
    for load in loads:
        view, density = SampledElements(mesh, 2 if load.kind == "force" else 1), load.density
        found = load.where_rough(free.space.V.globalorder)
        rough = None if found is None else found.rough
        inside = view.inside(load.region)
        for b, ((x, y), size) in enumerate(zip(bodies.middle, bodies.size, strict=True)):
            amounts = free.combinations[3 * b : 3 * b + 3]
            moving = np.flatnonzero(amounts.any(axis=0))
            here = inside[bodies.of_vertex[view.ends[inside, 0]] == b]
            if here.size and moving.size:
                turn = ((ng.x - x) * density[1] - (ng.y - y) * density[0]) / size
                parts = amounts[:, moving].T.tolist()
                powers = [r * density[0] + s * density[1] + t * turn for r, s, t in parts]
                power = model.weighted(ng.CF(tuple(powers)))
                done, missed = view.integral(power, here, rough)
                work[moving] += done
                error[moving] += missed
    return work, error
