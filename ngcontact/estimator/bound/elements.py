"""Stresses on triangles, condensed to multipliers of their tractions on sides.

On a triangle the stress is s = T c + s_p: T are the polynomials of `polynomials`, and s_p balances
the body force. With mu, the trace of a displacement, on the sides, 1/2 |s - C e(u_h)|^2 - <s n, mu>
is least for

    A c = g + N mu,  A = (T, T), g = (T, e(u_h) - C^-1 s_p), N = <T n, mu>,

in the norm of C^-1, and the tractions of s are N'A^-1 N mu + N'A^-1 g + <s_p n, .>.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...fem import connected_bodies, model_of
from ...lagrange import gauss
from ...problem import Problem, Triangulation, varies
from ...qp import vanishing_combinations
from ...quadrature import numbers
from .cells import Cells, Places, places
from .polynomials import Frame, balancing, frame_of, projected, scalars, stresses

ROUGH = 1e-4  # of a load on a triangle, that stresses of the usual degree may miss
ROUGH_RULE = (8, 4)  # order and parts of the quadrature of such loads
BONUS = 10  # orders of that of others
ON_ROUGH = 3  # degrees by which they are higher where they miss more
ON_CURVES = 4  # degrees by which stresses on triangles with a curved side are higher
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
DEFINITE = (1e-15, 1e-14, 1e-13, 1e-12)  # of the diagonal, until it is enough
ROUND_OFF = 1e-12  # of a force, below which nothing of it is missed
BLOCK = 4000  # triangles at once: bounds the memory


def traces(degree: int, t: Array) -> Array:
    """Orthonormal polynomials (..., degree + 1) on sides, at t (...) in [0, 1]."""
    values = legendre.legvander(2 * t - 1, degree)
    return np.asarray(values * np.sqrt(2 * np.arange(degree + 1) + 1))


@dataclass(frozen=True, eq=False)
class Element:
    """b triangles of one kind: m stresses, d multipliers on each.

    Attributes
    ----------
    places : Places
        Quadrature points, q in each.
    weight : ndarray (b, q)
        With the model's measure.
    frame : Frame
    degree : int
    on_axis : bool
        Whether a side of each lies on the axis.
    compliance : ndarray (b or 1, q or 1, v, v)
        C^-1.
    strain : ndarray (b, q, v)
        e(u_h), Voigt.
    force : ndarray (b, j, 2)
        Coefficients of the body force that s_p balances, of degree `force_degree`.
    radial : ndarray (b, q)
        Radial force times r about an axis: a part of the hoop stress.
    missed : ndarray (b,)
        Norm of what of the body force s_p does not balance.
    root : ndarray (b, m, m)
        L of A = L L'.
    N : ndarray (b, m, d)
        L^-1 N.
    g : ndarray (b, m)
        L^-1 g.
    own : ndarray (b, d)
        Moments of s_p n.
    dofs : ndarray of int (b, d)
        Numbers of the multipliers.
    """

    places: Places
    weight: Array
    frame: Frame
    degree: int
    on_axis: bool
    compliance: Array
    strain: Array
    force: Array
    radial: Array
    missed: Array
    root: Array
    N: Array
    g: Array
    own: Array
    dofs: Index

    @property
    def force_degree(self) -> int:
        """Of the body force that is balanced."""
        return _force_degree(self.degree, self.strain.shape[2] > 3)

    def answer(self, mu: Array) -> Array:
        """Change of c (b, m) with all multipliers, by `mu` (k,)."""
        y = np.einsum("bmd,bd->bm", self.N, mu[self.dofs])
        return np.linalg.solve(self.root.transpose(0, 2, 1), y[..., None])[..., 0]

    def coefficients(self, mu: Array) -> Array:
        """C (b, m) for all multipliers `mu` (k,)."""
        g = np.linalg.solve(self.root.transpose(0, 2, 1), self.g[..., None])[..., 0]
        return g + self.answer(mu)

    def tractions(self, c: Array) -> Array:
        """Moments (b, d) of the tractions of s with coefficients `c` (b, m)."""
        return self.own + np.einsum(
            "bmd,bmn,bn->bd", self.N, self.root.transpose(0, 2, 1), c, optimize=True
        )

    def full_stress(self, c: Array) -> Array:
        """Stress s (b, q, v) at the quadrature points, with radial forces."""
        s = self.stress(c, self.places.x)
        if s.shape[2] > 3:
            s[..., 2] += self.radial
        return s

    def stress(self, c: Array, x: Array, some: Index | slice = slice(None)) -> Array:
        """Stress s (b, q, v) at `x` (b, q, 2) for coefficients `c` (b, m), no radial forces."""
        axial = self.strain.shape[2] > 3
        frame = self.frame[some]
        T = stresses(self.degree, frame, x, frame.local(x), axial, self.on_axis)
        s = np.einsum("bqvm,bm->bqv", T, c[some])
        if self.force.any():
            s = s + balancing(self.force_degree, frame, x, self.force[some], axial)
        return s


def _force_degree(degree: int, axial: bool) -> int:
    return max(0, degree - 1 - axial)


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Numbers of the multipliers: on each of e sides (x, y) by polynomials of its degree.

    `degree` (e,), `start` (e + 1,): those of side i are start[i], ..., start[i + 1] - 1.
    """

    degree: Index
    start: Index

    def of(self, side: int) -> Index:
        """All of one side."""
        return np.arange(self.start[side], self.start[side + 1])


