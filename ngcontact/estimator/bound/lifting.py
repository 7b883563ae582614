"""A displacement w of little energy that corrects u_h on Gamma_u, Gamma_K and curved guides.

On sides d.w is asked for: u_D - u_h on Gamma_u, r shared by compliance between both bodies on
Gamma_K, -u_h.d on guides. Other parts of Gamma_K stay where they are. On the triangles around these
sides w is the displacement of least energy of a degree with the values asked for at nodes; what is
no polynomial of that degree is continued from its side to the opposite corner in proportion to the
distance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import ngsolve as ng
import numpy as np

from ...arrays import Array, Index, Mask
from ...errors import ContactError
from ...fem import model_of
from ...lagrange import gauss_lobatto, lagrange, lagrange_derivative
from ...linalg import cholesky, lower_half
from ...problem import Problem
from ...triplets import from_triplets
from .cells import Cells, Places, places
from .elements import compliance_at
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
    nodes = _Nodes(cells, layer, degree)
    lines = [name for pair in problem.contact for name in (pair.secondary, pair.primary)]
    still = np.isin(cells.segment, cells.trace.segments(*lines))
    still[np.asarray(away, dtype=np.intp)] = False
    for one in asked:
        still[one.side] = False
    conditions = _conditions(cells, nodes, asked, still, 100 * NOISE * extent)
    squares = _least(problem, cells, nodes, conditions, asked)
    norms[layer] = np.sqrt(np.maximum(squares, 0.0))
    return norms


class _Nodes:
    """Nodes of continuous polynomials on a layer of b triangles.

    `number` (b, m): of vertices, sides and inside in turn; `local` (m, 2) their coordinates.
    """

    def __init__(self, cells: Cells, layer: Index, degree: int) -> None:
        self.layer, self.degree = layer, degree
        inner = gauss_lobatto(degree)[1:-1]
        q = degree - 1
        local = [CORNERS]
        for i in range(3):
            a, b = CORNERS[(i + 1) % 3], CORNERS[(i + 2) % 3]
            local.append(a + inner[:, None] * (b - a))
        inside = [(i / degree, j / degree) for i in range(1, degree) for j in range(1, degree - i)]
        self.local = np.concatenate([*local, np.array(inside).reshape(-1, 2)])
        vertices, triangle = np.unique(cells.triangles[layer], return_inverse=True)
        sides, side = np.unique(cells.sides[layer], return_inverse=True)
        triangle, side = triangle.reshape(-1, 3), side.reshape(-1, 3)
        self.vertices, self.sides = vertices, sides
        along = np.arange(q)
        start = len(vertices) + side[..., None] * q
        back = cells.backward[layer][..., None]
        own = start + np.where(back, q - 1 - along, along)
        count = len(vertices) + len(sides) * q
        rest = count + np.arange(len(layer) * len(inside)).reshape(len(layer), -1)
        self.number = np.concatenate([triangle, own.reshape(len(layer), -1), rest], axis=1)
        self.count = count + rest.size
        self.components = np.concatenate([2 * self.number, 2 * self.number + 1], axis=1)
        self.inverse = np.linalg.inv(derivatives(degree, self.local, (0, 0))[..., 0, :])

    def on_sides(self, cells: Cells, side: Index) -> Index:
        """Nodes (k, degree + 1) from t = 0 to t = 1; of sides of the layer."""
        at = np.searchsorted(self.sides, side)
        q = self.degree - 1
        ends = np.searchsorted(self.vertices, cells.ends[side])
        inner = len(self.vertices) + at[:, None] * q + np.arange(q)
        return np.concatenate([ends[:, :1], inner, ends[:, 1:]], axis=1)


@dataclass(frozen=True, eq=False)
class _Conditions:
    """Frames (c, 2, 2) by rows at c nodes, which of their components are held, and their values."""

    frame: Array
    held: Mask
    value: Array


def _conditions(
    cells: Cells, nodes: _Nodes, asked: Sequence[Asked], still: Mask, noise: float
) -> _Conditions:
    """What is asked for at the nodes; 0 on the rim of the layer and on sides `still` (e,)."""
    frame = np.tile(np.eye(2), (nodes.count, 1, 1))
    held, value = np.zeros((nodes.count, 2), dtype=bool), np.zeros((nodes.count, 2))
    found = []
    t = gauss_lobatto(nodes.degree)
    carry = lagrange(DATA, t)
    for one in asked:
        here = np.isin(one.side, nodes.sides)
        vectors = np.einsum("ij,kjc->kic", carry, one.direction[here]).reshape(-1, 2)
        length = np.linalg.norm(vectors, axis=1, keepdims=True)
        own = (one.amount[here] @ carry.T).ravel() / length[:, 0]
        found.append((nodes.on_sides(cells, one.side[here]).ravel(), vectors / length, own))
    number, d, amount = (np.concatenate(x) for x in zip(*found, strict=True))
    # Normal equations at each node: two directions, or one and the one across, which is free.
    M, right = np.zeros((nodes.count, 2, 2)), np.zeros((nodes.count, 2))
    np.add.at(M, number, d[:, :, None] * d[:, None])
    np.add.at(right, number, d * amount[:, None])
    at = np.unique(number)
    size, vectors = np.linalg.eigh(M[at])
    vectors = vectors[:, :, ::-1].transpose(0, 2, 1)
    size = size[:, ::-1]
    both = size > PARALLEL * size[:, :1]
    frame[at], held[at] = vectors, both
    value[at] = np.where(
        both, np.einsum("kij,kj->ki", vectors, right[at]) / np.where(both, size, 1.0), 0.0
    )
    w = np.einsum("kij,ki->kj", frame, value)
    missed = np.abs((w[number] * d).sum(axis=1) - amount)
    if missed.max(initial=0.0) > max(INCONSISTENT * np.abs(amount).max(initial=0.0), noise):
        raise ContactError("conditions that meet at a vertex ask for different displacements")
    held[_rim(cells, nodes, still)] = True
    return _Conditions(frame, held, value)


def _rim(cells: Cells, nodes: _Nodes, still: Mask) -> Mask:
    """Nodes on sides whose other triangle is outside of the layer, or that are `still`."""
    inside = np.zeros(len(cells.triangles), dtype=bool)
    inside[nodes.layer] = True
    count = np.bincount(cells.sides[inside].ravel(), minlength=len(cells.ends))
    side = np.flatnonzero((count == 1) & (cells.inner | still))
    rim = np.zeros(nodes.count, dtype=bool)
    rim[nodes.on_sides(cells, side)] = True
    return rim


def _groups(cells: Cells, at: Index, others: Mask) -> list[Index]:
    """Positions in `at` (b,) of triangles of one kind and body; `others` (b,) tell two kinds."""
    key = np.column_stack([cells.bodies[at], cells.curved[at], others])
    kinds, number = np.unique(key, axis=0, return_inverse=True)
    return [np.flatnonzero(number.ravel() == kind) for kind in range(len(kinds))]


def _least(
    problem: Problem,
    cells: Cells,
    nodes: _Nodes,
    conditions: _Conditions,
    asked: Sequence[Asked],
) -> Array:
    """Squares (b,) of the norms of the w of least energy."""
    model, degree, layer = model_of(problem), nodes.degree, nodes.layer
    values, rows, columns = [], [], []
    for some in _groups(cells, layer, np.zeros(len(layer), dtype=bool)):
        bent = bool(cells.curved[layer[some[0]]])
        points = places(cells, layer[some], 2 * degree + 4 * bent)
        B, law, weight, _ = _operators(problem, cells, nodes, points)
        b, q, v, m = B.shape
        root = (weight[..., None, None] * B).reshape(b, q * v, m)
        K = root.transpose(0, 2, 1) @ (law @ B).reshape(b, q * v, m)
        values.append(K.ravel())
        rows.append(np.repeat(nodes.components[some], m, axis=1).ravel())
        columns.append(np.tile(nodes.components[some], (1, m)).ravel())
    size = 2 * nodes.count
    entries, i, j = (np.concatenate(x) for x in (values, rows, columns))
    K = from_triplets(entries, i, j, (size, size))
    n = 2 * np.arange(nodes.count)[:, None] + [0, 1]
    R = from_triplets(  # w = R (components in the frames)
        conditions.frame.transpose(0, 2, 1).ravel(),
        np.repeat(n, 2, axis=1).ravel(),
        np.tile(n, (1, 2)).ravel(),
        (size, size),
    )
    K = (R.T @ K @ R).tocsr()
    held, y = conditions.held.ravel(), conditions.value.ravel()
    if not held.all():
        y = y + cholesky(lower_half(K))(~held)(np.where(held, 0.0, -(K @ y)))
    w = R @ y
    rest = _remainders(cells, nodes, w.reshape(-1, 2), asked)
    squares = np.zeros(len(layer))
    for some in _groups(cells, layer, rest.reached):
        bent, rough = bool(cells.curved[layer[some[0]]]), bool(rest.reached[some[0]])
        order = max(2 * degree + 4 * bent, 2 * DATA + 4 if rough else 0)
        points = places(cells, layer[some], order)
        B, law, weight, into = _operators(problem, cells, nodes, points)
        e = np.einsum("bqvm,bm->bqv", B, w[nodes.components[some]])
        if rough:
            e = e + rest.strains(some, points, into, model.extent)
        squares[some] = (weight * (e * (law @ e[..., None])[..., 0]).sum(axis=2)).sum(axis=1)
    return squares


def _operators(
    problem: Problem, cells: Cells, nodes: _Nodes, points: Places
) -> tuple[Array, Array, Array, Array]:
    """Strains (b, q, v, 2 m) of the nodes' functions, C, weights, and d(a, b) / dx."""
    model, degree = model_of(problem), nodes.degree
    weight = points.weight * cells.measure(points.x)
    law = np.asarray(np.linalg.inv(compliance_at(problem, cells, points)))
    into = np.asarray(np.linalg.inv(cells.image(points.at, points.local)[1]))
    table = derivatives(degree, points.local, (0, 0), (1, 0), (0, 1)) @ nodes.inverse
    gradient = into.swapaxes(2, 3) @ (2 * table[:, 1:])
    return _strains(gradient, table[:, 0], points.x, model.extent), law, weight, into


