"""Squares in the range of numbers, normals, short indices of matrices, lines of warnings."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact import ContactWarning, errors
from ngcontact.arrays import across, power_of_two, rightward, root_of_squares
from ngcontact.errors import warn


@pytest.mark.parametrize("size", [1e-300, 1e-170, 1.0, 1e170, 1e300])
def test_root_of_squares_that_are_out_of_range(size):
    assert root_of_squares(np.array([3.0, -4.0]) * size) == pytest.approx(5 * size, rel=1e-14)
    unit = power_of_two(np.array([0.0, -size]))
    assert unit <= size < 2 * unit
    assert np.frexp(unit)[0] == 0.5
    assert root_of_squares(np.zeros(3)) == root_of_squares(np.zeros(0)) == 0.0


@pytest.mark.parametrize("d", [2, 3])
def test_normals_stand_before_slopes_in_a_positive_basis(d):
    slopes = np.random.default_rng(d).normal(size=(d - 1, 20, d))
    normal = rightward(*slopes)
    np.testing.assert_allclose(np.linalg.norm(normal, axis=1), 1, rtol=1e-15)
    np.testing.assert_allclose(np.einsum("ski,ki->sk", slopes, normal), 0, atol=1e-15 * 10)
    assert (np.linalg.det(np.stack([normal, *slopes], axis=1)) > 0).all()
    if d == 2:
        np.testing.assert_array_equal(
            across(normal) * np.linalg.norm(slopes[0], axis=1)[:, None] > 0, slopes[0] > 0
        )


@pytest.mark.parametrize("order", [1, 2])
def test_all_matrices_of_a_problem_have_short_indices(order):
    """One of 64 bits would make those of every product long, at twice the memory."""
    from drivers.reference import cases  # needs NGSolve, the others do not
    from ngcontact import solve

    d = solve(cases.pressed_disc(), maxh=0.5, order=order).discrete
    for matrix in (d.space.A, d.space.basis, d.basis.T, d.rows.matrix, d.program.K):
        assert isinstance(matrix, sp.csr_array)
        assert matrix.indices.dtype == matrix.indptr.dtype == np.int32


def test_a_warning_names_the_line_outside_of_the_package():
    with pytest.warns(ContactWarning, match="may be wrong") as caught:
        warn("this may be wrong")
    assert Path(caught[0].filename) == Path(__file__)


def test_a_generator_warns_at_the_line_that_asks_for_its_next_value():
    source = "def levels():\n    warn('of a level')\n    yield 1\n"
    room: dict[str, Any] = {"warn": warn}
    exec(compile(source, errors.PACKAGE + "adaptive.py", "exec"), room)
    levels = room["levels"]()
    with pytest.warns(ContactWarning) as caught:
        next(levels)
    assert Path(caught[0].filename) == Path(__file__)
