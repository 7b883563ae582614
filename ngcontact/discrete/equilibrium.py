"""Equilibrium of the load on the rigid motions that supports leave free.

HH81 Remark 3.7: the energy has a minimiser only if the load does no work on a rigid motion that
supports and contact admit.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from scipy.linalg import block_diag
from scipy.optimize import linprog, nnls

from ..arrays import Array, Mask
from ..constraints import BasisTransformation, Conditions
from ..errors import NoEquilibriumError
from ..fem import LOAD_BONUS, Space, load_vector
from ..mesh import cad_edges
from ..problem import Problem
from ..qp import FREE, NullSpace, pinned_null_space, vanishing_combinations
from .rigid_motions import (
    Bodies,
    RigidMotion,
    body_of_unknown,
    connected_bodies,
    functionals,
    node_values,
    rigid_motion,
    unsupported,
    work_of_load,
)

FINER = 5  # quadrature orders added to see the error of those of the loads
CURVED = 2  # degrees added to see the error of the mesh's curved sides
QUADRATURE = 10.0  # times that error is work that may be quadrature
ROUND_OFF = 1e-10  # ... and this, relative to the sum of its terms, round-off
NOISE = 1e-14  # work, relative to the sum of its terms or of all contact forces, that is none
INEXACT = 1e-9  # force of a rigid motion, relative to its terms, that shows it is not in V_h


@dataclass(frozen=True, eq=False)
class Rigid:
    """The r rigid motions that supports leave free, and the load on them.

    Attributes
    ----------
    combinations : ndarray (3 b, r)
        Of the translations and the rotation of each of b bodies.
    rows : ndarray (m, r)
        Left sides of the contact rows.
    work : ndarray (r,)
        Of the load, before what quadrature left of it was taken out.
    gram : callable
        Integrals (r, r) of the products of the motions over the boundaries, made when asked for.
    motions : ndarray (2n, r)
        In the unknowns of the program.
    null_space : NullSpace
        Their part that no row resists, and the rest.
    placing : ndarray (r,)
        Amounts by which the load moves the bodies until contact stops them, were they rigid.
    carries : ndarray of bool (m,)
        Rows that would carry the load there.
    """

    bodies: Bodies
    combinations: Array
    rows: Array
    work: Array
    gram: Callable[[], Array]
    motions: Array
    null_space: NullSpace
    placing: Array
    carries: Mask

    def motion(self, amounts: Array) -> RigidMotion:
        """One of the motions, by its amounts (r,)."""
        multiplier = float(amounts @ self.work / (amounts @ self.gram() @ amounts))
        return rigid_motion(self.bodies, self.combinations @ amounts, multiplier)

    def left_free(self, active: Mask) -> list[RigidMotion]:
        """Motions that the rows `active` do not resist either."""
        return [self.motion(x) for x in vanishing_combinations(self.rows[active]).T]


def _placing(rows: Array, work: Array, g: Array, equality: Mask) -> tuple[Array, Mask]:
    """Where the load presses rigid bodies: amounts (r,), and the rows (m,) that carry it.

    No movement without load, and where bodies must deform to fit at all.
    """
    stay = np.zeros(len(work)), np.zeros(len(g), dtype=bool)
    scale, force = np.abs(g).max(initial=0.0), np.abs(work).max(initial=0.0)
    if scale == 0.0 or force == 0.0:
        return stay
    lineal = vanishing_combinations(rows)
    free = ~equality
    result = linprog(
        -work / force,
        A_ub=rows[free] if free.any() else None,
        b_ub=g[free] / scale if free.any() else None,
        A_eq=np.vstack([rows[equality], lineal.T]),
        b_eq=np.concatenate([g[equality] / scale, np.zeros(lineal.shape[1])]),
        bounds=(None, None),
        method="highs",
    )
    if result.status != 0:
        return stay
    carries = np.zeros(len(g), dtype=bool)
    if free.any():
        carries[free] = result.ineqlin.marginals < -FREE
    return scale * result.x, carries


def _residue(rows: Array, equality: Mask, work: Array) -> tuple[Array, float]:
    """What contact forces, not negative but on equalities, cannot balance of the work (r,).

    Also the sum of these forces, whose round-off reaches bodies without load of their own.
    """
    scale = np.abs(work).max(initial=0.0)
    if scale == 0.0:
        return np.zeros_like(work), 0.0
    G = np.vstack([rows, -rows[equality]]).T
    if G.shape[1] == 0:
        return work, 0.0
    force, _ = nnls(G, work / scale, maxiter=100 * G.shape[1])
    return work - scale * (G @ force), scale * float(force.sum())


def _work_by_shape(problem: Problem, mesh: ng.Mesh, motion: RigidMotion) -> float:
    """What curved sides change of the load's work: the centre of a disc is not that of its mesh."""
    if cad_edges(mesh) is None or len(set(motion.bodies)) < len(motion.bodies):
        return 0.0
    copy = ng.Mesh(mesh.ngmesh.Copy())
    copy.Curve(mesh.GetCurveOrder() + CURVED)
    return work_of_load(problem, copy, motion) - work_of_load(problem, mesh, motion)


