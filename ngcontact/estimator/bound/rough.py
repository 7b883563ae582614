"""Body forces that no polynomial on a triangle meets: what stress on pieces of it balances them.

The triangle is divided into equal pieces, and what its own stress misses of the force is balanced
by the least stress on them without tractions on the triangle's sides: the problem of `program`
once more, without contact, triangle by triangle.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...arrays import Array, Index
from ...problem import Problem
from .cells import Cells, Places, joined, places
from .elements import BONUS, ON_CURVES, Element, elements, force_of
from .missed import data_norms, least_moduli, missed_tractions
from .polynomials import Frame, scalars
from .program import solved

DEGREE = 3  # of stresses on pieces in the plane; those of degree 2 on equal pieces lack freedom


def on_pieces(problem: Problem, cells: Cells, e: Element, some: Index, parts: int) -> Array:
    """Energy norms (b,) of the stresses on `parts`^2 pieces of triangles `some` (b,) of a group."""
    at = e.places.at[some]
    pieces, number = _pieces(cells, at, parts)
    frame, force = e.frame[some], e.force[some]
    extent = cells.trace.model.extent

    def rest(points: Places, load: Array) -> Array:
        """The force less what is balanced."""
        of = number[points.at]
        found = load - scalars(e.force_degree, frame[of], points.x) @ force[of]
        if extent:
            found[..., 0] = 0.0
        return np.asarray(
            found - np.einsum("bqcr,br->bqc", _rigid(frame[of], points, extent), work[of])
        )

    # The rule of whole triangles is another one: what it leaves does no work on rigid motions.
    work = np.zeros((len(at), 3 - 2 * extent))
    work = _work(problem, pieces, number, frame, rest, len(at))
    mu, groups = elements(problem, pieces, None, DEGREE + extent, rest)
    size = int(mu.start[-1])
    # Three multipliers of a side of each triangle fix its rigid motions.
    side = pieces.sides[np.unique(number, return_index=True)[1], 1]
    start, k = mu.start[side], mu.degree[side]
    along = np.diff(pieces.vertices[pieces.ends[side]], axis=1)[:, 0]
    upright = np.abs(along[:, 1]) > np.abs(along[:, 0])
    fixed = np.zeros(size, dtype=bool)
    fixed[np.concatenate([start, start + k + 1, np.where(upright, start, start + k + 1) + 1])] = (
        True
    )
    none = np.zeros(size)
    found = solved(mu, groups, none, fixed, none[:, None][:, :0], [])
    largest = max(
        float(np.abs(g.stress(c, g.places.x)).max())
        for g, c in zip(groups, found.coefficients, strict=True)
    )
    tractions = missed_tractions(pieces, groups, found.coefficients, largest)
    forces, norms = np.zeros((2, len(pieces.triangles)))
    for g, c in zip(groups, found.coefficients, strict=True):
        s = g.full_stress(c)
        energy = (s * (g.compliance @ s[..., None])[..., 0]).sum(axis=2)
        norms[g.places.at] = np.sqrt((g.weight * energy).sum(axis=1))
        forces[g.places.at] = g.missed
    norms += data_norms(pieces, forces, tractions, least_moduli(pieces, groups))
    return np.asarray(np.sqrt(np.bincount(number, norms**2, minlength=len(at))))


def _rigid(frame: Frame, points: Places, extent: int) -> Array:
    """Rigid motions (b, q, 2, r) at points."""
    x = frame.scaled(points.x)
    found = np.zeros((*x.shape, 3))
    found[..., 0, 0] = found[..., 1, 1] = 1.0
    found[..., 0, 2], found[..., 1, 2] = -x[..., 1], x[..., 0]
    return found[..., 1:2] if extent else found


def _work(
    problem: Problem,
    pieces: Cells,
    number: Index,
    frame: Frame,
    rest: Callable[[Places, Array], Array],
    count: int,
) -> Array:
    """Coefficients (count, r) of the rigid motions nearest to what is left of the force."""
    model = pieces.trace.model
    r = 3 - 2 * model.extent
    M, b = np.zeros((count, r, r)), np.zeros((count, r))
    load = force_of(problem, pieces, int(pieces.bodies[0]))
    for bent in (False, True):
        some = np.flatnonzero(pieces.curved == bent)
        if some.size:
            degree = DEGREE + model.extent + ON_CURVES * bent
            points = places(pieces, some, 2 * degree + BONUS)
            of = number[some]
            z = _rigid(frame[of], points, model.extent)
            measure = model.measure(points.x.reshape(-1, 2)).reshape(points.weight.shape)
            wz = (points.weight * measure)[..., None, None] * z
            np.add.at(M, of, np.einsum("bqcr,bqcs->brs", wz, z))
            np.add.at(
                b, of, np.einsum("bqcr,bqc->br", wz, rest(points, points.evaluate(pieces, load)))
            )
    return np.asarray(np.linalg.solve(M, b[..., None])[..., 0])


def _pieces(cells: Cells, at: Index, parts: int) -> tuple[Cells, Index]:
    """Pieces of triangles `at` (b,), which share no vertices, and the triangle of each."""
    m, b = parts, len(at)
    lattice = [(i, j) for i in range(m + 1) for j in range(i + 1)]
    place = {pair: k for k, pair in enumerate(lattice)}
    i, j = np.array(lattice).T
    sigma, t = i / m, j / np.maximum(i, 1)
    own, spans = cells.segment[cells.sides[at]], cells.span[cells.sides[at]]
    spans = np.where(cells.backward[at][..., None], spans[..., ::-1], spans)
    side, back = cells.sides[at, 0], cells.backward[at, 0]
    own_t = np.where(back[:, None], 1 - t, t)
    base, _ = cells.points(np.repeat(side, len(t)), own_t.ravel())
    apex = cells.corners[at][:, :1]
    x = apex + sigma[:, None] * (base.reshape(b, -1, 2) - apex)
    share = np.column_stack([1 - sigma, sigma * (1 - t), sigma * t])
    reference = np.einsum("qc,bcd->bqd", share, cells.reference[at])
    up = [(p, (p[0] + 1, p[1]), (p[0] + 1, p[1] + 1)) for p in lattice if p[0] < m]
    down = [(p, (p[0] + 1, p[1] + 1), (p[0], p[1] + 1)) for p in lattice if p[1] < p[0] < m]
    corners = np.array([[place[p] for p in three] for three in up + down])
    outer = np.array([three[1][0] == m and three[2][0] == m for three in up + down])
    n = len(corners)
    segment = np.full((b, n, 3), -1)
    segment[..., 0] = np.where(outer & cells.curved[at, None], own[:, :1], -1)
    span = np.broadcast_to([0.0, 1.0], (b, n, 3, 2)).copy()
    ends = np.array([[three[c][1] / m for c in (1, 2)] for three in up + down])
    a, stop = spans[:, 0, 0, None, None], spans[:, 0, 1, None, None]
    span[:, :, 0] = np.where(outer[:, None], a + (stop - a) * ends, span[:, :, 0])
    triangles = corners + len(lattice) * np.arange(b)[:, None, None]
    made = joined(
        cells.trace,
        x.reshape(-1, 2),
        triangles.reshape(-1, 3),
        reference[:, corners].reshape(-1, 3, 2),
        np.repeat(cells.parent[at], n),
        segment.reshape(-1, 3),
        span.reshape(-1, 3, 2),
        (outer & cells.curved[at, None]).ravel(),
    )
    return made, np.repeat(np.arange(b), n)
