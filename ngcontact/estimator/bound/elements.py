"""Stresses on triangles, condensed to multipliers of their tractions on sides.

On a triangle the stress is s = T c + s_p: T are the polynomials of `polynomials`, made orthonormal
in the norm of C^-1, and s_p balances the body force. With mu, the trace of a displacement, on the
sides, 1/2 |s - C e(u_h)|^2 - <s n, mu> is least for

    c = g + N mu,  g = (T, e(u_h) - C^-1 s_p),  N = <T n, mu>,

and the tractions of s are N'N mu + N'g + <s_p n, .>.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import ngsolve as ng
import numpy as np
from numpy.polynomial import legendre

from ...arrays import Array, Index, Mask
from ...fem import connected_bodies, elastic_strain
from ...lagrange import gauss
from ...problem import MeshArrays, Problem, numbers
from ...qp import vanishing_combinations
from .cells import Cells, Places, alike, places
from .polynomials import CORNERS, balancing, coordinates, edges, scalars, stresses

CURVED_DEGREES = 2  # degrees by which stresses on triangles with a curved side are higher
CLOCKWISE = np.array([[0.0, -1.0], [1.0, 0.0]])  # vectors, rows, turned by a right angle
FORCE_ROUND_OFF = 1e-12  # of a force, below which nothing of it is missed
BATCH_ENTRIES = 2**20  # of triangles at once, (degree + 2)^4 each: bounds the memory


def traces(degree: int, t: Array) -> Array:
    """Orthonormal polynomials (..., degree + 1) on sides at `t` (...,), from 0 to 1."""
    values = legendre.legvander(2 * t - 1, degree)
    return np.asarray(values * np.sqrt(2 * np.arange(degree + 1) + 1))


def to_traction(normal: Array, components: int) -> Array:
    """Matrices (..., 2, v) that make s n of the v `components` of s; `normal` (..., 2) is n."""
    found = np.zeros((*normal.shape, components))
    found[..., 0, 0] = found[..., 1, -1] = normal[..., 0]
    found[..., 1, 1] = found[..., 0, -1] = normal[..., 1]
    return found


@dataclass(frozen=True, eq=False)
class Basis:
    """Stresses T c + s_p on b triangles, without the hoop's part of radial forces."""

    degree: int  # of T
    force_degree: int  # of the body force that s_p balances
    axial: bool  # whether the model is axisymmetric
    on_axis: bool  # whether a side of each lies on the axis
    corners: Array  # (b, 3, 2) lengths
    force: Array  # (b, j, 2) coefficients, as of `scalars`, of the body force that s_p balances

    def part(self, rows: Index | slice) -> Basis:
        """That of the triangles `rows` (r,)."""
        return replace(self, corners=self.corners[rows], force=self.force[rows])

    def at(self, local: Array) -> tuple[tuple[Array, Array], Array]:
        """T as of `stresses`, and s_p (b, q, v), at (a, b) `local` (b, q, 2), or (q, 2) in each."""
        x = self.corners[:, 1:2] + local @ edges(self.corners).transpose(0, 2, 1)
        s_p = balancing(self.force_degree, self.corners, x, self.force, self.axial)
        return stresses(self.degree, self.corners, local, self.axial, self.on_axis), s_p