def _check_work(
    residue: Array,
    work: Array,
    finer: Array,
    terms: Array,
    carried: float,
    motion: RigidMotion,
    by_shape: Callable[[], float],
) -> None:
    """Raise unless the work on what cannot be balanced is quadrature, round-off or of the shape."""
    amounts = residue / np.abs(residue).max()
    done = float(amounts @ residue)  # what forces balance does no work on it
    allowed = QUADRATURE * abs(float(amounts @ (work - finer)))
    allowed += ROUND_OFF * float(np.abs(amounts) @ terms) + NOISE * carried
    if done > allowed and done > allowed + QUADRATURE * abs(by_shape()):
        raise NoEquilibriumError(
            f"no equilibrium: the load does the work {done:.6g} on a rigid {motion}, which "
            "neither supports nor contact resist; hold that body by `displacement`, `sliding` or "
            "a contact pair, or balance the load",
            body=motion.bodies[0],
            motion=motion,
            work=done,
        )


def rigid_motions(
    problem: Problem,
    space: Space,
    conditions: Conditions,
    basis: BasisTransformation,
    B: sp.csr_array,
    g: Array,
    equality: Mask,
) -> tuple[Rigid, Array] | None:
    """The rigid motions that supports leave free, and the load (2N,) in equilibrium on them.

    Parameters
    ----------
    problem, space, conditions, basis
        The discrete problem.
    B : sparse (m, 2n)
        Contact rows on node values.
    g : ndarray (m,)
        Their bounds.
    equality : ndarray of bool (m,)
        Rows that hold with equality.

    Returns
    -------
    None
        If supports alone hold all bodies.

    Raises
    ------
    NoEquilibriumError
        The load does work on a rigid motion that supports and contact admit.
    ValueError
        The elements do not contain the rotation of a free body.
    """
    trace = space.trace
    bodies = connected_bodies(trace)
    free = unsupported(trace, bodies, conditions)
    if not any(x.shape[1] for x in free):
        return None
    combinations = block_diag(*free)
    of_unknown = body_of_unknown(space, bodies)
    n = space.basis.shape[1] // 2
    Z = node_values(space, bodies, of_unknown[:n]) @ combinations
    in_v = space.basis @ Z
    terms = (space.diagonal[:, None] * np.abs(in_v)).max(axis=0)
    if (np.abs(space.A @ in_v).max(axis=0) > INEXACT * terms).any():
        raise ValueError(
            "curved superparametric elements do not contain the rotation of a body that its "
            'supports leave free; use element="isoparametric"'
        )
    rows = np.asarray(B @ Z)
    work = in_v.T @ space.f
    sizes = np.abs(in_v).T @ np.abs(space.f)
    noise = np.where(np.abs(work) <= NOISE * sizes, work, 0.0)
    residue, carried = _residue(rows, equality, work - noise)

    @cache
    def boundary() -> Array:
        """Integrals (2N, r) of v.z over the boundaries for the motions z."""
        return functionals(space, bodies, of_unknown) @ combinations

    if residue.any():
        finer = in_v.T @ load_vector(problem, space.V, LOAD_BONUS + FINER)
        motion = rigid_motion(bodies, combinations @ residue / np.abs(residue).max(), 0.0)
        _check_work(
            *(residue, work, finer, sizes, carried, motion),
            lambda: _work_by_shape(problem, trace.mesh, motion),
        )
    f = space.f
    if (left := residue + noise).any():
        f = f - boundary() @ np.linalg.solve(in_v.T @ boundary(), left)
    lineal = vanishing_combinations(rows)
    motions = basis.coordinates(Z, rows)
    means = np.zeros((len(motions), 0))
    if lineal.size:
        means = basis.T.T @ (space.basis.T @ (boundary() @ lineal))
    placing, carries = _placing(rows, work - noise - residue, g, equality)
    rigid = Rigid(
        bodies=bodies,
        combinations=combinations,
        rows=rows,
        work=work,
        gram=lambda: in_v.T @ boundary(),
        motions=motions,
        null_space=pinned_null_space(motions, lineal, means.T, basis.unknown, basis.fixed),
        placing=placing,
        carries=carries,
    )
    return rigid, f
