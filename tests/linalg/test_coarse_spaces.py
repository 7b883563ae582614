"""Coarser spaces of facing lines, halved again and again, and matrices shared with NGSolve."""

import ngsolve as ng
import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.arrays import from_triplets
from ngcontact.constraints import Conditions, Rows, change_of_basis
from ngcontact.lagrange import gauss_lobatto
from ngcontact.linalg import sparse
from ngcontact.linalg.coarse_spaces import COARSEST, coarsenings
from ngcontact.linalg.sparse import cholesky_of_closed_rows, congruent, shared

FIRST = 4  # vertices of each line at first


def facing_lines(rounds, d):
    """Vertices (nv, d), parents (nv, 2) and the segments (2, k, 2) of both lines, in one order."""
    rng = np.random.default_rng(rounds)
    points = np.tile(np.sort(rng.random((FIRST, d)), axis=0), (2, 1))
    parents = np.full((2 * FIRST, 2), -1)
    one = np.column_stack([np.arange(FIRST - 1), np.arange(1, FIRST)])
    both = np.stack([one, one + FIRST])
    for _ in range(rounds):
        edges = both.reshape(-1, 2)
        new = len(points) + np.arange(len(edges)).reshape(2, -1)
        points = np.concatenate([points, points[edges].mean(axis=1)])
        parents = np.concatenate([parents, np.sort(edges, axis=1)])
        halves = [np.stack([both[..., 0], new]), np.stack([new, both[..., 1]])]
        both = np.concatenate([half.transpose(1, 2, 0) for half in halves], axis=1)
    return points, parents, both


def transformed(n, one, other, d):
    """Basis T in which the jump between facing nodes is an unknown, and a node slides aslant."""
    angle = np.linspace(0.3, 1.2, len(one))
    direction = np.column_stack([np.cos(angle), np.sin(angle), 0.5 * np.cos(3 * angle)])[:, :d]
    direction /= np.linalg.norm(direction, axis=1)[:, None]
    coupling = from_triplets(np.ones(len(one)), np.arange(len(one)), other, (len(one), n))
    none = np.zeros(len(one), dtype=bool)
    rows = Rows(one, direction, coupling, np.zeros(len(one)), equality=none)
    return change_of_basis(Conditions(other[:1], direction[:1], np.zeros(1)), rows).T


def space(order, rounds, d=2):
    """T, parents and functions of degree 1 of the two lines, a linear displacement (d * n,)."""
    points, parents, both = facing_lines(rounds, d)
    segments = both.reshape(-1, 2)
    inner = len(points) + np.arange(len(segments) * (order - 1)).reshape(len(segments), -1)
    nodes = np.column_stack([segments[:, 0], inner, segments[:, 1]])
    s = gauss_lobatto(order)[1:-1, None]
    shares = np.column_stack([1 - s, s])
    one, share = np.repeat(segments, order - 1, axis=0), np.tile(shares, (len(segments), 1))
    rows = np.concatenate([np.arange(len(points)), np.repeat(inner.ravel(), 2)])
    columns = np.concatenate([np.arange(len(points)), one.ravel()])
    values = np.concatenate([np.ones(len(points)), share.ravel()])
    linear = from_triplets(values, rows, columns, (len(points) + inner.size, len(points)))
    points = linear @ points
    one, other = (np.unique(half) for half in np.split(nodes, 2))
    at = np.argsort(points[one, 0]), np.argsort(points[other, 0])
    rng = np.random.default_rng(order)
    u = points @ rng.normal(size=(d, d)) + rng.normal(size=d)
    return transformed(len(points), one[at[0]], other[at[1]], d), parents, linear, u.T.ravel()


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_linear_displacements_are_in_all_spaces(order, d):
    T, parents, linear, u = space(order, 4, d)
    y = sp.linalg.spsolve(T.tocsc(), u)
    steps = coarsenings(T, parents, linear, d * FIRST, d)
    # Half of a line's segments have more than half of its vertices: two generations a step.
    assert len(steps) == (2 if order == 1 else 3)
    for step in steps:
        # Theory: exact; sums of a few numbers of size 1, in blocks of condition below 10.
        np.testing.assert_allclose(step.P @ y[step.kept], y, rtol=0, atol=1e-13)
        y = y[step.kept]
    assert y.size == 2 * d * FIRST


@pytest.mark.parametrize("d", [2, 3])
@pytest.mark.parametrize("order", [1, 2, 4])
def test_unknowns_that_stay_mean_the_same(order, d):
    T, parents, linear, _ = space(order, 3, d)
    for step in coarsenings(T, parents, linear, 0, d):
        chosen = step.P[step.kept]
        # Theory: the identity; round-off of the frames.
        assert abs(chosen - sp.eye_array(chosen.shape[0])).max() < 1e-13


