"""Stresses on triangles, condensed to multipliers of their tractions on sides.

On a triangle the stress is s = T c + s_p: T are the polynomials of `polynomials`, and s_p balances
the body force. With mu, the trace of a displacement, on the sides, 1/2 |s - C e(u_h)|^2 - <s n, mu>
is least for

    A c = g + N mu,  A = (T, T), g = (T, e(u_h) - C^-1 s_p), N = <T n, mu>,

in the norm of C^-1, and the tractions of s are N'A^-1 N mu + N'A^-1 g + <s_p n, .>.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...fem import connected_bodies, model_of
from ...lagrange import gauss
from ...problem import Problem, Triangulation, varies
from ...qp import vanishing_combinations
from .cells import Cells, Places, places
from .parts import projection
from .polynomials import Frame, balancing, frame_of, in_frame, stresses

ON_CURVES = 3  # degrees by which stresses on triangles with a curved side are higher
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
DEFINITE = (1e-15, 1e-14, 1e-13, 1e-12)  # of the diagonal, until it is enough
WHOLE, PARTED = 10, 4  # degrees above 2 k of rules for forces: on triangles, on their parts
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
    source : CoefficientFunction or None
        The body force.
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
    source: ng.CoefficientFunction | None
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

    def alone(self) -> Array:
        """Coefficients c (b, m) without multipliers."""
        return np.linalg.solve(self.root.transpose(0, 2, 1), self.g[..., None])[..., 0]

    def tractions(self, c: Array) -> Array:
        """Moments (b, d) of the tractions of s with coefficients `c` (b, m)."""
        y = (self.root.transpose(0, 2, 1) @ c[..., None])[..., 0]
        return np.asarray(self.own + (self.N.transpose(0, 2, 1) @ y[..., None])[..., 0])

    def basis(self, x: Array, some: Index | slice = slice(None)) -> Array:
        """T (b, q, v, m) at points `x` (b, q, 2)."""
        frame, axial = self.frame[some], self.strain.shape[2] > 3
        return stresses(self.degree, frame, x, frame.local(x), axial, self.on_axis)

    def of_strain(self, strain: Array) -> Element:
        """The same triangles for another displacement, strains (b, q, v), without body forces."""
        b, q, v = strain.shape
        T = self.basis(self.places.x)
        g = np.einsum("bqvm,bqv->bm", T, self.weight[..., None] * strain)
        return replace(
            self,
            strain=strain,
            force=np.zeros_like(self.force),
            radial=np.zeros_like(self.radial),
            source=None,
            missed=np.zeros_like(self.missed),
            g=np.linalg.solve(self.root, g[..., None])[..., 0],
            own=np.zeros_like(self.own),
        )

    def whole_stress(self, c: Array) -> Array:
        """Stresses (b, q, v) at the quadrature points, the radial force's part of the hoop included."""
        s = self.stress(c, self.places.x)
        if s.shape[2] > 3:
            s[..., 2] += self.radial
        return s

    def radial_at(self, cells: Cells, at: Index, reference: Array) -> Array:
        """Radial force times r, (k,), in triangles (k,) at reference places (k, 2)."""
        if self.source is None:
            return np.zeros(len(at))
        return cells.evaluate(ng.x * self.source[0], at, reference)[:, 0]

    def stress(self, c: Array, x: Array, some: Index | slice = slice(None)) -> Array:
        """Stresses (b, q, v) at points `x` (b, q, 2) for coefficients `c` (b, m), without radial forces."""
        s = np.einsum("bqvm,bm->bqv", self.basis(x, some), c[some])
        if self.force.any():
            axial = self.strain.shape[2] > 3
            s = s + balancing(self.force_degree, self.frame[some], x, self.force[some], axial)
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


def multipliers(cells: Cells, degree: int) -> tuple[Index, Multipliers]:
    """Degree (n,) of the stress in each triangle, and the multipliers that it asks for."""
    own = np.where(cells.curved, degree + ON_CURVES, degree)
    of_side = np.zeros(len(cells.ends), dtype=np.intp)
    np.maximum.at(of_side, cells.sides, own[:, None])
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


