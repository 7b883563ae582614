"""Squares that stay in the range of numbers, and sparse arrays from entries."""

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.arrays import from_triplets, power_of_two, root_of_squares


@pytest.mark.parametrize("size", [1e-300, 1e-170, 1.0, 1e170, 1e300])
def test_root_of_squares_that_are_out_of_range(size):
    assert root_of_squares(np.array([3.0, -4.0]) * size) == pytest.approx(5 * size, rel=1e-14)
    unit = power_of_two(np.array([0.0, -size]))
    assert unit <= size < 2 * unit
    assert np.frexp(unit)[0] == 0.5


def test_root_of_squares_of_nothing():
    assert root_of_squares(np.zeros(3)) == 0.0
    assert root_of_squares(np.zeros(0)) == 0.0


@pytest.mark.parametrize("index", [np.int32, np.int64, np.uint64])
def test_repeated_entries_add(index):
    rows, columns = np.array([[2, 0, 2, 1], [1, 0, 1, 3]], dtype=index)
    matrix = from_triplets(np.array([1.0, 2.0, 4.0, 0.0]), rows, columns, (3, 4))
    assert isinstance(matrix, sp.csr_array)
    assert matrix.toarray().tolist() == [[2, 0, 0, 0], [0, 0, 0, 0], [0, 5, 0, 0]]
    assert matrix.indices.dtype == matrix.indptr.dtype == np.int32


@pytest.mark.parametrize("order", [1, 2])
def test_all_matrices_of_a_problem_have_short_indices(order):
    """One of 64 bits would make those of every product long, at twice the memory."""
    from drivers.reference import cases  # needs NGSolve, the others do not
    from ngcontact import solve

    d = solve(cases.pressed_disc(), maxh=0.5, order=order).discrete
    for matrix in (d.space.A, d.space.basis, d.basis.T, d.B, d.program.K, d.program.R):
        assert isinstance(matrix, sp.csr_array)
        assert matrix.indices.dtype == matrix.indptr.dtype == np.int32
