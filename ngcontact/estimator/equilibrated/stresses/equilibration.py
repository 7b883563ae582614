"""Stresses in equilibrium with the loads, and what they prove about a discrete solution."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index
from ..data import Discrete, EdgeConditions, basis, dimension
from .elements import Condensed, condensed, gathered, raw_operators, without_opposite
from .patches import multipliers
from .rigid_loads import exchanged_loads

ROUNDS = 3  # until what guides exert and what patches exchange fit each other
AT_ONCE = 300_000  # numbers in the operators of elements that are made together


@dataclass(frozen=True, eq=False)
class Equilibrated:
    """An equilibrated stress: its difference from the discrete one on n triangles.

    Attributes
    ----------
    change : ndarray (n, j)
        Coefficients, orthonormal in the energy.
    rest : float
        Forces on patches that stay unbalanced, relative to the largest.
    """

    change: Array
    rest: float

    def norms(self, discrete: Discrete) -> Array:
        """Norms (n,) of s - sigma_h: of the polynomials, and of what these miss of sigma_h."""
        norms = np.linalg.norm(self.change, axis=1)
        if discrete.rough is not None:
            at = discrete.rough.at
            norms[at] = np.hypot(norms[at], discrete.rough.rest)
        return np.asarray(norms)


def blocks(count: int, size: int) -> Iterator[Index]:
    """Numbers (j,) of `count` triangles, part by part; a triangle needs `size` numbers."""
    step = max(1, AT_ONCE // size)
    for low in range(0, count, step):
        yield np.arange(low, min(low + step, count))


@dataclass(frozen=True, eq=False)
class _Block:
    """Triangles `at` (b,): operators, hats times sigma_h (b, 3, 3 n), what to add (b, 3, 2 m).

    All on orthonormal coefficients, the latter the divergence that hats times sigma_h lack.
    """

    parts: Condensed
    hatted: Array
    rho: Array


def into_raw(discrete: Discrete, at: Index) -> Array:
    """Matrices (b, 3 n, 3 n) from orthonormal to raw coefficients of triangles `at` (b,)."""
    n, rough = dimension(discrete.degree), discrete.rough
    number = np.full(len(at), -1) if rough is None else rough.number[at]
    if rough is not None and (number >= 0).all():
        return rough.into[number]
    root = discrete.root[at] / np.sqrt(discrete.partition.areas[at])[:, None, None]
    into = np.einsum("bij,kl->bikjl", root, np.eye(n)).reshape(len(at), 3 * n, 3 * n)
    if rough is not None:
        into[number >= 0] = rough.into[number[number >= 0]]
    return into


def operators(discrete: Discrete, at: Index, frames: Array) -> Condensed:
    """Those of the triangles `at` (b,) on orthonormal coefficients; `frames` (e, 2, 2)."""
    into = into_raw(discrete, at)
    return condensed(*(M @ into for M in raw_operators(discrete, at, frames)))


def _block(discrete: Discrete, at: Index, frames: Array, theta: Array) -> _Block:
    """What the patches need of the triangles `at` (b,)."""
    n, b = dimension(discrete.degree), len(at)
    into = into_raw(discrete, at)
    D, N = (M @ into for M in raw_operators(discrete, at, frames))
    c, rho, rough = np.zeros((b, 3, 3 * n)), np.zeros((b, 3, D.shape[1])), discrete.rough
    number = np.full(b, -1) if rough is None else rough.number[at]
    mine, smooth = np.flatnonzero(number >= 0), np.flatnonzero(number < 0)
    if smooth.size:
        sigma, lacks = _loads(discrete, at[smooth])
        root, areas = discrete.root[at[smooth]], discrete.partition.areas[at[smooth]]
        wide = np.zeros((len(smooth), 3, 3, n))
        inverse = np.linalg.inv(root) * np.sqrt(areas)[:, None, None]
        wide[..., : sigma.shape[-1]] = np.einsum("bij,bajl->bail", inverse, sigma)
        lacks[..., :3] += theta[at[smooth]]
        c[smooth] = wide.reshape(len(smooth), 3, 3 * n)
        rho[smooth] = lacks.reshape(len(smooth), 3, -1)
    if rough is not None and mine.size:
        c[mine], load = rough.hatted[number[mine]], rough.divergence[number[mine]].copy()
        more = discrete.balance.rigid_load(discrete.partition, at[mine], theta[at[mine]])
        load[..., : more.shape[3]] += more
        c[mine] += theta[at[mine], :, 0] @ rough.around[number[mine]]
        rho[mine] = load[:, :, discrete.balance.equations].reshape(len(mine), 3, -1)
        rho[mine] -= c[mine] @ D[mine].transpose(0, 2, 1)
    return _Block(condensed(D, N), c, rho)


def _loads(discrete: Discrete, at: Index) -> tuple[Array, Array]:
    """Hats times sigma_h (b, 3, 3, m), and divergences (b, 3, 2, l) that they lack.

    Coefficients in polynomials of degree p and k - 1, for each vertex.
    """
    partition, p = discrete.partition, discrete.order
    sigma = discrete.stress[at]
    hatted = np.einsum("aij,bcj->baci", basis(p).hats, sigma)
    rho = -discrete.force[at]
    if p > 1:
        D = basis(p - 1).derivatives
        low = np.einsum("brd,rij,bcj->bdci", partition.inverses[at], D, sigma)
        divergence = np.stack([low[:, 0, 0] + low[:, 1, 2], low[:, 0, 2] + low[:, 1, 1]], axis=1)
        hat = np.einsum("aij,bcj->baci", basis(p - 1).hats, divergence)
        rho[..., : hat.shape[-1]] -= hat
    return hatted, rho


def patch_loads(discrete: Discrete) -> Array:
    """What the divergence of each patch's stress shall be: means (n, 3, 2, 3) of its products.

    With polynomials of degree 1, over the straight area.
    """
    sigma, gradients = discrete.stress, discrete.partition.hat_gradients
    xx, yy, xy = sigma[:, 0], sigma[:, 1], sigma[:, 2]
    gx, gy = gradients[:, :, 0, None], gradients[:, :, 1, None]
    load = np.stack(
        [gx * xx[:, None] + gy * xy[:, None], gx * xy[:, None] + gy * yy[:, None]], axis=2
    )
    result = -discrete.force[..., :3].copy()
    low = min(3, load.shape[-1])
    result[..., :low] += load[..., :low]
    if discrete.rough is not None:
        result[discrete.rough.at] = discrete.rough.moments
    return result


def _exchanged(discrete: Discrete, conditions: EdgeConditions, given: Array) -> tuple[Array, float]:
    """See `exchanged_loads`; with what the stresses of patches exert along d on turning guides.

    Motions that this resists hardly must be balanced with it: on a curve that is nearly a circle a
    small work would need large reactions.
    """
    partition, curves, load = discrete.partition, discrete.curves, patch_loads(discrete)
    found = exchanged_loads(discrete, load, given, conditions)
    edge = curves.edge[curves.guided]
    if edge.size == 0:
        return found
    known, q = given.copy(), given.shape[2] // 2
    triangle, side = (x[edge] for x in partition.owner)
    for _ in range(ROUNDS):
        block = _block(discrete, triangle, conditions.frames, found[0])
        c = block.hatted + block.parts.with_divergence(block.rho)
        t = (c @ block.parts.N.transpose(0, 2, 1)).reshape(len(edge), 3, 3, 2, q)
        for corner in ((side + 1) % 3, (side + 2) % 3):
            end = partition.ends[edge, 1] == partition.triangles[triangle, corner]
            mine = t[np.arange(len(edge)), corner, side, 0]
            known[edge, end.astype(np.intp), :q] = mine
        found = exchanged_loads(discrete, load, known, conditions)
    return found


def equilibrated(discrete: Discrete, conditions: EdgeConditions, given: Array) -> Equilibrated:
    """The stress of all patches together.

    `given` (e, 2, r) are the tractions of the boundary and of contact, see `EdgeConditions`.
    """
    partition, k = discrete.partition, discrete.degree
    n, r = len(partition.triangles), 2 * (k + 1)
    theta, rest = _exchanged(discrete, conditions, given)
    S, g = np.empty((n, 3, 2 * r, 2 * r)), np.empty((n, 3, 2 * r))
    X, x = np.empty((n, 3, r, 2 * r)), np.empty((n, 3, r))
    size = 9 * dimension(k) ** 2
    lacking = discrete.lacking
    for at in blocks(n, size):
        block = _block(discrete, at, conditions.frames, theta)
        c = block.hatted + block.parts.with_divergence(block.rho)
        t = c @ block.parts.N.transpose(0, 2, 1)
        S[at], g[at], X[at], x[at] = without_opposite(block.parts.G, t, lacking[at])
    lam = multipliers(partition, S, g, conditions, given)
    change = np.empty((n, 3 * dimension(k)))
    for at in blocks(n, size):
        block = _block(discrete, at, conditions.frames, 0 * theta)  # their sum is 0
        y = gathered(lam[at], X[at], x[at])
        change[at] = block.parts.with_divergence(block.rho.sum(axis=1, keepdims=True))[:, 0]
        change[at] -= block.parts.of_multipliers(y)
    return Equilibrated(change, rest)
