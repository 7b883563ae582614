"""Stresses on triangles, condensed to multipliers of their tractions on sides.

On a triangle the stress is s = T c + s_p: T are the polynomials of `polynomials`, and s_p balances
the body force. With mu, the trace of a displacement, on the sides, 1/2 |s - C e(u_h)|^2 - <s n, mu>
is least for

    A c = g + N mu,  A = (T, T), g = (T, e(u_h) - C^-1 s_p), N = <T n, mu>,

in the norm of C^-1, and the tractions of s are N'A^-1 N mu + N'A^-1 g + <s_p n, .>.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeVar

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
from .polynomials import (
    Frame,
    airy_stress,
    balancing,
    bending,
    frame_of,
    in_frame,
    stresses,
)

TURNED = 1e-4  # sine of the angle between normals that are not one
ON_CURVES = 4  # degrees by which stresses on triangles with a curved side are higher
CORNERS = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
CLOCKWISE = np.array([[0.0, -1.0], [1.0, 0.0]])  # vectors, rows, turned by a right angle
DEFINITE = (1e-15, 1e-14, 1e-13, 1e-12)  # of the diagonal, until it is enough
WHOLE, PARTED = 10, 4  # degrees above 2 k of rules for forces: on triangles, on their parts
ROUND_OFF = 1e-12  # of a force, below which nothing of it is missed
BLOCK = 4000  # triangles at once: bounds the memory
SMALL_BLOCK = 500  # ... where each has a table of its own

Value = TypeVar("Value")


def traces(degree: int, t: Array) -> Array:
    """Orthonormal polynomials (..., degree + 1) on sides at `t` (...,), from 0 to 1."""
    values = legendre.legvander(2 * t - 1, degree)
    return np.asarray(values * np.sqrt(2 * np.arange(degree + 1) + 1))


@dataclass(frozen=True, eq=False)
class Triangles:
    """b triangles of one kind, with stresses of one degree and v Voigt components.

    Attributes
    ----------
    places : Places
        Quadrature points, q in each.
    weight : ndarray (b, q)
        With the model's measure.
    frame : Frame
    degree : int
    curved, axial : bool
        Whether the base of each is curved; whether the model is axisymmetric.
    on_axis : bool
        Whether a side of each lies on the axis.
    compliance : ndarray (b, q, v, v)
        C^-1, one over a stress; (1, 1, v, v) where it is one matrix for all.
    """

    places: Places
    weight: Array
    frame: Frame
    degree: int
    curved: bool
    axial: bool
    on_axis: bool
    compliance: Array

    @property
    def alike(self) -> bool:
        """Whether T is one table for all, but for `Frame.airy`, and C a number."""
        return not self.curved and not self.axial and self.compliance.shape[:2] == (1, 1)

    @property
    def local(self) -> Array:
        """The quadrature points in `frame`, (q, 2), or (b, q, 2) of curved triangles."""
        return self.frame.local(self.places.x) if self.curved else in_frame(self.places.local)

    @property
    def force_degree(self) -> int:
        """Of the body force that is balanced."""
        return max(0, self.degree - 1 - self.axial)

    def basis(self, x: Array, local: Array) -> Array:
        """T (b, q, v, m) at points `x` (b, q, 2), which are `local` (b, q, 2) in `frame`.

        Or (q, 2), where that is the same for all.
        """
        return stresses(self.degree, self.frame, x, local, self.axial, self.on_axis)

    def balancing(self, x: Array, force: Array, some: Index | slice = slice(None)) -> Array:
        """Stresses s_p (b, q, v) at `x` (b, q, 2) in `some` (b,) of n triangles, or in all.

        `force` (n, j, 2) is as of `Element`; radial forces are left out.
        """
        frame = self.frame[some]
        return balancing(self.force_degree, frame, x, force[some], self.axial)

    def tested(self, strain: Array) -> Array:
        """Products (T, e), shape (b, m), with strains e, `strain` (b, q, v)."""
        local, b = self.local, len(strain)
        strain = self.weight[..., None] * strain
        if self.alike:
            second = (strain @ self.frame.airy).reshape(b, -1)
            table = bending(self.degree, local)
            return np.asarray(second @ table.reshape(-1, table.shape[-1]))
        T = self.basis(self.places.x, local)
        T = T.reshape(b, -1, T.shape[-1])
        return np.asarray((strain.reshape(b, 1, -1) @ T)[:, 0])

    def squared(self) -> Array:
        """Products A = (T, T), shape (b, m, m)."""
        b, local = len(self.weight), self.local
        if self.alike:
            table = bending(self.degree, local)
            m = table.shape[-1]
            size = self.weight.sum(axis=1)[:, None, None]
            share = (self.weight[0] / self.weight[0].sum())[:, None, None]
            R = np.tensordot(share * table, table, (0, 0)).transpose(0, 2, 1, 3)  # (3, 3, m, m)
            airy = self.frame.airy
            M = size * (airy.transpose(0, 2, 1) @ self.compliance[0] @ airy)
            return np.asarray(M.reshape(b, 9) @ R.reshape(9, m * m)).reshape(b, m, m)
        T = np.sqrt(self.weight)[..., None, None] * self.basis(self.places.x, local)
        m = T.shape[-1]
        strains = (self.compliance @ T).reshape(b, -1, m)
        return np.asarray(T.reshape(b, -1, m).transpose(0, 2, 1) @ strains)


@dataclass(frozen=True, eq=False)
class Element(Triangles):
    """Condensed triangles: m stresses, d multipliers on each.

    Attributes
    ----------
    strain : ndarray (b, q, v)
        e(u_h), Voigt.
    force : ndarray (b, j, 2)
        Coefficients of the body force that s_p balances, of degree `force_degree`.
    radial : ndarray (b, q)
        Radial force times r about an axis: a part of the hoop stress.
    source : CoefficientFunction or None
        The body force.
    missed : ndarray (b,)
        L2 norm of what of the body force s_p does not balance, times the measure.
    root : ndarray (b, m, m)
        L of A = L L'.
    N : ndarray (b, m, d)
        L^-1 N.
    g : ndarray (b, m)
        L^-1 g.
    own : ndarray (b, d)
        Moments of s_p n.
    sides : ndarray of int (b, 3)
        Numbers of the sides.
    dofs : ndarray of int (b, d)
        Numbers of their multipliers.
    """

    strain: Array
    force: Array
    radial: Array
    source: ng.CoefficientFunction | None
    missed: Array
    root: Array
    N: Array
    g: Array
    own: Array
    sides: Index
    dofs: Index

    def answer(self, mu: Array) -> Array:
        """A^-1 N mu (b, m): what all multipliers of the mesh, `mu` (k,), add to c."""
        y = np.einsum("bmd,bd->bm", self.N, mu[self.dofs])
        return np.asarray(np.linalg.solve(self.root.transpose(0, 2, 1), y[..., None])[..., 0])

    def alone(self) -> Array:
        """A^-1 g (b, m): the coefficients c without multipliers."""
        return np.asarray(np.linalg.solve(self.root.transpose(0, 2, 1), self.g[..., None])[..., 0])

    def tractions(self, c: Array) -> Array:
        """Moments (b, d) of the tractions of s with the multipliers, by coefficients `c` (b, m)."""
        y = (self.root.transpose(0, 2, 1) @ c[..., None])[..., 0]
        return np.asarray(self.own + (self.N.transpose(0, 2, 1) @ y[..., None])[..., 0])

    def of_strain(self, strain: Array) -> Element:
        """The same triangles for a displacement of `strain` (b, q, v), without body forces."""
        g = np.linalg.solve(self.root, self.tested(strain)[..., None])
        return replace(
            self,
            strain=strain,
            force=np.zeros_like(self.force),
            radial=np.zeros_like(self.radial),
            source=None,
            missed=np.zeros_like(self.missed),
            g=np.asarray(g[..., 0]),
            own=np.zeros_like(self.own),
        )

    def whole_stress(self, c: Array) -> Array:
        """Stresses (b, q, v) at the quadrature points for coefficients `c` (b, m).

        With the hoop's part of radial forces.
        """
        s = self._stress(c, self.places.x, self.local, slice(None))
        if self.axial:
            s[..., 2] += self.radial
        return s

    def radial_at(self, cells: Cells, at: Index, reference: Array) -> Array:
        """Radial force times r, (k,), in triangles `at` (k,) of `cells`, about an axis.

        `reference` (k, 2) are the places in the parents; units of stress.
        """
        if self.source is None:
            return np.zeros(len(at))
        return cells.evaluate(ng.x * self.source[0], at, reference)[:, 0]

    def stress(self, c: Array, x: Array, some: Index | slice = slice(None)) -> Array:
        """Stresses (b, q, v) at `x` (b, q, 2) in `some` (b,) of the n triangles, or in all.

        `c` (n, m) are the coefficients in all; the hoop's part of radial forces is left out.
        """
        return self._stress(c[some], x, self.frame[some].local(x), some)

    def _stress(self, c: Array, x: Array, local: Array, some: Index | slice) -> Array:
        frame = self.frame[some]
        if self.axial:
            T = stresses(self.degree, frame, x, local, self.axial, self.on_axis)
            s = (T @ c[:, None, :, None])[..., 0]
        else:
            s = airy_stress(self.degree, frame, local, c)
        return s + self.balancing(x, self.force, some) if self.force.any() else s


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Numbers of the multipliers: on each of e sides those of mu_x, then those of mu_y.

    Attributes
    ----------
    degree : ndarray of int (e,)
        Of their polynomials, `traces`.
    start : ndarray of int (e + 1,)
        Those of side i are start[i], ..., start[i + 1] - 1.
    """

    degree: Index
    start: Index

    def of(self, side: int) -> Index:
        """The k multipliers of one side, (k,)."""
        return np.arange(self.start[side], self.start[side + 1])


