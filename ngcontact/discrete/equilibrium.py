"""Equilibrium of the load on the rigid motions that supports leave free.

HH81 Remark 3.7: the energy has a minimiser only if the load does no work on a rigid motion that
supports and contact admit.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np
from scipy.optimize import linprog, nnls

from ..arrays import Array, Mask
from ..errors import NoEquilibriumError
from ..fem import Space, model_of
from ..mesh import cad_edges
from ..problem import Problem
from ..qp import FREE, NullSpace, pinned_null_space, vanishing_combinations
from ..quadrature import loads_of
from .admissible_set import AdmissibleSet
from .rigid_motions import FreeMotions, RigidMotion, free_motions, measured_work

LOAD_ORDER = 10  # of quadrature, enough for smooth loads on curved elements
CURVED = 2  # degrees added to see the error of the mesh's curved sides
QUADRATURE = 3.0  # times the error that is measured of the load's work is none; measured: up to .21
WORK_NOISE = 1e-10  # ... and this, relative to the sum of its terms, round-off
BALANCED = 1e-13  # of all contact forces: what their least squares leave, measured 2e-14
HARDLY = 1e-2  # of a motion, that closes or opens no gap more: contact hardly resists it
NO_WORK = 1e-14  # work, relative to the sum of its terms, that is none


@dataclass(frozen=True, eq=False)
class Rigid:
    """The r rigid motions that supports leave free, the load and the contact rows on them.

    Attributes
    ----------
    free : FreeMotions
        The motions.
    rows : ndarray (m, r)
        Left sides of the contact rows, lengths.
    work : ndarray (r,)
        Of the load, before what quadrature left of it was taken out.
    motions : ndarray (2n, r)
        In the unknowns of the program.
    null_space : NullSpace
        Their part that no row resists, and the rest.
    placing : ndarray (r,)
        Amounts by which the load moves the bodies until contact stops them, were they rigid.
    carries : ndarray of bool (m,)
        Rows that would carry the load there.
    """

    free: FreeMotions
    rows: Array
    work: Array
    motions: Array
    null_space: NullSpace
    placing: Array
    carries: Mask

    def left_free(self, active: Mask) -> list[RigidMotion]:
        """Motions that the rows `active` (m,) do not resist either, Remark 3.7."""
        return [self._motion(x) for x in vanishing_combinations(self.rows[active]).T]

    def hardly_held(self, values: Array) -> NoEquilibriumError | None:
        """What is to be said of a large motion that contact rows hardly see, None without one.

        Of one body or all, in the displacement of node `values` (2n,). A wrong moment, as of a
        hole's normals at points of a pin that lies elsewhere in it, drives it as far as round-off
        and the mesh allow.
        """
        free, extent = self.free, np.abs(values).max(initial=0.0)
        amounts = np.linalg.solve(free.nodal.T @ free.nodal, free.nodal.T @ values)
        lineal = vanishing_combinations(self.rows)
        amounts -= lineal @ np.linalg.lstsq(lineal, amounts)[0]
        for part in (free.combinations, *free.of_bodies):
            mine = np.where(part.any(axis=0), amounts, 0.0)
            size, seen = (np.abs(x @ mine).max(initial=0.0) for x in (part, self.rows))
            if size > HARDLY * extent and seen < HARDLY * size:
                motion, work = free.motion(mine / size), float(mine @ self.work)
                return NoEquilibriumError(
                    f"contact hardly holds a rigid {motion}: by {size:.3g} it opens or closes gaps "
                    f"by {seen:.3g} only, and the load does the work {work:.6g}; give that body as "
                    "secondary, hold it by `displacement` or `sliding`, or draw it where the load "
                    "presses it",
                    body=motion.bodies[0],
                    motion=motion,
                    work=work,
                )
        return None

    def on(self, space: Space | None) -> Rigid:
        """The same as functions of an equal space; of None, to be kept without one."""
        return replace(self, free=replace(self.free, space=space))  # type: ignore[arg-type]

    def _motion(self, amounts: Array) -> RigidMotion:
        """One of the motions, by its amounts (r,), with the multiplier of its condition."""
        multiplier = float(amounts @ self.work / (amounts @ self.free.gram @ amounts))
        return self.free.motion(amounts, multiplier)


def equilibrium(
    problem: Problem, space: Space, admissible: AdmissibleSet
) -> tuple[Rigid | None, Array]:
    """The rigid motions that supports leave free, and the load (2N,) in equilibrium on them.

    None, and the load as it is, if supports alone hold all bodies.

    Raises
    ------
    NoEquilibriumError
        The load does work on a rigid motion that supports and contact admit.
    ValueError
        The elements do not contain the rotation of a free body.
    """
    free = free_motions(space, admissible.conditions, model_of(problem).motions)
    if free is None:
        return None, space.f
    rows = np.asarray(admissible.B @ free.nodal)
    work = free.values.T @ space.f
    residue, noise = _left_over(problem, free, rows, admissible.equality, work)
    f, left = space.f, residue + noise
    if left.any():  # Remark 3.7: without it the energy has no minimiser
        f = f - free.means @ np.linalg.solve(free.gram, left)
    rest = work - noise - residue
    placing, carries = _placing(rows, rest, admissible.g, admissible.equality)
    motions = admissible.basis.coordinates(free.nodal, rows)
    rigid = Rigid(
        free=free,
        rows=rows,
        work=work,
        motions=motions,
        null_space=_null_space(free, rows, motions, admissible),
        placing=placing,
        carries=carries,
    )
    return rigid, f


def _null_space(
    free: FreeMotions, rows: Array, motions: Array, admissible: AdmissibleSet
) -> NullSpace:
    """The motions that no row resists, with the condition of Remark 3.7, and the others' pins.

    That condition: the mean of the motion over the boundary of the bodies vanishes.
    """
    basis = admissible.basis
    lineal = vanishing_combinations(rows)
    means = np.zeros((len(motions), 0))
    if lineal.size:
        means = basis.T.T @ (free.space.basis.T @ (free.means @ lineal))
    return pinned_null_space(motions, lineal, means.T, basis.unknown, basis.fixed)


def _left_over(
    problem: Problem, free: FreeMotions, rows: Array, equality: Mask, work: Array
) -> tuple[Array, Array]:
    """Work (r,) that contact cannot balance, left by quadrature, and work (r,) that is round-off.

    Raises
    ------
    NoEquilibriumError
        It is more than these leave.
    """
    terms = np.abs(free.values).T @ np.abs(free.space.f)
    noise = np.where(np.abs(work) <= NO_WORK * terms, work, 0.0)
    residue, carried = _residue(rows, equality, work - noise)
    if _done(residue) > _allowed(residue, WORK_NOISE * terms, carried):
        _check_work(problem, free, rows, equality, work - noise, WORK_NOISE * terms)
    return residue, noise


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


def _done(residue: Array) -> float:
    """Work on the motion by what cannot be balanced: what forces balance does none on it."""
    unit = np.abs(residue).max(initial=0.0) or 1.0
    return float(residue / unit @ residue)


def _allowed(residue: Array, error: Array, carried: float) -> float:
    """Work on that motion that is none: of errors (r,), and of the `carried` contact forces."""
    unit = np.abs(residue).max(initial=0.0) or 1.0
    return float(np.abs(residue / unit) @ error) + BALANCED * carried


def work_of_load(problem: Problem, mesh: ng.Mesh, motion: RigidMotion) -> float:
    """Work of the load on a rigid motion of bodies with names of their own, by the mesh's shape."""
    z = {}
    parts = zip(motion.bodies, motion.translation, motion.rotation, motion.middle, strict=True)
    for name, (tx, ty), turn, (cx, cy) in parts:
        z[name] = ng.CF((tx - turn * (ng.y - cy), ty + turn * (ng.x - cx)))
    moved = mesh.MaterialCF(z, default=ng.CF((0, 0)))
    work, model = 0.0, model_of(problem)
    for load in loads_of(problem, mesh):
        there = moved if load.kind == "force" else ng.BoundaryFromVolumeCF(moved)
        power = model.weighted(ng.InnerProduct(load.density, there))
        work += ng.Integrate(power, mesh, definedon=load.region, order=LOAD_ORDER)
    return float(work)


