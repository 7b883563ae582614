"""A displacement w of little energy that corrects u_h on Gamma_u, Gamma_K and curved guides.

On sides d.w is asked for: u_D - u_h on Gamma_u, r shared by compliance between both bodies on
Gamma_K, -u_h.d on guides. Other parts of Gamma_K stay where they are. On the triangles around these
sides w is the displacement of least energy of a degree with the values asked for at nodes; what is
no polynomial of that degree is continued from its side to the opposite corner in proportion to the
distance.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np
import scipy.sparse as sp

from ...arrays import Array, Index, Mask, from_triplets
from ...errors import ContactError
from ...lagrange import gauss_lobatto, lagrange, lagrange_derivative
from ...linalg import cholesky, lower_half
from ...problem import Problem
from .cells import Cells, Places, places
from .elements import ENTRIES, compliance_at
from .facing import DATA, PLACES, THROUGH, Facing
from .polynomials import CORNERS, derivatives
from .tractions import Given

NOISE = 1e-13  # of what is asked for, relative to the displacement: round-off
PARALLEL = 1e-8  # sine of the angle between directions at a vertex that are one
INCONSISTENT = 1e-9  # of what is asked for at a vertex, relative to it


@dataclass(frozen=True, eq=False)
class Asked:
    """d.w on k sides, at j Gauss-Lobatto points.

    Attributes
    ----------
    side : ndarray of int (k,)
    direction : ndarray (k, j, 2)
        d.
    amount : ndarray (k, j)
        d.w, lengths.
    """

    side: Index
    direction: Array
    amount: Array


def asked_on_supports(
    cells: Cells, given: Given, displacement: ng.CoefficientFunction
) -> list[Asked]:
    """u_D - u_h in each prescribed component; no radial motion on the axis."""
    trace, found, j = cells.trace, [], DATA + 1
    axis = np.flatnonzero(trace.model.on_axis(cells.vertices)[cells.ends].all(axis=1))
    along = np.broadcast_to([1.0, 0.0], (len(axis), j, 2))
    found.append(Asked(axis, along, np.zeros((len(axis), j))))
    for values, side in given.supports:
        k = len(side)
        segment, s = cells.on_side(np.repeat(side, j), np.tile(gauss_lobatto(DATA), k))
        u = trace.evaluate(displacement, segment, s)
        for c, value in enumerate(values):
            if value is not None:
                rest = trace.evaluate(ng.CF(value), segment, s)[:, 0] - u[:, c]  # (3.6)
                d = np.broadcast_to(np.eye(2)[c], (k, j, 2))
                found.append(Asked(side, d, rest.reshape(k, j)))
    return found


def asked_on_line(facing: Facing, r: Array, alone: bool) -> list[Asked]:
    """What opens the gap of a line by `r` (k, j), lengths at Gauss points.

    d.w = -r on the secondary and r on the primary by shares, or all on the secondary `alone`.
    """
    start, stop = np.ones((2, len(facing.side), 1)) if alone else facing.share.T[:, :, None]
    share = start + (stop - start) * PLACES
    d = np.einsum("ij,kjc->kic", THROUGH, facing.direction)
    found = [Asked(facing.side, d, -(share * r) @ THROUGH.T)]
    if (share < 1).any():
        both = np.concatenate([facing.direction, ((1 - share) * r)[..., None]], axis=2)
        there = THROUGH @ facing.on_primary(both)
        found.append(Asked(facing.other, there[..., :2], there[..., 2]))
    return found


def lifted(
    problem: Problem,
    cells: Cells,
    asked: Sequence[Asked],
    lines: Sequence[tuple[Facing, Array]],
    degree: int,
    extent: float,
) -> Array:
    """Norms (n,) of w, roots of energies per thickness, shared by both bodies of each line.

    On secondaries alone where conditions at a vertex disagree.

    Parameters
    ----------
    asked : sequence of Asked
        On supports.
    lines : sequence of (Facing, ndarray (k, j))
        Each line and its r, lengths at Gauss points.
    degree : int
        Of w.
    extent : float
        Size of displacements and gaps, a length, beside which round-off is told.

    Raises
    ------
    ContactError
        Conditions disagree on secondaries alone, too.
    """
    away = np.concatenate([np.zeros(0, dtype=np.intp), *(facing.away for facing, _ in lines)])
    for alone in (False, True):
        every = [*asked, *(one for line in lines for one in asked_on_line(*line, alone))]
        try:
            return lifting_of(problem, cells, every, degree, extent, away)
        except ContactError:
            if alone:
                raise
    raise AssertionError


def lifting_of(
    problem: Problem,
    cells: Cells,
    asked: Sequence[Asked],
    degree: int,
    extent: float,
    away: Sequence[int] | Index = (),
) -> Array:
    """Norms (n,) of w, of a `degree`, with all that is asked for; see `lifted`.

    Sides `away` (r,) of Gamma_K face nothing, and may move.

    Raises
    ------
    ContactError
        Conditions at a vertex ask for different displacements.
    """
    norms = np.zeros(len(cells.triangles))
    needed = [
        one.side[np.abs(one.amount).max(axis=1, initial=0.0) > NOISE * extent] for one in asked
    ]
    if not sum(map(len, needed)):
        return norms
    touched = np.zeros(len(cells.vertices), dtype=bool)
    touched[cells.ends[np.concatenate(needed)]] = True
    layer = np.flatnonzero(touched[cells.triangles].any(axis=1))
    nodes = _Nodes(problem, cells, layer, degree)
    lines = [name for pair in problem.contact for name in (pair.secondary, pair.primary)]
    still = np.isin(cells.segment, cells.trace.segments(*lines))
    still[np.asarray(away, dtype=np.intp)] = False
    for one in asked:
        still[one.side] = False
    w = _least(nodes, asked, nodes.rim(still), 100 * NOISE * extent)
    rest = _rest(nodes, w, asked)
    rough = np.asarray(rest.any(axis=(1, 2, 3)))
    for block in nodes.blocks(rough):
        some = block.some
        own = block.table @ w[nodes.number[some]][:, None]
        value, slope = own[:, :, 0], own[:, :, 1:]
        if rough[some[0]]:
            more = _continued(block.points.local, rest[some])
            value, slope = value + more[0], slope + more[1]
        e = block.strains(slope, value)
        energy = (e * (block.law @ e[..., None])[..., 0]).sum(axis=2)
        norms[layer[some]] = np.sqrt((block.weight * energy).sum(axis=1))
    return norms


@dataclass(frozen=True, eq=False)
class _Block:
    """Triangles `some` (b,) of a layer, all of one kind, with quadrature.

    `weight` (b, q) has the model's measure, `law` is C, `into` (b, q, 2, 2) are the derivatives of
    (a, b) by x, `table` (q, 3, m) the nodes' functions and their derivatives by (a, b).
    """

    some: Index
    points: Places
    weight: Array
    law: Array
    into: Array
    table: Array

    def strains(self, slope: Array, value: Array) -> Array:
        """Voigt strains (b, q, ..., v) by derivatives (b, q, 2, ..., 2) and values (b, q, ..., 2).

        Of displacements (..., 2); derivatives are by (a, b).
        """
        gradient = np.einsum("bqax,bqa...->bq...x", self.into, slope)
        xx, yy = gradient[..., 0, 0], gradient[..., 1, 1]
        found = [xx, yy, gradient[..., 0, 1] + gradient[..., 1, 0]]
        if self.law.shape[-1] > 3:
            r = self.points.x[..., 0].reshape(self.weight.shape + (1,) * (value.ndim - 3))
            found.insert(2, value[..., 0] / r)
        return np.stack(found, axis=-1)


class _Nodes:
    """Nodes of continuous polynomials on a layer of b triangles.

    `number` (b, m): of vertices, sides and inside in turn; `local` (m, 2) their places (a, b).
    """

    def __init__(self, problem: Problem, cells: Cells, layer: Index, degree: int) -> None:
        self.problem, self.cells, self.layer, self.degree = problem, cells, layer, degree
        t = gauss_lobatto(degree)[1:-1, None]
        along = [(1 - t) * CORNERS[(i + 1) % 3] + t * CORNERS[(i + 2) % 3] for i in range(3)]
        inside = [(i / degree, j / degree) for i in range(1, degree) for j in range(1, degree - i)]
        self.local = np.concatenate([CORNERS, *along, np.reshape(inside, (-1, 2))])
        on = self._on(cells.sides[layer])[..., 1:-1]
        on = np.where(cells.backward[layer][..., None], on[..., ::-1], on)
        first = len(cells.vertices) + len(cells.ends) * (degree - 1)
        rest = first + np.arange(len(layer) * len(inside)).reshape(len(layer), -1)
        every = np.concatenate([cells.triangles[layer], on.reshape(len(layer), -1), rest], axis=1)
        self.every, number = np.unique(every, return_inverse=True)
        self.number = number.reshape(every.shape)
        self.inverse = np.linalg.inv(derivatives(degree, self.local, (0, 0))[:, 0])

    def _on(self, side: Index) -> Index:
        """Nodes (..., degree + 1) of sides (...,) from t = 0 to t = 1, among those of all cells."""
        inner = len(self.cells.vertices) + side[..., None] * (self.degree - 1)
        inner = inner + np.arange(self.degree - 1)
        ends = self.cells.ends[side]
        return np.concatenate([ends[..., :1], inner, ends[..., 1:]], axis=-1)

    def on_sides(self, side: Index) -> Index:
        """Nodes (k, degree + 1) of sides (k,) of the layer, from t = 0 to t = 1."""
        return np.searchsorted(self.every, self._on(side))

    def rim(self, still: Mask) -> Index:
        """Nodes (k,) on sides whose other triangle is outside of the layer, or that are `still`."""
        cells = self.cells
        count = np.bincount(cells.sides[self.layer].ravel(), minlength=len(cells.ends))
        return self.on_sides(np.flatnonzero((count == 1) & (cells.inner | still))).ravel()

    def blocks(self, rough: Mask) -> Iterator[_Block]:
        """The layer in groups of one kind; rules see what is continued where it is `rough` (b,)."""
        cells, degree = self.cells, self.degree
        key = np.column_stack([cells.bodies[self.layer], cells.curved[self.layer], rough])
        kinds, number = np.unique(key, axis=0, return_inverse=True)
        for kind, (_, bent, fine) in enumerate(kinds.tolist()):
            order = max(2 * degree + 4 * bent, (2 * DATA + 4) * fine)
            every = np.flatnonzero(number.ravel() == kind)
            for some in np.array_split(every, 1 + len(every) * order**2 * degree**2 // ENTRIES):
                points = places(cells, self.layer[some], order)
                table = derivatives(degree, points.local, (0, 0), (1, 0), (0, 1))
                yield _Block(
                    some=some,
                    points=points,
                    weight=points.weight * cells.measure(points.x),
                    law=np.asarray(np.linalg.inv(compliance_at(self.problem, cells, points))),
                    into=np.asarray(np.linalg.inv(cells.image(points.at, points.local)[1])),
                    table=np.array([1, 2, 2])[:, None] * table @ self.inverse,
                )


def _least(nodes: _Nodes, asked: Sequence[Asked], rim: Index, noise: float) -> Array:
    """Values (c, 2) at the nodes of the w of least energy that is as asked for, 0 on the rim."""
    count, found = len(nodes.every), []
    carry = lagrange(DATA, gauss_lobatto(nodes.degree))
    for one in asked:
        here = np.isin(one.side, nodes.cells.sides[nodes.layer])
        vectors = (carry @ one.direction[here]).reshape(-1, 2)
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        own = (one.amount[here] @ carry.T).ravel() / length[:, 0]
        found.append((nodes.on_sides(one.side[here]).ravel(), vectors / length, own))
    number, d, amount = (np.concatenate(x) for x in zip(*found, strict=True))
    # Normal equations at each node: two directions, or one and the one across, which is free.
    M, right = np.zeros((count, 2, 2)), np.zeros((count, 2, 1))
    np.add.at(M, number, d[:, :, None] * d[:, None])
    np.add.at(right, number, (d * amount[:, None])[..., None])
    size, V = np.linalg.eigh(M)
    held = size > PARALLEL * size[:, 1:]
    parts = np.divide((V.transpose(0, 2, 1) @ right)[..., 0], size, out=0 * size, where=held)
    w = (V @ parts[..., None])[..., 0]
    missed = np.abs((w[number] * d).sum(axis=1) - amount)
    if missed.max(initial=0.0) > max(INCONSISTENT * np.abs(amount).max(initial=0.0), noise):
        raise ContactError("conditions that meet at a vertex ask for different displacements")
    held[rim] = True
    if held.all():
        return w
    values, rows, columns = [], [], []
    for block in nodes.blocks(np.zeros(len(nodes.layer), dtype=bool)):
        units = block.table[None, :, :, :, None, None] * np.eye(2)  # (1, q, 3, m, 2, 2)
        B = block.strains(units[:, :, 1:], units[:, :, 0])
        B = B.reshape(*B.shape[:2], -1, B.shape[-1])
        b, q, m, v = B.shape
        B = B.swapaxes(2, 3)
        root = (block.weight[..., None, None] * B).reshape(b, q * v, m)
        K = root.transpose(0, 2, 1) @ (block.law @ B).reshape(b, q * v, m)
        n = (2 * nodes.number[block.some][..., None] + [0, 1]).reshape(b, m)
        values.append(K.ravel())
        rows.append(np.repeat(n, m, axis=1).ravel())
        columns.append(np.tile(n, (1, m)).ravel())
    entries, i, j = (np.concatenate(x) for x in (values, rows, columns))
    K = from_triplets(entries, i, j, (2 * count, 2 * count))
    R = sp.bsr_array((V, np.arange(count), np.arange(count + 1)))
    Z = sp.csr_array(R.tocsc()[:, np.flatnonzero(~held)])
    A = (Z.T @ K @ Z).tocsr()
    y = cholesky(lower_half(A))(np.ones(A.shape[0], dtype=bool))(-(Z.T @ (K @ w.ravel())))
    return np.asarray(w + (Z @ y).reshape(-1, 2))


def _rest(nodes: _Nodes, w: Array, asked: Sequence[Asked]) -> Array:
    """What of d.w is no polynomial with the values `w` (c, 2) at the nodes: (b, 3, DATA + 1, 2).

    Vectors at Gauss-Lobatto points of the triangles' sides, anticlockwise.
    """
    cells, layer = nodes.cells, nodes.layer
    found = np.zeros((len(layer), 3, DATA + 1, 2))
    largest = max(float(np.abs(one.amount).max(initial=0.0)) for one in asked)
    fine = lagrange(nodes.degree, gauss_lobatto(DATA))
    for one in asked:
        here = np.isin(one.side, cells.sides[layer])
        side, d = one.side[here], one.direction[here]
        have = ((fine @ w[nodes.on_sides(side)]) * d).sum(axis=2)
        miss = (one.amount[here] - have)[..., None] * d
        miss[np.abs(miss) <= NOISE * largest] = 0.0
        owner, local = cells.owner[side], cells.local[side]
        back = cells.backward[owner, local]
        miss = np.where(back[:, None, None], miss[:, ::-1], miss)
        found[np.searchsorted(layer, owner), local] += miss
    return found


def _continued(local: Array, rest: Array) -> tuple[Array, Array]:
    """Values (b, q, 2) and derivatives (b, q, 2, 2) by (a, b) of what is no polynomial.

    At `local` (q, 2) in triangles, from their sides `rest` (b, 3, DATA + 1, 2): f(t) on a side is
    continued as sigma f(t), sigma being 0 in the opposite corner.
    """
    share = np.column_stack([local[:, 1], 1 - local.sum(axis=1), local[:, 0]])
    grad = np.array([[0.0, 1.0], [-1.0, -1.0], [1.0, 0.0]])  # of the shares by (a, b)
    value, slope = np.zeros((len(rest), len(local), 2)), np.zeros((len(rest), len(local), 2, 2))
    for i in range(3):
        j, k = (i + 1) % 3, (i + 2) % 3
        sigma = share[:, j] + share[:, k]
        t = share[:, k] / sigma
        f, df = (g(DATA, t) @ rest[:, i] for g in (lagrange, lagrange_derivative))
        by_sigma = grad[j] + grad[k]
        by_t = grad[k] - t[:, None] * by_sigma  # times sigma
        value += sigma[:, None] * f
        slope += by_sigma[:, None] * f[:, :, None] + by_t[..., None] * df[:, :, None]
    return value, slope