def test_spaces_shrink_geometrically_where_refinement_is_local():
    """One generation adds a vertex only: several go at a time."""
    depth = 12
    first = np.full((2, 2), -1)
    chain = np.column_stack([np.zeros(depth, dtype=int), np.arange(1, depth + 1)])
    parents = np.concatenate([first, chain])
    T = sp.eye_array(2 * len(parents), format="csr")
    linear = sp.eye_array(len(parents), format="csr")
    sizes = [step.P.shape for step in coarsenings(T, parents, linear, 4)]
    assert all(k <= n / 2 for n, k in sizes)
    assert sizes[0][0] == 2 * len(parents)
    assert sizes[-1][1] <= 8


def test_small_spaces_have_no_coarser_ones():
    T, parents, linear, _ = space(1, 3)
    assert T.shape[0] < COARSEST
    assert coarsenings(T, parents, linear) == []


def test_rows_in_a_ring_are_refused():
    T = sp.eye_array(8, format="lil")
    T[0, 1] = T[1, 0] = 0.5
    with pytest.raises(ArithmeticError, match="ring"):
        coarsenings(T.tocsr(), np.array([[-1, -1]] * 2 + [[0, 1]] * 2), sp.eye_array(4), 0)


SIZE = 40


def definite(rng, size=SIZE):
    """Sparse, symmetric, diagonally dominant."""
    X = sp.random(size, size, density=4 / size, random_state=rng)
    K = X + X.T
    return (K + sp.diags(1 + np.asarray(abs(K).sum(axis=1)).ravel())).tocsr()


def for_ngsolve(K):
    K = K.tocoo()
    return ng.la.SparseMatrixd.CreateFromCOO(K.row, K.col, K.data, *K.shape)


@pytest.mark.parametrize("full", [False, True])
@pytest.mark.parametrize("changed", [0, 1, SIZE])
def test_congruent_matrices(changed, full, monkeypatch):
    """T differs from the identity in that many rows; a full A has places for all that changes.

    A large matrix is changed, of a small one the product is made.
    """
    rng = np.random.default_rng(changed)
    given = definite(rng)
    if full:
        rows, columns = np.indices(given.shape).reshape(2, -1)
        given = sp.coo_matrix((given.toarray().ravel(), (rows, columns)), given.shape)
    A = for_ngsolve(given)
    T = np.eye(SIZE)
    T[rng.permutation(SIZE)[:changed]] += rng.normal(size=(changed, SIZE))
    small, _ = congruent(A, sp.csr_array(T))
    monkeypatch.setattr(sparse, "MULTIPLIED_ENTRIES", 0)
    monkeypatch.setattr(sparse, "MAX_CHANGE", np.inf)
    K, total = congruent(A, sp.csr_array(T))
    expected = T.T @ shared(A).toarray() @ T
    # Sums of at most SIZE^2 terms: 1e-13 is round-off.
    for one in (K, small):
        np.testing.assert_allclose(one.toarray(), expected, atol=1e-13 * np.abs(expected).max())
    assert np.shares_memory(K.data, np.asarray(total.CSR()[0]))
    np.testing.assert_array_equal(shared(A).toarray(), given.toarray())  # as it was
    right, product = total.CreateRowVector(), total.CreateColVector()
    right.FV().NumPy()[:] = rng.normal(size=SIZE)
    product.data = total * right
    reference = expected @ right.FV().NumPy()
    allowed = 1e-13 * np.abs(reference).max()
    np.testing.assert_allclose(product.FV().NumPy(), reference, atol=allowed)


def test_factors_without_the_couplings_of_open_rows(monkeypatch):
    """They solve with the same matrix, of which no more is known to NGSolve than A."""
    rng = np.random.default_rng(4)
    given = definite(rng)
    rows, half = np.arange(0, SIZE, 4), np.arange(1, SIZE, 2)
    links = np.zeros((SIZE, SIZE))
    links[np.ix_(rows, half)] = rng.normal(size=(len(rows), len(half)))
    T = sp.csr_array((np.eye(SIZE) - links) * 2.0)
    A = for_ngsolve(given)
    basis = sp.eye_array(SIZE, format="csr")
    monkeypatch.setattr(sparse, "MULTIPLIED_ENTRIES", 0)
    monkeypatch.setattr(sparse, "MAX_CHANGE", 0.0)
    K, matrix = congruent(A, T)
    assert matrix is None
    factor = cholesky_of_closed_rows(A, basis, T, sp.csr_array(links))
    right = rng.normal(size=SIZE)
    for closed in (rows, rows[:3], rows[:0]):
        free = np.ones(SIZE, dtype=bool)
        free[closed] = free[3] = False
        solution = factor(free)(np.where(free, right, 0.0))
        assert (solution[~free] == 0).all()
        reference = np.linalg.solve(K.toarray()[np.ix_(free, free)], right[free])
        # Round-off times the condition of T'AT, below 1e4.
        np.testing.assert_allclose(solution[free], reference, rtol=0, atol=1e-11)