def elements_of(
    problem: Problem,
    cells: Cells,
    displacement: ng.CoefficientFunction,
    degree: int,
    look: Index,
) -> tuple[Multipliers, list[Element]]:
    """The condensed triangles of a solution, and their multipliers.

    `look` (n, 3) says by what order rules integrate forces, and on parts of what depth,
    with thirds at corners or not.
    """
    own, mu = multipliers(cells, degree)
    on_axis = cells.trace.model.on_axis(cells.vertices)[cells.ends].all(axis=1)[cells.sides]
    key = np.column_stack([own, mu.degree[cells.sides], on_axis.any(axis=1), cells.curved])
    varying = _varying(problem, cells)
    key = np.column_stack([key, varying, _body(cells), look])
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
                    kinds[kind, -3:].tolist(),
                )
            )
    return mu, found


def _body(cells: Cells) -> Index:
    return cells.bodies


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


def _force_of(problem: Problem, cells: Cells, body: int) -> ng.CoefficientFunction | None:
    mesh = cells.trace.mesh
    for pattern, force in problem.force.items():
        if mesh.Materials(pattern).Mask()[body]:
            return ng.CF(force)
    return None


def _element(
    problem: Problem,
    cells: Cells,
    displacement: ng.CoefficientFunction,
    mu: Multipliers,
    at: Index,
    degree: int,
    on_axis: bool,
    look: Sequence[int],
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
    strain = points.evaluate(cells, model.strain(displacement))
    source = _force_of(problem, cells, body)
    force, radial, missed = _forces(source, cells, points, degree, axial, look)
    local = frame.local(points.x) if curved else in_frame(points.local)[None]
    T = stresses(degree, frame, points.x, local, axial, on_axis)
    root = np.sqrt(weight)[..., None]
    D = compliance
    v, m = T.shape[-2:]
    DT = D @ T
    wT = (root[..., None] * T).reshape(b, q * v, m)
    A = wT.transpose(0, 2, 1) @ (root[..., None] * DT).reshape(b, q * v, m)
    rest = strain
    if force.any() or radial.any():
        s_p = balancing(_force_degree(degree, axial), frame, points.x, force, axial)
        if axial:
            s_p[..., 2] += radial
        rest = strain - (D @ s_p[..., None])[..., 0]
    g = np.einsum("bxm,bx->bm", wT, (root * rest).reshape(b, -1))
    scale = 1 / np.sqrt(np.einsum("bmm->bm", A))
    N, own = _moments(cells, mu, at, degree, frame, on_axis, force, axial, m)
    L = _cholesky(A * scale[:, :, None] * scale[:, None, :])
    right = scale[..., None] * np.concatenate([N, g[..., None]], axis=2)
    solved = np.linalg.solve(L, right)
    dofs = np.concatenate(
        [
            mu.start[cells.sides[at, i], None]
            + np.arange(2 * (mu.degree[cells.sides[at[0], i]] + 1))
            for i in range(3)
        ],
        axis=1,
    )
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
        source,
        missed,
        L / scale[:, :, None],
        solved[..., :-1],
        solved[..., -1],
        own,
        dofs,
    )


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
        k = int(mu.degree[side[0]])
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
        start, stop = CORNERS[(i + 1) % 3], CORNERS[(i + 2) % 3]
        local = frame.local(x) if bent else in_frame(start + t[:, None] * (stop - start))[None]
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


def _forces(F, cells, points, degree, axial, look):
    """Coefficients of the force that is balanced, r F_r, and the norm of the rest."""
    b, q = points.weight.shape
    n = _force_degree(degree, axial)
    radial = np.zeros((b, q))
    if F is None:
        return np.zeros((b, (n + 1) * (n + 2) // 2, 2)), radial, np.zeros(b)
    parts = slice(1, None) if axial else slice(None)
    force, missed, size = projection(F, cells, points.at, n, *look, parts)
    if axial:
        radial = points.x[..., 0] * points.evaluate(cells, F)[..., 0]
        force[..., 0] = 0.0
    return force, radial, np.where(missed <= ROUND_OFF * size, 0.0, missed)