def multipliers(cells: Cells, degree: int, rough: Mask) -> tuple[Index, Multipliers]:
    """Degree (n,) of the stress in each triangle, and the multipliers that it asks for.

    In `rough` triangles (n,) it is higher, but tractions on inner sides are not.
    """
    own = np.where(cells.curved, degree + ON_CURVES, degree)
    of_side = np.zeros(len(cells.ends), dtype=np.intp)
    np.maximum.at(of_side, cells.sides, own[:, None])
    own = own + ON_ROUGH * rough
    of_side = np.where(cells.inner, of_side, own[cells.owner])
    start = np.concatenate([[0], np.cumsum(2 * (of_side + 1))])
    return own, Multipliers(of_side, start)


def rigid_motions(cells: Cells, mu: Multipliers, fixed: Mask) -> Array:
    """Multipliers (d, r) of rigid motions, of size 1, that vanish where they are `fixed` (d,)."""
    trace = cells.trace
    bodies = connected_bodies(trace)
    corner = Triangulation(trace.mesh).triangles[cells.parent[cells.owner], 0]
    body = bodies.of_vertex[corner]
    values = np.zeros((int(mu.start[-1]), len(bodies.names), 3))
    for k in np.unique(mu.degree).tolist():
        side = np.flatnonzero(mu.degree == k)
        t, w = gauss(k + trace.geometry_order)
        x, _ = cells.points(np.repeat(side, len(t)), np.tile(t, len(side)))
        arm = x.reshape(len(side), -1, 2) - bodies.middle[body[side], None]
        arm = arm / bodies.size[body[side], None, None]
        chi = w[:, None] * traces(k, t)
        along_x, at = mu.start[side, None] + np.arange(k + 1), body[side, None]
        values[along_x, at, 0] = values[along_x + k + 1, at, 1] = chi.sum(axis=0)
        values[along_x, at, 2] = -arm[..., 1] @ chi
        values[along_x + k + 1, at, 2] = arm[..., 0] @ chi
    found = values[:, :, np.array(trace.model.motions)].reshape(len(values), -1)
    return np.asarray(found @ vanishing_combinations(found[fixed]))


def elements(
    problem: Problem,
    cells: Cells,
    displacement: ng.CoefficientFunction | None,
    degree: int,
    rest: Callable[[Places, Array], Array] | None = None,
) -> tuple[Multipliers, list[Element]]:
    """The condensed triangles of a solution, and their multipliers.

    Or of the `rest` of body forces, by points and forces there, without a displacement.
    """
    rough = _rough(problem, cells, degree, rest is None)
    own, mu = multipliers(cells, degree, rough)
    on_axis = cells.trace.model.on_axis(cells.vertices)[cells.ends].all(axis=1)[cells.sides]
    key = np.column_stack([own, mu.degree[cells.sides], on_axis.any(axis=1), cells.curved])
    varying = _varying(problem, cells)
    key = np.column_stack([key, varying, cells.bodies, rough])
    kinds, number = np.unique(key, axis=0, return_inverse=True)
    found = []
    for kind in range(len(kinds)):
        every = np.flatnonzero(number.ravel() == kind)
        for start in range(0, len(every), BLOCK):
            at = every[start : start + BLOCK]
            found.append(
                _element(
                    problem,
                    cells,
                    displacement,
                    mu,
                    at,
                    int(kinds[kind, 0]),
                    bool(kinds[kind, 4]),
                    rest,
                    bool(kinds[kind, -1]),
                )
            )
    return mu, found