def _strains(gradient: Array, shape: Array, x: Array, extent: int) -> Array:
    """Voigt strains (b, q, v, 2 m) of both components; with the hoop's about an axis."""
    b, q, _, m = gradient.shape
    v = 3 + extent
    B = np.zeros((b, q, v, 2 * m))
    B[:, :, 0, :m], B[:, :, 1, m:] = gradient[:, :, 0], gradient[:, :, 1]
    B[:, :, -1, :m], B[:, :, -1, m:] = gradient[:, :, 1], gradient[:, :, 0]
    if extent:
        B[:, :, 2, :m] = shape / x[..., :1]
    return B


@dataclass(frozen=True, eq=False)
class _Remainders:
    """What of d.w is no polynomial of the nodes, on sides of b triangles.

    `rho` (b, 3, DATA + 1, 2) are vectors at Gauss-Lobatto points, anticlockwise; `reached` (b,)
    says where they are not 0.
    """

    rho: Array
    reached: Mask

    def strains(self, some: Index, points: Places, into: Array, extent: int) -> Array:
        """Voigt strains (k, q, v) at points of triangles `some` (k,), `into` as of `_operators`."""
        b, q = points.weight.shape
        share = points.local @ CORNERS.T + [0, 1, 0] * (1 - points.local.sum(axis=1))[:, None]
        slope = CORNERS - [[0, 0], [1, 1], [0, 0]]  # of the shares by (a, b)
        grad = np.einsum("sa,bqac->bqsc", slope, into)
        total = np.zeros((b, q, 2, 2))
        value = np.zeros((b, q, 2))
        for i in range(3):
            rho = self.rho[some, i]
            if not rho.any():
                continue
            j, k = (i + 1) % 3, (i + 2) % 3
            sigma = share[:, j] + share[:, k]
            t = share[:, k] / sigma
            f = np.einsum("qi,bic->bqc", lagrange(DATA, t), rho)
            df = np.einsum("qi,bic->bqc", lagrange_derivative(DATA, t), rho)
            by_sigma = grad[:, :, j] + grad[:, :, k]
            by_t = grad[:, :, k] - t[:, None] * by_sigma
            total += f[..., None] * by_sigma[:, :, None] + df[..., None] * by_t[:, :, None]
            value += sigma[:, None] * f
        e = [total[..., 0, 0], total[..., 1, 1], total[..., 0, 1] + total[..., 1, 0]]
        if extent:
            e.insert(2, value[..., 0] / points.x[..., 0])
        return np.stack(e, axis=-1)


