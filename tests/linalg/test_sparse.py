"""Matrices shared by NGSolve and SciPy: same memory, same values, their owner lives on."""

import ngsolve as ng
import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.linalg.sparse import cholesky, congruent, lower_half, shared

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
def test_congruent_matrices(changed, full):
    """T differs from the identity in that many rows; a full A has places for all that changes."""
    rng = np.random.default_rng(changed)
    given = definite(rng)
    if full:
        rows, columns = np.indices(given.shape).reshape(2, -1)
        given = sp.coo_matrix((given.toarray().ravel(), (rows, columns)), given.shape)
    A = for_ngsolve(given)
    T = np.eye(SIZE)
    T[rng.permutation(SIZE)[:changed]] += rng.normal(size=(changed, SIZE))
    K, total = congruent(A, shared(A), sp.csr_matrix(T))
    expected = T.T @ shared(A).toarray() @ T
    # Sums of at most SIZE^2 terms: 1e-13 is round-off.
    np.testing.assert_allclose(K.toarray(), expected, atol=1e-13 * np.abs(expected).max())
    assert np.shares_memory(K.data, np.asarray(total.CSR()[0]))
    np.testing.assert_array_equal(shared(A).toarray(), given.toarray())  # as it was
    right, product = total.CreateRowVector(), total.CreateColVector()
    right.FV().NumPy()[:] = rng.normal(size=SIZE)
    product.data = total * right
    reference = expected @ right.FV().NumPy()
    allowed = 1e-13 * np.abs(reference).max()
    np.testing.assert_allclose(product.FV().NumPy(), reference, atol=allowed)


def test_factorisation_of_principal_parts():
    rng = np.random.default_rng(2)
    free = rng.random(SIZE) < 0.7
    K = definite(rng)
    right = rng.normal(size=SIZE)
    solution = cholesky(lower_half(K))(free)(right)
    assert (solution[~free] == 0).all()
    np.testing.assert_allclose((K @ solution)[free], right[free], atol=1e-13 * np.abs(right).max())