def among(
    elements: Sequence[Element], coefficients: Sequence[Array], at: Index
) -> Iterator[tuple[Element, Array, Index, Index]]:
    """The elements that have some of the triangles `at` (m,).

    Parameters
    ----------
    coefficients : sequence of ndarray (b, m)
        Of a stress on the triangles of each element.

    Yields
    ------
    element : Element
    c : ndarray (b, m)
        Its coefficients.
    mine, some : ndarray of int (k,)
        Which of the triangles it has, and their places among its own.
    """
    number = np.empty(1 + max(int(e.places.at.max()) for e in elements), dtype=np.intp)
    for e, c in zip(elements, coefficients, strict=True):
        number[:] = -1
        number[e.places.at] = np.arange(len(e.places.at))
        mine = np.flatnonzero(number[at] >= 0)
        if mine.size:
            yield e, c, mine, number[at[mine]]


def turning(problem: Problem, cells: Cells) -> Mask:
    """Whether triangles (n,) lie beside contact along normals that are not those of the mesh."""
    pairs = [pair for pair in problem.contact if pair.direction is None]
    names = [name for pair in pairs for name in (pair.secondary, pair.primary)]
    side = np.flatnonzero(np.isin(cells.segment, cells.trace.segments(*names)))
    segment, s = cells.on_side(np.tile(side, 2), np.repeat([0.0, 1.0], len(side)))
    off = cells.trace.exact_normal(segment, s) - cells.trace.normal(segment, s)
    found = np.zeros(len(cells.triangles), dtype=bool)
    found[cells.owner[np.tile(side, 2)[np.linalg.norm(off, axis=1) > TURNED]]] = True
    return found


