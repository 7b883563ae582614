"""The primal-dual active set method: what safeguards end, and what it cannot solve."""

import numpy as np
import pytest
import scipy.sparse as sp

from drivers.stress.trials.algebra import CYCLES, dual
from ngcontact.errors import ConvergenceError
from ngcontact.qp.active_set import minimise
from ngcontact.qp.schur_complement import bordered_systems
from tests.qp.programs import counting_factor, first_unknowns_bounded, inequalities


def test_plain_method_cycles():
    """The safeguard is what ends it: with endless patience the plain method cycles."""
    S, d, force = CYCLES["T-cyc-1 moved"]
    program = inequalities(*dual(np.array(S, float), np.array(d, float)))
    factor = counting_factor(program.K, [])
    with pytest.raises(ConvergenceError, match="did not settle") as failure:
        minimise(bordered_systems(program, factor), patience=10**9)
    assert failure.value.iterate.u.shape == (3,)
    result = minimise(bordered_systems(program, factor))
    np.testing.assert_allclose(result.force, force, atol=1e-12)  # condition below 100


def test_a_singular_system_is_said():
    """Two springs of which nothing holds the second: never a number."""
    K = sp.csr_array(np.diag([1.0, 0.0]))
    program = first_unknowns_bounded(K, np.ones(2), np.ones(1))
    systems = bordered_systems(program, lambda free: lambda right: right)
    with pytest.raises(ConvergenceError, match=r"Newton step 1: .*singular") as failure:
        minimise(systems)
    assert failure.value.iterate.steps == []