def _rough(problem: Problem, cells: Cells, degree: int, looked: bool) -> Mask:
    """Triangles (n,) on which loads are no polynomials that stresses of a degree balance."""
    model = cells.trace.model
    axial, rough = model.extent > 0, np.zeros(len(cells.triangles), dtype=bool)
    if not looked:
        return rough
    n = _force_degree(degree, axial)
    for pattern, force in problem.force.items():
        mask = np.array(cells.trace.mesh.Materials(pattern).Mask())
        for bent in (False, True):
            at = np.flatnonzero(mask[cells.bodies] & (cells.curved == bent))
            if numbers(force) or not at.size:
                continue
            points = places(cells, at, 2 * degree + BONUS)
            F = points.evaluate(cells, ng.CF(force))[..., int(axial) :]
            weight = points.weight * model.measure(points.x.reshape(-1, 2)).reshape(len(at), -1)
            frame = frame_of(cells.corners[at])
            rest = F - scalars(n, frame, points.x) @ projected(n, frame, points.x, weight, F)
            miss, size = (np.einsum("bq,bqd->b", weight, f**2) for f in (rest, F))
            rough[at] = miss > ROUGH**2 * np.maximum(size, 1e-4 * size.mean())
    for pattern in problem.traction:
        side = np.flatnonzero(np.isin(cells.segment, cells.trace.segments(pattern)))
        t, w = gauss(2 * degree + 10)
        segment, s = cells.on_side(np.repeat(side, len(t)), np.tile(t, len(side)))
        P = cells.trace.evaluate(problem.traction_vector(pattern), segment, s)
        P = P.reshape(len(side), len(t), 2)
        chi = traces(degree - model.extent, t)
        rest = P - chi @ (chi.T @ (w[:, None] * P))
        miss, size = (np.einsum("q,sqc->s", w, f**2) for f in (rest, P))
        rough[cells.owner[side[miss > ROUGH**2 * size]]] = True
    # Directions of contact and of guides that are not the normals of the mesh.
    sides = [
        name for c in problem.contact if c.direction is None for name in (c.secondary, c.primary)
    ]
    side = np.flatnonzero(np.isin(cells.segment, cells.trace.segments(*sides, problem.sliding)))
    segment, s = cells.on_side(np.tile(side, 2), np.repeat([0.0, 1.0], len(side)))
    turn = cells.trace.exact_normal(segment, s) - cells.trace.normal(segment, s)
    turned = np.linalg.norm(turn, axis=1).reshape(2, -1).max(axis=0) > ROUGH
    rough[cells.owner[side[turned & ~cells.bent[side]]]] = True
    return rough


def _varying(problem: Problem, cells: Cells) -> Index:
    mesh = cells.trace.mesh
    flags = np.zeros(len(mesh.GetMaterials()), dtype=np.intp)
    for pattern, law in problem.materials.items():
        flags[np.array(mesh.Materials(pattern).Mask())] = varies(law)
    return flags[cells.bodies]


def law_of(problem: Problem, cells: Cells, body: int) -> ng.CoefficientFunction:
    """The law of a body, (v, v)."""
    mesh = cells.trace.mesh
    for pattern, law in problem.materials.items():
        if mesh.Materials(pattern).Mask()[body]:
            return law.voigt(problem.model)
    raise AssertionError


def compliance_at(problem: Problem, cells: Cells, points: Places) -> Array:
    """C^-1 at places of one body, (b, q, v, v) or, of a law of numbers, (1, 1, v, v)."""
    at = points.at
    law = law_of(problem, cells, int(cells.bodies[at[0]]))
    if _varying(problem, cells)[at[0]]:
        C = points.evaluate(cells, law)
    else:
        C = cells.evaluate(law, at[:1], np.full((1, 2), 1 / 3))[None]
    v = round(C.shape[-1] ** 0.5)
    return np.linalg.inv(C.reshape(*C.shape[:2], v, v))