def multipliers(
    cells: Cells, degree: int, turned: Mask | bool = False
) -> tuple[Index, Multipliers]:
    """Degree (n,) of the stress in each triangle, and the multipliers that it asks for.

    It is `degree`, and higher at curved sides and where directions are `turned` (n,).
    """
    own = np.where(cells.curved | turned, degree + ON_CURVES, degree)
    of_side = np.zeros(len(cells.ends), dtype=np.intp)
    np.maximum.at(of_side, cells.sides, own[:, None])
    start = np.concatenate([[0], np.cumsum(2 * (of_side + 1))])
    return own, Multipliers(of_side, start)


def rigid_motions(cells: Cells, mu: Multipliers, fixed: Mask) -> Array:
    """Multipliers (d, r) of the r rigid motions that vanish where they are `fixed` (d,).

    Motions are those of bodies, translations of size 1 and turns about their middles.
    """
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
    """The condensed triangles of a solution, in groups of one kind, and their multipliers.

    Parameters
    ----------
    degree : int
        Of stresses on triangles with straight sides.
    look : ndarray of int (n, 3)
        How forces are integrated: order of the rules, depth of the parts that these are on, and
        whether parts at corners are in thirds; see `looked_at`.

    Raises
    ------
    ContactError
        No equilibrated stress.
    """
    own, mu = multipliers(cells, degree, turning(problem, cells))
    at_axis = np.asarray(cells.trace.model.on_axis(cells.vertices))
    on_axis = np.asarray(at_axis[cells.ends].all(axis=1))[cells.sides]
    key = np.column_stack(
        [
            own,
            on_axis.any(axis=1),
            mu.degree[cells.sides],
            cells.curved,
            _varying(problem, cells),
            cells.bodies,
            *look.T,
        ]
    )
    kinds, number = np.unique(key, axis=0, return_inverse=True)
    found = []
    for kind, (own_degree, axis, *rest) in enumerate(kinds.tolist()):
        every = np.flatnonzero(number.ravel() == kind)
        curved, varying = rest[3:5]
        most = SMALL_BLOCK if curved or varying or cells.trace.model.extent else BLOCK
        for start in range(0, len(every), most):
            at = every[start : start + most]
            kept = problem, cells, displacement, mu, at, own_degree, bool(axis), rest[-3:]
            found.append(_element(*kept))
    return mu, found


