"""Rigid body loads that patches exchange, so that each is in equilibrium.

The load of a patch, by the hat of its vertex, is balanced where the discrete solution has been
tested with hat times rigid motion. It is not for rotations at order 1, on curved elements, and
where contact pressure replaces nodal forces. What is missing are loads theta on the triangles that
vanish in the sum over the three patches of each: the least ones that settle all patches.
"""

from __future__ import annotations

import numpy as np
import scipy.sparse as sp
from scipy.sparse.linalg import splu

from ....arrays import Array, Mask
from ....triplets import from_triplets
from ..data import CORNERS, Discrete, EdgeConditions, Partition, basis, rigid_motions_on

RESISTED = 1e-6  # square of a motion on free edges, relative, from which their tractions resist it
WEAKLY = 1e-2  # ... on turning guides: what these exert is known, and balanced
SHIFT = 1e-11  # relative, of a matrix that is singular where a body is free to move
REFINEMENTS = 3
OTHERS = 1e-8  # relative: balance of motions that a hoop stress resists is better, not needed


def _motions(partition: Partition) -> tuple[Array, Array]:
    """Rigid motions of the vertices of each triangle, and sizes (v,) of the patches.

    Two translations and the rotation over the patch's size, (n, 3, 3, 2, 3): vertex, motion,
    component, coefficient in the polynomials of degree 1.
    """
    x, triangles = partition.vertices, partition.triangles
    size = np.zeros(len(x))
    np.maximum.at(size, triangles, partition.diameters[:, None])
    size[size == 0] = 1.0
    corners = x[triangles]
    apart = (corners[:, None] - corners[:, :, None]) / size[triangles][:, :, None, None]
    values = np.zeros((len(triangles), 3, 3, 2, 3))  # last: at the corners
    values[:, :, 0, 0], values[:, :, 1, 1] = 1.0, 1.0
    values[:, :, 2, 0], values[:, :, 2, 1] = -apart[..., 1], apart[..., 0]
    return values @ np.linalg.inv(basis(1).values(CORNERS)).T, size