def force_of(problem: Problem, cells: Cells, body: int) -> ng.CoefficientFunction | None:
    """The force on a body, if there is one."""
    mesh = cells.trace.mesh
    for pattern, force in problem.force.items():
        if mesh.Materials(pattern).Mask()[body]:
            return ng.CF(force)
    return None


def _element(
    problem: Problem,
    cells: Cells,
    displacement: ng.CoefficientFunction | None,
    mu: Multipliers,
    at: Index,
    degree: int,
    on_axis: bool,
    rest: Callable[[Places, Array], Array] | None,
    finer: bool,
) -> Element:
    model = model_of(problem)
    axial = model.extent > 0
    body = int(cells.bodies[at[0]])
    curved, varying = bool(cells.curved[at[0]]), bool(_varying(problem, cells)[at[0]])
    order = 2 * degree + 4 * (curved or varying or axial)
    points = places(cells, at, order)
    b, q = points.weight.shape
    weight = points.weight * model.measure(points.x.reshape(-1, 2)).reshape(b, q)
    frame = frame_of(cells.corners[at])
    compliance = compliance_at(problem, cells, points)
    strain = np.zeros((b, q, 3 + model.extent))
    if displacement is not None:
        strain = points.evaluate(cells, model.strain(displacement))
    force, radial, missed = _forces(problem, cells, points, frame, degree, body, axial, rest, finer)
    local = frame.local(points.x) if curved else points.local[None]
    T = stresses(degree, frame, points.x, local, axial, on_axis)
    root = np.sqrt(weight)[..., None]
    D = compliance
    v, m = T.shape[-2:]
    weighted = (root[..., None] * T).reshape(b, q * v, m)
    A = weighted.transpose(0, 2, 1) @ (root[..., None] * (D @ T)).reshape(b, q * v, m)
    wanted = strain
    if force.any() or radial.any():
        s_p = balancing(_force_degree(degree, axial), frame, points.x, force, axial)
        if axial:
            s_p[..., 2] += radial
        wanted = strain - (D @ s_p[..., None])[..., 0]
    g = np.einsum("bxm,bx->bm", weighted, (root * wanted).reshape(b, -1))
    scale = 1 / np.sqrt(np.einsum("bmm->bm", A))
    N, own = _moments(cells, mu, at, degree, frame, on_axis, force, axial, m)
    L = _cholesky(A * scale[:, :, None] * scale[:, None, :])
    right = scale[..., None] * np.concatenate([N, g[..., None]], axis=2)
    solved = np.linalg.solve(L, right)
    of_side = mu.degree[cells.sides[at[0]]]
    dofs = np.concatenate(
        [
            start[:, None] + np.arange(2 * (k + 1))
            for start, k in zip(mu.start[cells.sides[at]].T, of_side, strict=True)
        ],
        axis=1,
    )
    highest = np.maximum(of_side, degree)
    shared = np.concatenate(
        [np.tile(np.arange(j + 1) <= k, 2) for j, k in zip(highest, of_side, strict=True)]
    )
    N, g = solved[..., :-1], solved[..., -1]
    if not shared.all():
        N, g, own = _without(N, g, own, shared)
    return Element(
        points,
        weight,
        frame,
        degree,
        on_axis,
        compliance,
        strain,
        force,
        radial,
        missed,
        L / scale[:, :, None],
        N,
        g,
        own,
        dofs,
    )


def _without(N: Array, g: Array, own: Array, shared: Mask) -> tuple[Array, Array, Array]:
    """N, g, moments of s_p n of the `shared` multipliers (d,), where all other moments vanish."""
    basis, R = np.linalg.qr(N[:, :, ~shared])
    fixed = -np.linalg.solve(R.transpose(0, 2, 1), own[:, ~shared, None])
    N, g = N[:, :, shared], g[..., None]
    along = basis.transpose(0, 2, 1) @ N
    own = own[:, shared] + (along.transpose(0, 2, 1) @ fixed)[..., 0]
    g = g - basis @ (basis.transpose(0, 2, 1) @ g - fixed)
    return N - basis @ along, g[..., 0], own