def _varying(problem: Problem, cells: Cells) -> Mask:
    """Whether the law varies in triangles (n,)."""
    mesh = cells.trace.mesh
    flags = np.zeros(len(mesh.GetMaterials()), dtype=bool)
    for pattern, law in problem.materials.items():
        flags[np.array(mesh.Materials(pattern).Mask())] = varies(law)
    return np.asarray(flags[cells.bodies])


def _of_body(values: Mapping[str, Value], cells: Cells, body: int) -> Value | None:
    """What is given for a body by a pattern of its name; None if nothing is."""
    mesh = cells.trace.mesh
    masks = ((mesh.Materials(pattern).Mask(), value) for pattern, value in values.items())
    return next((value for mask, value in masks if mask[body]), None)


def compliance_at(problem: Problem, cells: Cells, points: Places) -> Array:
    """C^-1 at places of one body, (b, q, v, v) or, of a law of numbers, (1, 1, v, v)."""
    at = points.at
    law = _of_body(problem.materials, cells, int(cells.bodies[at[0]]))
    assert law is not None
    C = law.voigt(problem.model)
    if _varying(problem, cells)[at[0]]:
        C = points.evaluate(cells, C)
    else:
        C = cells.evaluate(C, at[:1], np.full((1, 2), 1 / 3))[None]
    v = round(C.shape[-1] ** 0.5)
    return np.asarray(np.linalg.inv(C.reshape(*C.shape[:2], v, v)))


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
    """Triangles `at` (b,) of one kind, condensed; `look` as of `elements_of`."""
    model = model_of(problem)
    axial = model.extent > 0
    curved, varying = bool(cells.curved[at[0]]), bool(_varying(problem, cells)[at[0]])
    points = places(cells, at, 2 * degree + 4 * (curved or varying or axial))
    weight = points.weight * model.measure(points.x.reshape(-1, 2)).reshape(points.weight.shape)
    kind = Triangles(
        places=points,
        weight=weight,
        frame=frame_of(cells.corners[at]),
        degree=degree,
        curved=curved,
        axial=axial,
        on_axis=on_axis,
        compliance=compliance_at(problem, cells, points),
    )
    strain = points.evaluate(cells, model.strain(displacement))
    given = _of_body(problem.force, cells, int(cells.bodies[at[0]]))
    source = None if given is None else ng.CF(given)
    force, radial, missed = _forces(source, cells, kind, look)
    rest = strain
    if force.any() or radial.any():
        s_p = kind.balancing(points.x, force)
        if axial:
            s_p[..., 2] += radial
        rest = strain - (kind.compliance @ s_p[..., None])[..., 0]
    N, own = _moments(cells, mu, kind, force)
    A = kind.squared()
    scale = 1 / np.sqrt(np.einsum("bmm->bm", A))
    root = _cholesky(A * scale[:, :, None] * scale[:, None, :])
    right = np.concatenate([N, kind.tested(rest)[..., None]], axis=2)
    solved = np.linalg.solve(root, scale[..., None] * right)
    return Element(
        **vars(kind),
        strain=strain,
        force=force,
        radial=radial,
        source=source,
        missed=missed,
        root=root / scale[:, :, None],
        N=solved[..., :-1],
        g=solved[..., -1],
        own=own,
        sides=cells.sides[at],
        dofs=np.concatenate(
            [
                mu.start[side, None] + np.arange(2 * (mu.degree[side[0]] + 1))
                for side in cells.sides[at].T
            ],
            axis=1,
        ),
    )


def _cholesky(A: Array) -> Array:
    """Factors L of matrices `A` (b, m, m) of unit diagonal that are definite but for round-off.

    What is added to A changes which stress is the nearest, not its equilibrium.
    """
    for added in (0.0, *DEFINITE):
        try:
            return np.asarray(np.linalg.cholesky(A + added * np.eye(A.shape[-1])))
        except np.linalg.LinAlgError:
            continue
    raise ContactError(
        "no equilibrated stress: triangles are too thin or too curved, or a law is too stiff in "
        "one direction; use error_estimate"
    )