@dataclass(frozen=True, eq=False)
class Element:
    """Condensed triangles of one kind: b triangles, v Voigt components, d multipliers on each."""

    places: Places  # quadrature points, q in each
    basis: Basis
    compliance: Array  # (b, q, v, v) C^-1, or (b, 1, v, v) where it is one matrix for each
    strain: Array  # (b, q, v) e(u_h), less initial strains, Voigt
    missed: Array  # (b,) L2 norm of what of the body force s_p does not balance, times the measure
    modulus: Array  # (b,) smallest eigenvalue of C in Mandel's scaling, a stress
    combined: Array  # (b, n, m) T from the n polynomials of `stresses`, orthonormal: (T, T) = 1
    N: Array  # (b, m, d) moments <T n, .> of the tractions with the multipliers
    own: Array  # (b, d) those of s_p n
    g: Array  # (b, m) (T, e(u_h) - C^-1 s_p), the coefficients without multipliers
    beyond: Array  # (b,) squares of |C e(u_h) - s_p - T g|, which no coefficients reach
    dofs: Index  # (b, d) numbers of the multipliers

    def tractions(self, c: Array) -> Array:
        """Moments (b, d) of the tractions of s with the multipliers, by coefficients `c` (b, m)."""
        return np.asarray(self.own + (c[:, None] @ self.N)[:, 0])

    def answer(self, mu: Array) -> Array:
        """N mu (b, m): what all multipliers of the mesh, `mu` (k,), add to c."""
        return np.asarray((self.N @ mu[self.dofs][..., None])[..., 0])

    @cached_property
    def _polynomials(self) -> tuple[Array, Array]:
        """T as of `stresses` at the points."""
        return self.basis.at(self.places.affine)[0]

    def of_strain(self, strain: Array) -> Element:
        """These triangles for a displacement of `strain` (b, q, v), without body forces."""
        basis = replace(self.basis, force=np.zeros_like(self.basis.force))
        given = self.places.weight, self.compliance, strain, self.combined
        _, g, beyond = _nearest(self._polynomials, *given)
        none = {name: np.zeros_like(getattr(self, name)) for name in ("missed", "own")}
        return replace(self, basis=basis, strain=strain, g=g, beyond=beyond, **none)

    def stress(self, c: Array, local: Array, some: Index | slice = slice(None)) -> Array:
        """Stresses (k, q, v) in `some` (k,) of the triangles or in all, of coefficients `c` (b, m).

        At (a, b) `local` (k, q, 2), or (q, 2) in each.
        """
        T, s_p = self.basis.part(some).at(local)
        return _stress(T, (self.combined @ c[..., None])[some, :, 0]) + s_p


@dataclass(frozen=True, eq=False)
class Stress:
    """A stress on all triangles."""

    elements: Sequence[Element]
    coefficients: Sequence[Array]  # (b, m) on the triangles of each element

    def values(self, at: Index, local: Array) -> Array:
        """Stresses (k, q, v) in triangles `at` (k,), without radial forces.

        At (a, b) `local` (k, q, 2), or (q, 2) in each.
        """
        found = np.empty((len(at), local.shape[-2], self.elements[0].strain.shape[2]))
        for e, c in zip(self.elements, self.coefficients, strict=True):
            own = e.places.at
            some = np.minimum(np.searchsorted(own, at), len(own) - 1)
            mine = np.flatnonzero(own[some] == at)
            if mine.size:
                found[mine] = e.stress(c, local if local.ndim == 2 else local[mine], some[mine])
        return found

    def tractions(self, at: Index, x: Array, normal: Array) -> Array:
        """Tractions s n (k, q, 2) at `x` (k, q, 2) of `at` (k,), with unit `normal` (k, q, 2)."""
        corners = self.elements[0].places.cells.corners[at]
        s = self.values(at, coordinates(corners, x))
        return np.asarray((to_traction(normal, s.shape[2]) @ s[..., None])[..., 0])

    def traction_moments(self) -> tuple[Array, float]:
        """Moments (d,) of the tractions over all triangles, and the largest of one triangle."""
        total, largest = np.zeros(1 + max(int(e.dofs.max()) for e in self.elements)), 0.0
        for e, c in zip(self.elements, self.coefficients, strict=True):
            own = e.tractions(c)
            np.add.at(total, e.dofs, own)
            largest = max(largest, float(np.abs(own).max(initial=0.0)))
        return total, largest

    def norms(self) -> tuple[Array, float]:
        """|s - C e| (n,), roots of energies per thickness, and the largest component of s.

        That is looked at in the middles of straight sides.
        """
        pairs = list(zip(self.elements, self.coefficients, strict=True))
        squares = [((c - e.g) ** 2).sum(axis=1) + e.beyond for e, c in pairs]
        middles = (CORNERS + np.roll(CORNERS, 1, axis=0)) / 2
        sizes = [np.abs(e.stress(c, middles)).max() for e, c in pairs]
        return np.sqrt(by_triangle(self.elements, squares)), float(max(sizes, default=0.0))


