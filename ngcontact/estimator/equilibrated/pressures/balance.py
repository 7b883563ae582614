"""Forces and moments that p* shall share with the discrete contact forces, or with the loads."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import scipy.sparse as sp
from scipy.sparse.csgraph import connected_components

from ....arrays import Array, Index, Mask
from ....errors import ContactError
from ....fem import BoundaryTrace
from ....problem import Triangulation
from ....triplets import from_triplets
from ..data import (
    CORNERS,
    Discrete,
    EdgeConditions,
    Units,
    basis,
    dimension,
    rigid_motions_on,
)
from .choice import Sums
from .zone import Zone, ZonePoints

RESISTED = 1e-10  # square of a body's motion on its supports, relative, from which they resist it
MET = 1e-10  # work of the pressures on a motion, relative, from which they can balance it
BALANCED = 1e-3  # work of loads that nothing balances, relative, that is no quadrature error


def _in_order(nodes: Index) -> Index:
    """Vertices (v,) of segments with the ends `nodes` (k, 2), from end to end of each chain."""
    next_to: dict[int, list[int]] = {}
    for a, b in nodes.tolist():
        next_to.setdefault(a, []).append(b)
        next_to.setdefault(b, []).append(a)
    order: dict[int, None] = {}
    for start in sorted(next_to, key=lambda v: len(next_to[v])):
        at: int | None = start
        while at is not None and at not in order:
            order[at] = None
            at = next((v for v in next_to[at] if v not in order), None)
    return np.array(list(order), dtype=np.intp)


def line_sums(
    zone: Zone,
    boundary: BoundaryTrace,
    points: ZonePoints,
    supported: Index,
    units: Units,
    compliance: float,
) -> Sums:
    """Hat moments of p* and of the discrete forces, over their unit, along the secondary.

    Vertices `supported` (j,) take no part: there a support takes what is missing.
    """
    line, length = zone.state.line, units.length
    unit = units.energy / units.strain / length
    faces = np.flatnonzero(zone.reach.acts)
    nodes = boundary.nodes[line.segments[faces]][:, [0, -1]]
    order = _in_order(nodes)
    number = np.full(int(order.max(initial=-1)) + 1, -1)
    number[order] = np.arange(len(order))
    rows = line.rows[faces]
    known, first = np.unique(rows, return_index=True)
    first = first[known >= 0]
    segment, node = np.divmod(first, rows.shape[1])
    s = boundary.places(line.segments[faces])[segment, node]
    force = zone.state.force[rows.ravel()[first]] / unit
    forces = np.zeros(len(order))
    np.add.at(forces, number[nodes[segment, 0]], force * (1 - s))
    np.add.at(forces, number[nodes[segment, 1]], force * s)
    vertex, force = _beside(zone, boundary, order)
    np.add.at(forces, number[vertex], force / unit)
    at = np.flatnonzero(zone.reach.acts[points.local])
    ends = number[boundary.nodes[points.segment[at]][:, [0, -1]]]
    s = points.s[at]
    hats = np.stack([1 - s, s], axis=1) * points.weight[at, None]
    column = np.repeat(at, 2)
    shape = len(order), len(points.s)
    moments = from_triplets(hats.ravel(), ends.ravel(), column, shape)
    kept = ~np.isin(order, supported)
    moments = (moments @ zone.values(points.local, points.s)).tocsr()[np.flatnonzero(kept)]
    # About an axis forces spread over a circumference: the squares of sums are energies times it.
    x = Triangulation(boundary.mesh).vertices[order]
    past = (x[1:] + x[:-1]) / 2 / length
    weight = compliance / boundary.model.measure(np.concatenate([past, past[-1:]])[kept])
    return Sums(moments, forces[kept], weight, not kept.all())


def _beside(zone: Zone, boundary: BoundaryTrace, order: Index) -> tuple[Index, Array]:
    """Forces (k,) on segments without p*, and those of the vertices `order` (v,) beside them."""
    line, acts = zone.state.line, zone.reach.acts
    ends = boundary.nodes[line.segments][:, [0, -1]]
    inside: Mask = np.isin(ends, order) & ~acts[:, None]
    rows = np.where(inside.any(axis=1, keepdims=True), line.rows, -1)
    known, first = np.unique(rows, return_index=True)
    left = np.setdiff1d(np.flatnonzero(known >= 0), np.flatnonzero(np.isin(known, line.rows[acts])))
    segment = first[left] // rows.shape[1]
    return ends[segment, inside[segment].argmax(axis=1)], zone.state.force[known[left]]


def _bodies(discrete: Discrete) -> Index:
    """Number (v,) of the connected body of each vertex."""
    triangles = discrete.partition.triangles
    size = len(discrete.partition.vertices)
    start, end = triangles[:, [0, 1]].ravel(), triangles[:, [1, 2]].ravel()
    graph = from_triplets(np.ones(len(start)), start, end, (size, size))
    return np.asarray(connected_components(graph, directed=False)[1], dtype=np.intp)


def balanced(
    discrete: Discrete, conditions: EdgeConditions, pressures: sp.csr_array
) -> tuple[Discrete, Array, Array]:
    """What p* must balance: A b = a for the motions that no support resists.

    Loads that neither supports nor pressures balance, as quadrature leaves them, are balanced by
    rigid body loads.

    Parameters
    ----------
    discrete : Discrete
        The data.
    conditions : EdgeConditions
        Of e edges.
    pressures : sparse (e * 2 * r, m)
        Tractions by coefficients of p*.

    Returns
    -------
    discrete : Discrete
        With such loads.
    A, a : ndarray (c, m), (c,)
        The equations.

    Raises
    ------
    ContactError
        Loads that nothing balances.
    """
    body = _bodies(discrete)
    rows, sides = [], []
    for number in range(int(body.max()) + 1):
        of_body = _functionals(discrete, conditions, body == number)
        if of_body is None:
            continue
        functional, work, inside, fields = of_body
        A = functional @ pressures
        terms = functional * conditions.given.ravel()
        a = -terms.sum(axis=1) - work.sum(axis=1)
        # Motions by what pressures can do: a disc's rotation about its middle is a combination.
        turn, size, _ = np.linalg.svd(A, full_matrices=True)
        size = np.append(size, np.zeros(len(turn) - len(size)))
        met = size > MET * np.abs(functional).max()
        A, a = turn.T @ A, turn.T @ a
        if not met.all():
            largest = np.abs(terms).sum() + np.abs(work).sum()
            if np.abs(a[~met]).max() > BALANCED * largest:
                raise ContactError("the loads on a body that can move are not in equilibrium")
            # One that does no work on the others: these are met by pressures.
            turned = np.einsum("im,mjcp->ijcp", turn.T, fields)
            discrete = _with_rigid_load(discrete, inside, turned, np.where(met, 0.0, a))
        rows.append(A[met])
        sides.append(a[met])
    m = pressures.shape[1]
    return discrete, np.concatenate([np.zeros((0, m)), *rows]), np.concatenate([[], *sides])


def _functionals(
    discrete: Discrete, conditions: EdgeConditions, mine: Mask
) -> tuple[Array, Array, Index, Array] | None:
    """Work of tractions on the motions of a body, the `mine` (v,), that no support resists.

    The functionals (m, e * 2 * r), the work (m, j) of body forces on its triangles (j,), and the
    motions (m, j, 2, 3) there; None where supports resist all.
    """
    partition = discrete.partition
    e, r = conditions.constrained.shape
    edges = np.flatnonzero(mine[partition.ends[:, 0]] & (partition.segment >= 0))
    inside = np.flatnonzero(mine[partition.triangles[:, 0]])
    x = partition.vertices[mine]
    centre, size = x.mean(axis=0), np.ptp(x, axis=0).max()
    about = np.tile(centre, (len(edges), 1, 1)), np.full((len(edges), 1), size)
    frames, degree = conditions.frames[edges], discrete.motion_degree
    low = rigid_motions_on(partition, discrete.curves, edges, frames, about, degree)[:, 0]
    free = ~conditions.constrained[edges].reshape(len(edges), 2, r // 2)[:, :, 0]
    axis = discrete.balance.at_axis(partition)[partition.ends[edges]]
    free &= ~np.all(axis, axis=1, keepdims=True)
    square = np.einsum("eifq,ejfq,ef->ij", low, low, free, optimize=True) / max(1, len(edges))
    others = ~discrete.balance.motions
    square[others], square[:, others] = 0.0, 0.0
    square[others, others] = 1.0
    values, vectors = np.linalg.eigh(square)
    motions = vectors[:, values <= RESISTED].T
    if len(motions) == 0:
        return None
    low = np.einsum("mi,eifq->mefq", motions, low)
    functional = np.zeros((len(motions), e, 2, 2, r // 2))
    lengths = partition.edge_lengths[edges][:, None, None]
    functional[:, edges, :, :, : degree + 1] = (low * lengths)[:, :, None]
    work, fields = _work(discrete, inside, motions, centre, size)
    return functional.reshape(len(motions), -1), work, inside, fields


def _work(
    discrete: Discrete, inside: Index, motions: Array, centre: Array, size: float
) -> tuple[Array, Array]:
    """Work (m, j) of the body force on motions, triangle by triangle, and these (m, j, 2, 3)."""
    partition = discrete.partition
    corners = (partition.vertices[partition.triangles[inside]] - centre) / size
    values = np.zeros((3, len(inside), 2, 3))
    values[0, :, 0], values[1, :, 1] = 1.0, 1.0
    values[2, :, 0], values[2, :, 1] = -corners[..., 1], corners[..., 0]
    at_corners = basis(1).values(CORNERS)
    fields = np.einsum("mi,ijcp->mjcp", motions, values @ np.linalg.inv(at_corners).T)
    force = discrete.force[inside].sum(axis=1)[..., :3]
    work = np.einsum("j,mjcp,jcp->mj", partition.areas[inside], fields, force)
    return work, fields


def _with_rigid_load(discrete: Discrete, inside: Index, fields: Array, missing: Array) -> Discrete:
    """With the rigid load in the `inside` (j,) that does the work `missing` (m,) on `fields`."""
    if discrete.balance.extent:  # what quadrature leaves there is round-off
        return discrete
    area, means = discrete.partition.areas[inside], discrete.motions_gram()[inside]
    gram = np.einsum("j,mjcp,jpq,njcq->mn", area, fields, means, fields, optimize=True)
    load = np.einsum("m,mjcp->jcp", np.linalg.solve(gram, missing), fields)
    force, rough = discrete.force.copy(), discrete.rough
    force[inside, :, :, : dimension(2)] += np.einsum("aip,jcp->jaci", basis(2).hats, load)
    if rough is not None:
        number = rough.number[inside]
        mine = number >= 0
        rough = rough.with_load(number[mine], load[mine])
        force[rough.at] = rough.force_means[:, None] / 3
    return replace(discrete, force=force, rough=rough)