def _remainders(cells: Cells, nodes: _Nodes, w: Array, asked: Sequence[Asked]) -> _Remainders:
    """d.w as asked for less that of the polynomial with values `w` (c, 2) at the nodes."""
    layer = nodes.layer
    position = np.full(len(cells.triangles), -1)
    position[layer] = np.arange(len(layer))
    rho = np.zeros((len(layer), 3, DATA + 1, 2))
    largest = max(float(np.abs(one.amount).max(initial=0.0)) for one in asked)
    fine = lagrange(nodes.degree, gauss_lobatto(DATA))
    for one in asked:
        here = np.isin(one.side, nodes.sides)
        side = one.side[here]
        if not side.size:
            continue
        d, amount = one.direction[here], one.amount[here]
        have = np.einsum("iq,kqc->kic", fine, w[nodes.on_sides(cells, side)])
        miss = (amount - (have * d).sum(axis=2))[..., None] * d
        miss[np.abs(miss) <= NOISE * largest] = 0.0
        triangle, local = cells.owner[side], cells.local[side]
        back = cells.backward[triangle, local]
        miss = np.where(back[:, None, None], miss[:, ::-1], miss)
        at = position[triangle]
        rho[at, local] += miss
    return _Remainders(rho, np.asarray(rho.any(axis=(1, 2, 3))))