def _work_by_shape(problem: Problem, mesh: ng.Mesh, motion: RigidMotion) -> float:
    """What curved sides change of the load's work: the centre of a disc is not that of its mesh."""
    if cad_edges(mesh) is None or len(set(motion.bodies)) < len(motion.bodies):
        return 0.0
    return work_of_load(problem, _curved(mesh), motion) - work_of_load(problem, mesh, motion)


def load_by_shape(problem: Problem, mesh: ng.Mesh) -> Array:
    """What curved sides change of all loads at most, forces (2,) per thickness.

    A disc weighs more than its mesh, and pressure acts on more than the mesh of an arc.
    """
    change, model = np.zeros(2), model_of(problem)
    if cad_edges(mesh) is None or not loads_of(problem, mesh):
        return change
    meshes = (mesh, _curved(mesh))
    for own, finer in zip(*(loads_of(problem, m) for m in meshes), strict=True):
        coarse, fine = (
            np.array(
                ng.Integrate(
                    model.weighted(load.density), m, definedon=load.region, order=LOAD_ORDER
                )
            )
            for m, load in zip(meshes, (own, finer), strict=True)
        )
        change += np.abs(model.resultant(fine - coarse))
    return change


def _curved(mesh: ng.Mesh) -> ng.Mesh:
    """A copy with sides of a higher degree."""
    copy = ng.Mesh(mesh.ngmesh.Copy())
    copy.Curve(mesh.GetCurveOrder() + CURVED)
    return copy


def _check_work(
    problem: Problem, free: FreeMotions, rows: Array, equality: Mask, work: Array, noise: Array
) -> None:
    """Raise unless the work (r,) that cannot be balanced is quadrature, round-off or of the shape.

    Loads that are not numbers are integrated again: their own work decides, to the error that is
    measured of it, not what the rules of V_h made of it.
    """
    measured = measured_work(problem, free)
    if measured is not None:
        work, noise = measured[0], noise + QUADRATURE * measured[1]
    residue, carried = _residue(rows, equality, work)
    done, allowed = _done(residue), _allowed(residue, noise, carried)
    if done <= allowed:
        return
    motion = free.motion(residue / np.abs(residue).max())
    if done > allowed + QUADRATURE * abs(_work_by_shape(problem, free.space.trace.mesh, motion)):
        raise NoEquilibriumError(
            f"no equilibrium: the load does the work {done:.6g} on a rigid {motion}, which "
            "neither supports nor contact resist; hold that body by `displacement`, `sliding` or "
            "a contact pair, or balance the load",
            body=motion.bodies[0],
            motion=motion,
            work=done,
        )
