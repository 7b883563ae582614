"""Residuals of the optimality conditions, and the size of the terms of a product."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
import scipy.sparse as sp

from ngcontact.qp.active_set import minimise
from ngcontact.qp.quadratic_program import kkt_residuals, terms
from ngcontact.qp.schur_complement import bordered_systems
from tests.qp.programs import counting_factor, first_unknowns_bounded, membrane

SIZE = 40


@pytest.mark.parametrize("columns", [(), (3,)])
@pytest.mark.parametrize("rows", [1, SIZE - 1, SIZE, 7, None])
def test_size_of_terms(columns, rows):
    rng = np.random.default_rng(4)
    A = sp.csr_array(rng.normal(size=(SIZE, SIZE)) * (rng.random((SIZE, SIZE)) < 0.1))
    x = rng.normal(size=(SIZE, *columns))
    expected = np.abs(A.toarray()) @ np.abs(x)
    found = terms(A, x) if rows is None else terms(A, x, rows)
    # Sums of a few positive numbers.
    np.testing.assert_allclose(found, expected, rtol=1e-14)


def test_residuals_name_what_is_violated():
    K, b, g = membrane()
    program = first_unknowns_bounded(K, -b, g)
    result = minimise(bordered_systems(program, counting_factor(K, [])))
    assert max(kkt_residuals(program, result).values()) < 1e-13  # round-off
    contact, apart = np.flatnonzero(result.active)[0], np.flatnonzero(~result.active)[0]
    length, largest = np.abs(result.u).max(), result.force.max()
    u, force = result.u.copy(), result.force.copy()
    u[contact] += 0.1 * length
    force[apart] -= 0.2 * largest
    wrong = kkt_residuals(program, replace(result, u=u, force=force))
    assert wrong["penetration"] == pytest.approx(0.1 / 1.1, rel=1e-9)
    assert wrong["tension"] == pytest.approx(0.2, rel=1e-12)
    assert min(wrong["equilibrium"], wrong["complementarity"]) > 1e-3


def test_residuals_of_nothing_are_zero():
    program = first_unknowns_bounded(sp.eye_array(3, format="csr"), np.zeros(3), np.ones(2))
    result = minimise(bordered_systems(program, counting_factor(program.K, [])))
    assert set(kkt_residuals(program, result).values()) == {0.0}
