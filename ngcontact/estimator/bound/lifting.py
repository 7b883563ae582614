"""A displacement w of little energy that corrects u_h on Gamma_u, Gamma_K and curved guides.

On sides d.w is asked for: u_D - u_h on Gamma_u, r shared by compliance between both bodies on
Gamma_K, -u_h.d on guides. Other parts of Gamma_K stay where they are. On the triangles around these
sides w is the displacement of least energy with the values asked for at nodes. It is of one degree,
and of a higher one, up to `DATA_DEGREE`, on sides where what is asked for is no such polynomial.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial

import ngsolve as ng
import numpy as np
import scipy.sparse as sp
from numpy.polynomial import legendre

from ...arrays import Array, Index
from ...errors import ContactError
from ...lagrange import gauss_lobatto, lagrange
from ...linalg import cholesky, lower_half, summed
from ...problem import Problem
from .cells import Cells, alike, places
from .elements import BATCH_ENTRIES, BodyData
from .facing import DATA_DEGREE, POINTS, TO_LOBATTO, FacingSides, at_places
from .polynomials import CORNERS, DERIVATIVES, derivatives

SIDE_DEGREES = 3  # steps from `DATA_DEGREE` down, by which degrees on sides may differ
# By so much, or by less than `LIFTING_NOISE` makes noise, polynomials on sides may miss the largest
# amount and d.
AMOUNT_ERROR = 1e-10
LIFTING_NOISE = 1e-13  # of what is asked for, relative to the displacement: round-off
SAME_DIRECTION = 1e-8  # sine of the angle between directions at a vertex that are one
INCONSISTENT_AMOUNT = 1e-9  # of what is asked for at a vertex, relative to it


@dataclass(frozen=True, eq=False)
class Prescribed:
    """Prescribed values of d.w at j Gauss-Lobatto points of k sides."""

    side: Index  # (k,)
    direction: Array  # (k, j, 2) d
    amount: Array  # (k, j) lengths


def prescribed_on_supports(
    problem: Problem, cells: Cells, displacement: ng.CoefficientFunction
) -> list[Prescribed]:
    """u_D - u_h in each prescribed component; no radial motion on the axis."""
    trace, found, j = cells.trace, [], DATA_DEGREE + 1
    axis = np.flatnonzero(trace.model.on_axis(cells.vertices)[cells.ends].all(axis=1))
    along = np.broadcast_to([1.0, 0.0], (len(axis), j, 2))
    found.append(Prescribed(axis, along, np.zeros((len(axis), j))))
    for name, values in problem.displacement.items():
        side = cells.sides_on(trace.segments(name))
        place = cells.on_side(side, gauss_lobatto(DATA_DEGREE)[None])
        u = at_places(partial(trace.evaluate, displacement), *place)
        for c, value in enumerate(values):
            if value is not None:
                fixed = at_places(partial(trace.evaluate, ng.CF(value)), *place)[..., 0]
                d = np.broadcast_to(np.eye(2)[c], u.shape)
                found.append(Prescribed(side, d, fixed - u[..., c]))  # (3.6)
    return found


def lifted(
    problem: Problem,
    cells: Cells,
    prescribed: Sequence[Prescribed],
    lines: Sequence[tuple[FacingSides, Array]],
    degree: int,
    extent: float,
) -> Array:
    """Norms (n,) of w, roots of energies per thickness, with what is asked for at supports and r.

    `prescribed` are the conditions on supports, `lines` (k, j) the facing sides with r, lengths at
    Gauss points, of which both bodies take their shares. w is of a `degree`, or more on sides that
    need it. Amounts below round-off of the `extent` of displacements and gaps, a length, are not
    lifted.

    Raises
    ------
    ContactError
        Conditions at a vertex require different displacements.
    """
    prescribed = list(prescribed)
    for line, r in lines:
        start, stop = line.share.T[:, :, None]
        share = start + (stop - start) * POINTS
        d = np.einsum("ij,kjc->kic", TO_LOBATTO, line.direction)
        prescribed.append(Prescribed(line.side, d, -(share * r) @ TO_LOBATTO.T))
        if (share < 1).any():
            both = np.concatenate([line.direction, ((1 - share) * r)[..., None]], axis=2)
            there = TO_LOBATTO @ line.on_primary(both)
            prescribed.append(Prescribed(line.other, there[..., :2], there[..., 2]))
    norms, degrees = np.zeros(len(cells.triangles)), np.full(len(cells.ends), degree)
    largest = [np.abs(one.amount).max(axis=1, initial=0.0) for one in prescribed]
    least, each = LIFTING_NOISE * extent, zip(prescribed, largest, strict=True)
    needed = [one.side[size > least] for one, size in each]
    if not sum(map(len, needed)):
        return norms
    touched = np.zeros(len(cells.vertices), dtype=bool)
    touched[cells.ends[np.concatenate(needed)]] = True
    layer = np.flatnonzero(touched[cells.triangles].any(axis=1))
    count = np.bincount(cells.sides[layer].ravel(), minlength=len(cells.ends))
    touching = [name for pair in problem.contact for name in pair.sides]
    fixed = cells.inner
    fixed[cells.sides_on(cells.trace.segments(*touching))] = True
    for line, _ in lines:  # what faces nothing may move
        fixed[line.slots] = False
    unit = np.concatenate(largest).max()
    error = max(AMOUNT_ERROR, least / unit)
    for one in prescribed:
        fixed[one.side] = False
        both = np.concatenate([one.direction, one.amount[..., None] / unit], axis=2)
        asked = np.full(len(both), DATA_DEGREE)
        for n in (*range(DATA_DEGREE - SIDE_DEGREES, degree, -SIDE_DEGREES), degree):
            asked[(np.abs(both - _reduced(n)[1] @ both) <= error).all(axis=(1, 2))] = n
        degrees[one.side] = np.maximum(degrees[one.side], asked)
    stiffness = list(_stiffness(problem, cells, layer, degrees, degree))
    nodes = np.unique(np.concatenate([own.ravel() for _, own, _ in stiffness]))
    # Normal equations at each node: two directions, or one and the one across, which is free.
    conditions = []
    for one in prescribed:
        for n in np.unique(degrees[one.side]).tolist():
            some = (count[one.side] > 0) & (degrees[one.side] == n)
            carry, _ = _reduced(n)
            d = (carry @ one.direction[some]).reshape(-1, 2)
            length = np.linalg.norm(d, axis=1, keepdims=True)
            number = np.searchsorted(nodes, _on_sides(cells, one.side[some], n)).ravel()
            amount = (one.amount[some] @ carry.T).ravel() / length[:, 0]
            conditions.append((number, d / length, amount))
    number, d, amount = (np.concatenate(x) for x in zip(*conditions, strict=True))
    M, right = np.zeros((len(nodes), 2, 2)), np.zeros((len(nodes), 2, 1))
    np.add.at(M, number, d[:, :, None] * d[:, None])
    np.add.at(right, number, (d * amount[:, None])[..., None])
    size, V = np.linalg.eigh(M)
    held = size > SAME_DIRECTION * size[:, 1:]
    parts = np.divide((V.transpose(0, 2, 1) @ right)[..., 0], size, out=0 * size, where=held)
    w = (V @ parts[..., None])[..., 0]
    missed = np.abs((w[number] * d).sum(axis=1) - amount).max()
    if missed > max(INCONSISTENT_AMOUNT * unit, 100 * LIFTING_NOISE * extent):
        raise ContactError("conditions that meet at a vertex require different displacements")
    rim = _on_sides(cells, np.flatnonzero((count == 1) & fixed), degree)
    held[np.searchsorted(nodes, rim)] = True
    first = [2 * np.searchsorted(nodes, own) for _, own, _ in stiffness]
    dofs = [np.concatenate([x, x + 1], axis=1) for x in first]
    if not held.all():
        blocks = [(x, x, part) for x, (*_, part) in zip(dofs, stiffness, strict=True)]
        K, node = summed(blocks, (w.size, w.size)), np.arange(len(nodes) + 1)
        R = sp.bsr_array((V, node[:-1], node)).tocsr()
        R.eliminate_zeros()
        load = np.where(held.ravel(), 0.0, -(R.T @ (K @ w.ravel())))
        y = cholesky(lower_half((R.T @ K @ R).tocsr()))(~held.ravel())(load)
        w += (R @ y).reshape(-1, 2)
    still = int(cells.trace.model.extent)  # translations from here on have no energy, but round-off
    for (at, _, part), x in zip(stiffness, dofs, strict=True):
        own = w.ravel()[x].reshape(len(x), 2, -1)
        own[:, still:] -= own[:, still:, :1]
        own = own.reshape(x.shape)
        square = ((part @ own[..., None])[..., 0] * own).sum(axis=1)
        norms[at] = np.sqrt(np.maximum(square, 0.0))
    return norms


@lru_cache
def _reduced(n: int) -> tuple[Array, Array]:
    """From values at j Gauss-Lobatto points to those of degree n (n + 1, j), and back (j, j)."""
    carry = lagrange(DATA_DEGREE, gauss_lobatto(n))
    return carry, lagrange(n, gauss_lobatto(DATA_DEGREE)) @ carry


def _on_sides(cells: Cells, side: Index, n: int) -> Index:
    """Nodes (k, n + 1) of degree n on sides (k,), from t = 0 to t = 1."""
    inner = len(cells.vertices) + (DATA_DEGREE - 1) * side[:, None] + np.arange(n - 1)
    return np.concatenate([cells.ends[side, :1], inner, cells.ends[side, 1:]], axis=1)


def _stiffness(
    problem: Problem, cells: Cells, layer: Index, degrees: Index, degree: int
) -> Iterator[tuple[Index, Index, Array]]:
    """Stiffness of triangles of a `layer` (k,) at a time: these (b,), nodes (b, m), (b, 2 m, 2 m).

    For polynomials of a `degree`, on the sides of `degrees` (e,), least over what is inside; x
    components come first.
    """
    data, axial = BodyData.of(problem, cells.trace.mesh), cells.trace.model.extent
    V = np.zeros((2, 2 + axial, 3 + axial))  # Voigt strains by component, of its derivatives
    V[0, 0, 0] = V[0, 1, -1] = V[1, 0, -1] = V[1, 1, 1] = 1.0
    V[0, 2:, 2:-1] = 1.0  # ... and of u_r / r
    kind = [degrees[cells.sides], cells.curved, data.varies[cells.bodies]]
    for (*own, bent, varies), every in alike(kind, layer):
        inverse = _nodal(degree, *own)
        order, m = 2 * max(own) + 4 * bent, len(inverse)
        for at in np.array_split(every, 1 + len(every) * order**2 * m // BATCH_ENTRIES):
            points = places(cells, at, order)
            F, into = _functions(degree, own, points.local) @ inverse, np.linalg.inv(points.slopes)
            C = np.linalg.inv(data.compliance(points))
            S = [V[c] @ C @ V[d].T for c, d in ((0, 0), (0, 1), (1, 1))]
            if bent or varies or axial:
                rows = into.swapaxes(2, 3) @ F[:, 1:]
                if axial:
                    rows = np.append(rows, F[:, :1] / points.x[..., :1, None], axis=2)
                stress = [(points.weight[..., None, None] * x) @ rows for x in S]
                rows, *stress = (x.reshape(len(at), -1, m) for x in (rows, *stress))
                xx, xy, yy = (rows.transpose(0, 2, 1) @ x for x in stress)
            else:  # integrals of products of derivatives are those of one triangle
                w, into = points.weight, into[:, 0]
                table = np.einsum("q,qim,qjn->ijmn", w[0], F[:, 1:], F[:, 1:], optimize=True)
                size = (w[:, 0] / w[0, 0])[:, None, None]
                by = [(size * (into @ x[:, 0] @ into.swapaxes(1, 2))).reshape(-1, 4) for x in S]
                xx, xy, yy = ((x @ table.reshape(4, -1)).reshape(-1, m, m) for x in by)
            K = np.block([[xx, xy], [xy.transpose(0, 2, 1), yy]])
            outer = np.arange(2 * m) % m < sum(own)
            whole, across = K[:, outer][..., outer], K[:, ~outer][..., outer]
            whole -= across.transpose(0, 2, 1) @ np.linalg.solve(K[:, ~outer][..., ~outer], across)
            on = [_on_sides(cells, cells.sides[at, i], n)[:, 1:-1] for i, n in enumerate(own)]
            back = cells.backward[at]
            on = [np.where(back[:, i, None], x[:, ::-1], x) for i, x in enumerate(on)]
            yield at, np.hstack([cells.triangles[at], *on]), whole


@lru_cache
def _nodal(degree: int, *own: int) -> Array:
    """What makes the functions of `_functions` nodal (m, m).

    Nodes are at corners, on the sides in turn, inside.
    """
    t = [gauss_lobatto(n)[1:-1, None] for n in own]
    on = [(1 - t[i]) * CORNERS[i - 2] + t[i] * CORNERS[i - 1] for i in range(3)]
    inside = [(i / degree, j / degree) for i in range(1, degree) for j in range(1, degree - i)]
    found = np.concatenate([CORNERS, *on, np.reshape(inside, (-1, 2))])
    return np.asarray(np.linalg.inv(_functions(degree, own, found)[:, 0]))


def _functions(degree: int, own: Sequence[int], local: Array) -> Array:
    """Values and derivatives by (a, b), (q, 3, m), at `local` (q, 2) of the m functions.

    Polynomials of a `degree`, and of higher ones n on sides of degree `own`: with the shares s and
    t s of its ends, (P_n - P_(n-2))(2 t - 1) s^n, which vanish on the others.
    """
    found = [derivatives(degree, local, DERIVATIVES[:3]) * np.array([[1], [2], [2]])]
    share = np.column_stack([local[:, 1], 1 - local.sum(axis=1), local[:, 0]])
    by = np.array([[0.0, 1.0], [-1.0, -1.0], [1.0, 0.0]])  # of the shares
    for i, highest in enumerate(own):
        n = np.arange(degree + 1, highest + 1)
        s = share[:, i - 2] + share[:, i - 1]
        t = np.divide(share[:, i - 1], s, out=np.zeros_like(s), where=s > 0)
        P = legendre.legvander(2 * t - 1, highest)
        f, df = P[:, n] - P[:, n - 2], 2 * (2 * n - 1) * P[:, n - 1]
        ds, power = by[i - 2] + by[i - 1], s[:, None] ** (n - 1)
        dt = by[i - 1] - t[:, None] * ds  # times s
        slope = power[:, None] * (n * f[:, None] * ds[:, None] + df[:, None] * dt[..., None])
        found.append(np.concatenate([(s[:, None] * power * f)[:, None], slope], axis=1))
    return np.concatenate(found, axis=2)