def _moments(cells: Cells, mu: Multipliers, kind: Triangles, force: Array) -> tuple[Array, Array]:
    """N (b, m, d), and the moments (b, d) of s_p n for the coefficients `force` (b, j, 2)."""
    at, loaded, found, given = kind.places.at, force.any(), [], []
    for i in range(3):
        side, back = cells.sides[at, i], cells.backward[at, i]
        k, bent = int(mu.degree[side[0]]), bool(cells.bent[side[0]])
        t, w = gauss(kind.degree + k + 2 * kind.axial + 4 * cells.trace.geometry_order * bent)
        start, stop = CORNERS[(i + 1) % 3], CORNERS[(i + 2) % 3]
        local = in_frame(start + t[:, None] * (stop - start))
        if kind.alike:
            N = _tractions_alike(kind, i, local, w[:, None] * traces(k, t))
            odd = np.arange(2 * (k + 1)) % (k + 1) % 2 == 1
            found.append(np.where((back[:, None] & odd)[:, None], -N, N))
        if kind.alike and not loaded:
            given.append(np.zeros((len(at), 2 * (k + 1))))
            continue
        own = np.where(back[:, None], 1 - t, t)
        x, dx = (
            z.reshape(len(at), -1, 2) for z in cells.points(np.repeat(side, len(t)), own.ravel())
        )
        normal = np.where(back[:, None, None], -1, 1) * (dx @ CLOCKWISE)  # times ds / dt
        weight = w * cells.trace.model.measure(x.reshape(-1, 2)).reshape(len(at), -1)
        chi = weight[..., None] * traces(k, own)
        if not kind.alike:
            T = kind.basis(x, kind.frame.local(x) if bent else local)
            found.append(_tractions(T, normal, chi))
        given.append(_tractions(kind.balancing(x, force)[..., None], normal, chi)[:, 0])
    return np.concatenate(found, axis=2), np.concatenate(given, axis=1)


def _tractions_alike(kind: Triangles, i: int, local: Array, chi: Array) -> Array:
    """Moments (b, m, 2 r) of tractions of T on side `i` with chi (q, r), from one table."""
    base, edge = kind.frame.edges[..., 0], kind.frame.edges[..., 1]
    nx, ny = ((base, edge - base, -edge)[i] @ CLOCKWISE).T[..., None]
    xx, yy, xy = kind.frame.airy.transpose(1, 0, 2)
    rates = np.stack([nx * xx + ny * xy, nx * xy + ny * yy], axis=1)  # (b, 2, 3)
    table = bending(kind.degree, local)
    q, _, m = table.shape
    moments = table.reshape(q, -1).T @ chi
    parts = rates.reshape(-1, 3) @ moments.reshape(3, -1)
    return parts.reshape(-1, 2, m, chi.shape[1]).transpose(0, 2, 1, 3).reshape(len(nx), m, -1)


def _tractions(T: Array, normal: Array, chi: Array) -> Array:
    """Moments (b, m, 2 r) of tractions of T (b, q, v, m) with chi (b, q, r)."""
    nx, ny = normal[..., :1], normal[..., 1:]
    tx = T[:, :, 0] * nx + T[:, :, -1] * ny
    ty = T[:, :, -1] * nx + T[:, :, 1] * ny
    return np.concatenate([tx.transpose(0, 2, 1) @ chi, ty.transpose(0, 2, 1) @ chi], axis=2)


def _forces(
    source: ng.CoefficientFunction | None, cells: Cells, kind: Triangles, look: Sequence[int]
) -> tuple[Array, Array, Array]:
    """`Element.force`, `.radial` and `.missed`."""
    points, n = kind.places, kind.force_degree
    b, q = points.weight.shape
    radial = np.zeros((b, q))
    if source is None:
        return np.zeros((b, (n + 1) * (n + 2) // 2, 2)), radial, np.zeros(b)
    (order, depth, thirds), parts = look, slice(int(kind.axial), None)
    rule = order, depth, bool(thirds)
    force, missed, size = projection(source, cells, points.at, n, *rule, parts)
    if kind.axial:
        radial = points.x[..., 0] * points.evaluate(cells, source)[..., 0]
        force[..., 0] = 0.0
    return force, radial, np.where(missed <= ROUND_OFF * size, 0.0, missed)