@dataclass(frozen=True, eq=False)
class Multipliers:
    """Numbers of the multipliers: on each of e sides those of mu_x, then those of mu_y."""

    of_stress: Index  # (n,) degree of the stress in each triangle
    degree: Index  # (e,) of their polynomials, `traces`
    start: Index  # (e + 1,) the first of each side, and their number

    def of(self, side: Index) -> tuple[Index, Mask]:
        """Numbers (..., k) of the multipliers of sides `side` (...,), and which of the k each has.

        There are k of the highest degree; in place of those that a side lacks stands its first.
        """
        n = np.arange(int(self.degree[side].max(initial=0)) + 1)
        own = n <= self.degree[side][..., None]
        x = self.start[side][..., None] + np.where(own, n, 0)
        y = x + np.where(own, self.degree[side][..., None] + 1, 0)
        return np.concatenate([x, y], axis=-1), np.concatenate([own, own], axis=-1)

    def moments(self, side: Index, t: Array, weighted: Array) -> Array:
        """Moments (d,) of values at `t` (j,) of sides `side` (k,), `weighted` (k, j, 2)."""
        found, (at, own) = np.zeros(int(self.start[-1])), self.of(side)
        parts = weighted.swapaxes(1, 2) @ traces(at.shape[1] // 2 - 1, t)
        found[at[own]] = parts.reshape(at.shape)[own]
        return found


def by_triangle(elements: Sequence[Element], values: Sequence[Array | Index]) -> Array:
    """One array (n,) of `values` (b,) on each element's triangles, n in all."""
    found = np.zeros(sum(map(len, values)))
    for e, own in zip(elements, values, strict=True):
        found[e.places.at] = own
    return found


def multipliers(cells: Cells, degree: int) -> Multipliers:
    """The multipliers for stresses of a `degree`, which is higher at curved sides."""
    own, of_side = degree + CURVED_DEGREES * cells.curved, np.zeros(len(cells.ends), dtype=np.intp)
    np.maximum.at(of_side, cells.sides, own[:, None])
    return Multipliers(own, of_side, np.concatenate([[0], np.cumsum(2 * (of_side + 1))]))


def rigid_motions(cells: Cells, mu: Multipliers, fixed: Mask) -> Array:
    """Multipliers (d, r) of the r rigid motions that vanish where they are `fixed` (d,).

    Motions are those of bodies, translations of size 1 and turns about their middles.
    """
    trace, bodies = cells.trace, connected_bodies(cells.trace)
    body = bodies.of_vertex[MeshArrays(trace.mesh).elements[cells.parent[cells.owner], 0]]
    t, w = gauss(int(mu.degree.max()) + trace.geometry_order)
    x, _ = cells.points(np.arange(len(body)), np.tile(t, (len(body), 1)))
    arm = (x - bodies.middle[body, None]) / bodies.size[body, None, None]
    shifts = [np.broadcast_to(e, arm.shape) for e in np.eye(2)]
    motions = np.stack([*shifts, arm @ CLOCKWISE.T])[np.array(trace.model.motions)]
    own = [np.flatnonzero(body == k) for k in range(len(bodies.names))]
    each = [mu.moments(k, t, w[:, None] * motion[k]) for k in own for motion in motions]
    found = np.column_stack(each)
    return np.asarray(found @ vanishing_combinations(found[fixed]))


def elements_of(
    problem: Problem,
    cells: Cells,
    displacement: ng.CoefficientFunction,
    degree: int,
) -> tuple[Multipliers, list[Element]]:
    """The condensed triangles of a solution, in groups of one kind, and their multipliers.

    Stresses are of a `degree` on triangles with straight sides.
    """
    mu, data = multipliers(cells, degree), BodyData.of(problem, cells.trace.mesh)
    highest = mu.degree[cells.sides].max(axis=1)
    varying = data.varies[cells.bodies]
    kind = [mu.of_stress, highest, cells.on_axis, cells.curved, varying]
    strain, found = elastic_strain(problem, displacement), []
    for (n, *_), every in alike(kind, np.arange(len(highest))):
        for at in np.array_split(every, 1 + len(every) * (n + 2) ** 4 // BATCH_ENTRIES):
            found.append(_element(data, cells, strain, mu, at))
    return mu, found


@dataclass(frozen=True, eq=False)
class BodyData:
    """Laws and forces of all bodies, n of them, as functions on the mesh."""

    stiffness: ng.CoefficientFunction  # C, Voigt
    force: ng.CoefficientFunction | None  # None without any
    varies: Mask  # (n,) where a law, an initial strain or a force is no number

    @staticmethod
    def of(problem: Problem, mesh: ng.Mesh) -> BodyData:
        """The data of a problem."""
        laws = {k: law.voigt(problem.model) for k, law in problem.materials.items()}
        rough = [*problem.varying, *(k for k, F in problem.force.items() if not numbers(F))]
        return BodyData(
            mesh.MaterialCF(laws),
            mesh.MaterialCF(problem.force, default=ng.CF((0, 0))) if problem.force else None,
            np.any([list(mesh.Materials(k).Mask()) for k in ["", *rough]], axis=0),
        )

    def compliance(self, points: Places) -> Array:
        """C^-1 at places, (b, q, v, v) or, where data are numbers in all bodies, (b, 1, v, v)."""
        cells = points.cells
        if self.varies[cells.bodies[points.at]].any():
            C = points.evaluate(self.stiffness)
        else:
            middle = np.full((1, 2), 1 / 3)
            C = cells.elements.evaluate(self.stiffness, cells.parent[points.at], middle)
        v = round(C.shape[-1] ** 0.5)
        return np.asarray(np.linalg.inv(C.reshape(*C.shape[:2], v, v)))


def projection(force: ng.CoefficientFunction, points: Places, degree: int) -> tuple[Array, Array]:
    """Polynomials (b, m, 2) of a `degree`, as of `scalars`, near to a force in b triangles.

    And L2 norms (b,) of what they miss, times the measure; axially about an axis.
    """
    P, values = scalars(degree, points.corners, points.x), points.evaluate(force)
    weighted, root = P * points.weight[..., None], np.sqrt(points.weight)[..., None]
    # Orthonormal ones: the normal equations of P are singular on flat triangles.
    combined = _inverses(np.asarray(np.linalg.qr(root * P, mode="r")))
    onto = combined @ (weighted @ combined).transpose(0, 2, 1)
    found = onto @ values
    found += onto @ (values - P @ found)
    weight = points.weight * points.cells.measure(points.x)
    axial = points.cells.trace.model.extent
    missed, size = (
        np.sqrt((weight * (x[..., axial:] ** 2).sum(axis=2)).sum(axis=1))
        for x in (values - P @ found, values)
    )
    return np.asarray(found), np.where(missed <= FORCE_ROUND_OFF * size, 0.0, missed)


def _element(
    data: BodyData, cells: Cells, strain_of: ng.CoefficientFunction, mu: Multipliers, at: Index
) -> Element:
    """Triangles `at` (b,) of one kind, condensed, for a strain."""
    degree, axial = int(mu.of_stress[at[0]]), cells.trace.model.extent > 0
    higher = cells.curved[at[0]] or axial or data.varies[cells.bodies[at]].any()
    points = places(cells, at, 2 * degree + 4 * bool(higher))
    compliance, strain = data.compliance(points), points.evaluate(strain_of)
    n = max(0, degree - 1 - axial)
    force, missed = np.zeros((len(at), (n + 1) * (n + 2) // 2, 2)), np.zeros(len(at))
    hoop = np.zeros(points.weight.shape)
    if data.force is not None:
        force, missed = projection(data.force, points, n)
        if axial:
            force[..., 0] = 0.0
            hoop = points.x[..., 0] * points.evaluate(data.force)[..., 0]
    basis = Basis(degree, n, axial, bool(cells.on_axis[at[0]]), points.corners, force)
    T, s_p = basis.at(points.affine)
    if axial:
        s_p[..., 2] += hoop
    rest = strain - products(compliance, s_p)
    combined, g, beyond = _nearest(T, points.weight, compliance, rest)
    mandel = np.append(np.ones(compliance.shape[-1] - 1), 0.5**0.5)
    largest = np.linalg.eigvalsh(compliance * mandel * mandel[:, None])[..., -1].max(axis=1)
    N, own, dofs = _moments(cells, mu, at, basis)
    return Element(
        places=points,
        basis=basis,
        compliance=compliance,
        strain=strain,
        missed=missed,
        modulus=1 / largest,
        combined=combined,
        N=combined.transpose(0, 2, 1) @ N,
        own=own,
        g=g,
        beyond=beyond,
        dofs=dofs,
    )


def _nearest(
    T: tuple[Array, Array],
    weight: Array,
    compliance: Array,
    strain: Array,
    combined: Array | None = None,
) -> tuple[Array, Array, Array]:
    """`Element.combined`, made where it is not known, `.g` and `.beyond` for a `strain` (b, q, v).

    For stresses T, as of `stresses`, in the norm of C^-1, `compliance`, by a `weight` (b, q).
    """
    (A, P), root, L = T, np.sqrt(weight)[..., None], np.linalg.cholesky(compliance)
    if combined is None:
        M = L.swapaxes(2, 3) @ A
        if P.ndim == 3 and M.shape[1] == 1:  # one M on a triangle, one P on all
            rows = M.reshape(-1, M.shape[-1]) @ P.swapaxes(0, 1).reshape(M.shape[-1], -1)
            rows = rows.reshape(*M.shape[::2], *P.shape[::2]) * root[:, None, :]
        else:
            rows = (root[..., None] * M) @ P
        rows = rows.reshape(len(weight), -1, P.shape[-1])
        combined = _inverses(np.asarray(np.linalg.qr(rows, mode="r")))
    g, rest = np.zeros((len(weight), combined.shape[2])), strain
    for _ in range(2):  # once more, as they are orthonormal but for round-off
        more = (_work(T, weight[..., None] * rest)[:, None] @ combined)[:, 0]
        s = _stress(T, (combined @ more[..., None])[..., 0])
        g, rest = g + more, rest - products(compliance, s)
    return combined, g, ((root * products(np.linalg.inv(L), rest)) ** 2).sum(axis=(1, 2))


def _inverses(R: Array) -> Array:
    """Inverses of upper triangular matrices `R` (b, n, n), row by row for all at once.

    LAPACK's LU of one after the other takes twice the time.
    """
    found = np.zeros_like(R)
    for i in reversed(range(R.shape[1])):
        found[:, i, i] = 1.0
        found[:, i, i + 1 :] = -(R[:, i, None, i + 1 :] @ found[:, i + 1 :, i + 1 :])[:, 0]
        found[:, i, i:] /= R[:, i, i, None]
    return found


def products(C: Array, e: Array) -> Array:
    """C e (b, q, v) for `e` (b, q, v) and `C` (b, q, v, v), or (b, 1, v, v), one in a triangle."""
    if C.shape[1] == 1:
        return np.asarray(e @ C[:, 0].swapaxes(1, 2))
    return np.asarray((C @ e[..., None])[..., 0])


def _stress(T: tuple[Array, Array], c: Array) -> Array:
    """Stresses (b, q, v) of coefficients `c` (b, n) of the polynomials T, as of `stresses`."""
    A, P = T
    table = P.reshape(*P.shape[:-3], -1, P.shape[-1])
    values = c @ table.T if table.ndim == 2 else (table @ c[..., None])[..., 0]
    return np.asarray(values.reshape(len(c), -1, P.shape[-2]) @ A[:, 0].swapaxes(1, 2))


def _work(T: tuple[Array, Array], strain: Array) -> Array:
    """Sums (b, n) over points of T times a `strain` (b, q, v): the adjoint of `_stress`."""
    A, P = T
    table = P.reshape(*P.shape[:-3], -1, P.shape[-1])
    values = (strain @ A[:, 0]).reshape(len(strain), -1)
    return np.asarray(values @ table if table.ndim == 2 else (values[:, None] @ table)[:, 0])


def _moments(cells: Cells, mu: Multipliers, at: Index, basis: Basis) -> tuple[Array, Array, Index]:
    """Moments of tractions with the multipliers of triangles `at` (b,), and their numbers (b, d).

    Those (b, n, d) of T, and those (b, d) of s_p.
    """
    number, there = mu.of(cells.sides[at])
    k, found = number.shape[2] // 2 - 1, []  # the highest degree of a side
    for i in range(3):
        side, back = cells.sides[at, i], cells.backward[at, i]
        bent = bool(cells.bent[side[0]])
        t, w = gauss(basis.degree + k + 2 * basis.axial + 4 * cells.trace.geometry_order * bent)
        x, dx = cells.around(at, i, t)
        local = CORNERS[i - 2] + t[:, None] * (CORNERS[i - 1] - CORNERS[i - 2])
        (A, P), s_p = basis.at(coordinates(basis.corners, x) if bent else local)
        n = to_traction(dx @ CLOCKWISE, s_p.shape[2])  # times ds / dt
        weight, chi = w * cells.measure(x), traces(k, t)
        signs = np.where(back[:, None], (-1.0) ** np.arange(k + 1), 1.0)  # of chi at 1 - t
        both = np.empty((len(at), P.shape[-1] + 1, 2, k + 1))
        if P.ndim == 3:  # n and A are one on a side, P on all triangles
            table = np.tensordot(P * w[:, None, None], chi, (0, 0))
            both[:, :-1] = np.tensordot(n[:, 0] @ A[:, 0], table, 1).swapaxes(1, 2)
        else:
            both[:, :-1] = (((n @ A) @ P) * weight[..., None, None]).transpose(0, 3, 2, 1) @ chi
        both[:, -1] = ((n @ s_p[..., None])[..., 0] * weight[..., None]).swapaxes(1, 2) @ chi
        both *= there[:, i].reshape(-1, 1, 2, k + 1) * signs[:, None, None]
        found.append(both.reshape(*both.shape[:2], -1))
    N = np.concatenate(found, axis=2)
    return N[:, :-1], N[:, -1], number.reshape(len(at), -1)
