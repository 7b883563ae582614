"""Coarser spaces of two lines that face each other, halved again and again: arrays only."""

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.linalg.coarse_spaces import RingError, coarsenings, refined_share


def test_spaces_shrink_geometrically_where_refinement_is_local():
    """One generation adds a vertex only: several go at a time."""
    depth = 12
    first = np.full((2, 2), -1)
    chain = np.column_stack([np.zeros(depth, dtype=int), np.arange(1, depth + 1)])
    parents = np.concatenate([first, chain])
    nodes = np.array([[0, depth + 1]])
    T = sp.eye_array(2 * len(parents), format="csr")
    sizes = [step.P.shape for step in coarsenings(T, parents, nodes, 4)]
    assert all(k <= n / 2 for n, k in sizes)
    assert sizes[0][0] == 2 * len(parents)
    assert sizes[-1][1] <= 8
    assert refined_share(parents) == depth / (depth + 2)


def test_rows_in_a_ring_are_refused():
    T = sp.eye_array(8, format="lil")
    T[0, 1] = T[1, 0] = 0.5
    with pytest.raises(RingError, match="ring"):
        coarsenings(T.tocsr(), np.array([[-1, -1]] * 2 + [[0, 1]] * 2), np.array([[0, 1]]), 0)