def _admitted(discrete: Discrete, on_edges: Array, constrained: Mask) -> Array:
    """Projectors (v, 3, 3) to the motions of each patch that no free traction resists.

    On an axis there are no tractions, and no motions of patches but rigid ones of the body.
    """
    partition, axis = discrete.partition, discrete.balance.at_axis(discrete.partition)
    constrained = constrained | axis[partition.ends].all(axis=1, keepdims=True)
    e, r = constrained.shape
    free = ~constrained.reshape(e, 2, r // 2)[:, :, : on_edges.shape[-1]]
    squares = np.einsum("eaifq,eajfq,efq->eaij", on_edges, on_edges, free)
    total = np.zeros((len(partition.vertices), 3, 3))
    np.add.at(total, partition.ends, squares)
    values, vectors = np.linalg.eigh(total)
    least = np.full((len(total), 1), RESISTED)
    curves = discrete.curves
    least[partition.ends[curves.edge[curves.guided]]] = WEAKLY
    kept = values <= least
    P = np.einsum("vij,vj,vkj->vik", vectors, kept, vectors)
    some = discrete.balance.motions
    P[axis] *= some[:, None] & some
    return P


def exchanged_loads(
    discrete: Discrete, load: Array, given: Array, conditions: EdgeConditions
) -> tuple[Array, float]:
    """Loads theta (n, 3, 2, 3) by triangle, vertex, component and polynomial of degree 1.

    Parameters
    ----------
    discrete : Discrete
        On n triangles.
    load : ndarray (n, 3, 2, 3)
        What the divergence shall be in the patch of each vertex: means of its products with
        polynomials of degree 1.
    given : ndarray (e, 2, r)
        Tractions on the e edges, see `multipliers`.
    conditions : EdgeConditions
        Of the edges.

    Returns
    -------
    theta : ndarray (n, 3, 2, 3)
        To be added to `load`.
    rest : float
        Forces that stay unbalanced, relative to the largest term.
    """
    partition, constrained = discrete.partition, conditions.constrained
    motions, size = _motions(partition)
    about = partition.vertices[partition.ends], size[partition.ends]
    every = np.arange(len(partition.ends))
    frames, degree = conditions.frames, discrete.motion_degree
    on_edges = rigid_motions_on(partition, discrete.curves, every, frames, about, degree)
    P = _admitted(discrete, on_edges, constrained)
    area, triangles, v = partition.areas, partition.triangles, len(partition.vertices)
    inside = area[:, None, None] * np.einsum("tacq,taicq->tai", load, motions)
    e, r = constrained.shape
    low = given.reshape(e, 2, 2, r // 2)[..., : degree + 1]
    outside = partition.edge_lengths[:, None, None] * np.einsum("eafq,eaifq->eai", low, on_edges)
    defect, terms = np.zeros((v, 3)), np.zeros((v, 3))
    np.add.at(defect, triangles, inside)
    np.add.at(defect, partition.ends, -outside)
    np.add.at(terms, triangles, np.abs(inside))
    np.add.at(terms, partition.ends, np.abs(outside))
    defect = np.einsum("vij,vj->vi", P, defect)
    largest = terms.max(initial=0.0)
    if np.abs(defect).max(initial=0.0) <= 1e-15 * largest:
        return np.zeros_like(load), 0.0
    stiffness = 1 / np.linalg.inv(discrete.law)[:, [0, 1], [0, 1]].max(axis=1)
    weight = stiffness / partition.diameters**2
    weighed = motions @ discrete.motions_gram()[:, None, None]
    A = _exchange(partition, motions, weighed, weight * area)
    mu = _least(A, P, -defect, discrete.balance.motions)
    rho = np.einsum("tai,taicq->tacq", mu[triangles], motions)
    theta = weight[:, None, None, None] * (rho - rho.mean(axis=1, keepdims=True))
    left = defect.copy()
    np.add.at(left, triangles, area[:, None, None] * np.einsum("tacq,taicq->tai", theta, weighed))
    left = np.einsum("vij,vj->vi", P, left)
    return theta, float(np.abs(left).max() / largest)


def _exchange(partition: Partition, motions: Array, weighed: Array, weight: Array) -> sp.csr_array:
    """Loads on patches by the motions (v, 3) of their vertices: each less the mean of the three."""
    triangles, v = partition.triangles, len(partition.vertices)
    blocks = -np.einsum("t,tajcq,tbicq->tabji", weight, motions / 3, weighed, optimize=True)
    for i in range(3):
        mine = motions[:, i], weighed[:, i]
        blocks[:, i, i] += np.einsum("t,tjcq,ticq->tji", weight, *mine)
    rows = (3 * triangles[:, :, None] + np.arange(3)).reshape(-1, 9)
    full = blocks.transpose(0, 1, 3, 2, 4).reshape(-1, 81)
    row, column = np.repeat(rows, 9, axis=1), np.tile(rows, (1, 9))
    return from_triplets(full.ravel(), row.ravel(), column.ravel(), (3 * v, 3 * v))


def _least(A: sp.csr_array, P: Array, right: Array, needed: Mask) -> Array:
    """Solution (v, 3) of the consistent system on the admitted motions, `P` (v, 3, 3)."""
    v = len(P)
    project = sp.bsr_array((P, np.arange(v), np.arange(v + 1)), shape=(3 * v, 3 * v)).tocsr()
    A = (project @ A @ project).tocsr()
    scale = A.diagonal().copy()
    block = scale.reshape(v, 3).max(axis=1)
    block[block == 0] = 1.0
    rest = sp.bsr_array((np.eye(3) - P, np.arange(v), np.arange(v + 1)), shape=(3 * v, 3 * v))
    unit = sp.diags_array(np.repeat(block, 3))
    A = A + unit @ rest.tocsr()
    if not needed.all():
        A = A + sp.diags_array(np.tile(~needed * OTHERS, v) * np.repeat(block, 3))
    half = sp.diags_array(1 / np.sqrt(np.repeat(block, 3)))
    scaled = (half @ A @ half).tocsc()
    lu = splu(
        (scaled + SHIFT * sp.eye_array(3 * v)).tocsc(),
        permc_spec="MMD_AT_PLUS_A",
        diag_pivot_thresh=0.0,
        options={"SymmetricMode": True},
    )
    b = half @ right.ravel()
    x = lu.solve(b)
    for _ in range(REFINEMENTS):
        x += lu.solve(b - scaled @ x)
    return np.asarray((half @ x).reshape(v, 3))
