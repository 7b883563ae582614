"""The primal-dual active set method: what safeguards end, and what it cannot solve."""

import numpy as np
import pytest
import scipy.sparse as sp

from drivers.stress.trials.algebra import CYCLES, dual
from ngcontact.errors import ConvergenceError
from ngcontact.qp.active_set import minimise
from ngcontact.qp.quadratic_program import QuadraticProgram
from ngcontact.qp.schur_complement import bordered_systems
from tests.qp.programs import counting_factor, first_unknowns_bounded, inequalities, membrane


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


def test_given_values_and_equalities_with_unit_rows():
    K, b, g = membrane(n=9)
    n = g.size
    rows = np.array([3, 6])
    R = sp.eye_array(n, format="csr")[rows]
    fixed, values = np.zeros(n, dtype=bool), np.zeros(n)
    fixed[0], values[0] = True, 0.01
    program = QuadraticProgram(
        K=K,
        b=b,
        R=R,
        g=np.array([0.05, 1.0]),
        equality=np.array([True, False]),
        fixed=fixed,
        values=values,
        unknown=rows,
    )
    result = minimise(bordered_systems(program, counting_factor(K, [])))
    assert result.u[0] == 0.01
    assert result.u[3] == 0.05
    assert result.active.tolist() == [True, False]
    assert result.force[0] < 0  # pulled up to the bound: an equality may pull
    free = np.ones(n, dtype=bool)
    free[[0, 3]] = False
    assert np.abs((b - K @ result.u)[free]).max() < 1e-13 * abs(K).max()


def test_a_singular_system_is_said():
    """Two springs of which nothing holds the second: never a number."""
    K = sp.csr_array(np.diag([1.0, 0.0]))
    program = first_unknowns_bounded(K, np.ones(2), np.ones(1))
    systems = bordered_systems(program, lambda free: lambda right: right)
    with pytest.raises(ConvergenceError, match=r"Newton step 1: .*singular") as failure:
        minimise(systems)
    assert failure.value.iterate.steps == []
