"""Stresses of one triangle: condensed to tractions on its edges, once for its three patches.

On a triangle stresses are polynomials of degree k with coefficients c, orthonormal in the energy.
A patch asks for the nearest ones to a given stress with a given divergence, without traction on
the edge opposite to its vertex: divergence and that edge are eliminated, and what is left are
multipliers on the two other edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ....arrays import Array, Index, Mask
from ..data import OF_AXIS, Discrete, basis, dimension, divergence

TRUNCATED = 1e-11  # eigenvalues, relative, of tractions that a triangle at the axis lacks


def raw_operators(discrete: Discrete, at: Index, frames: Array) -> tuple[Array, Array]:
    """Divergence (b, m, 3 n) and tractions (b, 6 (k + 1), 3 n) of the triangles `at` (b,).

    Of the coefficients of (xx, yy, xy) in the n polynomials of degree k; the divergence in those of
    degree k - 1, for each equation, the tractions, by edge, component along `frames` (e, 2, 2) and
    Legendre polynomial, in the direction in which each edge runs. On curved edges, where these are
    moments, tractions count per chord.
    """
    partition, degree = discrete.partition, discrete.degree
    table, b = basis(degree), len(at)
    n = dimension(degree)
    D = divergence(partition, at, degree)[:, discrete.balance.equations].reshape(b, -1, 3 * n)
    along = np.einsum("cds,bed->becs", OF_AXIS, partition.normals[at])
    along = np.einsum("befc,becs->befs", frames[partition.edges[at]], along)
    signs = np.where(partition.flips[at][:, :, None], (-1.0) ** np.arange(degree + 1), 1.0)
    N = np.einsum("befs,beq,eqj->befqsj", along, signs, table.traces, optimize=True)
    N = N.reshape(b, 3, -1, 3 * n)
    curved, side = np.nonzero(discrete.curves.number[partition.edges[at]] >= 0)
    edge = partition.edges[at[curved], side]
    N[curved, side] = discrete.moments[discrete.curves.number[edge]]
    return D, N.reshape(b, -1, 3 * n)


@dataclass(frozen=True, eq=False)
class Condensed:
    """Operators of b triangles on coefficients that are orthonormal in the energy, n of them.

    Attributes
    ----------
    Q, R : ndarray (b, n, m), (b, m, m)
        Q R is the transpose of the divergence.
    N : ndarray (b, E, n)
        Tractions on the three edges.
    K : ndarray (b, n, E)
        Stresses without divergence that multipliers of the tractions cause.
    G : ndarray (b, E, E)
        Their tractions.
    """

    Q: Array
    R: Array
    N: Array
    K: Array
    G: Array

    @property
    def size(self) -> int:
        """Count of all numbers."""
        return sum(x.size for x in (self.Q, self.R, self.N, self.K, self.G))

    def with_divergence(self, rho: Array) -> Array:
        """Least stresses (b, j, n) of divergences `rho` (b, j, m)."""
        x = np.linalg.solve(self.R.transpose(0, 2, 1), rho.transpose(0, 2, 1))
        return np.asarray((self.Q @ x).transpose(0, 2, 1))

    def of_multipliers(self, y: Array) -> Array:
        """Stresses (b, n) without divergence that multipliers `y` (b, E) cause.

        They cancel in thin triangles, where multipliers are large, and the divergence with them.
        """
        c = self.K @ y[:, :, None]
        return np.asarray((c - self.Q @ (self.Q.transpose(0, 2, 1) @ c))[:, :, 0])


def condensed(D: Array, N: Array) -> Condensed:
    """Condense operators `D` (b, m, n), `N` (b, E, n) on orthonormal coefficients."""
    across, R = np.linalg.qr(D.transpose(0, 2, 1))
    K = N.transpose(0, 2, 1)
    for _ in range(2):  # once more for round-off
        K = K - across @ (across.transpose(0, 2, 1) @ K)
    return Condensed(Q=across, R=R, N=N, K=K, G=K.transpose(0, 2, 1) @ K)


def _solved(G: Array, right: Array, lacking: Mask, size: Array) -> Array:
    """Solutions (b, r, j) for `G` (b, r, r), semidefinite on the triangles `lacking` (b,).

    `size` (b,) is that of the whole of which G is a part.
    """
    result = np.empty_like(right)
    full = ~lacking
    result[full] = np.linalg.solve(G[full], right[full])
    if lacking.any():
        values, vectors = np.linalg.eigh(G[lacking])
        kept = values > TRUNCATED * size[lacking, None]
        inverse = np.where(kept, 1 / np.where(kept, values, 1.0), 0.0)
        turned = vectors.transpose(0, 2, 1) @ right[lacking]
        result[lacking] = vectors @ (inverse[:, :, None] * turned)
    return result


def without_opposite(G: Array, t: Array, lacking: Mask) -> tuple[Array, Array, Array, Array]:
    """Eliminate the edge opposite to each of the three vertices.

    Parameters
    ----------
    G : ndarray (b, 3 r, 3 r)
        Tractions by multipliers.
    t : ndarray (b, 3, 3 r)
        Tractions without them, for each vertex.
    lacking : ndarray of bool (b,)
        Triangles without some of the tractions.

    Returns
    -------
    S, g : ndarray (b, 3, 2 r, 2 r), (b, 3, 2 r)
        The same on the edges i + 1 and i + 2 of vertex i.
    X, x : ndarray (b, 3, r, 2 r), (b, 3, r)
        The opposite edge's multipliers are x - X times those.
    """
    b, r = len(G), G.shape[1] // 3
    S, g = np.empty((b, 3, 2 * r, 2 * r)), np.empty((b, 3, 2 * r))
    X, x = np.empty((b, 3, r, 2 * r)), np.empty((b, 3, r))
    whole = np.einsum("bii->bi", G).max(axis=1)
    for i in range(3):
        away = i * r + np.arange(r)
        here = np.concatenate([(i + j) % 3 * r + np.arange(r) for j in (1, 2)])
        right = np.concatenate([G[:, away[:, None], here], t[:, i, away][:, :, None]], axis=2)
        solved = _solved(G[:, away[:, None], away], right, lacking, whole)
        X[:, i], x[:, i] = solved[:, :, :-1], solved[:, :, -1]
        across = G[:, here[:, None], away]
        S[:, i] = G[:, here[:, None], here] - across @ X[:, i]
        g[:, i] = t[:, i, here] - (across @ x[:, i, :, None])[:, :, 0]
    if lacking.any():
        kept = np.einsum("biss->bis", S[lacking]) > TRUNCATED * whole[lacking, None, None]
        S[lacking] *= kept[:, :, :, None] & kept[:, :, None, :]
    return S, g, X, x


def gathered(multipliers: Array, X: Array, x: Array) -> Array:
    """Multipliers (b, 3 r) of the three edges together, summed over the three vertices.

    Parameters
    ----------
    multipliers : ndarray (b, 3, 2 r)
        Of the two edges at each vertex.
    X, x : ndarray (b, 3, r, 2 r), (b, 3, r)
        Of `without_opposite`.
    """
    b, _, r, _ = X.shape
    y = np.zeros((b, 3, r))
    for i in range(3):
        y[:, i] += x[:, i] - (X[:, i] @ multipliers[:, i, :, None])[:, :, 0]
        y[:, (i + 1) % 3] += multipliers[:, i, :r]
        y[:, (i + 2) % 3] += multipliers[:, i, r:]
    return y.reshape(b, -1)
