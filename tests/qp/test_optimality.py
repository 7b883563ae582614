"""Residuals of the optimality conditions, and the size of the terms of a product."""

from dataclasses import replace

import numpy as np
import pytest

from ngcontact.qp.active_set import minimise
from ngcontact.qp.optimality import kkt_residuals
from ngcontact.qp.schur_complement import bordered_systems
from tests.qp.programs import counting_factor, first_unknowns_bounded, membrane


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
