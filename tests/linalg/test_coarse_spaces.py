"""Coarser spaces: their sizes, and what has none; what they are good for: test_multigrid.py."""

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.linalg.coarse_spaces import coarsenings

HALVED = np.array([[-1, -1]] * 2 + [[0, 1]] * 2)  # parents of four vertices


def test_spaces_shrink_geometrically_where_refinement_is_local():
    """One generation adds a vertex only: several go at a time. Linear functions are in all.

    Of three rows one refers to the next, which refers to a third; one mixes x and y.
    """
    depth = 12
    first = np.full((2, 2), -1)
    chain = np.column_stack([np.zeros(depth, dtype=int), np.arange(1, depth + 1)])
    parents = np.concatenate([first, chain])
    T = sp.eye_array(2 * len(parents), format="lil")
    T[0, 1], T[1, 2], T[3, 3 + len(parents)] = 0.5, -0.25, 0.6
    linear = sp.eye_array(len(parents), format="csr")
    steps = coarsenings(T.tocsr(), parents, linear, 4)
    y = np.linalg.solve(T.toarray(), np.tile([0.0, *0.5 ** np.arange(depth + 1)], 2))
    for step in steps:
        np.testing.assert_allclose(step.P @ y[step.kept], y, rtol=0, atol=1e-14)  # round-off
        y = y[step.kept]
    sizes = [step.P.shape for step in steps]
    assert all(k <= n / 2 for n, k in sizes)
    assert sizes[0][0] == 2 * len(parents)
    assert sizes[-1][1] <= 8


def test_small_spaces_have_no_coarser_ones():
    T, linear = (sp.eye_array(n, format="csr") for n in (8, 4))
    assert len(coarsenings(T, HALVED, linear, 0)) == 1
    assert coarsenings(T, HALVED, linear) == []


def test_rows_in_a_ring_are_refused():
    T = sp.eye_array(8, format="lil")
    T[0, 1] = T[1, 0] = 0.5
    with pytest.raises(ArithmeticError, match="ring"):
        coarsenings(T.tocsr(), HALVED, sp.eye_array(4), 0)