def _cholesky(A: Array) -> Array:
    """Of matrices (b, m, m) with unit diagonals that are definite but for round-off.

    What is added to A changes which stress is the nearest, not its equilibrium.
    """
    for added in (0.0, *DEFINITE):
        try:
            return np.linalg.cholesky(A + added * np.eye(A.shape[-1]))
        except np.linalg.LinAlgError:
            continue
    raise ContactError("triangles are too thin, or too curved, for an equilibrated stress")


def _moments(cells, mu, at, degree, frame, on_axis, force, axial, m):
    """N (b, m, d), and the moments (b, d) of s_p n."""
    found, given = [], []
    for i in range(3):
        side = cells.sides[at, i]
        k = max(int(mu.degree[side[0]]), degree)
        bent = bool(cells.bent[side[0]])
        t, w = gauss(degree + k + 2 * axial + (4 * cells.trace.geometry_order if bent else 0))
        own = np.where(cells.backward[at, i, None], 1 - t, t)
        x, dx = (
            z.reshape(len(at), -1, 2) for z in cells.points(np.repeat(side, len(t)), own.ravel())
        )
        dx = np.where(cells.backward[at, i, None, None], -dx, dx)
        normal = np.stack([dx[..., 1], -dx[..., 0]], axis=-1)  # times ds / dt
        weight = w * cells.trace.model.measure(x.reshape(-1, 2)).reshape(len(at), -1)
        chi = weight[..., None] * traces(k, own)
        local = (
            frame.local(x)
            if bent
            else (
                CORNERS[(i + 1) % 3] + t[:, None] * (CORNERS[(i + 2) % 3] - CORNERS[(i + 1) % 3])
            )[None]
        )
        T = stresses(degree, frame, x, local, axial, on_axis)
        found.append(_tractions(T, normal, chi))
        if force.any():
            s = balancing(_force_degree(degree, axial), frame, x, force, axial)[..., None]
            given.append(_tractions(s, normal, chi)[:, 0])
        else:
            given.append(np.zeros((len(at), 2 * (k + 1))))
    return np.concatenate(found, axis=2), np.concatenate(given, axis=1)


def _tractions(T: Array, normal: Array, chi: Array) -> Array:
    """Moments (b, m, 2 r) of tractions of T (b, q, v, m) with chi (b, q, r)."""
    nx, ny = normal[..., :1], normal[..., 1:]
    tx = T[:, :, 0] * nx + T[:, :, -1] * ny
    ty = T[:, :, -1] * nx + T[:, :, 1] * ny
    return np.concatenate([tx.transpose(0, 2, 1) @ chi, ty.transpose(0, 2, 1) @ chi], axis=2)


def _forces(problem, cells, points, frame, degree, body, axial, less, finer):
    """Coefficients of the force that is balanced, r F_r, and the norm of the rest."""
    b, q = points.weight.shape
    n = _force_degree(degree, axial)
    j = (n + 1) * (n + 2) // 2
    F = force_of(problem, cells, body)
    if F is None:
        return np.zeros((b, j, 2)), np.zeros((b, q)), np.zeros(b)
    fine = places(cells, points.at, *(ROUGH_RULE if finer else (2 * degree + BONUS,)))
    values = fine.evaluate(cells, F)
    size = values
    if less is not None:
        values = less(fine, values)
    measure = cells.trace.model.measure(fine.x.reshape(-1, 2)).reshape(b, -1)
    weight = fine.weight * measure
    force = projected(n, frame, fine.x, weight, values)
    rest = values - scalars(n, frame, fine.x) @ force
    if axial:
        rest[..., 0] = 0.0
        radial = (
            points.x[..., 0] * points.evaluate(cells, F)[..., 0]
            if less is None
            else np.zeros((b, q))
        )
        force[..., 0] = 0.0
    else:
        radial = np.zeros((b, q))
    missed = np.sqrt(np.einsum("bq,bqd->b", weight, rest**2))
    size = np.sqrt(np.einsum("bq,bqd->b", weight, size**2))
    return force, radial, np.where(missed <= ROUND_OFF * size, 0.0, missed)
